"""The chart of ``carom bench``: ratios against pymunk."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..pictures import canvas
from .report import Result

BAR = "#4dabf7"
SLOWER = "#ff6b6b"
ROW_HEIGHT = 0.42  # inches


@canvas.styled
def draw_ratios(result: Result, folder: Path) -> Path | None:
    """Draw bars of pymunk's time over carom's on a logarithmic scale; None if nothing was compared."""
    rows = [row for row in reversed(result.rows) if row.ratio is not None]
    if not rows:
        return None
    figure = Figure(figsize=(canvas.LONG_SIDE, 1.8 + ROW_HEIGHT * len(rows)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set_title(f"carom against pymunk {result.machine['pymunk']}", fontsize=15, fontweight="bold", loc="left")
    axes.grid(axis="x")
    places = range(len(rows))
    ratios = [row.ratio for row in rows if row.ratio is not None]
    colours = [BAR if ratio.median >= 1 else SLOWER for ratio in ratios]
    axes.barh(places, [ratio.median - 1 for ratio in ratios], left=1, color=colours, height=0.6)
    axes.hlines(places, [r.low for r in ratios], [r.high for r in ratios], color=canvas.TEXT, lw=1.2)
    for place, ratio in zip(places, ratios, strict=True):
        axes.text(max(ratio.high, 1) * 1.06, place, f"{ratio.median:.2g}", color=canvas.TEXT, fontsize=9, va="center")
    axes.set_xscale("log")
    axes.axvline(1, color=canvas.MUTED, lw=1)
    axes.set_yticks(list(places), [row.label for row in rows])
    shown = [r.low for r in ratios] + [r.high for r in ratios] + [1.0]
    axes.set_xlim(min(shown) / 1.3, max(shown) * 1.5)
    axes.set_xlabel("times as fast (line: from the least to the largest repeat)")
    _plain_numbers(axes)
    path = folder / "bench.png"
    figure.savefig(path, facecolor=canvas.BACKGROUND)
    return path


def _plain_numbers(axes: Any) -> None:
    """Format ticks as 0.5 and 20 instead of powers of ten."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())

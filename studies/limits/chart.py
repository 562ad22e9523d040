"""The limits as a picture: one panel per quantity, the error against the value, crosses where it breaks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from carom.lab.pictures import canvas

from ..runner import Line, Result
from .search import LEVELS, measured

PANEL, COLUMNS, DPI = (3.4, 2.5), 3, 90  # inches
TOP, BOTTOM = 1e3, 1e-16  # errors outside this range are drawn at its ends
COLOURS = (
    "#4dabf7", "#ffd43b", "#ff6b6b", "#8b98a8", "#e599f7", "#51cf66", "#ffa94d", "#22b8cf", "#a9e34b", "#748ffc",
)  # fmt: skip


@canvas.styled
def draw(result: Result, folder: Path) -> Path:
    """limits.png; returns its path."""
    panels = list(measured(result))
    columns = min(COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(PANEL[0] * columns, PANEL[1] * rows + 0.9), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle("where carom's errors grow, and where it breaks", fontsize=13, fontweight="bold")
    shown: dict[str, Any] = {}  # a line of each method, for the legend
    for place, (quantity, line) in enumerate(panels):
        panel = figure.add_subplot(rows, columns, place + 1)
        _lines(panel, line, shown)
        for level in list(LEVELS.values())[:-1]:
            panel.axhline(level, color=canvas.MUTED, lw=0.7, ls=":")
        panel.set(xscale="log", yscale="log", ylim=(BOTTOM / 3, TOP))
        panel.set_title(quantity.title, fontsize=9, loc="left")
        panel.set_xlabel(quantity.unit, fontsize=8)
        panel.set_ylabel("" if place % columns else "error", fontsize=8)
        panel.tick_params(labelsize=7, which="both", length=2)
    cross = figure.axes[0].plot([], [], "x", color=canvas.TEXT, ms=6, mew=1.5)[0]
    legend = {**shown, "broken": cross}
    figure.legend(legend.values(), legend.keys(), loc="outside lower center", ncols=min(4, len(legend)), fontsize=8)
    path = folder / "limits.png"
    figure.savefig(path, facecolor=canvas.BACKGROUND, pil_kwargs={"optimize": True})
    return path


def _lines(panel: Any, line: Line, shown: dict[str, Any]) -> None:
    for order, sample in enumerate(line.samples):
        found = sorted(sample.facts.items())
        known = [(value, min(max(error, BOTTOM), TOP)) for value, (error, _) in found if error is not None]
        width = 1.0 + 0.7 * (len(line.samples) - 1 - order)  # lines may coincide: the later ones are thinner
        colour = shown[sample.value].get_color() if sample.value in shown else COLOURS[len(shown)]
        drawn = panel.plot(*zip(*known, strict=True), "-", color=colour, lw=width)[0]
        shown.setdefault(sample.value, drawn)
        for value, (error, _) in [one for one in found if one[1][1]][:1]:
            height = TOP if error is None else min(max(error, BOTTOM), TOP)
            panel.plot([value], [height], "x", color=colour, ms=7, mew=1.8, zorder=5, clip_on=False)

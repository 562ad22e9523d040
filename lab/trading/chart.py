"""The chart of a trade: what is noticed, or the error, on the x axis, work on the y axis, a curve for each method."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..cli.usage_errors import Problem
from ..pictures import canvas
from ..reporting.text import number
from .answer import curves
from .trade import Point, SceneTrade, Trade

SIZE, ROW = (10.0, 6.6), 0.2  # inches: the chart without its legend, a row of that
LEAST, MOST = 1e-3, 1e3  # of what a player would notice: beyond it is all the same
ROUNDING = 1e-15  # where an error is 0
COLOURS = ("#4dabf7", "#ffa94d", "#51cf66", "#ff6b6b", "#b197fc", "#ffd43b", "#22d3c5", "#f78fd0")
MARKERS = "osD^vPphX"  # one more than the colours: they pair in many ways
LINES = {"discrete": "-", "continuous": "-.", "event_driven": ":"}
NOTICED = "times the least that a player would notice, of what differs most"
NOTES = "Filled: nothing is noticed. Hollow: a player would notice it. Cross: failed. The worst of all runs counts."


@canvas.styled
def draw(trade: Trade, folder: Path, norm: str = "") -> list[Path]:
    """A chart of each measured scene as a PNG in ``folder``; norm: over the error in it, of those that have it. Problem
    for the folder."""
    made = []
    for case in (case for case in trade.scenes if not case.refused):
        words = re.sub(r"[^A-Za-z0-9_]+", "-", f"{case.scene} {norm if norm in case.norms else ''}".strip())
        path = folder / f"trade-{words}.png"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            figure(case, norm).savefig(path, facecolor=canvas.BACKGROUND, dpi=canvas.DPI)
        except OSError as error:
            raise Problem(f"{path}: {error.strerror or error}") from error
        made.append(path)
    return made


@canvas.styled
def figure(case: SceneTrade, norm: str = "") -> Figure:
    """The work of each setting over what is noticed, or over the error in the norm if the case has it."""
    norm = norm if norm in case.norms else ""
    found = curves(case)
    made = Figure(figsize=(SIZE[0], SIZE[1] + ROW * -(-len(found) // 2)), layout="constrained")
    FigureCanvasAgg(made)
    axes: Any = made.subplots()
    axes.set(xscale="log", yscale="log", xlabel=f"{norm} error" if norm else NOTICED)
    axes.set_ylabel("work per simulated second (weighted counts)")
    axes.margins(0.12)
    axes.grid(lw=0.7)
    if not norm:
        axes.axvline(1.0, color=canvas.MUTED, lw=1.2, ls="--", zorder=1)
    for place, (label, points) in enumerate(found.items()):
        colour, marker = COLOURS[place % len(COLOURS)], MARKERS[place % len(MARKERS)]
        line = LINES.get(points[0].settings.collision, "-")
        axes.plot([], [], label=label, color=colour, marker=marker, ls=line)
        good = [point for point in points if not point.failed]
        axes.plot([_x(point, norm) for point in good], [point.work for point in good], color=colour, ls=line)
        for point in points:
            if point.failed:
                axes.plot([0.99], [point.work], "x", transform=axes.get_yaxis_transform(), color=colour, ms=7, mew=1.8)
            else:
                face = canvas.PANEL if point.severity > 1 else colour
                axes.plot([_x(point, norm)], [point.work], ls="", ms=7, marker=marker, color=colour, mfc=face, zorder=4)
    for point in case.points:
        words = [word for word, one in (("now", case.own), ("use", case.chosen), ("more", case.more)) if one is point]
        if words and not point.failed:
            text = f"{', '.join(words)}: {number(point.settings.dt)} s"
            axes.annotate(text, (_x(point, norm), point.work), xytext=(0, 9), textcoords="offset points", ha="center",
                          color=canvas.TEXT, fontsize=10, fontweight="bold", zorder=5)  # fmt: skip
    made.suptitle(case.scene, x=0.01, ha="left", fontsize=16, fontweight="bold")
    if norm:
        axes.set_title(f"{norm}: {case.norms[norm]}", loc="left", color=canvas.MUTED, fontsize=9, wrap=True)
    made.legend(ncols=2, loc="outside lower left", frameon=False, fontsize=8.5, title=NOTES, title_fontsize=8,
                alignment="left")  # fmt: skip
    return made


def _x(point: Point, norm: str) -> float:
    if norm:
        return max(point.figures[norm].error, ROUNDING)
    return min(max(point.severity, LEAST), MOST)

"""The picture: objects with enclosing shapes, examples of false positives, and bars."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Polygon, Rectangle

from ...pictures import canvas
from .objects import OBJECTS, Object
from .records import GeometryStudy
from .reference import placed
from .report import attitude
from .study import OPTIONS

SIZE = (12.5, 11.8)  # inches
ROWS = (2.9, 2.9, 2.4, 2.8)  # relative heights
TURN = 0.6  # radians, of the objects in the second row
SPHERE, BOX, PRECISE = "#4dabf7", "#ffa94d", "#51cf66"
COLOURS = {
    "sphere": SPHERE, "box": BOX, "sphere then box": "#b197fc", "sphere then precise": "#20c997",
    "box then precise": "#ffd43b", "precise": PRECISE,
}  # fmt: skip
BY_NAME = {thing.name: thing for thing in OBJECTS}
MARGIN = 0.12  # m around the outlines
# Two objects whose cheap shapes overlap and whose polygons do not: offset of the second, m, and both rotations.
EXAMPLES = {
    False: ("humanoid", "sphere", (0.95, 0.35), (0.0, 0.0)),
    True: ("humanoid", "box", (1.0, -0.15), (0.6, 0.6)),
}


def draw_geometry(result: GeometryStudy, folder: Path) -> Path:
    """Draw the picture of a study of objects of :data:`OBJECTS` into the folder; returns the file."""
    figure = Figure(figsize=SIZE, dpi=canvas.DPI, facecolor=canvas.BACKGROUND, layout="constrained")
    FigureCanvasAgg(figure)
    things = [BY_NAME[name] for name in dict.fromkeys(name for name, _ in result.cases)]
    extents = [_extent(thing) for thing in things]
    widths = [*extents, 1.2 * max(extents)]
    figure.suptitle(
        "what fits which object: the sphere (blue), the box (orange), the precise shape (green); each of 1 m\u00b2",
        color=canvas.TEXT, fontsize=13, fontweight="bold", x=0.01, ha="left",
    )  # fmt: skip
    rows = figure.add_gridspec(4, 1, height_ratios=ROWS)
    for row, turned in enumerate((False, True)):
        panels = rows[row].subgridspec(1, len(widths), width_ratios=widths)
        for column, thing in enumerate(things):
            axes = figure.add_subplot(panels[column])
            _view(axes, extents[column], max(extents))
            _outlines(axes, thing, np.zeros(2), TURN if turned else 0.0)
            axes.set_title(f"{thing.name}, turned" if turned else thing.name, color=canvas.TEXT, fontsize=9)
        _example(figure.add_subplot(panels[len(things)]), turned)
    rough = [option for option in result.options if OPTIONS[option][-1] != "precise"]
    _bars(
        figure.add_subplot(rows[2]), result, rough, "false positives, % of contacts reported (precise shape last: 0)",
        [[100 * result.cost(*case, option).share for option in rough] for case in result.cases],
    )  # fmt: skip
    _bars(
        figure.add_subplot(rows[3]), result, result.options,
        "finding the contacts, ns per object (broad and narrow phase)",
        [[result.cost(*case, option).finding.median for option in result.options] for case in result.cases],
    )  # fmt: skip
    path = folder / "geometry.png"
    figure.savefig(path, facecolor=canvas.BACKGROUND, pil_kwargs={"optimize": True})
    return path


def _extent(thing: Object) -> float:
    """m from the origin to the farthest point drawn."""
    centre, radius = thing.circle
    return max(float(np.linalg.norm(centre)) + radius, float(np.linalg.norm(thing.half_extents))) + MARGIN


def _view(axes: Any, wide: float, high: float) -> None:
    """Set equal scales and remove the ticks."""
    axes.set_xlim(-wide, wide)
    axes.set_ylim(-high, high)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _outlines(axes: Any, thing: Object, position: np.ndarray, rotation: float, only: str | None = None) -> None:
    """The polygon, filled, with its circle and its enlarged box, or with one of them."""
    corners = placed(thing.corners, position[None], np.array([rotation]))[0]
    axes.add_patch(Polygon(corners, facecolor=PRECISE, edgecolor=canvas.TEXT, alpha=0.55, lw=1.0))
    centre, radius = thing.circle
    if only in (None, "sphere"):
        middle = placed(centre[None], position[None], np.array([rotation]))[0, 0]
        axes.add_patch(Circle(tuple(middle), radius, fill=False, edgecolor=SPHERE, lw=1.8))
    if only in (None, "box"):
        cosine, sine = abs(math.cos(rotation)), abs(math.sin(rotation))
        half = np.array(((cosine, sine), (sine, cosine))) @ thing.half_extents
        axes.add_patch(Rectangle(tuple(position - half), *(2 * half), fill=False, edgecolor=BOX, lw=1.8))


def _example(axes: Any, turned: bool) -> None:
    name, level, offset, rotations = EXAMPLES[turned]
    thing = BY_NAME[name]
    places = np.array((offset, np.negative(offset))) / 2
    reach = _extent(thing) + abs(places).max()
    _view(axes, reach, reach)
    for position, rotation in zip(places, rotations, strict=True):
        _outlines(axes, thing, position, rotation, level)
    shapes = {"sphere": "spheres", "box": "boxes"}[level]
    axes.set_title(f"a false positive: the {shapes} overlap", color=canvas.TEXT, fontsize=9)


def _bars(axes: Any, result: GeometryStudy, options: list[str], title: str, heights: list[list[float]]) -> None:
    """Groups of bars, one for each object, upright and turned."""
    axes.set_facecolor(canvas.PANEL)
    width = 0.84 / len(options)
    for number, option in enumerate(options):
        places = np.arange(len(heights)) + (number - (len(options) - 1) / 2) * width
        values = [group[number] for group in heights]
        axes.bar(places, values, 0.92 * width, color=COLOURS[option])
        for place, value in zip(places, values, strict=True):
            axes.annotate(
                f"{value:.0f}", (place, value), xytext=(0, 2), textcoords="offset points", color=canvas.MUTED,
                fontsize=6.5, ha="center",
            )  # fmt: skip
    axes.set_xticks(range(len(heights)), [f"{thing}\n{attitude(turned)}" for thing, turned in result.cases])
    axes.set_title(title, color=canvas.TEXT, fontsize=10, loc="left")
    axes.tick_params(colors=canvas.MUTED, length=0)
    axes.grid(axis="y", color=canvas.FRAME)
    axes.set_axisbelow(True)
    axes.set_xlim(-0.5, len(heights) - 0.5)
    for spine in axes.spines.values():
        spine.set_color(canvas.FRAME)
    marks: list[Any] = [Patch(color=COLOURS[option], label=option) for option in options]
    axes.legend(
        handles=marks, ncols=len(options), fontsize=8, facecolor=canvas.PANEL, edgecolor=canvas.FRAME,
        labelcolor=canvas.TEXT, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2,
    )  # fmt: skip

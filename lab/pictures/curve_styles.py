"""The styles that distinguish the curves of a chart: colour, line and marker."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

from ..trading.records import CAROM, Cell, Curve
from . import canvas

FEW = 8  # up to this number each curve has its own colour
COLOURS = ("#4dabf7", "#ffa94d", "#51cf66", "#ff6b6b", "#b197fc", "#ffd43b", "#22d3c5", "#f78fd0")
PEER = canvas.TEXT  # pymunk's colour
MARKERS = "osD^vPpXhd"
LINES = {"discrete": "-", "continuous": "-.", "event_driven": ":"}
PEER_LINE = "--"
MARKS, WIDTHS = (8.5, 4.5), (2.6, 1.3)  # points, of the first and the last curve: covered ones stay visible


@dataclass(frozen=True)
class Style:
    """How a curve is drawn."""

    colour: str
    line: str
    marker: str
    size: float
    width: float


def styles(curves: Sequence[Curve]) -> list[Style]:
    """One colour per curve if there are few; with many the colour stands for the integrator, the line for the collision
    mode, the marker for substeps and geometry. Other engines are dashed and without colour."""
    cells = [curve.points[0].cell for curve in curves]
    own = [cell for cell in cells if cell.engine == CAROM]
    peers = [cell for cell in cells if cell.engine != CAROM]
    many = len(curves) > FEW
    colour = _numbered(own, (lambda cell: cell.integrator) if many else (lambda cell: cell))
    marker = _numbered(own, (lambda cell: (cell.substeps, cell.geometry)) if many else (lambda cell: cell))
    peer_marker = _numbered(peers, lambda cell: cell)
    made = []
    for place, cell in enumerate(cells):
        share = place / max(len(cells) - 1, 1)
        sizes = [first + (last - first) * share for first, last in (MARKS, WIDTHS)]
        if cell.engine == CAROM:
            line = LINES.get(cell.collision, "-") if many else "-"
            made.append(Style(COLOURS[colour(cell) % len(COLOURS)], line, MARKERS[marker(cell) % len(MARKERS)], *sizes))
        else:
            made.append(Style(PEER, PEER_LINE, MARKERS[::-1][peer_marker(cell) % len(MARKERS)], *sizes))
    return made


def _numbered(cells: Sequence[Cell], key: Callable[[Cell], Hashable]) -> Callable[[Cell], int]:
    """A function from a cell to the index of its key among the keys present."""
    places = {found: place for place, found in enumerate(dict.fromkeys(key(cell.method) for cell in cells))}
    return lambda cell: places[key(cell.method)]

"""The shapes of a drawing list in 2D as triangles and lines, in arrays that a graphics card takes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...drawing import Circles, Lines, Points, Polygons, Style
from ..colours import EDGES, FILLS, tints

# local: of a disc's square, -1 to 1, so that a shader leaves out its corners; 0 in polygons. edge: its colour there.
CORNER = np.dtype([("place", "f4", 2), ("local", "f4", 2), ("fill", "u1", 4), ("edge", "u1", 4)])
SQUARE = np.array([(-1, -1), (1, -1), (1, 1), (-1, -1), (1, 1), (-1, 1)], np.float32)
GLASS, SOLID = 60, 255  # of 255, how opaque sensors are, and the others
MARKED = 254  # of an edge: discs that turn have a line


def polygon_corners(groups: Iterable[Polygons], fills: Any = FILLS) -> NDArray[Any]:
    """(3 t,) CORNER: each convex polygon as a fan."""
    made = [np.empty(0, CORNER)]
    for group in groups:
        n, k = group.points.shape[:2]
        corners = np.zeros((n, k - 2, 3), CORNER)
        corners["place"][:, :, 0] = group.points[:, :1]
        corners["place"][:, :, 1], corners["place"][:, :, 2] = group.points[:, 1:-1], group.points[:, 2:]
        corners["fill"], corners["edge"] = (each[:, None, None] for each in _colours(group, fills))
        made.append(corners.reshape(-1))
    return np.concatenate(made)


def polygon_edges(groups: Iterable[Polygons], fills: Any = FILLS) -> NDArray[Any]:
    """(2 e,) CORNER: the edges of polygons, as ends of lines."""
    made = [np.empty(0, CORNER)]
    for group in groups:
        ends = np.zeros((*group.points.shape[:2], 2), CORNER)
        ends["place"][:, :, 0], ends["place"][:, :, 1] = group.points, np.roll(group.points, -1, axis=1)
        fill, edge = _colours(group, fills)
        ends["fill"] = np.where((group.style == Style.SENSOR)[:, None], fill | (0, 0, 0, SOLID), edge)[:, None, None]
        made.append(ends.reshape(-1))
    return np.concatenate(made)


def disc_corners(circles: Circles, fills: Any = FILLS) -> NDArray[Any]:
    """(6 n,) CORNER: squares around discs, turned as these are."""
    turned = np.isfinite(circles.angle)
    angle = np.where(turned, circles.angle, 0.0)
    c, s = (circles.radius[:, None] * of(angle)[:, None] for of in (np.cos, np.sin))
    corners = np.zeros((len(angle), 6), CORNER)
    corners["local"] = SQUARE
    x, y = SQUARE.T
    corners["place"] = circles.centre[:, None] + np.stack((c * x - s * y, s * x + c * y), axis=2)
    fill, edge = _colours(circles, fills)
    edge[turned, 3] = MARKED
    corners["fill"], corners["edge"] = fill[:, None], edge[:, None]
    return corners.reshape(-1)


def line_ends(groups: Iterable[Lines], fills: Any = FILLS) -> NDArray[Any]:
    """(2 n,) CORNER"""
    made = [np.empty(0, CORNER)]
    for group in groups:
        ends = np.zeros((len(group.points), 2), CORNER)
        ends["place"], ends["fill"] = group.points, _colours(group, fills)[0][:, None] | (0, 0, 0, SOLID)
        made.append(ends.reshape(-1))
    return np.concatenate(made)


def dot_corners(groups: Iterable[Points], radius: float, fills: Any = FILLS) -> NDArray[Any]:
    """(6 n,) CORNER: discs of that ``radius``, m."""
    made = [np.empty(0, CORNER)]
    for group in groups:
        n = len(group.points)
        some = Circles(group.points, np.full(n, radius), np.full(n, np.nan), group.style, np.zeros(n, np.int64))
        corners = disc_corners(some, fills)
        corners["edge"] = corners["fill"]
        made.append(corners)
    return np.concatenate(made)


def _colours(things: Any, fills: Any) -> tuple[Any, Any]:
    """(n, 4) each."""
    rows = tints(np.asarray(things.style), np.asarray(things.entity))
    found = []
    for table in (fills, EDGES):
        colour = np.full((len(rows), 4), SOLID, np.uint8)
        colour[:, :3] = table.reshape(-1, 3)[rows]
        found.append(colour)
    found[0][np.asarray(things.style) == Style.SENSOR, 3] = GLASS
    return found[0], found[1]

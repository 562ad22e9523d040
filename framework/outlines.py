"""Outlines of shapes: the corners and faces that ``outline(shape, dimensions)`` of a shape's class returns."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

SIGNS = {  # by the dimensions: the corners of a box; in space bit k of a corner's number is the end of axis k
    2: np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]),
    3: 2.0 * (np.arange(8)[:, None] >> np.arange(3) & 1) - 1.0,
}
FACES = {2: (), 3: ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6))}


class Outline(NamedTuple):
    """What a shape looks like, about its centre and along its body's axes, if it turns with these.

    corners
        (n, d) m; the shape goes its ``rounding`` beyond them. One is a ball or a point, two are a capsule or a line
    faces
        in space of each face, in a plane of each convex piece the rows of its corners, counter-clockwise, in space as
        seen from outside; none: in a plane the corners are those of one convex polygon
    """

    corners: NDArray[np.float64]
    faces: tuple[NDArray[np.int64], ...]

    @classmethod
    def of(cls, returned: Any, dimensions: int) -> Outline:
        """From what a function has returned; ValueError says what is wrong with it."""
        if not isinstance(returned, tuple) or len(returned) != 2:
            raise ValueError("return two things: corners, and faces, which may be ()")
        corners = np.array(returned[0], float)
        if corners.ndim != 2 or corners.shape[1] != dimensions or not len(corners) or not np.isfinite(corners).all():
            raise ValueError(f"the corners are rows of {dimensions} finite numbers, at least one")
        if dimensions == 3 and len(corners) > 2 and not len(returned[1]):
            raise ValueError("in space more than two corners need faces, the rows of the corners of each")
        faces = []
        for face in returned[1]:
            rows = np.asarray(face)
            if rows.ndim != 1 or rows.dtype.kind not in "iu" or len(set(rows.tolist())) < max(3, len(rows)):
                raise ValueError(f"a face is three or more different rows of corners, not {face!r}")
            if not 0 <= rows.min() <= rows.max() < len(corners):
                raise ValueError(f"face {rows.tolist()} has a corner that is not among the {len(corners)}")
            faces.append(rows.astype(np.int64))
        return cls(corners, tuple(faces))


def box_outline(half: Any, dimensions: int) -> tuple[np.ndarray, Any]:
    """``(corners, faces)`` of a box with these half extents, (d,) m, about its centre."""
    return SIGNS[dimensions] * np.asarray(half), FACES[dimensions]


def runs_outline(tiles: np.ndarray, tile_size: float) -> tuple[np.ndarray, np.ndarray]:
    """The same of a rectangle for each run of ``tiles`` (rows, columns) of bool in a row, the top row first; the middle
    of the map is the origin."""
    cells = np.pad(tiles[::-1], ((0, 0), (1, 1)))  # the lowest row first
    row, ends = np.nonzero(cells[:, 1:] != cells[:, :-1])  # of the runs, by turns
    low, high = np.stack((ends[::2], row[::2]), axis=1), np.stack((ends[1::2], row[1::2] + 1), axis=1)
    corners = np.where(SIGNS[2] > 0.0, high[:, None], low[:, None]) - np.array(tiles.shape[::-1]) / 2
    return tile_size * corners.reshape(-1, 2), np.arange(4 * len(low)).reshape(-1, 4)

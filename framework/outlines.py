"""Corners and faces of boxes, and of maps of tiles, for the shapes that draw themselves so."""

from __future__ import annotations

from typing import Any

import numpy as np

SIGNS = {  # by the dimensions: the corners of a box; in space bit k of a corner's number is the end of axis k
    2: np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]),
    3: 2.0 * (np.arange(8)[:, None] >> np.arange(3) & 1) - 1.0,
}
FACES = {2: (), 3: ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6))}


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

"""A uniform grid of what does not move: made once, and whatever moves looks into it (see :mod:`uniform_grid`).

A level seldom has boxes of one size only: there are walls around it. So the few longest boxes stay outside the grid.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...framework.compilation import kernel
from .tree.tree import CANDIDATE_LIMIT
from .uniform_grid import (
    CELLS_PER_OBJECT,
    FRAME_SIZE,
    FULL,
    HIGHEST,
    LARGEST,
    LOWEST,
    SPARE_CELLS,
    count_cells,
    find_cells,
    look_inside,
    place_objects,
)

OUTSIDE = 64  # boxes at most that stay outside the grid, so that its cells need not be as large as they are


@kernel
def lay_out(lower, upper, frame, keys, directory, order, cells, codes, like):
    """Put all these boxes into a grid; returns (1 / cell, cells a row, cells a layer), 1 / cell 0 if none suits."""
    inverse, row, layer, total = count_cells(frame, len(lower), like)
    if inverse != 0.0:
        if find_cells(lower, upper, len(lower), frame, inverse, row, layer, total, keys, directory, like):
            place_objects(lower, upper, len(lower), frame, inverse, keys, directory, order, cells, codes, like)
        else:
            inverse = 0.0
    return inverse, row, layer


@kernel
def pairs_inside(rows, lower, upper, frame, inverse, row, layer, directory, order, first, second, like):
    """Write the overlapping pairs of what is in the grid with ``rows``; returns how many, or FULL."""
    return look_inside(
        rows, lower, upper, frame, inverse, row, layer, directory, order, first, second, np.int64(0), like
    )


class StillGrid:
    """The boxes of some rows, most of them in a grid. ``outside`` (k,): the rows that are not; they are few.

    ``suits``: whether there is a grid at all.
    """

    def __init__(self, lower: NDArray[np.float64], upper: NDArray[np.float64], start: int, stop: int) -> None:
        """Corners (capacity, d), read again by :meth:`pairs`; the grid is for rows start..stop-1."""
        self._lower, self._upper, d = lower, upper, lower.shape[1]
        self._like = (0.0,) * d
        self._frame, self._layout = np.zeros(FRAME_SIZE), (0.0, 0, 0)
        self._first, self._second = (np.empty(4 * OUTSIDE, np.int32) for _ in range(2))
        self._directory, self._order = np.empty(0, np.int32), np.empty(0, np.int32)
        edges = np.zeros(stop - start)
        for q in range(d):
            np.maximum(edges, upper[start:stop, q] - lower[start:stop, q], out=edges)
        edges[np.isnan(edges)] = -1.0
        self.outside = np.empty(0, np.int32)
        if len(edges) > OUTSIDE:
            longest = float(np.sort(edges)[-1 - OUTSIDE])
            self.outside = start + np.flatnonzero(edges > longest).astype(np.int32)
            self._build(start + np.flatnonzero((edges >= 0.0) & (edges <= longest)).astype(np.int32), longest)

    def _build(self, rows: NDArray[np.int32], longest: float) -> None:
        if not len(rows):
            return
        frame = self._frame
        lower, upper = self._lower.take(rows, axis=0), self._upper.take(rows, axis=0)
        for q in range(len(self._like)):
            frame[LOWEST + q], frame[HIGHEST + q] = lower[:, q].min(), upper[:, q].max()
        frame[LARGEST] = longest
        self._directory = np.empty(int(CELLS_PER_OBJECT * len(rows)) + SPARE_CELLS + 4, np.int32)
        keys, order, cells = (np.empty(len(rows), np.int32) for _ in range(3))
        codes = np.empty(len(rows), np.int64)
        self._layout = lay_out(lower, upper, frame, keys, self._directory, order, cells, codes, self._like)
        if self.suits:
            self._order = rows.take(order)

    @property
    def suits(self) -> bool:
        return self._layout[0] != 0.0

    def pairs(self, rows: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]] | None:
        """Rows (inside, of ``rows``) of overlapping pairs between the grid and these rows; views until the next call.

        None if there are more pairs than allowed: the tree counts them.
        """
        while True:
            found = pairs_inside(
                rows, self._lower, self._upper, self._frame, *self._layout, self._directory, self._order,
                self._first, self._second, self._like,
            )  # fmt: skip
            if found != FULL:
                return self._first[:found], self._second[:found]
            if len(self._first) >= CANDIDATE_LIMIT:
                return None
            room = 2 * len(self._first)
            self._first, self._second = np.empty(room, np.int32), np.empty(room, np.int32)

"""Boxes too few for a tree: every pair is tested. Same interface as :class:`~.tree.tree.SpatialTree`.

A small scene so starts without compiling the tree's kernels, and steps no slower.
"""

from __future__ import annotations

import numpy as np

from ...framework.compilation import kernel
from .tree import build as tree_build
from .tree.tree import SpatialTree

FEW = 192  # boxes; testing their 18,000 pairs takes little longer than building a tree of them
TESTS_AT_MOST = 1 << 17  # between two sets, or with queries; beyond it a tree pays even for few boxes


@kernel
def test_all(boxes_a, rows_a, boxes_b, rows_b, within, first, second):
    """Write the rows of overlapping pairs (``within``: of one set given twice, each pair once); returns how many.

    Of more than ``first`` and ``second`` have room for, the rest is counted only.
    """
    d = boxes_a.shape[1] // 2
    found = 0
    for i in range(len(rows_a)):
        for j in range(i + 1 if within else 0, len(rows_b)):
            k = 0
            while k < d and boxes_a[i, k] <= boxes_b[j, d + k] and boxes_b[j, k] <= boxes_a[i, d + k]:
                k += 1
            if k == d:
                if found < len(first):
                    first[found] = rows_a[i]
                    second[found] = rows_b[j]
                found += 1
    return found


class FewBoxes:
    """The boxes of some consecutive rows."""

    def __init__(self, dimensions: int) -> None:
        self.dimensions = dimensions
        self.count = 0
        self.rows = np.empty(0, np.int32)
        self.boxes = np.empty((0, 2 * dimensions))
        self._tree: SpatialTree | None = None
        self._layout: tuple[np.ndarray, ...] | None = None

    def build(self, lower: np.ndarray, upper: np.ndarray, start: int, stop: int) -> None:
        """Take the boxes of rows start..stop-1; NaN boxes overlap nothing."""
        self.boxes = np.concatenate((lower[start:stop], upper[start:stop]), axis=1)
        self.rows = np.arange(start, stop, dtype=np.int32)
        self.count = stop - start
        self._tree = self._layout = None

    def take(self, lower: np.ndarray, upper: np.ndarray, rows: np.ndarray) -> None:
        """Take the boxes of any rows (k,) int32."""
        self.boxes = np.concatenate((lower[rows], upper[rows]), axis=1)
        self.rows, self.count = rows, len(rows)
        self._tree = self._layout = None

    @property
    def layout(self) -> tuple[np.ndarray, ...]:
        """As that of a tree whose only level has one cell."""
        if self._layout is None:
            d = self.dimensions
            valid = (self.boxes[:, :d] <= self.boxes[:, d:]).all(axis=1)
            table = np.zeros((tree_build.MAX_LEVELS + 2, tree_build.TABLE_COLUMNS), np.int64)
            table[0, tree_build.CELLS], table[0, tree_build.END] = 1, valid.sum()
            directory = np.array((0, valid.sum()), np.int32)
            frame = np.zeros(tree_build.FRAME_SIZE)
            self._layout = table, frame, directory, self.rows[valid], self.boxes[valid]
        return self._layout

    def pairs_within(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows (first, second) of overlapping pairs."""
        return _tested(self, self, True, self.count * (self.count - 1) // 2)

    def pairs_between(self, other: FewBoxes | SpatialTree) -> tuple[np.ndarray, np.ndarray]:
        """Rows (of self, of other) of overlapping pairs."""
        if self.count * other.count <= TESTS_AT_MOST:
            return _tested(self, other, False, self.count * other.count)
        return self._as_tree().pairs_between(other if isinstance(other, SpatialTree) else other._as_tree())

    def query(self, query_lower: np.ndarray, query_upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Overlaps of m boxes: box i overlaps rows[offsets[i]:offsets[i + 1]], ascending."""
        if len(query_lower) * self.count > TESTS_AT_MOST:
            return self._as_tree().query(query_lower, query_upper)
        lower, upper = self.boxes[:, : self.dimensions], self.boxes[:, self.dimensions :]
        meet = (query_lower[:, None] <= upper) & (lower <= query_upper[:, None])
        query, found = np.nonzero(meet.all(axis=2))
        return np.searchsorted(query, np.arange(len(query_lower) + 1)), self.rows[found]

    def query_one(self, lower: tuple[float, ...], upper: tuple[float, ...]) -> np.ndarray:
        """Rows that overlap one box, ascending."""
        meet = (self.boxes[:, : self.dimensions] <= upper) & (lower <= self.boxes[:, self.dimensions :])
        return self.rows[meet.all(axis=1)]

    def _as_tree(self) -> SpatialTree:
        if self._tree is None:
            self._tree = SpatialTree(self.dimensions)
            start = int(self.rows[0]) if self.count else 0
            padding = np.full((start, 2 * self.dimensions), np.nan)
            corners = np.concatenate((padding, self.boxes))
            lower, upper = np.split(corners, 2, axis=1)
            self._tree.build(np.ascontiguousarray(lower), np.ascontiguousarray(upper), start, len(corners))
        return self._tree


def _tested(
    one: FewBoxes | SpatialTree, other: FewBoxes | SpatialTree, within: bool, tests: int
) -> tuple[np.ndarray, np.ndarray]:
    room = min(tests, 4 * (one.count + other.count))
    while True:
        first, second = np.empty(room, np.int32), np.empty(room, np.int32)
        found = test_all(one.boxes, one.rows, other.boxes, other.rows, within, first, second) if tests else 0
        if found <= room:
            return first[:found], second[:found]
        room = found


def pairs_between(
    one: FewBoxes | SpatialTree, other: FewBoxes | SpatialTree
) -> tuple[np.ndarray, np.ndarray]:
    """Rows (of one, of other) of overlapping pairs between any two sets."""
    if isinstance(one, FewBoxes):
        return one.pairs_between(other)
    if isinstance(other, FewBoxes):
        second, first = other.pairs_between(one)
        return first, second
    return one.pairs_between(other)

"""The broad phase's spatial tree: which boxes may touch, from a loose quadtree (2D) or octree (3D) without pointers.

How it is laid out stands in :mod:`build`, how pairs are found in :mod:`pairs`. Boxes are closed: boxes that
share no more than a point overlap. A box with NaN in it, or with a lower corner above its upper one, overlaps nothing;
an infinite box overlaps all it covers. Same input, same output in the same order.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from . import build as tree_build
from . import pairs as tree_pairs
from . import queries as tree_queries
from .refine import refine

Rows: TypeAlias = NDArray[np.int32]
Corners: TypeAlias = NDArray[np.float64]
Vector: TypeAlias = Sequence[float] | NDArray[np.float64]

# 8 million candidates: with all that is kept of a pair about 4 gigabytes. A game has 1 to 50 per object.
CANDIDATE_LIMIT = 1 << 23


class CandidateLimitError(RuntimeError):
    """More candidate pairs than allowed, counted before anything was stored: too many objects in one place.

    ``count`` is the number of candidates, an upper bound of the number of overlapping pairs; ``limit`` what is allowed.
    """

    def __init__(self, count: int, limit: int) -> None:
        super().__init__(
            f"{count} candidate pairs exceed the limit of {limit}: too many objects in one place; "
            "spread them out or make them smaller"
        )
        self.count = count
        self.limit = limit


class SpatialTree:
    """A loose quadtree (``dimensions=2``) or octree (3) over the boxes of rows; rebuilt as a whole, buffers reused.

    ValueError for other dimensions.
    """

    def __init__(self, dimensions: int) -> None:
        if dimensions not in (2, 3):
            raise ValueError(f"dimensions must be 2 or 3, not {dimensions!r}")
        self.dimensions = dimensions
        self.count = 0  # objects in the tree: rows given to build, less empty and NaN boxes
        self._like = (0.0,) * dimensions
        self._table = np.zeros((tree_build.MAX_LEVELS + 2, tree_build.TABLE_COLUMNS), np.int64)
        self._frame = np.zeros(tree_build.FRAME_SIZE)
        self._directory = np.zeros(4, np.int32)
        self._keys = np.empty(0, np.int32)
        self._reserve(0)
        self._ranges = np.empty((0, 3), np.int32)
        self._first = np.empty(2 * tree_pairs.CHUNK, np.int32)
        self._second = np.empty(2 * tree_pairs.CHUNK, np.int32)
        self._chunk_owners = np.empty(tree_pairs.CHUNK + tree_pairs.BLOCK, np.int32)
        self._chunk_members = np.empty(tree_pairs.CHUNK + tree_pairs.BLOCK, np.int32)
        self._state = np.zeros(1, np.int64)
        self._found = np.empty(1024, np.int32)

    def build(self, lower: Corners, upper: Corners, start: int, stop: int) -> None:
        """Put the boxes of rows start..stop-1 into the tree, in place of what it held.

        ``lower`` and ``upper`` are (capacity, d) C-contiguous arrays of corners in metres; they are copied.
        ValueError if the rows are not all there.
        """
        if not 0 <= start <= stop <= min(len(lower), len(upper)):
            raise ValueError(f"rows {start}..{stop} are not within the {len(lower)} given")
        if stop - start > len(self._keys):
            self._reserve(max(stop - start, len(self._keys) * 3 // 2))
        table, frame, directory, keys, like = self._table, self._frame, self._directory, self._keys, self._like
        tree_build.choose_frame(lower, upper, start, stop, frame, like)
        if not tree_build.assign_cells(lower, upper, start, stop, directory, keys, table, frame, like):

            def assign() -> bool:
                return tree_build.assign_cells(lower, upper, start, stop, directory, keys, table, frame, like)

            rows = slice(start, stop)
            refine(assign, lower[rows], upper[rows], directory, keys[: stop - start], table, frame)
        tree_build.place(
            lower, upper, start, stop, directory, keys, self._order, self._cells, self._boxes, self._codes, frame, like
        )
        self.count = int(table[int(frame[tree_build.LEVELS]), tree_build.END])

    @property
    def layout(self) -> tuple[NDArray[Any], ...]:
        """(table, frame, directory, order, boxes) as the kernels take them that walk through the tree."""
        return self._table, self._frame, self._directory, self._order, self._boxes

    @property
    def boxes(self) -> Corners:
        """(count, 2 d): lower and upper corners of the objects, in the tree's order."""
        return self._boxes[: self.count]

    @property
    def rows(self) -> Rows:
        """The objects' rows, in the tree's order."""
        return self._order[: self.count]

    def pairs_within(self, limit: int = CANDIDATE_LIMIT) -> tuple[Rows, Rows]:
        """Rows (first, second) of all pairs of objects whose boxes overlap; each pair once, no order within a pair.

        The arrays are views that hold until the next call. CandidateLimitError if there are more than ``limit``
        candidates.
        """
        if self.count < 2:
            return self._first[:0], self._second[:0]
        wanted = tree_pairs.RANGES_PER_OBJECT * self.count
        if wanted + tree_pairs.SPARE > len(self._ranges):
            self._grow_ranges(wanted)
        stop, candidates, levels = tree_pairs.ranges_within_levels(
            self._table, self._frame, self._directory, self._cells, self._ranges, self._like
        )
        if levels > 1:
            before = stop
            while True:
                _, stop, more = self._ranges_between(self, before, True)
                if stop >= 0:
                    break
                self._grow_ranges(wanted, keep=before)
            candidates += more
        if candidates > limit:
            raise CandidateLimitError(candidates, limit)
        self._state[0] = 0
        self._test(0, stop, self, self, self._codes)
        return self._first[: self._state[0]], self._second[: self._state[0]]

    def pairs_between(self, other: SpatialTree, limit: int = CANDIDATE_LIMIT) -> tuple[Rows, Rows]:
        """Rows (of self, of other) of all overlapping pairs between two trees; cheap if either is small.

        Views and errors as in :meth:`pairs_within`.
        """
        if self.dimensions != other.dimensions:
            raise ValueError(f"trees of {self.dimensions} and {other.dimensions} dimensions")
        if self.count == 0 or other.count == 0:
            return self._first[:0], self._second[:0]
        while True:
            middle, stop, candidates = self._ranges_between(other, 0, False)
            if stop >= 0:
                break
            self._grow_ranges(4 * min(self.count, other.count))
        if candidates > limit:
            raise CandidateLimitError(candidates, limit)
        self._state[0] = 0
        if middle > 0:
            self._test(0, middle, self, other, self._no_codes)
        # The second kind of range is owned by objects of the other tree: columns change places.
        if stop > middle:
            self._first, self._second = self._second, self._first
            self._test(middle, stop, other, self, other._no_codes)
            self._first, self._second = self._second, self._first
        return self._first[: self._state[0]], self._second[: self._state[0]]

    def query(self, query_lower: Corners, query_upper: Corners) -> tuple[NDArray[np.int64], Rows]:
        """Overlaps of m boxes, (m, d) arrays: box i overlaps rows[offsets[i]:offsets[i + 1]], ascending.

        ``rows`` is a view that holds until the next query.
        """
        query_lower = np.ascontiguousarray(query_lower, np.float64)
        query_upper = np.ascontiguousarray(query_upper, np.float64)
        if not query_lower.shape == query_upper.shape == (len(query_lower), self.dimensions):
            raise ValueError(
                f"boxes must be (m, {self.dimensions}), not {query_lower.shape} and {query_upper.shape}"
            )
        offsets = np.zeros(len(query_lower) + 1, np.int64)
        done = 0
        while True:
            done = tree_queries.query_boxes(
                query_lower, query_upper, self._table, self._frame, self._directory, self._order, self._boxes,
                self._found, offsets, done, self._like,
            )  # fmt: skip
            if done == len(query_lower):
                break
            self._grow_found(int(offsets[done]))
        for i in np.flatnonzero(np.diff(offsets) > tree_queries.SORTED_HERE):
            self._found[offsets[i] : offsets[i + 1]].sort()
        return offsets, self._found[: offsets[-1]]

    def query_one(self, lower: Vector, upper: Vector) -> Rows:
        """Rows whose box overlaps the one from ``lower`` to ``upper`` (d numbers each), ascending.

        A view that holds until the next query. This is the quick way for a single box.
        """
        low, high = tuple(map(float, lower)), tuple(map(float, upper))
        if not len(low) == len(high) == self.dimensions:
            raise ValueError(f"corners must have {self.dimensions} numbers, not {len(low)} and {len(high)}")
        while True:
            found = tree_queries.query_box(
                low, high, self._table, self._frame, self._directory, self._order, self._boxes, self._found, 0
            )
            if found >= 0:
                break
            self._grow_found(0)
        rows = self._found[:found]
        if found > tree_queries.SORTED_HERE:
            rows.sort()
        return rows

    def _ranges_between(self, other: SpatialTree, found: int, within: bool) -> tuple[int, int, int]:
        """See :func:`pairs.ranges_between`."""
        return tree_pairs.ranges_between(
            self._table, self._frame, self._directory, self._boxes,
            other._table, other._frame, other._directory, other._boxes, self._ranges, found, within, self._like,
        )  # fmt: skip

    def _test(
        self, position: int, stop: int, owners: SpatialTree, members: SpatialTree, codes: NDArray[np.int64]
    ) -> None:
        """Pass 2 over ranges position..stop-1, with a larger output whenever it is full."""
        while True:
            position = tree_pairs.overlapping(
                self._ranges, position, stop, owners._boxes, owners._order, codes,
                members._boxes, members._order, members._codes, self._chunk_owners, self._chunk_members,
                self._first, self._second, self._state, self._like,
            )  # fmt: skip
            if position >= stop:
                return
            self._first = np.concatenate((self._first, np.empty_like(self._first)))
            self._second = np.concatenate((self._second, np.empty_like(self._second)))

    def _reserve(self, capacity: int) -> None:
        d = self.dimensions
        self._directory = np.zeros(tree_build.directory_size(capacity), np.int32)
        self._keys = np.empty(capacity, np.int32)
        self._order = np.empty(capacity, np.int32)
        self._cells = np.empty(capacity, np.int32)
        self._boxes = np.empty((capacity, 2 * d))
        self._codes = np.zeros(capacity + tree_pairs.BLOCK, np.int64)  # read past the end, never used
        self._no_codes = np.zeros(capacity, np.int64)  # of use between trees, whose frames differ

    def _grow_ranges(self, wanted: int, keep: int = 0) -> None:
        larger = np.empty((max(wanted, 2 * len(self._ranges)) + 2 * tree_pairs.SPARE, 3), np.int32)
        larger[:keep] = self._ranges[:keep]
        self._ranges = larger

    def _grow_found(self, used: int) -> None:
        larger = np.empty(2 * len(self._found), np.int32)
        larger[:used] = self._found[:used]
        self._found = larger

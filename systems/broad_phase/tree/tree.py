"""The broad phase's spatial tree: which boxes may touch, from a loose quadtree (2D) or octree (3D) without pointers.

How it is laid out stands in :mod:`.build`, how pairs are found in :mod:`.pairs`. Boxes are closed: boxes that share no
more than a point overlap. A box with nan in it, or with a lower corner above its upper one, overlaps nothing; an
infinite box overlaps all it covers. Same input, same output in the same order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ....framework.compilation import kernel
from ....framework.jit.kinds import INT, record_kind
from ....framework.jit.linkable import Linkable
from ....framework.jit.linking import Linked, linked_call
from ....framework.jit.records.record import Record, make_record
from ....framework.jit.records.record_type import record_at
from ..brute_force import BRUTE_FORCE_MAX
from ..records import TREE
from ..stages import CANDIDATE_LIMIT
from . import build, pairs
from .refine import refine

Rows: TypeAlias = NDArray[np.int32]
Corners: TypeAlias = NDArray[np.float64]


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


BUILDING: tuple[Callable[..., Any], ...] = (
    build.build_one_cell, build.build_tree, build.assign_again, build.finish_tree,
)  # fmt: skip
PAIR_FUNCTIONS: tuple[Callable[..., Any], ...] = (
    pairs.find_ranges_within, pairs.find_ranges_between, pairs.test_within, pairs.test_between,
)  # fmt: skip


class TreePasses:
    """The passes of trees of one dimension, ``(tree, other) -> code``, by the addresses of two records; each compiles,
    or is loaded, when first run."""

    def __init__(self, dimensions: int) -> None:
        kind = record_kind(TREE, dimensions)
        self._signature = INT(kind, kind)
        self._at = record_at(TREE, dimensions)
        functions = (*BUILDING, *PAIR_FUNCTIONS)
        self.linked = {function.__name__: Linked(function, self._signature) for function in functions}

    @cached_property
    def _call(self) -> Any:
        at, call = self._at, linked_call(lambda: self._signature)

        @kernel
        def run_tree_pass(function: int, tree: int, other: int) -> int:
            return call(function, at(tree), at(other))

        return run_tree_pass

    def of_world(self, has_shapes: bool) -> Iterator[Linkable]:
        """The passes that a world may run; without shapes there are no pairs, only trees for queries."""
        yield self._call
        for function in (*BUILDING, *(PAIR_FUNCTIONS if has_shapes else ())):
            yield self.linked[function.__name__]

    def run(self, name: str, tree: Any, other: Any = None) -> int:
        """Run a pass over the records of a tree, or of two."""
        return self._call(self.linked[name].address, tree.address, (tree if other is None else other).address)


@cache
def tree_passes(dimensions: int) -> TreePasses:
    """The passes for worlds of that many dimensions."""
    return TreePasses(dimensions)


class SpatialTree:
    """A loose quadtree (``dimensions=2``) or octree (3) over the boxes of rows; rebuilt as a whole, buffers reused.

    Up to ``one_cell_max`` boxes it is a single cell: every box is tested. ``record`` is what kernels take.
    ValueError for other dimensions.
    """

    def __init__(self, dimensions: int, one_cell_max: int = BRUTE_FORCE_MAX) -> None:
        if dimensions not in (2, 3):
            raise ValueError(f"dimensions must be 2 or 3, not {dimensions!r}")
        self.dimensions = dimensions
        self.record: Record = make_record(TREE, dimensions)
        self._one_cell_max = one_cell_max
        self._passes = tree_passes(dimensions)
        record = self.record
        record.reserve(1, "origin", "extent", "width", "lowest", "highest")
        record.reserve(8, "extremes")
        levels = [name for name in TREE.fields if name.startswith("level_")]
        record.reserve(build.MAX_LEVELS + 2, *levels)
        record.level_begin[:], record.level_end[:], record.level_cells[:] = 0, 0, 1
        record.level_stride[:], record.level_scale[:] = 0, 0.0
        record.reserve(pairs.RANGE_CHUNK + pairs.TEST_BLOCK, "chunk_owners", "chunk_members")
        record.reserve(2 * pairs.RANGE_CHUNK, "first", "second")
        self._reserve(0)

    @property
    def count(self) -> int:
        """Boxes in the tree: rows given to build, without empty and nan boxes."""
        return self.record.count

    def build(self, lower: Corners, upper: Corners, start: int, stop: int) -> None:
        """Put the boxes of rows start..stop-1 into the tree, in place of what it held.

        ``lower`` and ``upper`` are (capacity, d) C-contiguous arrays of corners in metres; they are copied.
        ValueError if the rows are not all there.
        """
        if not 0 <= start <= stop <= min(len(lower), len(upper)):
            raise ValueError(f"rows {start}..{stop} are not within the {len(lower)} given")
        record, run = self.record, self._passes.run
        if stop - start > len(record.keys):
            self._reserve(max(stop - start, len(record.keys) * 3 // 2))
        if record.lower is not lower or record.upper is not upper:
            record.lower, record.upper = lower, upper
        record.start, record.stop = start, stop
        if stop - start <= self._one_cell_max:
            run("build_one_cell", record)
        elif run("build_tree", record) != build.SUITS:
            refine(record, lambda: run("assign_again", record))
            run("finish_tree", record)

    def shift_rows(self, by: int) -> None:
        """Until the next build the boxes are those of rows higher ``by`` that many."""
        self.rows[:] += by

    @property
    def rows(self) -> Rows:
        """(count,) the boxes' rows, in the tree's order."""
        return self.record.order[: self.count]

    def pairs_within(self, limit: int = CANDIDATE_LIMIT) -> tuple[Rows, Rows]:
        """Rows (k,) and (k,) of all pairs whose boxes overlap; each pair once, no order within a pair.

        The arrays are views that hold until the next call. CandidateLimitError if there are more than ``limit``
        candidates.
        """
        if self.count < 2:
            return self.record.first[:0], self.record.second[:0]
        wanted = pairs.RANGES_PER_BOX * self.count
        if wanted + pairs.SPARE_RANGES > len(self.record.ranges):
            self._grow_ranges(wanted)
        return self._pairs("within", self, limit, wanted)

    def pairs_between(self, other: SpatialTree, limit: int = CANDIDATE_LIMIT) -> tuple[Rows, Rows]:
        """Rows (k,) of self and (k,) of ``other`` of all overlapping pairs of both trees; cheap if either is small.

        Views, ``limit`` and errors as in :meth:`pairs_within`; ValueError for a tree of other dimensions.
        """
        if self.dimensions != other.dimensions:
            raise ValueError(f"trees of {self.dimensions} and {other.dimensions} dimensions")
        if self.count == 0 or other.count == 0:
            return self.record.first[:0], self.record.second[:0]
        return self._pairs("between", other, limit, 4 * min(self.count, other.count))

    def _pairs(self, kind: str, other: SpatialTree, limit: int, ranges: int) -> tuple[Rows, Rows]:
        record, run = self.record, self._passes.run
        while run(f"find_ranges_{kind}", record, other.record) != pairs.DONE:
            self._grow_ranges(ranges)
        if record.candidates > limit:
            raise CandidateLimitError(record.candidates, limit)
        while run(f"test_{kind}", record, other.record) != pairs.DONE:
            record.reserve(2 * len(record.first), "first", "second")
        return record.first[: record.pair_count], record.second[: record.pair_count]

    def _reserve(self, capacity: int) -> None:
        record = self.record
        record.directory = np.zeros(build.directory_size(capacity), np.int32)
        record.reserve(capacity, "keys", "order", "cells", "boxes")
        record.codes = np.zeros(capacity + pairs.TEST_BLOCK, np.int64)  # read past the end, never used

    def _grow_ranges(self, wanted: int) -> None:
        self.record.reserve(max(wanted, 2 * len(self.record.ranges)) + 2 * pairs.SPARE_RANGES, "ranges")

"""The memory behind a record of queries, and the query shapes, of which each has its own parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ...framework.data.component import Component
from ...framework.jit.records.record import Record, make_record
from ...framework.plugins.registry import Registry
from ...framework.world.queries.arguments import Wanted
from ..broad_phase.tree.build import MAX_LEVELS
from ..shapes.linking.linked_shapes import LinkedShapes, ParameterRecords
from ..shapes.linking.parameters import bind, make_parameter_record
from ..shapes.query import QUERY, linked_query
from .records import QUERIES, QUERY_BATCH, RESULTS

MOST_QUERIES = 4096  # in one call of a kernel; what larger batches need is not kept
FIRST_ROOM = 64  # rows


def slices_of(count: int) -> Iterator[slice]:
    """Slices of at most MOST_QUERIES of that many queries; an empty one if there are none."""
    for start in range(0, max(count, 1), MOST_QUERIES):
        yield slice(start, min(start + MOST_QUERIES, count))


def some_rows(values: Any, some: slice) -> Any:
    """Those rows of an array; of one value for all, that."""
    return values[some] if isinstance(values, np.ndarray) else values


class QueryBatch:
    """Room for queries, which the verbs write into the columns of ``record``, and for what they find.

    ``radius`` and ``half_extents`` are the parameters of query spheres and boxes.
    """

    def __init__(self, dimensions: int) -> None:
        self.record = make_record(QUERY_BATCH, dimensions)
        self.record.slice_level = np.zeros(MAX_LEVELS + 2, np.int64)
        self.record.slice_begin = np.zeros(MAX_LEVELS + 2)
        self.record.excluded = np.zeros(FIRST_ROOM, np.int64)
        self.queries = self.results = 0  # rows that there is room for
        self.reserve(FIRST_ROOM, FIRST_ROOM)

    def reserve(self, queries: int, results: int) -> bool:
        """Make room; returns whether columns of parameters have been replaced."""
        queries = min(queries, MOST_QUERIES)
        if max(queries, results) > self.results:
            self.results = max(queries, results, 2 * self.results)
            self.record.reserve(self.results, *RESULTS)
            self._results = {name: getattr(self.record, name) for name in RESULTS}
        if queries <= self.queries:
            return False
        self.queries = max(queries, 2 * self.queries)
        self.record.reserve(self.queries, *QUERIES)
        self.radius, self.half_extents = np.zeros(self.queries), self.record.half
        return True

    def ask(self, count: int, some: slice, wanted: Wanted) -> int:
        """Write what those queries look for, to the first rows; returns how many entities each leaves out."""
        record, each = self.record, wanted.excluded.shape[1]
        record.mask[:count], record.one_way = some_rows(wanted.masks, some), wanted.one_way
        if each:
            if len(record.excluded) < count * each:
                record.excluded = np.zeros(count * each, np.int64)
            record.excluded[: count * each] = wanted.excluded[some].ravel()
        return each

    def copied(self, which: slice | np.ndarray, *names: str) -> tuple[np.ndarray, ...]:
        """Copies of some rows of columns of results."""
        return tuple([self._results[name][which].copy() for name in names])


class CollectedHits:
    """Hits of overlaps and neighbours, taken out of a batch call by call: these columns of the results."""

    def __init__(self, batch: QueryBatch, count: int, names: tuple[str, ...] = ("entity", "row")) -> None:
        self._batch, self._record, self._names = batch, batch.record, names
        self.offsets = np.zeros(count + 1, np.int64)
        self._queries = self._hits = 0  # taken so far
        self._pieces: list[tuple[np.ndarray, ...]] = []

    def take(self, first: int, stop: int) -> None:
        """Take the hits of the queries first..stop-1 of the batch, which are all it holds."""
        if stop > first:
            ends = self._record.end[first:stop]
            self.offsets[self._queries + 1 : self._queries + 1 + stop - first] = ends + self._hits
            found = int(ends[-1])
            self._pieces.append(self._batch.copied(slice(found), *self._names))
            self._queries += stop - first
            self._hits += found

    def columns(self) -> tuple[np.ndarray, ...]:
        """All that was taken."""
        return joined(self._pieces) if self._pieces else self._batch.copied(slice(0), *self._names)


class QueryShape:
    """A shape that queries are made with, against the shapes of a scene; ``record`` is one of ``QUERY``."""

    def __init__(
        self, registry: Registry, linked: LinkedShapes, bodies: ParameterRecords, component: type[Component]
    ) -> None:
        self._linked, self._bodies = linked_query(registry, linked, component), bodies
        self.record: Record = make_record(QUERY, linked.dimensions)
        self._parameters = make_parameter_record(self._linked.shape, linked.dimensions)
        self._identity = np.empty((0, linked.dimensions, linked.dimensions))
        self.has_sweeps = False
        self._linked.fill(self.record, self._parameters, bodies)

    def need_sweeps(self) -> None:
        """Link the sweeps of its pairs too, which only casts use."""
        self._linked.fill(self.record, self._parameters, self._bodies, sweeps=True)
        self.has_sweeps = True

    def bind(self, columns: Mapping[str, np.ndarray], count: int) -> None:
        """Use these parameters for as many queries; shapes of queries are not rotated."""
        axes = None
        if self._linked.shape.rotates:
            if len(self._identity) < count:
                d = self._identity.shape[1]
                self._identity = np.broadcast_to(np.eye(d), (count, d, d)).copy()
            axes = self._identity
        bind(self._parameters, self._linked.shape, columns, axes)


def joined(pieces: list[tuple[np.ndarray, ...]]) -> tuple[Any, ...]:
    """Columns of several pieces behind each other."""
    return pieces[0] if len(pieces) == 1 else tuple(map(np.concatenate, zip(*pieces, strict=True)))

"""How Python calls the compiled functions of queries: one kernel per dimension, which knows neither them nor shapes."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

from ...framework.compilation import kernel
from ...framework.jit.kinds import INT, record_kind
from ...framework.jit.linkable import Linkable
from ...framework.jit.linking import Linked, linked_call
from ...framework.jit.records.record_type import record_at
from ..broad_phase.records import TREE
from ..records import STATE
from ..shapes.attribution import NOTHING_TESTED
from .casts import find_hits
from .nearest import find_nearest
from .overlap import find_neighbours, find_overlaps
from .records import QUERY_BATCH


class QueryKernels:
    """Functions of a batch of queries, by address; each compiles or loads when its address is asked for.

    All are called as ``run(function.address, state, batch, moving, static, excluded, first, stop)``: addresses of
    records, how many entities each query leaves out, and the queries first..stop-1 of the batch. They return the query
    to go on with.
    """

    def __init__(self, dimensions: int) -> None:
        state, batch, tree = (record_kind(schema, dimensions) for schema in (STATE, QUERY_BATCH, TREE))
        signature = INT(state, batch, tree, tree, INT, INT)
        state_at, batch_at, tree_at = (record_at(schema, dimensions) for schema in (STATE, QUERY_BATCH, TREE))
        call = linked_call(lambda: signature)

        @kernel
        def run_queries(
            function: int, state: int, batch: int, moving: int, static: int, excluded: int, first: int, stop: int
        ) -> int:
            known, queries = state_at(state), batch_at(batch)
            known.row_a, known.unsound = NOTHING_TESTED, 0
            queries.excluded_count, queries.selects = excluded, excluded > 0 or queries.query.is_collider
            return call(function, known, queries, tree_at(moving), tree_at(static), first, stop)

        self.run: Any = run_queries
        self.overlaps = Linked(find_overlaps, signature)
        self.nearest = Linked(find_nearest, signature)
        self.hits = Linked(find_hits, signature)
        self.neighbours = Linked(find_neighbours, signature)

    def of_world(self, has_shapes: bool) -> Iterator[Linkable]:
        """What queries of a world may call; without shapes that is the search for neighbours alone."""
        yield self.run
        yield self.neighbours
        if has_shapes:
            yield from (self.overlaps, self.nearest, self.hits)


@cache
def query_kernels(dimensions: int) -> QueryKernels:
    """The same kernels for all worlds of that dimension."""
    return QueryKernels(dimensions)

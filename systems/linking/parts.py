"""Parts of stages that are compiled on their own and called through their address: those of swept bodies and impacts,
which take seconds to compile and which many worlds never need."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from ...framework.jit.lazy import types
from ...framework.jit.linking import Linked
from ...framework.jit.records.record_type import record_type
from ..records import STATE
from ..shapes.linking.signatures import call_in_dimension, vector_type

# Places in ``state.links``.
BOUND_SEARCHES, FIRST_TOUCH, TAKE_TOGETHER = PLACES = range(3)
SWEPT_PARTS, IMPACT_PARTS = (BOUND_SEARCHES, FIRST_TOUCH), (FIRST_TOUCH, TAKE_TOGETHER)


@cache
def _bound_searches(dimensions: int) -> Any:
    return types.int64(record_type(STATE, dimensions), types.float64, types.float64)


@cache
def _first_touch(dimensions: int) -> Any:
    vector, i, f = vector_type(dimensions), types.int64, types.float64
    path = types.UniTuple(vector, 4)  # (x0, x1, x2, x3), see trajectory
    found = types.Tuple((i, f, vector, vector, vector))
    return found(record_type(STATE, dimensions), i, i, path, f, f, types.UniTuple(f, 4))


@cache
def _take_together(dimensions: int) -> Any:
    return types.int64(record_type(STATE, dimensions), types.int64, types.float64)


SIGNATURES = _bound_searches, _first_touch, _take_together
call_bound_searches, call_first_touch, call_take_together = map(call_in_dimension, SIGNATURES)


@cache
def linked_part(place: int, function: Callable[..., Any], dimensions: int) -> Linked:
    """The function that belongs to a place in ``state.links``, one for the process."""
    return Linked(function, SIGNATURES[place](dimensions))

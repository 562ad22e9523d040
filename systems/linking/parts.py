"""Parts of stages that are compiled on their own and called through their address: those of swept bodies, and impacts
at the same time, which take seconds to compile and which many worlds never need."""

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
BOUND_SEARCHES, FIRST_TOUCH, TAKE_TOGETHER = range(3)
COUNT = 3
SWEPT = BOUND_SEARCHES, FIRST_TOUCH


def _signature(make: Callable[..., Any]) -> Callable[[int], Any]:
    """By dimension: what ``make`` gives for (the types of the state, of a vector, of a path, int64, float64)."""

    @cache
    def signature_of(dimensions: int) -> Any:
        vector = vector_type(dimensions)
        path = types.UniTuple(vector, 4)  # (x0, x1, x2, x3), see trajectory
        return make(record_type(STATE, dimensions), vector, path, types.int64, types.float64)

    return signature_of


def _first_touch(state: Any, vector: Any, path: Any, i: Any, f: Any) -> Any:
    found = types.Tuple((i, f, vector, vector, vector))
    return found(state, i, i, path, types.boolean, f, f, types.UniTuple(f, 3))


SIGNATURES = {
    place: _signature(make)
    for place, make in {
        BOUND_SEARCHES: lambda state, vector, path, i, f: i(state, f, f),
        FIRST_TOUCH: _first_touch,
        TAKE_TOGETHER: lambda state, vector, path, i, f: i(state, i, f),
    }.items()
}

call_bound_searches, call_first_touch, call_take_together = map(call_in_dimension, SIGNATURES.values())

_linked: dict[tuple[Any, int], Linked] = {}


def linked_part(place: int, function: Callable[..., Any], dimensions: int) -> Linked:
    """The function that belongs to a place in ``state.links``, one for the process."""
    key = (function, dimensions)
    if key not in _linked:
        _linked[key] = Linked(function, SIGNATURES[place](dimensions))
    return _linked[key]

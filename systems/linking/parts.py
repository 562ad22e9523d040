"""Parts of stages that are compiled on their own and called through their address.

Swept bodies need them alone, so that a discrete world does not compile them; or several stages share one; or they are
needed so seldom that they are linked when that happens first.
"""

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
BOX_ROWS, BOUND_SEARCHES, FIRST_TOUCH, HELD_BY_EDGE, KIND_BEYOND_CAP, TAKE_SWEPT, WATCH_BOUNDS, TAKE_TOGETHER = range(8)
COUNT = 8
SWEPT = BOUND_SEARCHES, FIRST_TOUCH, HELD_BY_EDGE, KIND_BEYOND_CAP, TAKE_SWEPT, WATCH_BOUNDS


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


def _held_by_edge(state: Any, vector: Any, path: Any, i: Any, f: Any) -> Any:
    touch = types.Tuple((f, vector, vector, vector))  # (time, normal, point, from a's centre to b's)
    return types.boolean(state, i, i, path, touch, f, f)


SIGNATURES = {
    place: _signature(make)
    for place, make in {
        BOX_ROWS: lambda state, vector, path, i, f: i(state, i, i, i),
        BOUND_SEARCHES: lambda state, vector, path, i, f: i(state, f, f),
        FIRST_TOUCH: _first_touch,
        HELD_BY_EDGE: _held_by_edge,
        KIND_BEYOND_CAP: lambda state, vector, path, i, f: i(state, i, i, path, f, f, f, f),
        TAKE_SWEPT: lambda state, vector, path, i, f: i(state, i, f),
        WATCH_BOUNDS: lambda state, vector, path, i, f: i(state, i, f),
        TAKE_TOGETHER: lambda state, vector, path, i, f: i(state, i, f),
    }.items()
}

call_box_rows, call_bound_searches, call_first_touch, call_held_by_edge = map(
    call_in_dimension, [SIGNATURES[place] for place in (BOX_ROWS, BOUND_SEARCHES, FIRST_TOUCH, HELD_BY_EDGE)]
)
call_kind_beyond_cap, call_take_swept, call_watch_bounds, call_take_together = map(
    call_in_dimension, [SIGNATURES[place] for place in (KIND_BEYOND_CAP, TAKE_SWEPT, WATCH_BOUNDS, TAKE_TOGETHER)]
)

_linked: dict[tuple[Any, int], Linked] = {}


def linked_part(place: int, function: Callable[..., Any], dimensions: int) -> Linked:
    """The function that belongs to a place in ``state.links``, one for the process."""
    key = (function, dimensions)
    if key not in _linked:
        _linked[key] = Linked(function, SIGNATURES[place](dimensions))
    return _linked[key]

"""Parts of stages that are compiled on their own and called through their address.

Swept bodies need them alone, so that a discrete world does not compile them; or several stages share one.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from numba import types

from ..framework.jit.linking import Linked
from ..framework.jit.record_type import record_type
from .records import STATE
from .shapes.linking.signatures import call_in_dimension, vector_type

# Places in ``state.links``.
BOX_ROWS, BOUND_SEARCHES, FIRST_TOUCH, HELD_BY_EDGE, KIND_BEYOND_CAP, TAKE_SWEPT, WATCH_BOUNDS = range(7)
COUNT = 7

_INT, _FLOAT, _BOOL = types.int64, types.float64, types.boolean


def path_type(dimensions: int) -> Any:
    """(x0, x1, x2, x3), see trajectory."""
    return types.UniTuple(vector_type(dimensions), 4)


def touch_type(dimensions: int) -> Any:
    """(time, normal, point, from a's centre to b's)."""
    vector = vector_type(dimensions)
    return types.Tuple((_FLOAT, vector, vector, vector))


def _signature(result: Any, *arguments: Any) -> Callable[[int], Any]:
    """Of (state, *arguments); functions among the types are called with the dimension."""

    @cache
    def signature_of(dimensions: int) -> Any:
        made = [kind(dimensions) if callable(kind) and not isinstance(kind, types.Type) else kind for kind in arguments]
        answer = result(dimensions) if callable(result) and not isinstance(result, types.Type) else result
        return answer(record_type(STATE, dimensions), *made)

    return signature_of


def _first_touch(dimensions: int) -> Any:
    vector = vector_type(dimensions)
    return types.Tuple((_INT, _FLOAT, vector, vector, vector))


SIGNATURES = {
    BOX_ROWS: _signature(_INT, _INT, _INT, _INT),
    BOUND_SEARCHES: _signature(_INT, _FLOAT, _FLOAT),
    FIRST_TOUCH: _signature(_first_touch, _INT, _INT, path_type, _BOOL, _FLOAT, _FLOAT, types.UniTuple(_FLOAT, 3)),
    HELD_BY_EDGE: _signature(_BOOL, _INT, _INT, path_type, touch_type, _FLOAT, _FLOAT),
    KIND_BEYOND_CAP: _signature(_INT, _INT, _INT, path_type, _FLOAT, _FLOAT, _FLOAT, _FLOAT),
    TAKE_SWEPT: _signature(_INT, _INT, _FLOAT),
    WATCH_BOUNDS: _signature(_INT, _INT, _FLOAT),
}

call_box_rows = call_in_dimension(SIGNATURES[BOX_ROWS])
call_bound_searches = call_in_dimension(SIGNATURES[BOUND_SEARCHES])
call_first_touch = call_in_dimension(SIGNATURES[FIRST_TOUCH])
call_held_by_edge = call_in_dimension(SIGNATURES[HELD_BY_EDGE])
call_kind_beyond_cap = call_in_dimension(SIGNATURES[KIND_BEYOND_CAP])
call_take_swept = call_in_dimension(SIGNATURES[TAKE_SWEPT])
call_watch_bounds = call_in_dimension(SIGNATURES[WATCH_BOUNDS])

_linked: dict[tuple[Any, int], Linked] = {}


def linked_part(place: int, function: Callable[..., Any], dimensions: int) -> Linked:
    """The function that belongs to a place in ``state.links``, one for the process."""
    key = (function, dimensions)
    if key not in _linked:
        _linked[key] = Linked(function, SIGNATURES[place](dimensions))
    return _linked[key]

"""Parts of stages that are compiled on their own and called through their address.

Swept bodies need them alone, so that a discrete world does not compile them; or several stages share one; or they are
needed so seldom that they are linked when that happens first.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from ...framework.jit.late import types
from ...framework.jit.linking import Linked
from ...framework.jit.records.record_type import record_type
from ..records import STATE
from ..shapes.linking.signatures import call_in_dimension, vector_type

# Places in ``state.links``.
BOX_ROWS, BOUND_SEARCHES, FIRST_TOUCH, HELD_BY_EDGE, KIND_BEYOND_CAP, TAKE_SWEPT, WATCH_BOUNDS, TAKE_TOGETHER = range(8)
COUNT = 8
SWEPT = BOUND_SEARCHES, FIRST_TOUCH, HELD_BY_EDGE, KIND_BEYOND_CAP, TAKE_SWEPT, WATCH_BOUNDS


def _int(dimensions: int) -> Any:
    return types.int64


def _float(dimensions: int) -> Any:
    return types.float64


def _bool(dimensions: int) -> Any:
    return types.boolean


def _three_floats(dimensions: int) -> Any:
    return types.UniTuple(types.float64, 3)


def path_type(dimensions: int) -> Any:
    """(x0, x1, x2, x3), see trajectory."""
    return types.UniTuple(vector_type(dimensions), 4)


def touch_type(dimensions: int) -> Any:
    """(time, normal, point, from a's centre to b's)."""
    vector = vector_type(dimensions)
    return types.Tuple((types.float64, vector, vector, vector))


def _signature(result: Callable[[int], Any], *arguments: Callable[[int], Any]) -> Callable[[int], Any]:
    """Of (state, *arguments); each gives its type for a dimension."""

    @cache
    def signature_of(dimensions: int) -> Any:
        return result(dimensions)(record_type(STATE, dimensions), *(kind(dimensions) for kind in arguments))

    return signature_of


def _first_touch(dimensions: int) -> Any:
    vector = vector_type(dimensions)
    return types.Tuple((types.int64, types.float64, vector, vector, vector))


SIGNATURES = {
    BOX_ROWS: _signature(_int, _int, _int, _int),
    BOUND_SEARCHES: _signature(_int, _float, _float),
    FIRST_TOUCH: _signature(_first_touch, _int, _int, path_type, _bool, _float, _float, _three_floats),
    HELD_BY_EDGE: _signature(_bool, _int, _int, path_type, touch_type, _float, _float),
    KIND_BEYOND_CAP: _signature(_int, _int, _int, path_type, _float, _float, _float, _float),
    TAKE_SWEPT: _signature(_int, _int, _float),
    WATCH_BOUNDS: _signature(_int, _int, _float),
    TAKE_TOGETHER: _signature(_int, _int, _float),
}

call_box_rows = call_in_dimension(SIGNATURES[BOX_ROWS])
call_bound_searches = call_in_dimension(SIGNATURES[BOUND_SEARCHES])
call_first_touch = call_in_dimension(SIGNATURES[FIRST_TOUCH])
call_held_by_edge = call_in_dimension(SIGNATURES[HELD_BY_EDGE])
call_kind_beyond_cap = call_in_dimension(SIGNATURES[KIND_BEYOND_CAP])
call_take_swept = call_in_dimension(SIGNATURES[TAKE_SWEPT])
call_watch_bounds = call_in_dimension(SIGNATURES[WATCH_BOUNDS])
call_take_together = call_in_dimension(SIGNATURES[TAKE_TOGETHER])

_linked: dict[tuple[Any, int], Linked] = {}


def linked_part(place: int, function: Callable[..., Any], dimensions: int) -> Linked:
    """The function that belongs to a place in ``state.links``, one for the process."""
    key = (function, dimensions)
    if key not in _linked:
        _linked[key] = Linked(function, SIGNATURES[place](dimensions))
    return _linked[key]

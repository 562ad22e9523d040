"""Parts of stages that are compiled on their own and called through their address: those of swept bodies and impacts,
which take seconds to compile and which many worlds never need."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from ...framework.jit.kinds import FLOAT, INT, Signature, floats, record_kind, tuple_of
from ...framework.jit.linking import Linked
from ..records import STATE
from ..shapes.linking.signatures import call_in_dimension

# Places in ``state.links``.
BOUND_SEARCHES, FIRST_TOUCH, TAKE_TOGETHER = PLACES = range(3)
SWEPT_PARTS, IMPACT_PARTS = (BOUND_SEARCHES, FIRST_TOUCH), (FIRST_TOUCH, TAKE_TOGETHER)


@cache
def _bound_searches(dimensions: int) -> Signature:
    return INT(record_kind(STATE, dimensions), FLOAT, FLOAT)


@cache
def _first_touch(dimensions: int) -> Signature:
    vector, i, f = floats(dimensions), INT, FLOAT
    path = tuple_of(*(vector,) * 4)  # (x0, x1, x2, x3), see trajectory
    found = tuple_of(i, f, vector, vector, vector)
    return found(record_kind(STATE, dimensions), i, i, path, f, f, floats(4))


@cache
def _take_together(dimensions: int) -> Signature:
    return INT(record_kind(STATE, dimensions), INT, FLOAT)


SIGNATURES = _bound_searches, _first_touch, _take_together
call_bound_searches, call_first_touch, call_take_together = map(call_in_dimension, SIGNATURES)


@cache
def linked_part(place: int, function: Callable[..., Any], dimensions: int) -> Linked:
    """The function that belongs to a place in ``state.links``, one for the process."""
    return Linked(function, SIGNATURES[place](dimensions))

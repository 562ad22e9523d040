"""Parts of stages that are compiled on their own and called through their address: those of swept bodies and impacts,
of what turns and of joints. They take seconds to compile; many worlds never need them, and others in several stages."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

from ...framework.jit.kinds import BOOL, FLOAT, INT, Signature, floats, record_kind, tuple_of
from ...framework.jit.linking import Linked
from ..contacts.solving.records import SOLVER
from ..records import STATE
from ..shapes.linking.signatures import call_in_dimension

# Places in ``state.links``.
(
    BOUND_SEARCHES, FIRST_TOUCH, TAKE_TOGETHER, FREE_TURN, TURNING_TOUCH, TOUCH_OF_TURN, CLOSING_POINT, ARMS_AT_REST,
    TURNING_RESPONSE, TURN_BY_IMPACT, JOINED_ISLANDS, JOINED_BODIES, JOINED_RESPONSE, JOINED_IMPACT,
    JOINED_START, JOINED_RANGE, JOINED_SUPPORT, TURN_BACK, TUMBLE, FOURS,
) = PLACES = range(20)  # fmt: skip
SWEPT_PARTS, IMPACT_PARTS = (BOUND_SEARCHES, FIRST_TOUCH), (FIRST_TOUCH,)
IN_SPACE = (FREE_TURN, TURN_BACK, TUMBLE, FOURS)  # in a plane nothing calls them
TURNING_PARTS = (*IN_SPACE, TURNING_TOUCH, TOUCH_OF_TURN, CLOSING_POINT, ARMS_AT_REST, TURNING_RESPONSE, TURN_BY_IMPACT)
JOINT_PARTS = (JOINED_SUPPORT, JOINED_ISLANDS, JOINED_BODIES, JOINED_RANGE, TURN_BACK, TUMBLE, FOURS)
JOINT_IMPACT_PARTS = (JOINED_RESPONSE, JOINED_IMPACT, JOINED_START)


@cache
def signature_of(place: int, dimensions: int) -> Signature:
    """That of the part of a place."""
    state, vector, i, f = record_kind(STATE, dimensions), floats(dimensions), INT, FLOAT
    path = tuple_of(*(vector,) * 4)  # (x0, x1, x2, x3), see trajectory
    touch = tuple_of(f, vector, vector, vector)  # (time, normal, point, from a's centre to b's)
    solver, span = record_kind(SOLVER, dimensions), tuple_of(i, i, i, i)
    of_step, turn_by_impact = i(state, f), i(state, i, f, vector, f)
    response = tuple_of(f, vector)(state, tuple_of(i, i), touch, tuple_of(vector, f), f, f)
    return (
        i(state, f, f),
        tuple_of(i, f, vector, vector, vector)(state, i, i, path, f, f, floats(4)),
        i(state, i, f),
        vector(state, i, vector, f),
        tuple_of(i, touch, f)(state, i, i, path, tuple_of(vector, vector), floats(2), floats(5)),
        tuple_of(BOOL, f, f, vector, vector, vector, vector)(state, f, i, i),
        tuple_of(f, vector)(state, i, i, vector, tuple_of(f, vector, vector), f, vector),
        of_step, response, turn_by_impact,
        of_step, of_step, response, turn_by_impact, of_step,
        f(solver, i, floats(2), span),
        of_step, of_step, i(solver, f, span), i(solver, BOOL, tuple_of(i, i, i)),
    )[place]  # fmt: skip


(
    call_bound_searches, call_first_touch, call_take_together, call_free_turn, call_turning_touch, call_touch_of_turn,
    call_closing_point, call_of_step, call_turning_response, call_turn_by_impact, call_joined_range, call_tumble,
    call_fours,
) = (
    call_in_dimension(partial(signature_of, place)) for place in (*PLACES[:JOINED_ISLANDS], JOINED_RANGE, TUMBLE, FOURS)
)  # fmt: skip


def needed_places(dimensions: int, sweeps: bool, bounces: bool, turns: bool, joined: bool) -> list[int]:
    """Of the parts that a world needs before its steps, where that may happen in it: those of several impacts at one
    time are linked when there are some."""
    places = {*(SWEPT_PARTS if sweeps else ()), *(IMPACT_PARTS if bounces else ())}
    places.update(TURNING_PARTS if turns else (), JOINT_PARTS if joined else ())
    places.update(JOINT_IMPACT_PARTS if joined and (sweeps or bounces) else ())
    return sorted(places.difference(IN_SPACE if dimensions == 2 else ()))


@cache
def linked_part(place: int, function: Callable[..., Any], dimensions: int) -> Linked:
    """The function that belongs to a place in ``state.links``, one for the process."""
    return Linked(function, signature_of(place, dimensions), f"{function.__name__}, {dimensions}D,")

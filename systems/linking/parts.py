"""Parts of stages that are compiled on their own and called through their address: those of swept bodies and impacts,
of what turns and of joints. They take seconds to compile; many worlds never need them, and others in several stages."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from ...framework.jit.kinds import BOOL, FLOAT, INT, Kind, Signature, floats, record_kind, tuple_of
from ...framework.jit.linking import Linked
from ..contacts.solving.records import SOLVER
from ..records import STATE
from ..shapes.linking.signatures import call_in_dimension

# Places in ``state.links``.
(
    BOUND_SEARCHES, FIRST_TOUCH, TAKE_TOGETHER, FREE_TURN, TURNING_TOUCH, TOUCH_OF_TURN, CLOSING_POINT, ARMS_AT_REST,
    TURNING_RESPONSE, TURN_BY_IMPACT, JOINED_ISLANDS, JOINED_BODIES, JOINED_RESPONSE, JOINED_IMPACT,
    JOINED_START, JOINED_RANGE,
) = PLACES = range(16)  # fmt: skip
SWEPT_PARTS, IMPACT_PARTS = (BOUND_SEARCHES, FIRST_TOUCH), (FIRST_TOUCH,)
TURNING_PARTS = (FREE_TURN, TURNING_TOUCH, TOUCH_OF_TURN, CLOSING_POINT, ARMS_AT_REST, TURNING_RESPONSE, TURN_BY_IMPACT)
JOINT_PARTS = (JOINED_ISLANDS, JOINED_BODIES, JOINED_RANGE)
JOINT_IMPACT_PARTS = (JOINED_RESPONSE, JOINED_IMPACT, JOINED_START)
IN_SPACE = (FREE_TURN,)  # in a plane nothing calls it


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


@cache
def _free_turn(dimensions: int) -> Signature:
    vector = floats(dimensions)
    return vector(record_kind(STATE, dimensions), INT, vector, FLOAT)


@cache
def _touch(dimensions: int) -> Kind:
    vector = floats(dimensions)
    return tuple_of(FLOAT, vector, vector, vector)  # (time, normal, point, from a's centre to b's)


@cache
def _turning_touch(dimensions: int) -> Signature:
    vector, i, f = floats(dimensions), INT, FLOAT
    spins, times, limits = tuple_of(*(vector,) * 2), floats(2), floats(5)
    found = tuple_of(i, _touch(dimensions), f)
    return found(record_kind(STATE, dimensions), i, i, tuple_of(*(vector,) * 4), spins, times, limits)


@cache
def _touch_of_turn(dimensions: int) -> Signature:
    vector, i, f = floats(dimensions), INT, FLOAT
    found = tuple_of(BOOL, f, f, vector, vector, vector, vector)
    return found(record_kind(STATE, dimensions), f, i, i)


@cache
def _closing_point(dimensions: int) -> Signature:
    vector, i, f = floats(dimensions), INT, FLOAT
    met = tuple_of(f, vector, vector)
    return tuple_of(f, vector)(record_kind(STATE, dimensions), i, i, vector, met, f, vector)


@cache
def _of_step(dimensions: int) -> Signature:
    return INT(record_kind(STATE, dimensions), FLOAT)


@cache
def _turning_response(dimensions: int) -> Signature:
    vector, f = floats(dimensions), FLOAT
    change, motion = tuple_of(f, vector), tuple_of(vector, f)
    sides = tuple_of(*(INT,) * 2)
    return change(record_kind(STATE, dimensions), sides, _touch(dimensions), motion, f, f)


@cache
def _turn_by_impact(dimensions: int) -> Signature:
    f = FLOAT
    return INT(record_kind(STATE, dimensions), INT, f, floats(dimensions), f)


@cache
def _joined_range(dimensions: int) -> Signature:
    return FLOAT(record_kind(SOLVER, dimensions), INT, floats(2), tuple_of(*(INT,) * 4))


SIGNATURES = (
    _bound_searches, _first_touch, _take_together, _free_turn, _turning_touch, _touch_of_turn, _closing_point, _of_step,
    _turning_response, _turn_by_impact, _of_step, _of_step, _turning_response, _turn_by_impact, _of_step, _joined_range,
)  # fmt: skip
(
    call_bound_searches, call_first_touch, call_take_together, call_free_turn, call_turning_touch, call_touch_of_turn,
    call_closing_point, call_arms, call_turning_response, call_turn_by_impact, call_joined_islands, call_joined_bodies,
    call_joined_range,
) = map(call_in_dimension, (*SIGNATURES[:JOINED_RESPONSE], _joined_range))  # fmt: skip


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
    return Linked(function, SIGNATURES[place](dimensions), f"{function.__name__}, {dimensions}D,")

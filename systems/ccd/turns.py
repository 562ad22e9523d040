"""Where two bodies first touch in a step in which one of them turns so far that the end of the step may say nothing.

Shapes stand as they are turned where the step ends. What a flipper passes is behind it then; so such pairs are looked
at on the way there, as they are turned at each time.
"""

from __future__ import annotations

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, add_scaled, dot, length, scale, sub
from ..shapes.dispatch import evaluate, restitution_of
from ..shapes.poses import turn_shape
from ..shapes.tolerances import reach_of, slop_of, smaller_extent
from .search_bounds import FAST

TURN_LOOKS = 256
NEAR = 0.5  # slops: so near is a touch


@inlined
def angle_of(bodies, i):
    """By how much body i turns in the step; what is round stays as it is."""
    return length(bodies.turn[i]) if bodies.rolling_radius[i] == 0.0 else 0.0


@part
def turns_far(state, a, b):
    """Whether a pair has to be looked at on its way: one of the two turns by more than a part of the smaller one. Where
    they may bounce, only if it turns by itself: impacts have the others."""
    bodies = state.bodies
    if len(bodies.axes) == 0:
        return False
    way_a, way_b = angle_of(bodies, a) * reach_of(bodies, a), angle_of(bodies, b) * reach_of(bodies, b)
    far = FAST * smaller_extent(bodies, a, b)
    if way_a + way_b <= far:
        return False
    if (way_a > far and bodies.inverse_mass[a] == 0.0) or (way_b > far and bodies.inverse_mass[b] == 0.0):
        return True
    return restitution_of(state, a, b) == 0.0


@part
def first_touch_of_turn(state, a, b):
    """(whether they touch on the way, share of the step before that, gap then, normal, point from a's centre), by
    conservative advancement: nothing comes nearer by more than the centres do, and the farthest points by turning."""
    bodies, nothing = state.bodies, zero_of(state)
    start = sub(bodies.previous_position[b], bodies.previous_position[a])
    travel = sub(sub(bodies.position[b], bodies.position[a]), start)
    turn_a, turn_b, slop = angle_of(bodies, a), angle_of(bodies, b), slop_of(state, a, b)
    reach_a, reach_b = reach_of(bodies, a), reach_of(bodies, b)
    found, share, posed, depth, normal, point = False, 0.0, 1.0, 0.0, nothing, nothing
    for _ in range(TURN_LOOKS):
        turn_shape(state, a, scale(bodies.turn[a], share - posed))
        turn_shape(state, b, scale(bodies.turn[b], share - posed))
        posed = share
        d = add(add_scaled(start, travel, share), sub(bodies.offset[b], bodies.offset[a]))
        _, depth, normal, point = evaluate(state, bodies.shape[a], a, bodies.shape[b], b, d)
        far = length(add_scaled(start, travel, share))  # what lies near the centre of a mill is not met by its ends
        nearer = turn_a * min(reach_a, far + reach_b) + turn_b * min(reach_b, far + reach_a) - dot(travel, normal)
        found = depth >= -NEAR * slop
        if found or not nearer > 0.0:
            break
        share -= depth / nearer
        if not share <= 1.0:
            break
    turn_shape(state, a, scale(bodies.turn[a], 1.0 - posed))
    turn_shape(state, b, scale(bodies.turn[b], 1.0 - posed))
    return found, share, -depth, normal, point

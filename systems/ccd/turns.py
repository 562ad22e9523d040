"""Where two bodies first touch in a step in which one of them turns so far that the end of the step may say nothing.

Shapes stand as they are turned where the step ends. What a flipper passes is behind it then; so such pairs are looked
at on the way there, as they are turned at each time.
"""

from __future__ import annotations

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.jit.stack_arrays import stack_array
from ...framework.vectors import add, add_scaled, dot, item, length, replace, scale, sub
from ..integration.turning import turn_of_arm
from ..shapes.dispatch import evaluate
from ..shapes.tolerances import reach_of, slop_of, smaller_extent
from .search_bounds import FAST

TURN_LOOKS = 256
NEAR = 0.5  # slops: so near is a touch


@inlined
def angle_of(bodies, i):
    """By how much body i turns in the step; what is round stays as it is."""
    return length(bodies.turn[i]) if bodies.rolling_radius[i] == 0.0 else 0.0


@inlined
def turns_far(state, a, b):
    """Whether a pair has to be looked at on its way: one of the two turns by more than a part of the smaller one."""
    bodies = state.bodies
    if len(bodies.axes) == 0:
        return False
    way = angle_of(bodies, a) * reach_of(bodies, a) + angle_of(bodies, b) * reach_of(bodies, b)
    return way > FAST * smaller_extent(bodies, a, b)


@part
def stand_at(state, i, left, kept, offset):
    """The axes and the offset of body i as they are where a share of the step is left, from those at its end."""
    bodies, d = state.bodies, len(offset)
    angle = scale(bodies.turn[i], -left)
    for j in range(d):  # the columns are the axes of the body
        axis = offset
        for k in range(d):
            axis = replace(axis, k, kept[k * d + j])
        axis = add(axis, turn_of_arm(angle, axis))
        for k in range(d):
            bodies.axes[(i * d + k) * d + j] = item(axis, k)
    bodies.offset[i] = add(offset, turn_of_arm(angle, offset))


@part
def put_at_end(state, i, kept, offset):
    """As they were."""
    for k in range(len(offset) * len(offset)):
        state.bodies.axes[i * len(offset) * len(offset) + k] = kept[k]
    state.bodies.offset[i] = offset


@part
def first_touch_of_turn(state, a, b):
    """(whether they touch on the way, share of the step before that, gap then, normal, point from a's centre), by
    conservative advancement: nothing comes nearer by more than the centres do, and the farthest points by turning."""
    bodies, nothing = state.bodies, zero_of(state)
    kept_a, kept_b = stack_array(9, 0.0), stack_array(9, 0.0)
    offset_a, offset_b, size = bodies.offset[a], bodies.offset[b], len(nothing) * len(nothing)
    for k in range(size):
        kept_a[k], kept_b[k] = bodies.axes[a * size + k], bodies.axes[b * size + k]
    start = sub(bodies.previous_position[b], bodies.previous_position[a])
    travel = sub(sub(bodies.position[b], bodies.position[a]), start)
    turn_a, turn_b, slop = angle_of(bodies, a), angle_of(bodies, b), slop_of(state, a, b)
    reach_a, reach_b = reach_of(bodies, a), reach_of(bodies, b)
    found, share, depth, normal, point = False, 0.0, 0.0, nothing, nothing
    for _ in range(TURN_LOOKS):
        stand_at(state, a, 1.0 - share, kept_a, offset_a)
        stand_at(state, b, 1.0 - share, kept_b, offset_b)
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
    put_at_end(state, a, kept_a, offset_a)
    put_at_end(state, b, kept_b, offset_b)
    return found, share, -depth, normal, point

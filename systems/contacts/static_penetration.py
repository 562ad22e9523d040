"""What cannot be moved has the last word: where the solver has pushed a body into it, or through it, the body is put
back, and loses the speed that leads there.

So is what a turning thing has struck and then turned into, within the step, and what turns and has had more impacts
than it may: from each to the next it has sunk in a little.

The solver knows contacts as planes where the step starts, and shares what its passes leave undone among all of them.
So a light body between two heavy ones may be shot through a wall that is none of its contacts, or pressed into one a
little deeper in each step, until it is nearer to the other side.
"""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.vectors import add, add_scaled, at_most, dot, larger, length, negative, scale, shifted, smaller, sub
from ..broad_phase.boxes import find_extents
from ..ccd.search_bounds import FAST, turns_far
from ..ccd.turning_touch import turn_of_path
from ..codes import OK
from ..impacts.impulses import STOPPED
from ..integration.trajectory import along, path_of, relative_path
from ..integration.turning import turn_of_arm
from ..joints.groups import is_joined
from ..linking.parts import TOUCH_OF_TURN, call_touch_of_turn
from ..narrow_phase.manifolds import (
    centre_offset,
    centre_offset_at_start,
    depth_bound,
    depth_bound_on_path,
    evaluate_pair,
)  # fmt: skip
from ..narrow_phase.one_way import one_way_holds
from ..narrow_phase.stages import is_solid_pair, layers_meet
from ..parts.rows import next_row, owner_of
from ..shapes.tolerances import SAME_PLACE, smaller_extent, way_of_turning
from .bodies import rows_at_rest
from .resting import first_touch_on_segment, segment_start
from .solving.records import SQUEEZED, note_fault

QUARTER = 0.5 * math.pi  # rad: what turns farther shows its other side
ALLOWED = 0.05  # of the extent: overlap with what cannot be moved; what was deeper may stay so
JOINED = 0.35  # the same of what joints hold, which moving one part of it out would tear
NO_PAIR = -1
ROUNDS = 4  # over what a body in a corner touches; the last one is for what stands still alone
KNOWN = 0.05  # of the extent: so far around its foreseen motion the neighbours of a body are known


@part
def depth_on_side_of_touch(state, dt, a, b, d):
    """(depth, normal) of a pair of which one body turns far, on the side on which they have first touched: something
    thin may have turned past the middle of what it pushes."""
    bodies, travel = state.bodies, length(sub(d, centre_offset_at_start(state.bodies, a, b)))
    _, depth, normal, _ = evaluate_pair(state, a, b, d)
    ways = travel + way_of_turning(bodies, a, bodies.turn[a]) + way_of_turning(bodies, b, bodies.turn[b])
    if ways <= 0.5 * smaller_extent(bodies, a, b):
        return depth, normal  # no middle has passed another one
    turner, out = a if bodies.inverse_mass[b] > 0.0 else b, bodies.min_extent[a] + bodies.min_extent[b] + travel
    touches, share, _, way, _, _, _ = call_touch_of_turn(state.links[TOUCH_OF_TURN], state, dt, a, b)
    left = scale(turn_of_path(state, turner, dt), 1.0 - share)
    way = add(way, turn_of_arm(left, way))
    if not touches or length(left) > QUARTER or dot(way, normal) >= 0.0:
        return depth, normal
    _, depth, normal, _ = evaluate_pair(state, a, b, add_scaled(d, way, out))
    return depth + out * dot(way, normal), normal


@part
def penetration_of(state, dt, c, a, b):
    """(by how much they overlap more than they may, normal) at the end of the step; c: the pair, or NO_PAIR."""
    bodies, extent = state.bodies, smaller_extent(state.bodies, a, b)
    d, start = centre_offset(bodies, a, b), segment_start(state, a, b)
    travel = sub(d, start)
    way = length(travel)
    allowed, edge = (JOINED if is_joined(state, a, b) else ALLOWED) * extent, FAST * extent
    found, depth, normal = False, 0.0, travel
    if state.spinning and turns_far(state, a, b):  # where it started says nothing of the shapes at the end
        searched = along(relative_path(state, a, b), dt)
        pushed = sub(d, searched)
        unseen = state.impacts.sweeps and max(a, b) >= state.moving  # by searches; what turns by itself sweeps it up
        if unseen and length(pushed) > edge and not evaluate_pair(state, a, b, searched)[0]:
            found, gap, normal = first_touch_on_segment(state, a, b, searched, pushed, edge)
            if found:
                return -gap - dot(pushed, normal) - allowed, normal
        if c != NO_PAIR and depth_bound_on_path(state, c) <= allowed:  # usual
            return 0.0, normal
        depth, normal = depth_on_side_of_touch(state, dt, a, b, d)
        return depth - allowed, normal
    if way > edge:
        found, gap, normal = first_touch_on_segment(state, a, b, start, travel, edge)
        depth = -gap - dot(travel, normal)
    elif c != NO_PAIR and depth_bound(state.pairs, c, d) <= allowed:  # usual
        return 0.0, normal
    if not found:
        _, depth, normal, _ = evaluate_pair(state, a, b, d)
    stopped = bodies.impact_count[a] >= STOPPED or bodies.impact_count[b] >= STOPPED  # it has turned in as well
    deep = evaluate_pair(state, a, b, start)[1] if depth > allowed and not stopped else 0.0
    return depth - max(deep, allowed), normal


@part
def lets_pass(state, a, b):
    """Whether two that can push each other do not in this step: their contact is disabled, or is none as one of them is
    solid from one side only."""
    pairs, bodies = state.pairs, state.bodies
    for c in range(pairs.count if pairs.disabled_count > 0 else 0):
        if pairs.disabled[c] and pairs.a[c] in (a, b) and pairs.b[c] in (a, b):
            return True
    return not one_way_holds(state, a, b, centre_offset_at_start(bodies, a, b), centre_offset(bodies, a, b), -1.0)


@part
def push_out(state, dt, c, a, b):
    """Move the one of a and b that can be moved out of the other, where it is deeper than it may, and take the speed
    that leads there; returns how far it was moved."""
    bodies, velocities = state.bodies, state.bodies.linear_velocity
    far, normal = penetration_of(state, dt, c, a, b)
    if not far > 0.0 or (c == NO_PAIR and lets_pass(state, a, b)):
        return 0.0
    i, fixed, normal = (b, a, normal) if bodies.inverse_mass[b] > 0.0 else (a, b, negative(normal))
    velocity = velocities[i]
    if fixed < state.moving:
        velocity = sub(velocity, velocities[fixed])
    closing = dot(velocity, normal)
    k = owner_of(state, i)
    while k >= 0:
        bodies.position[k] = add_scaled(bodies.position[k], normal, far)
        if closing < 0.0:
            velocities[k] = add_scaled(velocities[k], normal, -closing)
            if rows_at_rest(state) > 0:  # what held it does not push it there again
                bodies.held_velocity[k] = velocities[k]
        k = next_row(state, k)
    return far


@part
def is_moved_by_solver(state, i):
    """Whether contacts at rest have moved body i, now or in the prediction, and no impact has stopped it."""
    bodies, owner = state.bodies, owner_of(state, i)
    if bodies.impact_count[i] >= STOPPED:
        return False
    return (state.any_warm_started and bodies.warm_started[i]) or (state.solver.contacts > 0 and bodies.held[owner])


@part
def may_penetrate(state, c, i):
    """Whether body i of pair c may be deeper than it may: the solver has moved it, or has left it on its path, which is
    not quite that of the substeps; what has struck it turns on, or so many impacts in which it turns have stopped it:
    from one to the next it sinks in a little."""
    pairs = state.pairs
    rests = state.impacts.sweeps and state.solver.contacts > 0 and pairs.rests[c]
    if rests or is_moved_by_solver(state, i):
        return True
    if not state.spinning:
        return False
    struck = pairs.impulse[c] > 0.0 and turns_far(state, pairs.a[c], pairs.b[c])
    return struck or state.bodies.impact_count[i] >= STOPPED


@part
def is_displaced(state, i, dt):
    """Whether body i is where its neighbours are not known."""
    bodies = state.bodies
    at, known = bodies.position[i], KNOWN * bodies.min_extent[i]
    start, end = bodies.previous_position[i], along(path_of(state, i), dt)
    if state.impacts.sweeps:
        start, end = bodies.search_lower[i], bodies.search_upper[i]
    return not (at_most(shifted(smaller(start, end), -known), at) and at_most(at, shifted(larger(start, end), known)))


@part
def push_out_of_all(state, dt, i):
    """Body i against everything that cannot be moved."""
    bodies, moved = state.bodies, False
    for k in range(state.dynamic, state.count):
        if bodies.shape[k] >= 0 and layers_meet(state, i, k) and is_solid_pair(state, i, k):
            moved |= push_out(state, dt, NO_PAIR, i, k) > 0.0
    return moved


@part
def measure_turned(state, i):
    """The extents of body i as it stands now, if contacts have turned it."""
    bodies = state.bodies
    if not state.spinning or bodies.rolling_radius[i] > 0.0:  # what is round looks the same
        return
    if bodies.held[owner_of(state, i)] or bodies.impact_count[i] > 0:
        for level in range(state.level_count):
            find_extents(state, level, i, i + 1)


def resolve_static_penetration(state, dt):
    """Put the bodies that the solver has moved, and in swept modes those that rest, out of what cannot be moved."""
    pairs, bodies, dynamic = state.pairs, state.bodies, state.dynamic
    pushed = state.solver.contacts > 0 or state.any_warm_started or (state.spinning and state.impacts.logged > 0)
    pushed |= state.turns_too_far > 0  # it stopped, and turned on
    if not pushed or state.count == dynamic:
        return OK
    for turn in range(ROUNDS):
        last, moved = turn == ROUNDS - 1, False
        first = state.moving if last else dynamic
        for c in range(pairs.count):
            a, b = pairs.a[c], pairs.b[c]
            fixed, i = max(a, b), min(a, b)  # dynamic rows come first
            if not (fixed >= first and i < dynamic and pairs.is_solid[c] and may_penetrate(state, c, i)):
                continue
            measure_turned(state, i)
            far = push_out(state, dt, c, a, b)
            moved |= far > 0.0
            if last and far > SAME_PLACE * smaller_extent(bodies, a, b):  # more than rounding
                note_fault(state.solver, SQUEEZED, i)
        if not moved:
            break
    for i in range(state.first, dynamic if not state.pairs_filtered else 0):
        if bodies.shape[i] >= 0 and is_moved_by_solver(state, i) and is_displaced(state, i, dt):
            measure_turned(state, i)
            for _ in range(ROUNDS):
                if not push_out_of_all(state, dt, i):
                    break
    return OK

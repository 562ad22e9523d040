"""The next impact of a pair: when and where the two meet on their paths, and whether they meet fast enough.

They are taken where they first touch on their path; pairs that are not swept only if they overlap at the end of it.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, add_scaled, divided, dot, length, negative, scale, sub
from ..ccd.search_bounds import EVENT_DRIVEN, FAST, is_swept, limits_of_sweep, rest_edge, turns_far
from ..ccd.time_of_impact import APART, AT_CORNER, TOUCHES, bounds_stay_disjoint, clear_of_rounding
from ..ccd.turning_touch import UNFOLLOWED
from ..integration.trajectory import ROUNDING, along, centre_at, rate_along, relative_path, travel_of
from ..integration.turning import arms_to, closing_by_spin, is_turned
from ..linking.parts import FIRST_TOUCH, TURNING_RESPONSE, call_first_touch, call_turning_response
from ..narrow_phase.manifolds import is_at_manifold
from ..narrow_phase.stages import rank_rows
from ..shapes.dispatch import (
    both_convex,
    evaluate,
    friction_at,
    has_corner_rule,
    is_corner_touch,
    restitution_at,
    restitution_of,
)
from ..shapes.poses import advance_pose, motion_of, set_motion
from ..shapes.surfaces import slip_at
from ..shapes.tolerances import is_turning, slop_of, smaller_extent, turning_travel
from .heap import heap_push
from .impulses import (
    CROSSING,
    HALT,
    HAND_OVER,
    IMPACT,
    NO_EVENT,
    STOPPED,
    count_capped,
    is_beyond_cap,
    is_deflected,
    is_trapped,
)

QUICK = 1e-3  # of the step: inelastic impacts closer than this in time are treated as inelastic collapse
REGRAZE_IMPACTS = 4  # impacts of two bodies in a step after which they sink in before the next one,
SINKS, PLASTIC_SINKS = math.inf, 1.0  # by so many grazes, up to MOST_SUNK: elastic ones at 8, 16, ... impacts, others
# at each
MOST_PLASTIC = 1000  # impacts of a body in a step after which those beyond the cap are none any more

NO_TOUCH, OVERLAPS_AT_END, FOUND_BY_SWEEP, UNKNOWN = range(4)


@part
def overlap_at_end(state, a, b, path, dt):
    """(whether they overlap at the end of their motion, and not at a corner only; the normal there)."""
    bodies = state.bodies
    shape_a, shape_b, d = bodies.shape[a], bodies.shape[b], along(path, dt)
    hit, depth, normal, _ = evaluate(state, shape_a, a, shape_b, b, d)
    corners, slop = state.spinning and is_turned(bodies, a) and is_turned(bodies, b), slop_of(state, a, b)
    return hit and (corners or not is_corner_touch(state, shape_a, a, shape_b, b, d, (depth, normal), slop)), normal


@part
def leaves_touch_at(state, c, path, since, t):
    """When pair c, that touches at t on the side opposite to its last impact, is clear of the place of that: ``since``,
    unless it is there still. Things without thickness touch on either side, by rounding, after they have bounced."""
    pairs = state.pairs
    if not pairs.struck[c] >= since:
        return since
    a, b, rate = pairs.a[c], pairs.b[c], dot(rate_along(path, since), pairs.normal[c])
    clear = since + clear_of_rounding(state, a, b, path, since) / abs(rate)
    return clear if t < clear and both_convex(state, state.bodies.shape[a], state.bodies.shape[b]) else since


@part
def regraze_depth(state, a, b, restitution):
    """By how many grazes two bodies that turn are deeper at their next touch; -inf: at any depth. After REGRAZE_IMPACTS
    impacts of both in a step it is one of those that follow each other at once: a corner that slides along a face parts
    slowly, and is turned back into it. Where they may sink in first elastic ones part faster, fly for
    longer, and lose nothing; others come to the end of the step before the cap.
    """
    count, inverse_mass = state.bodies.impact_count, state.bodies.inverse_mass
    fewest = min(count[a] if inverse_mass[a] > 0.0 else STOPPED, count[b] if inverse_mass[b] > 0.0 else STOPPED)
    if fewest < REGRAZE_IMPACTS:
        return -math.inf
    if restitution < 1.0:
        return PLASTIC_SINKS
    return SINKS if fewest & (fewest - 1) == 0 else 0.0


@part
def find_touch(state, c, a, b, path, since, restitution, dt):
    """(NO_TOUCH, OVERLAPS_AT_END or FOUND_BY_SWEEP; (time, normal, point, from a's centre to b's)) of the pair's next
    touch from a time on; UNKNOWN: none until that time, nothing is known of later. What is not swept, or touches at a
    corner, has none unless it overlaps at the step's end."""
    impacts, pairs, bodies, zero = state.impacts, state.pairs, state.bodies, zero_of(state)
    swept, overlaps, end_normal, nothing = False, False, zero, (dt, zero, zero, zero)
    turning = state.spinning and is_turning(state, dt, a, b)
    limits = slop_of(state, a, b), dt, bounce_threshold(state, a, b) if turning else -math.inf, -math.inf
    if impacts.sweeps:
        since = max(since, bodies.last_impact[a], bodies.last_impact[b])
        passive, travel = not pairs.is_solid[c], travel_of(path, dt) + turning_travel(state, dt, a, b)
        swept = is_swept(state, a, b, travel)
        if passive and (not swept or pairs.crossed[c]):
            return NO_TOUCH, nothing
        if swept:
            limits = limits_of_sweep(state, a, b, travel, bounce_threshold(state, a, b), dt)
    if turning:
        limits = limits[0], limits[1], limits[2], regraze_depth(state, a, b, restitution)
    if not swept:
        if state.spinning and turns_far(state, a, b):  # contacts at rest know what a mill meets on its way
            return NO_TOUCH, nothing
        if restitution > 0.0:
            overlaps, end_normal = overlap_at_end(state, a, b, path, dt)
        if not overlaps:
            return NO_TOUCH, nothing
    while True:
        address, clear = state.links[FIRST_TOUCH], since
        found, t, normal, point, apart = call_first_touch(address, state, a, b, path, since, dt, limits)
        if swept and found == TOUCHES and pairs.impulse[c] > 0.0 and dot(normal, pairs.normal[c]) < 0.0:
            clear = leaves_touch_at(state, c, path, since, t)
        if not clear > since:
            break
        since = clear
        if since >= dt:
            return NO_TOUCH, nothing
    if found == APART:
        return NO_TOUCH, nothing
    if found != AT_CORNER:
        touch = t, normal, point, apart
        return (UNKNOWN if found == UNFOLLOWED else FOUND_BY_SWEEP if swept else OVERLAPS_AT_END), touch
    if swept:
        overlaps, end_normal = overlap_at_end(state, a, b, path, dt)
        if not overlaps:
            return NO_TOUCH, nothing
    return OVERLAPS_AT_END, (t, end_normal, point, apart)  # it slides onto the next thing: edges do not stop it


@part
def bounce_threshold(state, a, b):
    """The approach speed up to which a touch is a contact at rest."""
    fixed, change = state.restitution_threshold, state.bodies.force_speed_change
    return fixed if fixed >= 0.0 else 2.0 * max(change[a], change[b])


@part
def is_held_by_edge(state, a, b, path, touch, speed, dt):
    """Whether a supported body that slides or rolls has sunk in a little, and only meets the edge of the next thing in
    its row: it does not get deeper than it may."""
    bodies, (t, _, _, apart) = state.bodies, touch
    edge = rest_edge(state, a, b, dt)
    at = add_scaled(apart, rate_along(path, t), 2.0 * edge / -speed)
    return evaluate(state, bodies.shape[a], a, bodies.shape[b], b, at)[1] <= edge


@part
def is_missed_by_discrete(state, a, b, path, touch, dt):
    """Whether so slow an approach leads far in before or after an impact, or while the two turn: contacts at rest know
    only the way after the last one, with shapes that stay as they are."""
    bodies, touchdown_time = state.bodies, state.impacts.touchdown_time
    count, inverse_mass = bodies.impact_count, bodies.inverse_mass
    if not state.impacts.sweeps:
        return False
    until, (_, normal, _, start) = dt, touch
    if count[a] == 0 and count[b] == 0:
        if touchdown_time > 0.0 and inverse_mass[a] * inverse_mass[b] == 0.0:
            until = touchdown_time
        elif (
            not state.spinning
            or turns_far(state, a, b)
            or not turning_travel(state, dt, a, b) > FAST * smaller_extent(bodies, a, b)
        ):
            return False
    return dot(sub(start, along(path, until)), normal) > FAST * smaller_extent(bodies, a, b)


@part
def approach_speed(state, c, path, touch, kind, dt):
    """Of a solid pair: (NO_EVENT, HAND_OVER if it lands, too slow to bounce, or IMPACT; speed along the normal)."""
    bodies, impacts, pairs, (t, normal, point, apart) = state.bodies, state.impacts, state.pairs, touch
    a, b = pairs.a[c], pairs.b[c]
    speed = dot(rate_along(path, t), normal)
    if state.spinning:
        speed += closing_by_spin(bodies, a, b, arms_to(bodies, a, b, normal, point, apart), normal)
    threshold, rounding, turning = bounce_threshold(state, a, b), 0.0, turning_travel(state, 1.0, a, b)
    if impacts.sweeps:  # else a plastic impact would be one again, by a rounding error
        rounding = ROUNDING * (length(bodies.path_velocity[a]) + length(bodies.path_velocity[b]))
    if not speed < -(threshold + rounding):  # a contact at rest
        if state.spinning and not speed < -ROUNDING * turning:  # it has landed
            return NO_EVENT, speed
        return HAND_OVER if is_missed_by_discrete(state, a, b, path, touch, dt) else NO_EVENT, speed
    turns = turning * dt > slop_of(state, a, b)
    slides = kind == FOUND_BY_SWEEP and (bodies.warm_started[a] or bodies.warm_started[b])
    if has_corner_rule(state, bodies.shape[a], bodies.shape[b]):  # what turns reaches the edge by that as well
        slides &= not turns
    if slides and turns:  # what tips over on another body lands on its next corner while the one before holds it
        slides = pairs.early[c] and restitution_at(state, a, b, (point, normal, apart)) == 0.0
        slides &= turning * (dt - t) - speed * dt <= smaller_extent(bodies, a, b)
    elif slides:
        slides = is_held_by_edge(state, a, b, path, touch, speed, dt)
    if slides:
        return NO_EVENT, speed
    return IMPACT, speed


@inlined
def is_held(state, i):
    """Whether contacts or joints have held row i in the last step."""
    return state.any_warm_started and state.bodies.warm_started[i]


@part
def bend_until(state, i, e, normal, t, dt):
    """By how much body i is faster along a normal at time t than a straight path says, which has the velocity of the
    middle of the step. With that of another time what always meets the floor at the same phase of a step hops for ever.
    Where e is 1 what flies freely reflects its path: its flight then runs backwards exactly, and nothing drifts."""
    bodies = state.bodies
    bend = dot(sub(bodies.linear_velocity[i], bodies.start_velocity[i]), normal)
    if is_held(state, i):
        forced = bodies.force_speed_change[i]
        bend = min(max(bend, -forced), forced)  # their push is no force
    elif e == 1.0:
        bend = 0.0
    return bend * (t / dt - 0.5)


@part
def kind_beyond_cap(state, a, b, path, t, speed, restitution, dt):
    """What becomes of a pair of which a body has had all the impacts it may have: HAND_OVER; IMPACT, once more, but
    without restitution, if impacts that lose energy follow each other at once; NO_EVENT, if it goes on too little."""
    bodies = state.bodies
    count, inverse_mass = bodies.impact_count, bodies.inverse_mass
    still = (count[a] >= STOPPED or inverse_mass[a] == 0.0) and (count[b] >= STOPPED or inverse_mass[b] == 0.0)
    turning = turning_travel(state, dt - t, a, b)  # brings in other points than the one that closes so slowly
    sinks = turning - speed * (dt - t) > slop_of(state, a, b)
    far = turning + travel_of(path, dt - t) > FAST * smaller_extent(bodies, a, b)
    if still or not sinks or not (far or is_deflected(state, a) or is_deflected(state, b)):
        return NO_EVENT
    if restitution == 1.0 and is_trapped(state, a, b):
        return HAND_OVER
    since_last = t - max(bodies.last_impact[a], bodies.last_impact[b])
    collapse = restitution <= 0.0 or (restitution < 1.0 and since_last <= QUICK * dt)
    collapse |= state.mode == EVENT_DRIVEN and since_last <= 0.0
    return IMPACT if collapse and max(count[a], count[b]) < MOST_PLASTIC else HAND_OVER


@part
def queue_event(state, c, kind, path, touch, speed, restitution):
    """Put an event into the queue."""
    impacts, pairs, bodies, (t, normal, point, _) = state.impacts, state.pairs, state.bodies, touch
    a, b = pairs.a[c], pairs.b[c]
    place = point, normal, touch[3]
    change, pull, mu = -(1.0 + restitution) * speed, zero_of(state), friction_at(state, a, b, place)
    w = slip_at(state, a, b, rate_along(path, t), place)
    if state.spinning and kind != CROSSING:
        address, motion = state.links[TURNING_RESPONSE], (w, speed)
        change, pull = call_turning_response(address, state, (a, b), touch, motion, restitution, mu)
    elif mu > 0.0:  # Coulomb: stops what slides, with at most mu times the normal impulse
        sliding = add_scaled(w, normal, -dot(w, normal))
        fast = length(sliding)
        if fast > 0.0:
            pull = scale(sliding, -min(1.0, -mu * (1.0 + restitution) * speed / fast))
    if state.ranks_version != state.version:
        rank_rows(state)
    event = impacts.heap[impacts.waiting]
    impacts.event_pair[event], impacts.event_kind[event] = c, kind
    impacts.event_count_a[event], impacts.event_count_b[event] = bodies.impact_count[a], bodies.impact_count[b]
    impacts.event_time[event] = t
    impacts.event_key[event] = bodies.rank[a] * state.count + bodies.rank[b]
    impacts.event_change[event], impacts.event_normal[event] = change, normal
    impacts.event_point[event], impacts.event_pull[event] = add(centre_at(state, a, t), point), pull
    heap_push(impacts, impacts.waiting)


@part
def queue_next_impact(state, c, since, dt):
    """Put the pair's next impact from a time on into the queue, if it has one: a touch, and a fast approach.

    A pair that is not solid only has its crossing noted, if it is swept.
    """
    pairs, bodies, impacts = state.pairs, state.bodies, state.impacts
    a, b, passive = pairs.a[c], pairs.b[c], not pairs.is_solid[c]
    path = relative_path(state, a, b)
    turns = state.spinning and is_turning(state, dt, a, b)
    if impacts.sweeps and not turns and bounds_stay_disjoint(state, a, b, path, since, dt):
        return
    e = restitution_of(state, a, b)
    rested = pairs.early[c] and not passive and e < 1.0 and not turns
    if rested and is_at_manifold(pairs, c, along(path, dt), smaller_extent(bodies, a, b)):  # it stays there
        return
    found, touch = find_touch(state, c, a, b, path, since, e, dt)
    if found == NO_TOUCH:
        return
    if found == UNKNOWN:
        if not passive:
            queue_event(state, c, HALT, path, touch, 0.0, 0.0)
        return
    e = restitution_at(state, a, b, (touch[2], touch[1], touch[3]))
    if e == 0.0 and not (passive or impacts.sweeps):  # nothing of what bounces elsewhere
        return
    if not state.spinning:
        queue_touch(state, c, path, found, touch, e, dt)
        return
    motions = motion_of(state, a), motion_of(state, b)  # of the end of the step
    advance_pose(state, a, bodies.spin[a], touch[0] - dt)
    advance_pose(state, b, bodies.spin[b], touch[0] - dt)
    queue_touch(state, c, path, found, touch, e, dt)
    set_motion(state, a, motions[0])
    set_motion(state, b, motions[1])


@part
def queue_touch(state, c, path, found, touch, e, dt):
    """Put a touch of a pair into the queue, if it is an impact; the two spin as they do then."""
    pairs, bodies, impacts = state.pairs, state.bodies, state.impacts
    a, b, passive = pairs.a[c], pairs.b[c], not pairs.is_solid[c]
    t, normal, point, apart = touch
    w = rate_along(path, t)
    if dot(apart, apart) == 0.0 and length(apart) == 0.0 and length(w) > 0.0:
        if pairs.impulse[c] > 0.0:  # it has parted already
            return
        normal = divided(negative(w), length(w))  # no direction between the centres: they part the way they came
    touch = (t, normal, point, apart)
    speed, kind = dot(w, normal), CROSSING
    if not passive:
        kind, speed = approach_speed(state, c, path, touch, found, dt)
        e = 0.0 if kind == HAND_OVER else e
    if state.path_degree == 1 and kind == IMPACT and (e != 1.0 or is_held(state, a) or is_held(state, b)):
        speed = min(0.0, speed + bend_until(state, b, e, normal, t, dt) - bend_until(state, a, e, normal, t, dt))
        if impacts.sweeps:
            rounding = ROUNDING * (length(bodies.path_velocity[a]) + length(bodies.path_velocity[b]))
            if not speed < -rounding:  # not in the flight
                return
    if kind not in (CROSSING, NO_EVENT) and is_beyond_cap(state, a, b):
        kind = kind_beyond_cap(state, a, b, path, t, speed, e, dt) if impacts.sweeps else NO_EVENT
        if kind != HAND_OVER and e > 0.0:  # else it is what it would have been
            count_capped(state, a, b)
        e = 0.0 if kind == IMPACT else e
    if kind != NO_EVENT:
        queue_event(state, c, kind, path, touch, speed, e)

"""When two bodies of which one turns, and is not round, first touch: by conservative advancement, with both shapes
turned as they are at each time. What a flipper passes is behind it where the step ends.

The gap closes no faster than the bodies approach along its normal, plus the speed by spin of the farthest point of
each; nor than it does as seen from what turns with one of them, where of spins only the difference counts, at the
other: so what a turning body carries along takes few looks. An impact needs a point that approaches: after one the two
still touch, and another corner may come in.
(B. Mirtich, "Impulse-based dynamic simulation of rigid body systems", 1996.)
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.jit.stack_arrays import stack_array
from ...framework.vectors import add, add_scaled, dot, length, negative, row, scale, sub
from ..integration.trajectory import ROUNDING, along, path_of, rate_along, travel_of
from ..integration.turning import arms_to, closing_by_spin, cross_spin, is_turned, size_of_turn
from ..joints.groups import is_joined
from ..linking.parts import CLOSING_POINT, TURNING_TOUCH, call_closing_point, call_turning_touch
from ..shapes.convex.points import MOST_POINTS, contact_points
from ..shapes.dispatch import both_convex, evaluate, has_corner_rule, is_corner_touch
from ..shapes.linking.convex_by_address import convex_at, rounding_by_address, support_by_address
from ..shapes.poses import has_unequal_moments, pose_of, turn_to
from ..shapes.tolerances import slop_of, smaller_extent, way_of_turning

APART, TOUCHES, AT_CORNER, UNFOLLOWED = range(4)  # what a search finds; the last: its looks have run out
STOPPED = 1 << 30  # added to a body's impacts: it moves no more in this step, and the solver leaves it alone
EXACT_LOOKS, COARSE_LOOKS = 60, 190
NEAR_EXTENTS = 1e-6  # of the extent: a smaller gap is a touch; of bodies at rest,
TOUCH_SLOP = 0.5  # of the slop
TURNING_TILT = 0.1  # rad, between faces that may touch in several points
MOST_STRIDES = 4096  # looks in a search, and at shapes whose gap does not tell the next one;
STRIDE, SHORTER = 0.02, 0.1  # extents between these; of the stride of others: that of a thin box which is turned is
# the extent of the box around it
FOLLOWED_TURN = 0.5  # rad in a step: up to that the end of the step tells where what turns touches
UNSURE = 64.0 * ROUNDING  # of speeds, also those by which spins move places: slower nothing closes
MOST_SUNK = 0.5  # slops, or a graze: deeper nothing sinks in before a touch
GRAZE = 0.125  # slops: as far as points move between looks at a pair that touches and parts, or after EXACT_LOOKS,
THIN = 0.1  # of the widths of both: or no farther than that, or one may be behind the other at the next look


def closing_point(state, a, b, d, met, near, velocity):
    """(how fast the gap grows there, point): the middle of those points in which the two touch that approach; that of
    the pair if none does, and in a plane if all do: it is in their middle, to the bit. met: (depth,
    normal, point) as the pair's function answers; velocity: of b's body as a's sees it."""
    bodies, (_, normal, point) = state.bodies, met
    places, gaps = stack_array(MOST_POINTS, d), stack_array(MOST_POINTS, 0.0)
    speed, middle, closing = dot(velocity, normal), scale(d, 0.0), 0
    count = contact_points(state, (a, b), d, met, (near, TURNING_TILT), places, gaps)
    for k in range(count):
        place = row(places, k, d)
        if speed + closing_by_spin(bodies, a, b, arms_to(bodies, a, b, normal, place, d), normal) < 0.0:
            middle, closing = add(middle, place), closing + 1
    if closing > 0 and (closing < count or len(d) == 3):
        point = scale(middle, 1.0 / closing)
    return speed + closing_by_spin(bodies, a, b, arms_to(bodies, a, b, normal, point, d), normal), point


@inlined
def reach_along(state, i, direction):
    """How far the shape of body i reaches from its centre in a direction; infinity if it has no support that tells."""
    shape = convex_at(state.shapes.parameters[state.bodies.shape[i]], i)
    if shape[0] == 0:
        return math.inf
    return dot(support_by_address(shape, direction), direction) + rounding_by_address(shape)


@part
def clear_along(state, a, b, d, normal):
    """How far apart two convex shapes are at least, d from centre to centre, by planes across a normal; 0 if none parts
    them."""
    out, way = negative(normal), dot(d, normal)
    ahead = way - reach_along(state, a, normal) - reach_along(state, b, out)
    return max(0.0, ahead, -way - reach_along(state, a, out) - reach_along(state, b, normal))


@inlined
def speed_seen_turning(spin, motion, span):
    """How fast the centre of b comes along a normal, at most, in a span of time, but for what forces make of
    that, as seen from what turns with that spin, which turns the velocity and the normal, too; a normal of 0: how fast
    it moves in any direction. motion: see :func:`nearing_speed`."""
    between, w, normal, gained = motion
    seen, turn = sub(w, cross_spin(spin, between)), size_of_turn(spin) * span
    size, bent = length(seen), turn * (length(w) + gained)
    if dot(normal, normal) > 0.0:
        size = min(size, max(0.0, -dot(seen, normal)) + turn * (size + bent))
    return size + bent


@part
def nearing_speed(bodies, a, b, spins, motion, span):
    """How fast points of two come nearer to each other, at most, in a span of time from now on: as seen from what does
    not turn, or from what turns with one of them, where what lies on it stands still. motion: (from a's centre of mass
    to b's, b's velocity as a's centre sees it, the normal of a plane between them; 0 if they touch; m/s by which forces
    change that velocity, at most)."""
    ways = way_of_turning(bodies, a, spins[0]) + way_of_turning(bodies, b, spins[1])
    spin_a = spins[1] if bodies.rolling_radius[a] > 0.0 else spins[0]  # round things look the same, however they spin
    spin_b = spins[0] if bodies.rolling_radius[b] > 0.0 else spins[1]
    turned = sub(spin_b, spin_a)
    nearing = min(
        speed_seen_turning(scale(spin_a, 0.0), motion, span) + ways,
        speed_seen_turning(spin_a, motion, span) + way_of_turning(bodies, b, turned),
        speed_seen_turning(spin_b, motion, span) + way_of_turning(bodies, a, turned),
    )
    return nearing + motion[3]


@part
def has_to_stop(state, a, b, threshold):
    """Whether one of two whose way an impact search cannot follow still moves."""
    count, inverse_mass = state.bodies.impact_count, state.bodies.inverse_mass
    moves_a, moves_b = inverse_mass[a] > 0.0 and count[a] < STOPPED, inverse_mass[b] > 0.0 and count[b] < STOPPED
    return state.sweeping and threshold > -math.inf and (moves_a or moves_b)


def touch_of_turning(state, a, b, path, spins, times, limits):
    """(APART, TOUCHES, or UNFOLLOWED: nothing is known of what comes later; (time, normal, point, from a's centre to
    b's); gap then) between two times, while they turn with those spins; shapes stand as at the second of these. limits:

    - slop, m
    - gap of a touch, m
    - approach of the point, m/s: a slower touch counts only if no faster one follows; -inf: any, at corners too
    - grazes by which they have to be deeper than at the first time; -inf: none
    - s between looks at a pair with a corner rule, whose gap holds for one pose alone: its touch is bisected
    """
    bodies, (spin_a, spin_b), (since, until) = state.bodies, spins, times
    (slop, near, threshold, grazes, stride), shape_a, shape_b = limits, bodies.shape[a], bodies.shape[b]
    holds = not has_corner_rule(state, shape_a, shape_b)  # its gap, however they are turned meanwhile
    stride = max(stride, (until - since) / MOST_STRIDES)
    strides = 0 if holds else int((until - since) / stride)
    convex, ends = both_convex(state, shape_a, shape_b), sub(bodies.offset[b], bodies.offset[a])
    turning = way_of_turning(bodies, a, spin_a) + way_of_turning(bodies, b, spin_b)
    way = turning * (until - since) + travel_of(path, until)
    graze = max(GRAZE * slop, way / (COARSE_LOOKS + strides))
    rates, places = size_of_turn(spin_a) + size_of_turn(spin_b), length(bodies.origin[a]) + length(bodies.origin[b])
    rounding = UNSURE * (turning + rates * places + length(bodies.path_velocity[a]) + length(bodies.path_velocity[b]))
    bend = 2.0 * length(path[2]) + 6.0 * length(path[3]) * until
    corners = threshold < 0.0 or (is_turned(bodies, a) and is_turned(bodies, b))  # of others, too
    poses = pose_of(state, a), pose_of(state, b)
    touch, found, gap, crept, ended = (until, zero_of(state), zero_of(state), zero_of(state)), False, 0.0, 0, False
    t, least, begun, low, high = since, 0.0, 0.0, since, math.inf
    thin = max(THIN * (bodies.min_extent[a] + bodies.min_extent[b]), GRAZE * slop)
    for look in range(MOST_STRIDES + strides):
        turn_to(state, a, poses[0], spin_a, until, t)
        turn_to(state, b, poses[1], spin_b, until, t)
        d = add(along(path, t), sub(sub(bodies.offset[b], bodies.offset[a]), ends))
        _, depth, normal, point = evaluate(state, shape_a, a, shape_b, b, d)
        w = rate_along(path, t)
        if look == 0 and grazes > -math.inf:
            sunk = min(depth + grazes * graze, max(depth, graze, MOST_SUNK * slop))
            least = max(0.0, depth, min(sunk, thin))
        if look == 0 and not 0.0 < grazes < math.inf:  # else it has sunk in by plastic impacts, which add up
            begun = max(0.0, depth)
        depth -= least
        if crept == EXACT_LOOKS:
            near = max(near, min(graze, thin))
        left, touches, between = until - t, -depth <= near, sub(d, sub(bodies.offset[b], bodies.offset[a]))
        motion = between, w, scale(normal, 1.0 if convex and not touches else 0.0), bend * left
        fastest = nearing_speed(bodies, a, b, spins, motion, left)
        if touches:
            rate = 0.0
            if threshold > -math.inf:
                met, address = (depth + least, normal, point), state.links[CLOSING_POINT]
                rate, point = call_closing_point(address, state, a, b, d, met, near - least, w)
            fast, there = rate < -(threshold + rounding), (depth + least, normal)
            closes = fast or (rate < -rounding and not found)
            if closes and (corners or not is_corner_touch(state, shape_a, a, shape_b, b, d, there, slop)):
                touch, found, gap = (t, normal, point, d), True, -depth
                high = t if fast else high
        low = low if high <= t else t
        exact = (holds and depth <= near) or (high - low) * fastest <= near  # else the touch is bisected
        ended = exact if high < math.inf else t >= until
        if ended:
            break
        clear = max(-depth - 0.5 * near, 0.5 * near)
        if touches:
            clear = max(-depth, GRAZE * slop, min(graze, thin - (depth + least - begun)))
        further = t + clear / fastest if clear < fastest * left else until
        crept += 1 if holds or further < t + stride else 0
        if high < math.inf:
            further = 0.5 * (low + high)
        elif not holds:
            further = min(further, t + stride)
            if convex:  # what is beside the other one is looked at when it may be there
                along_it = turning + bend * left + abs(dot(w, normal))
                further = max(further, t + clear_along(state, a, b, d, normal) / along_it)
        if not (found or ended):
            touch = t, normal, point, d
        t = further if further < until else until
    turn_to(state, a, poses[0], spin_a, until, until)
    turn_to(state, b, poses[1], spin_b, until, until)
    if found or ended or not has_to_stop(state, a, b, threshold):
        return (TOUCHES if found else APART), touch, gap
    state.turns_too_far = 1 + (a if way_of_turning(bodies, a, spin_a) > way_of_turning(bodies, b, spin_b) else b)
    return UNFOLLOWED, touch, gap


@inlined
def is_struck(state, i):
    """Whether body i has had an impact at a known time of the step."""
    return state.impacts.sweeps and state.bodies.impact_count[i] > 0


@part
def turn_of_path(state, i, dt):
    """By how much body i turns in the step, as seen from what the last impact has made of its spin."""
    bodies = state.bodies
    led = state.impacts.logged > 0 and bodies.impact_count[i] > 0
    struck = is_struck(state, i) or (led and (has_unequal_moments(state, i) or is_joined(state, i, i)))
    return scale(bodies.spin[i], dt) if struck else bodies.turn[i]


@part
def is_followed(state, a, b, dt):
    """Whether two bodies turn so little that the points in which they touch where the step ends tell of all of it."""
    turn = 0.0
    for i in (a, b):
        turn += size_of_turn(turn_of_path(state, i, dt)) if state.bodies.rolling_radius[i] == 0.0 else 0.0
    return turn <= FOLLOWED_TURN


@part
def place_on_way(state, i, share, dt):
    """Where body i is after that share of the step: on its path, if it is struck there, for what has moved it since did
    so at the end; else on the straight way to where it is now."""
    bodies = state.bodies
    if is_struck(state, i):
        return along(path_of(state, i), share * dt)
    return add_scaled(bodies.previous_position[i], sub(bodies.position[i], bodies.previous_position[i]), share)


def first_touch_of_turn(state, dt, a, b):
    """(whether they touch on the way, share of the step before that, gap then, normal, point from a's centre, from a's
    body to b's where that path starts, and how far that has gone), as the step leads and turns them since their last
    impacts; they need not approach."""
    bodies, slop, still, since = state.bodies, slop_of(state, a, b), zero_of(state), 0.0
    for i in (a, b):
        if is_struck(state, i):
            since = max(since, bodies.last_impact[i] / dt)
    start, left = sub(place_on_way(state, b, since, dt), place_on_way(state, a, since, dt)), 1.0 - since
    travel = sub(sub(bodies.position[b], bodies.position[a]), start)
    path = add(start, sub(bodies.offset[b], bodies.offset[a])), travel, still, still
    spins = scale(turn_of_path(state, a, dt), left), scale(turn_of_path(state, b, dt), left)
    way = length(travel) + way_of_turning(bodies, a, spins[0]) + way_of_turning(bodies, b, spins[1])
    stride = STRIDE * smaller_extent(bodies, a, b) / way if way > 0.0 else 1.0
    limits = (slop, TOUCH_SLOP * slop, -math.inf, -math.inf, stride)
    address = state.links[TURNING_TOUCH]
    found, touch, gap = call_turning_touch(address, state, a, b, path, spins, (0.0, 1.0), limits)
    share, normal, point, _ = touch
    return found == TOUCHES, since + left * share, gap, normal, point, start, scale(travel, share)

"""When two bodies first touch on their paths through a step: the swept test of any two shapes.

A straight path of a pair with a closed form of its own is answered by that. Everywhere else the time is found
by conservative advancement: while the two are apart, a plane with the pair's normal lies in the gap between them, and
they cannot meet before the gap along that normal, which is a polynomial of the time, has closed. From there the search
goes on. Convex shapes are never taken past their touch. On a plane one look is exact, a parabola included; elsewhere
the error is squared by each. (B. Mirtich, "Impulse-based dynamic simulation of rigid body systems", 1996, with the rate
of closing replaced by the path itself.)

Where neither shape has an extent along the normal, as of a point and a box of zero thickness, the side of the touch is
a matter of rounding. They touch on the side that they come from; what begins there leaves to where it goes.

Between concave shapes there is no such plane, and they may touch in one place while they approach another. These are
looked at in strides that are short for their extent, for an approach that is fast enough to matter.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import absolute, add, add_scaled, dot, item, length, scale, sub
from ..integration.trajectory import ROUNDING, along, bend_of, first_root, is_straight, rate_along
from ..integration.turning import is_turned, turn_of_arm
from ..linking.parts import CLOSING_POINT, TURNING_TOUCH, call_closing_point, call_turning_touch
from ..shapes.dispatch import both_convex, evaluate, is_corner_touch, sweep
from ..shapes.poses import advance_pose, motion_of, set_motion
from ..shapes.tolerances import is_turning, smaller_extent
from .turning_touch import APART, AT_CORNER, MOST_STRIDES, NEAR_EXTENTS, SHORTER, TOUCHES

MOST_ADVANCES = 100  # a graze takes about 30; whatever is still closing in after that counts as touching
SAFETY_FACTOR, FAR_ROUNDING = 1.001, 1e-12  # more than all rounding: of an extent, of a distance
CLEAR = 64.0 * ROUNDING  # of the distances in a path: farther off a touch rounding does not turn its normal round
DEPTH = 0.25  # of the extent: what is deeper in is there, however coarse the numbers are


@part
def bounds_stay_disjoint(state, a, b, path, since, until):
    """Whether the boxes around the two are surely apart between two times, as those of most pairs are.

    Either along one axis, or the way does not lead through the ball around both.
    """
    bodies, start, end = state.bodies, along(path, since), along(path, until)
    bend = bend_of(path[2], path[3], until) if state.path_degree > 1 else 0.0
    far = add(absolute(bodies.origin[a]), absolute(bodies.origin[b]))
    reach = add_scaled(scale(add(bodies.half_extents[a], bodies.half_extents[b]), SAFETY_FACTOR), far, FAR_ROUNDING)
    apart = False
    for k in range(len(end)):
        room = item(reach, k) + bend
        apart |= (max(item(start, k), item(end, k)) < -room) | (min(item(start, k), item(end, k)) > room)
    if apart or bend > 0.0:
        return apart
    v = sub(end, start)
    ahead, way = dot(start, v), dot(v, v)
    return dot(start, start) * way - ahead * ahead > SAFETY_FACTOR * dot(reach, reach) * way


@part
def shift_of_offset(state, i, h):
    """How the collider of body i is shifted beside it, h seconds from where it is."""
    motion = motion_of(state, i)
    turn = advance_pose(state, i, state.bodies.spin[i], h)
    set_motion(state, i, motion)
    return turn_of_arm(turn, state.bodies.offset[i])


def first_touch(state, a, b, path, since, until, limits):
    """(APART, TOUCHES, AT_CORNER or UNFOLLOWED; time, normal, point, from a's centre to b's) of the first touch on b's
    path as seen from a, between two times; touching at ``since`` and parting is none unless the path leads back.

    AT_CORNER: they touch at a corner only, also a slop further on; what comes after it is not looked at.
    limits: (slop; stride, seconds between looks at concave shapes; approach speed below which these have no touch; by
    how many grazes what turns has to sink in, see touch_of_turning).
    """
    bodies = state.bodies
    shape_a, shape_b = bodies.shape[a], bodies.shape[b]
    if state.spinning and is_turning(state, until, a, b):
        spins, near = (bodies.spin[a], bodies.spin[b]), NEAR_EXTENTS * smaller_extent(bodies, a, b)
        near_limits = limits[0], near, limits[2], limits[3], SHORTER * limits[1]
        address, times = state.links[TURNING_TOUCH], (since, until)
        found, (t, normal, point, at), _ = call_turning_touch(address, state, a, b, path, spins, times, near_limits)
        # Offsets of colliders stand as where the step ends: seen from there, so that arms are right.
        shift_a, shift_b = shift_of_offset(state, a, t - until), shift_of_offset(state, b, t - until)
        return found, t, normal, add(point, shift_a), sub(at, sub(shift_b, shift_a))
    if not both_convex(state, shape_a, shape_b):
        return march(state, a, b, path, since, until, limits)
    t, known, met, share = since, False, False, 0.0
    straight = is_straight(state, a, b, path, until)
    if straight:
        start = along(path, since)
        known, met, share = sweep(state, shape_a, a, shape_b, b, start, sub(along(path, until), start))
        t += share * (until - since)
    if known and not met:  # most pairs
        zero = zero_of(state)
        return APART, t, zero, zero, zero
    found, t, normal, point, at = advance_conservatively(
        state, a, b, path, (straight, known), (since, t), until, limits[0]
    )
    if state.spinning and found == TOUCHES and (is_turned(bodies, a) or is_turned(bodies, b)):
        near = NEAR_EXTENTS * smaller_extent(bodies, a, b)
        address, met = state.links[CLOSING_POINT], (0.0, normal, point)
        _, point = call_closing_point(address, state, a, b, at, met, near, rate_along(path, t))
    return found, t, normal, point, at


@part
def march(state, a, b, path, since, until, limits):
    """The same for concave shapes; the time is bisected between the look that finds an approach and the one before."""
    _, stride, threshold, _ = limits
    shape = state.bodies.shape
    shape_a, shape_b = shape[a], shape[b]
    low, high, t, looks = since, math.inf, since, 0
    normal = point = at = zero_of(state)
    while True:
        d = along(path, t)
        hit, _, n, p = evaluate(state, shape_a, a, shape_b, b, d)
        if hit and dot(rate_along(path, t), n) < -threshold:
            high, normal, point, at = t, n, p, d
        else:
            low = t
        if high < math.inf:
            t = 0.5 * (low + high)
            if not low < t < high:
                return TOUCHES, high, normal, point, at
        elif not t < until:  # also if it is no number
            return APART, t, normal, point, at
        else:
            looks += 1
            t = min(since + looks * max(stride, (until - since) / MOST_STRIDES), until)


@inlined
def clear_of_rounding(state, a, b, path, t):
    """A distance of the two at time t, m, beyond what rounding makes of it; of what has an extent a part of that."""
    bodies = state.bodies
    origin, speed, extent = bodies.origin, bodies.path_velocity, smaller_extent(bodies, a, b)
    places = length(origin[a]) + length(origin[b]) + length(path[0])
    rounding = CLEAR * (places + (length(speed[a]) + length(speed[b])) * t)
    return min(rounding, DEPTH * extent) if extent > 0.0 else rounding


@part
def closed_at(path, t, normal, gap, rate, until):
    """A time until which a gap along the normal, that at time t is this one and grows at this rate, stays open on a
    path; infinity, or one after ``until``, if it does not close before that (see first_root)."""
    bend = dot(path[3], normal)
    return t + first_root(gap, rate, dot(path[2], normal) + 3.0 * t * bend, bend, until - t)


@part
def normal_beside(state, a, b, path, times, normal, rate, slop):
    """The normal of a touch that opens at this rate, seen from where they come from, or, at the first time, from where
    they go: another one only if that is on the other side, and within the times beyond what rounding makes of it.

    times: (since when the pair is looked at, that of the touch, until when)."""
    bodies, (since, t, until), clear = state.bodies, times, clear_of_rounding(state, a, b, path, times[1])
    beside = max(since, t - clear / rate) if t > since else closed_at(path, t, normal, clear, rate, until)
    if not beside <= until:
        return normal
    d, shape_a, shape_b = along(path, beside), bodies.shape[a], bodies.shape[b]
    _, depth, n, _ = evaluate(state, shape_a, a, shape_b, b, d)
    if not dot(n, normal) < 0.0:
        return normal
    # What is beside a corner there parts along a normal that is none of a touch.
    return normal if is_corner_touch(state, shape_a, a, shape_b, b, d, (depth, n), slop) else n


@part
def advance_conservatively(state, a, b, path, kind, times, until, slop):
    """Conservative advancement; kind: (the path is straight, the first touch is known); times: (since when the pair is
    looked at, the time to begin with: that of the touch if it is known)."""
    (straight, known), (since, t) = kind, times
    shape = state.bodies.shape
    shape_a, shape_b = shape[a], shape[b]
    normal = point = at = zero_of(state)
    found, cornered, time = False, False, t
    for look in range(MOST_ADVANCES):
        d = along(path, t)
        hit, depth, n, p = evaluate(state, shape_a, a, shape_b, b, d)
        w, met = rate_along(path, t), (depth, n)
        rate = dot(w, n)
        if cornered:  # what they meet just behind the corner is what they touch
            if not hit or is_corner_touch(state, shape_a, a, shape_b, b, d, met, slop):
                return AT_CORNER, time, normal, point, at
            return TOUCHES, time, n, point, at
        last = look == MOST_ADVANCES - 1
        touches = known or hit or abs(depth) <= ROUNDING * length(d) or last
        turns = rate > 0.0 if t > since else rate < 0.0 and depth == 0.0  # past the touch, by rounding
        if turns and (touches or -depth <= clear_of_rounding(state, a, b, path, t)):
            normal = normal_beside(state, a, b, path, (since, t, until), n, rate, slop)
            touches |= dot(normal, n) < 0.0
            n, rate = normal, dot(w, normal)
        normal, point, at, time = n, p, d, t
        found = touches and (straight or rate < 0.0 or last)
        further = t
        if not found:
            further = closed_at(path, t, n, 0.0 if touches else -depth, rate, until)
            if not further <= until:
                return APART, t, normal, point, at
            found = not further > t
        if found:
            if not is_corner_touch(state, shape_a, a, shape_b, b, d, met, slop):
                return TOUCHES, time, normal, point, at
            cornered = True
            further = t + 2.0 * slop / length(w)
            if not further <= until:
                return AT_CORNER, time, normal, point, at
        t = further
    return TOUCHES, time, normal, point, at

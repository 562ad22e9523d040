"""Sweeps of the built-in shapes in closed form: the time of first touch for straight relative motion.

A sweep gets the parameters of a and b, the vector d from a's centre to b's, and the displacement v of b relative to a.
It returns (hit, time): time, from 0 to 1, is the fraction of v at the first touch. (True, 0.0): the pair's function
reports a touch at the start. (False, 0.0): no touch during the motion.
"""

from __future__ import annotations

import math

from ..framework.compilation import inlined
from ..framework.vectors import add_scaled, divided, dot, item, length, replace

SURE = 1.0 - 1e-14  # factor of a sum of squares: makes it less than the exact value, whatever the rounding
TINY, HUGE = 1e-280, 1e280  # range of products of two squares in which no digits are lost
ROUNDING = 4e-16  # of position and size: rounding may shift a box this far, past another box or into a seam
LATER = 2.0  # a time after the end of the motion


@inlined
def largest(vector):
    """The largest absolute value of the components."""
    result = 0.0
    for k in range(len(vector)):
        result = max(result, abs(item(vector, k)))
    return result


@inlined
def ball(d, v, reach):
    """(hit, time) for a point that starts at d and moves by v, and a ball around the origin.

    The first root of a quadratic, computed without cancellation: the numerator is the gap at the start, and the
    discriminant comes from the point of the line nearest to the centre. Clear misses return before any division.
    """
    square, way, along = dot(d, d), dot(v, v), dot(d, v)
    both, inner = square * way, reach * reach
    plain = (both > TINY) & (both < HUGE) & (square > TINY)
    aside = both * SURE - along * along > inner * way
    early = (along + way < 0.0) & ((square + way) * SURE + 2.0 * along > inner)  # the end is before the nearest point
    if plain & (square * SURE > inner) & ((along >= 0.0) | aside | early):
        return False, 0.0
    distance = length(d)
    gap, far, unit = distance - reach, distance + reach, 1.0
    if gap <= 0.0:
        return True, 0.0
    if not plain:  # scale by the sizes
        size, speed = largest(d), largest(v)
        if speed == 0.0:
            return False, 0.0
        d, v, reach, unit = divided(d, size), divided(v, speed), reach / size, size / speed
        gap, far = gap / size, far / size
        way, along = dot(v, v), dot(d, v)
    if not along < 0.0:
        return False, 0.0
    nearest = add_scaled(d, v, -along / way)
    room = reach * reach - dot(nearest, nearest)
    if not room >= 0.0:
        return False, 0.0
    time = gap * far / (math.sqrt(way * room) - along) * unit
    return (True, time) if time <= 1.0 else (False, 0.0)


def sphere_sphere_sweep(a, b, d, v):
    """The centre of one sphere against a ball with the sum of the radii."""
    return ball(d, v, a.radius + b.radius)


@inlined
def fall(d, v, k):
    """(height, speed) along axis k, with the sign chosen so that the height at time t is height - speed * t."""
    return item(d, k) * (1.0 if item(v, k) < 0.0 else -1.0), abs(item(v, k))


@inlined
def fallen(gap, speed):
    """When a gap is closed during the motion; 0 if there is no gap or if it is too long. Without a branch."""
    ahead = (gap > 0.0) & (gap <= speed)
    return (gap if ahead else 0.0) / (speed if ahead else 1.0)


@inlined
def down_at(height, speed):
    """When a falling height reaches 0: at the start, during the motion, or LATER."""
    return 0.0 if height <= 0.0 else (height / speed if height < speed else LATER)


def sphere_box_sweep(a, b, d, v):
    """The centre against the box with faces moved outwards by the radius; near edges and corners, against these."""
    radius, time, beside, apart, aside = a.radius, 0.0, 0, -1.0, -1.0  # distances outside the box; negative: none
    for k in range(len(d)):
        height, speed = fall(d, v, k)
        half = item(b.half_extents, k)
        slack = ROUNDING * (abs(height) + half + radius)
        apart = max(apart, max(height - speed, -height) - half - radius - slack)
    if apart > 0.0:
        return False, 0.0
    for k in range(len(d)):
        height, speed = fall(d, v, k)
        gap = height - item(b.half_extents, k) - radius
        time = max(time, fallen(gap, speed))
    for k in range(len(d)):
        height, speed = fall(d, v, k)
        half = item(b.half_extents, k)
        slack = ROUNDING * (abs(height) + half + radius)
        out = abs(height - speed * time) - half
        aside = max(aside, out - radius - slack)
        beside += out > slack
    if time > 0.0:
        if aside > 0.0:
            return False, 0.0
        if beside <= 1:
            return True, time
    # Beside an edge or a corner, or inside. Along each axis the motion enters the box's slab and leaves it. Between
    # these times the distance is that of a point from a point, a line or a plane, in the axes outside their slab.
    for _ in range(2 * len(d) + 1):
        outside, pace, change = d, v, LATER
        for k in range(len(d)):
            height, speed = fall(d, v, k)
            half = item(b.half_extents, k)
            enter, leave = down_at(height - half, speed), down_at(height + half, speed)
            now, out, rate = height - speed * time, 0.0, 0.0
            if time < enter:
                out, rate, change = now - half, -speed, min(change, enter)
            elif time < leave:
                change = min(change, leave)
            else:
                out, rate = -now - half, speed
            outside, pace = replace(outside, k, out), replace(pace, k, rate)
        hit, more = ball(outside, pace, radius)
        if hit and time + more <= min(change, 1.0):
            return True, time + more
        if not (change < 1.0 and dot(outside, pace) < 0.0):
            break
        time = change
    return False, 0.0


def box_box_sweep(a, b, d, v):
    """The last axis on which the boxes come together gives the time, unless they separate on another axis by then."""
    time, apart, aside = 0.0, -1.0, -1.0  # distances outside the boxes; negative: none
    for k in range(len(d)):
        height, speed = fall(d, v, k)
        reach = item(a.half_extents, k) + item(b.half_extents, k)
        slack = ROUNDING * (abs(height) + reach)
        apart = max(apart, max(height - speed, -height) - reach - slack)
    if apart > 0.0:
        return False, 0.0
    for k in range(len(d)):
        height, speed = fall(d, v, k)
        gap = height - (item(a.half_extents, k) + item(b.half_extents, k))
        time = max(time, fallen(gap, speed))
    for k in range(len(d)):
        height, speed = fall(d, v, k)
        reach = item(a.half_extents, k) + item(b.half_extents, k)
        slack = ROUNDING * (abs(height) + reach) if time > 0.0 else 0.0
        aside = max(aside, abs(height - speed * time) - reach - slack)
    return (False, 0.0) if aside > 0.0 else (True, time)

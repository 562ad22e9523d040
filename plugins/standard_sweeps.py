"""When two of the built-in shapes first touch, one of them moving straight: in closed form.

A sweep gets the parameters of a and b, the vector d from a's centre to b's, and the way v that b moves relative to a. It
returns (hit, time): time, from 0 to 1, is the part of the way after which they first touch; (True, 0.0) for what the
pair's function calls touching at the start, (False, 0.0) for what does not touch on that way.
"""

from __future__ import annotations

import math

from ..framework.compilation import inlined
from ..framework.vectors import add_scaled, divided, dot, item, length, replace

SURE = 1.0 - 1e-14  # times a sum of squares: what is left of it is less than the true one, however it was rounded
TINY, HUGE = 1e-280, 1e280  # products of two squares: between these no digits are lost
ROUNDING = 4e-16  # of place and size: how far rounding may move a box aside, past what it meets or through a seam
ENDLESS = 1e300  # instead of infinity, which times zero is no number


@inlined
def largest(vector):
    """The largest component, without its sign."""
    result = 0.0
    for k in range(len(vector)):
        result = max(result, abs(item(vector, k)))
    return result


@inlined
def ball(d, v, reach):
    """(hit, time) for a point that starts at d and moves by v, and a ball around the origin.

    The first of the roots of a quadratic, without its two cancellations: the gap at the start is the numerator, and
    the discriminant comes from the line's nearest point to the centre. What is clearly missed costs no division.
    """
    square, way, along = dot(d, d), dot(v, v), dot(d, v)
    both, inner = square * way, reach * reach
    plain = (both > TINY) & (both < HUGE) & (square > TINY)
    aside = both * SURE - along * along > inner * way
    early = (along + way < 0.0) & ((square + way) * SURE + 2.0 * along > inner)  # it ends before it is nearest
    if plain & (square * SURE > inner) & ((along >= 0.0) | aside | early):
        return False, 0.0
    distance = length(d)
    gap, far, unit = distance - reach, distance + reach, 1.0
    if gap <= 0.0:
        return True, 0.0
    if not plain:  # in units of the sizes
        size, speed = largest(d), largest(v)
        if speed == 0.0:
            return False, 0.0
        d, v, reach, gap, far, unit = divided(d, size), divided(v, speed), reach / size, gap / size, far / size, size / speed
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
    """The centre of one against a ball of both radii."""
    return ball(d, v, a.radius + b.radius)


@inlined
def fall(d, v, k):
    """(height, speed) along axis k, turned so that it falls: the height after some time is height - speed * time."""
    return (item(d, k) if item(v, k) < 0.0 else -item(d, k)), abs(item(v, k))


def sphere_box_sweep(a, b, d, v):
    """The centre against the box with faces farther out by the radius; where these meet, against edges and corners."""
    radius, time, apart, beside = a.radius, 0.0, False, 0
    for k in range(len(d)):
        height, speed = fall(d, v, k)
        half = item(b.half_extents, k)
        slack = ROUNDING * (abs(height) + half + radius)
        apart |= (height - half - radius > speed + slack) | (-height - half - radius > slack)
    if apart:
        return False, 0.0
    for k in range(len(d)):
        height, speed = fall(d, v, k)
        gap = height - item(b.half_extents, k) - radius
        time = max(time, gap / speed if 0.0 < gap <= speed else 0.0)
    for k in range(len(d)):
        height, speed = fall(d, v, k)
        half = item(b.half_extents, k)
        slack = ROUNDING * (abs(height) + half + radius)
        out = abs(height - speed * time) - half
        apart |= out > radius + slack
        beside += out > slack
    if time > 0.0:
        if apart:
            return False, 0.0
        if beside <= 1:
            return True, time
    # Beside an edge or a corner, or inside. Along each axis the way leads into the box and out again; in between the
    # distance is that of a point from a point, a line or a plane: of the axes along which it is outside.
    for _ in range(2 * len(d) + 1):
        outside, pace, change = d, v, ENDLESS
        for k in range(len(d)):
            height, speed = fall(d, v, k)
            half = item(b.half_extents, k)
            inverse = 1.0 / speed if speed > 1.0 / ENDLESS else ENDLESS
            enter, leave = (height - half) * inverse, (height + half) * inverse
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
    """The last axis along which they come together tells when, if along the others they have not parted by then."""
    time, apart, outside = 0.0, False, False
    for k in range(len(d)):
        height, speed = fall(d, v, k)
        reach = item(a.half_extents, k) + item(b.half_extents, k)
        slack = ROUNDING * (abs(height) + reach)
        apart |= (height - reach > speed + slack) | (-height - reach > slack)
    if apart:
        return False, 0.0
    for k in range(len(d)):
        height, speed = fall(d, v, k)
        gap = height - (item(a.half_extents, k) + item(b.half_extents, k))
        time = max(time, gap / speed if 0.0 < gap <= speed else 0.0)
    for k in range(len(d)):
        height, speed = fall(d, v, k)
        reach = item(a.half_extents, k) + item(b.half_extents, k)
        slack = ROUNDING * (abs(height) + reach) if time > 0.0 else 0.0
        outside |= abs(height - speed * time) - reach > slack
    return (False, 0.0) if outside else (True, time)

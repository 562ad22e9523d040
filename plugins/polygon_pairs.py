"""How two convex shapes that have corners meet in a plane: by the normals of their edges, which are all the axes that
may separate them. Exact at any size; the generic pair of convex shapes gives the same, in several times the time.

Shapes are (parameters, how many corners, corner(parameters, k, like), reach(parameters, direction)): corner k, in the
world and counter-clockwise, and how far the shape reaches in a direction; both of what its rounding is around. A
segment has two corners, and an edge on either side; a point has one, and none.
"""

from __future__ import annotations

import math

from ..framework.compilation import inlined
from ..framework.vectors import add, add_scaled, divided, dot, length, negative, scale, sub
from ..systems.shapes.convex.pair import SUPPORT_TILT

CLOSE = 1e-14  # of a gap: corners that are no farther apart than an edge says are beside it but for rounding


@inlined
def widest_gap(one, other, d):
    """(gap, outward unit normal, start, end) of that edge of a shape which another, d from it, is farthest beyond."""
    shape, count, corner, _ = one
    most, normal, before = -math.inf, d, corner(shape, count - 1, d)
    start, end = before, before
    for k in range(count if count > 1 else 0):
        here = corner(shape, k, d)
        way = sub(here, before)
        size = length(way)
        if size > 0.0:
            outward = (way[1] / size, -way[0] / size)
            gap = dot(outward, sub(d, here)) - other[3](other[0], negative(outward))
            if gap > most:
                most, normal, start, end = gap, outward, before, here
        before = here
    return most, normal, start, end


@inlined
def span_along(one, outward, along):
    """(low, high) of the edge or the corner of a shape that is farthest in a direction: where its ends are along
    another one."""
    shape, count, corner, _ = one
    level, at, place = -math.inf, 0, 0.0
    for k in range(count):
        here = corner(shape, k, along)
        if dot(outward, here) > level:
            level, at, place = dot(outward, here), k, dot(along, here)
    low, high = place, place
    for turn in range(2):
        k = at + 1 - 2 * turn
        beside = corner(shape, k - count if k == count else (count - 1 if k < 0 else k), along)
        if level - dot(outward, beside) <= SUPPORT_TILT * abs(dot(along, beside) - place):
            low, high = min(low, dot(along, beside)), max(high, dot(along, beside))
    return low, high


@inlined
def nearest_corners(one, other, d):
    """(corner of a shape, way from there to one of another) of the two that are nearest to each other."""
    least, nearest, way = math.inf, d, d
    for i in range(one[1]):
        here = one[2](one[0], i, d)
        for k in range(other[1]):
            between = sub(add(d, other[2](other[0], k, d)), here)
            if length(between) < least:
                least, nearest, way = length(between), here, between
    return nearest, way


@inlined
def meet_by_edges(one, other, d, radius, beyond):
    """As from a pair's function; radius, beyond: the roundings of both."""
    gap, normal, start, end = widest_gap(one, other, d)
    back, opposite, from_b, to_b = widest_gap(other, one, negative(d))
    across = back > gap
    if across:
        gap, normal, start, end = back, negative(opposite), add(d, to_b), add(d, from_b)
    along = (-normal[1], normal[0])
    if across:
        low, high = span_along(one, normal, along)
    else:
        low, high = span_along(other, negative(normal), along)
        low, high = low + dot(along, d), high + dot(along, d)
    low, high = max(low, dot(along, start)), min(high, dot(along, end))
    level = dot(normal, end) - (gap if across else 0.0)
    point = add_scaled(scale(normal, level), along, 0.5 * (low + high))
    if gap > 0.0 and low > high:
        nearest, way = nearest_corners(one, other, d)
        if length(way) > gap * (1.0 + CLOSE):
            gap, normal, point = length(way), divided(way, length(way)), nearest
    depth = radius + beyond - gap
    return depth >= 0.0, depth, normal, add_scaled(point, normal, radius - 0.5 * depth)

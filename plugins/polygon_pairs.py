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
    """(gap, outward unit normal) of the edge of a shape that another one, d from it, lies farthest beyond."""
    shape, count, corner, _ = one
    most, normal, before = -math.inf, d, corner(shape, count - 1, d)
    for k in range(count if count > 1 else 0):
        here = corner(shape, k, d)
        way = sub(here, before)
        size = length(way)
        if size > 0.0:
            outward = (way[1] / size, -way[0] / size)
            gap = dot(outward, sub(d, here)) - other[3](other[0], negative(outward))
            if gap > most:
                most, normal = gap, outward
        before = here
    return most, normal


@inlined
def span_along(one, outward, along):
    """(low, high, level) of the edge or the corner of a shape that is farthest in a direction: where its ends are along
    another one, and how far out."""
    shape, count, corner, _ = one
    level, at = -math.inf, 0.0
    for k in range(count):
        here = corner(shape, k, along)
        if dot(outward, here) > level:
            level, at = dot(outward, here), dot(along, here)
    low, high = at, at
    for k in range(count):
        here = corner(shape, k, along)
        place = dot(along, here)
        if level - dot(outward, here) <= SUPPORT_TILT * abs(place - at):
            low, high = min(low, place), max(high, place)
    return low, high, level


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
    gap, normal = widest_gap(one, other, d)
    back, opposite = widest_gap(other, one, negative(d))
    if back > gap:
        gap, normal = back, negative(opposite)
    along = (-normal[1], normal[0])
    low, high, level = span_along(one, normal, along)
    low_b, high_b, _ = span_along(other, negative(normal), along)
    low, high = max(low, low_b + dot(along, d)), min(high, high_b + dot(along, d))
    point = add_scaled(scale(normal, level), along, 0.5 * (low + high))
    if gap > 0.0 and low > high:
        nearest, way = nearest_corners(one, other, d)
        if length(way) > gap * (1.0 + CLOSE):
            gap, normal, point = length(way), divided(way, length(way)), nearest
    depth = radius + beyond - gap
    return depth >= 0.0, depth, normal, add_scaled(point, normal, radius - 0.5 * depth)

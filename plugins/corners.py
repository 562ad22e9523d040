"""What shapes share that turn with the body, and whose surface is that of some corners: arrays (n, d), in its axes."""

from __future__ import annotations

import math

from ..framework.compilation import inlined
from ..framework.vectors import absolute, add_scaled, dot, item, replace, row, scale, sub


@inlined
def along_axes(shape, vector):
    """A vector of the world along the axes of a shape."""
    result = vector
    for k in range(len(vector)):
        result = replace(result, k, dot(shape.axes[k], vector))
    return result


@inlined
def in_world(shape, vector):
    """The vector of the world that leads so far along the axes of a shape."""
    result = scale(shape.axes[0], item(vector, 0))
    for k in range(1, len(vector)):
        result = add_scaled(result, shape.axes[k], item(vector, k))
    return result


@inlined
def farthest_of(corners, first, along):
    """The row, from ``first`` on, of the corner that lies farthest in a direction, which is given along the axes."""
    farthest, at = -math.inf, first
    for k in range(first, len(corners)):
        reach = dot(row(corners, k, along), along)
        if reach > farthest:
            farthest, at = reach, k
    return at


@inlined
def support_of(corners, first, shape, direction):
    """The corner, from row ``first`` on, that lies farthest in a direction."""
    at = farthest_of(corners, first, along_axes(shape, direction))
    return in_world(shape, row(corners, at, direction))


@inlined
def edge_of(corners, shape, direction):
    """In a plane both ends of the edge that looks most in a direction, of corners that run counter-clockwise."""
    along = along_axes(shape, direction)
    at = farthest_of(corners, 0, along)
    here = row(corners, at, along)
    before = row(corners, (at if at > 0 else len(corners)) - 1, along)
    after = row(corners, at + 1 if at + 1 < len(corners) else 0, along)
    left, right = sub(after, here), sub(here, before)
    ahead = along[0] * left[1] - along[1] * left[0]
    behind = along[0] * right[1] - along[1] * right[0]
    if ahead * math.sqrt(dot(right, right)) >= behind * math.sqrt(dot(left, left)):
        return in_world(shape, here), in_world(shape, after)
    return in_world(shape, before), in_world(shape, here)


@inlined
def bounds_of(corners, first, shape):
    """Half extents of the box around the corners from row ``first`` on."""
    reach = scale(shape.axes[0], 0.0)
    for k in range(first, len(corners)):
        way = absolute(in_world(shape, row(corners, k, reach)))
        for axis in range(len(reach)):
            reach = replace(reach, axis, max(item(reach, axis), item(way, axis)))
    return reach

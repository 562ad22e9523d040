"""What shapes share that turn with the body, and whose surface is that of some corners: arrays (n, d), in its axes."""

from __future__ import annotations

import math

from ..framework.compilation import inlined
from ..framework.vectors import absolute, add_scaled, dot, item, replace, row, scale


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
def support_of(corners, first, shape, direction):
    """The corner, from row ``first`` on, that lies farthest in a direction."""
    along, farthest, at = along_axes(shape, direction), -math.inf, first
    for k in range(first, len(corners)):
        reach = dot(row(corners, k, direction), along)
        if reach > farthest:
            farthest, at = reach, k
    return in_world(shape, row(corners, at, direction))


@inlined
def bounds_of(corners, first, shape):
    """Half extents of the box around the corners from row ``first`` on."""
    reach = scale(shape.axes[0], 0.0)
    for k in range(first, len(corners)):
        way = absolute(in_world(shape, row(corners, k, reach)))
        for axis in range(len(reach)):
            reach = replace(reach, axis, max(item(reach, axis), item(way, axis)))
    return reach

"""The built-in shapes, spheres and boxes, and their pairs; registered like those of any plugin.

A pair function gets the parameters of a and b and the vector d from a's centre to b's, a tuple of 2 or 3 numbers. It
returns (hit, depth, normal, point): whether they touch, the depth of the overlap (negative: minus the distance), the
unit normal from a to b and the contact point relative to a's centre. Touching counts as a hit.
"""

from __future__ import annotations

import math

from ..components import AABBCollider, SphereCollider
from ..framework.compilation import inlined
from ..framework.plugins.plugin import Convex, Plugin
from ..framework.vectors import add, divided, filled, item, larger, length, negative, replace, scale, smaller, sub
from ..systems.shapes.convex.pair import convex_convex
from .standard_sweeps import box_box_sweep, sphere_box_sweep, sphere_sphere_sweep

standard_shapes = Plugin("standard shapes")

standard_shapes.shape(cost=1)(SphereCollider)
standard_shapes.shape(cost=1.5)(AABBCollider)


@inlined
def sharp(shape):
    """The rounding of a shape that has none."""
    return 0.0


@inlined
def axis_normal(like, axis, sign):
    """The unit vector along an axis."""
    return replace(filled(like, 0.0), axis, sign)


@standard_shapes.pair(SphereCollider, SphereCollider)
def sphere_sphere(a, b, d):
    """Distance of the centres against the sum of the radii. Coincident centres separate along the first axis."""
    distance = length(d)
    depth = (a.radius + b.radius) - distance
    normal = divided(d, distance) if distance > 0.0 else axis_normal(d, 0, 1.0)
    # The point divides the segment between the centres, in the middle of the overlap.
    return depth >= 0.0, depth, normal, scale(normal, a.radius - 0.5 * depth)


@standard_shapes.pair(SphereCollider, AABBCollider)
def sphere_box(a, b, d):
    """Sphere against the nearest point of the box; for a centre inside, the nearest face gives the normal."""
    nearest = d  # of the box, relative to the sphere's centre
    inside = True
    for k in range(len(d)):
        low, high = item(d, k) - item(b.half_extents, k), item(d, k) + item(b.half_extents, k)
        if low > 0.0:
            nearest = replace(nearest, k, low)
            inside = False
        elif high < 0.0:
            nearest = replace(nearest, k, high)
            inside = False
        else:
            nearest = replace(nearest, k, 0.0)
    distance = length(nearest)
    if not inside and distance > 0.0:
        depth = a.radius - distance
        return depth >= 0.0, depth, divided(nearest, distance), nearest
    axis, room, sign = 0, math.inf, 1.0
    for k in range(len(d)):
        to_face = item(b.half_extents, k) - abs(item(d, k))
        if to_face < room:
            axis, room, sign = k, to_face, 1.0 if item(d, k) >= 0.0 else -1.0
    depth = a.radius + room
    normal = axis_normal(d, axis, sign)
    return True, depth, normal, scale(normal, -room)


def box_corner(a, b, d, slop):
    """True if two boxes overlap by less than ``slop``, or have a gap, along more than one axis: corners or edges."""
    shallow = 0
    for k in range(len(d)):
        overlap = item(a.half_extents, k) + item(b.half_extents, k) - abs(item(d, k))
        if overlap < slop:
            shallow += 1
    return shallow > 1


@standard_shapes.pair(AABBCollider, AABBCollider, corner=box_corner)
def box_box(a, b, d):
    """The boxes overlap if their intervals do on every axis (separating axes); the normal is the axis of least overlap.

    The point is the centre of the overlap region.
    """
    axis, depth, sign = 0, math.inf, 1.0
    for k in range(len(d)):
        overlap = item(a.half_extents, k) + item(b.half_extents, k) - abs(item(d, k))
        if overlap < depth:
            axis, depth, sign = k, overlap, 1.0 if item(d, k) >= 0.0 else -1.0
    low = larger(negative(a.half_extents), sub(d, b.half_extents))
    high = smaller(a.half_extents, add(d, b.half_extents))
    return depth >= 0.0, depth, axis_normal(d, axis, sign), scale(add(low, high), 0.5)


standard_shapes.pair(Convex, Convex)(convex_convex)

standard_shapes.sweep(SphereCollider, SphereCollider)(sphere_sphere_sweep)
standard_shapes.sweep(SphereCollider, AABBCollider)(sphere_box_sweep)
standard_shapes.sweep(AABBCollider, AABBCollider)(box_box_sweep)

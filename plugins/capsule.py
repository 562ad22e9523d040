"""A capsule: all points within a radius of a segment along the body's y axis; in 2D a stadium.

It meets every convex shape through its support function. Pairs with spheres, boxes and other capsules are in closed
form: two capsules are two segments, and their distance is that of the segments less both radii.
"""

from __future__ import annotations

import math

from ..components import AABBCollider, Collider, SphereCollider
from ..framework import Plugin, column
from ..framework.vectors import absolute, add, add_scaled, divided, dot, item, length, negative, replace, scale, sub
from .segment_box import box_gap, box_overlap, place_along
from .standard_sweeps import LATER, ball, down_at

__all__ = ["CapsuleCollider"]

plugin = Plugin("capsule", version="1.0")

CROSSING = 1e-8  # sine of the angle below which two segments count as parallel, because rounding dominates
TOUCHING = 1e-12  # of the sizes: closer segments have no usable direction between them


@plugin.shape(cost=2)
class CapsuleCollider(Collider):
    """All points within a radius of a segment along the body's y axis; it turns with the Transform.

    radius
        m, 0 or more
    half_height
        m, half the length of the segment, 0 or more; the whole capsule is 2 * (half_height + radius) high
    """

    __slots__ = ()

    rotates = True
    radius: float = column(unit="m", minimum=0.0)
    half_height: float = column(unit="m", minimum=0.0)

    @staticmethod
    def bounds(shape, dimensions):
        x, y = shape.axes[1][0], shape.axes[1][1]
        half_x = shape.radius + abs(x) * shape.half_height
        half_y = shape.radius + abs(y) * shape.half_height
        if dimensions == 2:
            return half_x, half_y
        return half_x, half_y, shape.radius + abs(shape.axes[1][2]) * shape.half_height

    @staticmethod
    def support(shape, direction):
        end = scale(shape.axes[1], shape.half_height)
        return end if dot(end, direction) >= 0.0 else negative(end)

    @staticmethod
    def rounding(shape):
        return shape.radius

    @staticmethod
    def edge(shape, direction):
        up = shape.axes[1][1] * direction[0] >= shape.axes[1][0] * direction[1]
        end = scale(shape.axes[1], shape.half_height if up else -shape.half_height)
        return negative(end), end

    @staticmethod
    def outline(shape, dimensions):
        return [(0.0, end, 0.0)[:dimensions] for end in (-shape.half_height, shape.half_height)], ()

    @staticmethod
    def second_moments(shape, dimensions):
        """Of the part between the two centres, and of two half discs or balls beyond them."""
        r, half = shape.radius, shape.half_height
        square = r * r
        if dimensions == 2:
            middle, ends = 4.0 * r * half, math.pi * square
            area = middle + ends
            if area == 0.0:
                return 0.0, 0.0, 0.0, 0.0, 0.0, half * half / 3.0
            xx = middle * square / 3.0 + ends * square / 4.0
            yy = middle * half * half / 3.0 + ends * (half * half + square / 4.0) + 8.0 / 3.0 * half * square * r
            return area, 0.0, 0.0, xx / area, 0.0, yy / area
        middle, ends = 2.0 * math.pi * square * half, 4.0 / 3.0 * math.pi * square * r
        volume = middle + ends
        if volume == 0.0:
            return 0.0, 0.0, 0.0, 0.0, 0.0, half * half / 3.0, 0.0, 0.0, 0.0, 0.0
        xx = (middle * square / 4.0 + ends * square / 5.0) / volume
        yy = middle * half * half / 3.0 + ends * (half * half + square / 5.0) + math.pi * half * square * square
        return volume, 0.0, 0.0, 0.0, xx, yy / volume, xx, 0.0, 0.0, 0.0


@plugin.kernel
def nearest_along(axis, half, d):
    """Position along the segment of half length ``half`` of its point nearest to d."""
    return max(-half, min(half, dot(axis, d)))


@plugin.kernel
def across(axis):
    """Any unit vector perpendicular to a unit vector."""
    if len(axis) == 2:
        return replace(replace(axis, 0, item(axis, 1)), 1, -item(axis, 0))
    k = 0  # the world axis most perpendicular to it
    for j in range(1, len(axis)):
        k = j if abs(item(axis, j)) < abs(item(axis, k)) else k
    result = scale(axis, -item(axis, k))
    result = replace(result, k, item(result, k) + 1.0)
    return divided(result, length(result))


@plugin.kernel
def towards(normal, axis, d):
    """The normal or its opposite, whichever points towards d; if neither, by the axis, so that -d reverses it."""
    side = dot(normal, d)
    if side == 0.0:
        side = dot(axis, d)
    return normal if side >= 0.0 else negative(normal)


@plugin.pair(CapsuleCollider, SphereCollider)
def capsule_sphere(a, b, d):
    """The sphere against the nearest point of the segment."""
    axis = a.axes[1]
    nearest = scale(axis, nearest_along(axis, a.half_height, d))
    apart = sub(d, nearest)
    distance = length(apart)
    depth = a.radius + b.radius - distance
    normal = divided(apart, distance) if distance > 0.0 else across(axis)
    return depth >= 0.0, depth, normal, add_scaled(nearest, normal, a.radius - 0.5 * depth)


@plugin.sweep(CapsuleCollider, SphereCollider)
def capsule_sphere_sweep(a, b, d, v):
    """The sphere's centre against a rounded segment: an end, the sides and the other end in order of the motion."""
    axis, half, reach = a.axes[1], a.half_height, a.radius + b.radius
    along, rate = dot(axis, d), dot(axis, v)
    place, speed = (along if rate < 0.0 else -along), abs(rate)  # oriented so that the motion is down the segment
    enter, leave, time = down_at(place - half, speed), down_at(place + half, speed), 0.0
    for _ in range(3):
        beside = enter <= time < leave
        change = enter if time < enter else (leave if beside else LATER)
        centre = add_scaled(d, v, time)
        apart = sub(centre, scale(axis, nearest_along(axis, half, centre)))
        pace = add_scaled(v, axis, -rate) if beside else v
        hit, more = ball(apart, pace, reach)
        if hit and time + more <= min(change, 1.0):
            return True, time + more
        if not (change < 1.0 and dot(apart, pace) < 0.0):
            break
        time = change
    return False, 0.0


@plugin.kernel
def crossing_plane(d, u, v, half_u, half_v):
    """2D: (whether two segments cross, the depth of the overlap, its normal), d from one to the other.

    The points of one less those of the other form a parallelogram: tests if it contains the origin, and finds the
    nearest side.
    """
    depth, normal = math.inf, across(u)
    for turn in range(2):
        axis = u if turn == 0 else v
        side = across(axis)
        overlap = half_v * abs(dot(side, v)) if turn == 0 else half_u * abs(dot(side, u))
        overlap -= abs(dot(side, d))
        if overlap < depth:
            depth, normal = overlap, towards(side, axis, d)
    return depth > 0.0, depth, normal


@plugin.kernel
def common_normal(d, u, v):
    """3D: (unit vector perpendicular to both unit vectors, towards d; sine of the angle between them)."""
    last = len(d) - 1  # 2: an index that compiles in 2D, where this is never called
    x = item(u, 1) * item(v, last) - item(u, last) * item(v, 1)
    y = item(u, last) * item(v, 0) - item(u, 0) * item(v, last)
    z = item(u, 0) * item(v, 1) - item(u, 1) * item(v, 0)
    normal = replace(replace(replace(d, 0, x), 1, y), last, z)
    sine = length(normal)
    if sine <= TOUCHING:
        return towards(across(u), u, d), 0.0
    normal = divided(normal, sine)
    normal = add_scaled(normal, u, -dot(normal, u))  # for nearly parallel segments the product is inexact
    return towards(divided(normal, length(normal)), u, d), sine


@plugin.kernel
def segment_gap(d, u, v, half_u, half_v):
    """(distance, unit normal, point of the first) of two segments, d from the middle of one to that of the other.

    u, v: unit vectors along them. The smallest of these: each end with the other segment, and in 3D the nearest points
    of the two lines. Each is a distance between points of the segments, so nearly parallel segments lose no accuracy.
    """
    best, apart, point, axis, inner = math.inf, d, d, u, False
    normal, sine, s = d, 0.0, 0.0
    if len(d) == 3:
        normal, sine = common_normal(d, u, v)
    if sine > CROSSING:
        s = dot(add_scaled(u, v, -dot(u, v)), d) / (sine * sine)  # nearest to the second line
    for turn in range(5 if sine > CROSSING and abs(s) <= half_u else 4):
        if turn < 2:  # ends of the second
            other = add_scaled(d, v, -half_v if turn == 0 else half_v)
            foot = nearest_along(u, half_u, other)
            mine = scale(u, foot)
        else:  # ends of the first, and the lines
            mine = scale(u, s if turn == 4 else (-half_u if turn == 2 else half_u))
            foot = nearest_along(v, half_v, sub(mine, d))
            other = add_scaled(d, v, foot)
        between = sub(other, mine)
        distance = length(between)
        if distance < best:
            best, apart, point = distance, between, mine
            axis = u if turn < 2 else v  # the segment with the nearest point: gives the normal if they touch
            inner = abs(foot) < (half_u if turn < 2 else half_v)
    size = length(d) + half_u + half_v
    if best > TOUCHING * size:
        if inner:  # make the normal exactly perpendicular: rounding matters if the gap is small
            apart = add_scaled(apart, axis, -dot(apart, axis))
        return best, divided(apart, length(apart)), point
    if min(half_u, half_v) <= TOUCHING * size:  # a point: the normal is perpendicular to the other
        axis = u if half_u >= half_v else v
    elif len(d) == 3:
        return best, normal, point
    return best, towards(across(axis), axis, d), point


@plugin.pair(CapsuleCollider, CapsuleCollider)
def capsule_capsule(a, b, d):
    """The distance of the segments less both radii; in 2D segments may cross, and then overlap themselves."""
    u, v = a.axes[1], b.axes[1]
    distance, normal, point = segment_gap(d, u, v, a.half_height, b.half_height)
    if len(d) == 2:
        cross, overlap, out = crossing_plane(d, u, v, a.half_height, b.half_height)
        if cross:
            distance, normal = -overlap, out
            lines = dot(across(v), d) / dot(across(v), u)
            point = scale(u, max(-a.half_height, min(a.half_height, lines)))
    depth = a.radius + b.radius - distance
    return depth >= 0.0, depth, normal, add_scaled(point, normal, a.radius - 0.5 * (depth + min(distance, 0.0)))


@plugin.pair(CapsuleCollider, AABBCollider)
def capsule_box(a, b, d):
    """The overlap of segment and box, or their distance if they are apart, with the radius."""
    u, half, box = a.axes[1], a.half_height, b.half_extents
    depth, normal, axis = box_overlap(d, u, half, box)
    normal = towards(normal, axis, d)
    if depth < 0.0:
        way = box_gap(d, u, half, box)
        depth = -length(way)
        if -depth > TOUCHING * (half + dot(absolute(normal), add(absolute(d), box))):
            normal = divided(way, -depth)
    depth += a.radius
    t, rise = place_along(normal, d, u, half, box), dot(normal, u)
    inwards = a.radius - 0.5 * depth + (half * abs(rise) - t * rise)  # from there to the middle of the overlap
    return depth >= 0.0, depth, normal, add_scaled(scale(u, t), normal, inwards)

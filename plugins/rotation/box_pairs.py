"""How boxes that turn meet balls and other boxes: from their faces and corners, mostly without a search."""

from __future__ import annotations

import collections
import math

from ...components import AABBCollider, SphereCollider
from ...framework.vectors import add, add_scaled, divided, dot, item, length, negative, replace, scale
from ...systems.shapes.convex.pair import SUPPORT_TILT, convex_convex, middle_of_overlap
from ..capsule import CapsuleCollider, capsule_box
from ..corners import along_axes, in_world
from ..standard_shapes import sharp, sphere_box
from .box import BoxCollider, boxes
from .boxes_in_space import boxes_in_space

CLOSE = 1e-14  # of the coordinates: nearer than that a distance has no direction, as for any two convex shapes

Level = collections.namedtuple("Level", "half_extents axes")  # a box that never turns, as one that does
Seen = collections.namedtuple("Seen", "radius half_height axes")  # a capsule, along the axes of a box
ball_and_box, capsule_and_box = boxes.kernel(sphere_box), boxes.kernel(capsule_box)
support = boxes.kernel(BoxCollider.support)


@boxes.kernel
def level(box, like):
    """A box that never turns, with the axes of the world."""
    if len(like) == 2:
        return Level(box.half_extents, ((1.0, 0.0), (0.0, 1.0)))
    return Level(box.half_extents, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))


@boxes.kernel
def nearest_face(half, other, at, turn):
    """In a plane: (gap, axis) of the face of a box that another one, ``at`` along its axes, lies farthest beyond."""
    c, s = abs(turn[0]), abs(turn[1])
    one = abs(item(at, 0)) - item(half, 0) - c * item(other, 0) - s * item(other, 1)
    two = abs(item(at, 1)) - item(half, 1) - s * item(other, 0) - c * item(other, 1)
    return (two, 1) if two > one else (one, 0)


@boxes.kernel
def nearest_edge(other, at, turn, axis, side):
    """(low, high), from the middle of a box's face along it, of the edge of the other box that is nearest to the face,
    or of the corner. side: 1 if that is the face in the direction of the axis, else -1."""
    c, s = turn
    out_0, out_1 = (c, -s) if axis == 0 else (s, c)  # the other's axes, across and along the face
    on_0, on_1 = (s, c) if axis == 0 else (c, -s)
    half_0, half_1 = item(other, 0), item(other, 1)
    if abs(out_0) < abs(out_1):  # the edge runs along its first axis
        out_0, out_1, on_0, on_1, half_0, half_1 = out_1, out_0, on_1, on_0, half_1, half_0
    middle = item(at, 1 - axis) - side * math.copysign(half_0, out_0) * on_0
    reach = half_1 * on_1
    if abs(out_1) > SUPPORT_TILT:
        corner = middle - side * math.copysign(reach, out_1 * on_1)
        return corner, corner
    return middle - abs(reach), middle + abs(reach)


@boxes.kernel
def to_nearest_corner(a, b, d):
    """In a plane: from the point of a that comes nearest to a corner of b, to that corner."""
    least, nearest = math.inf, d
    for k in range(4):
        x = item(b.half_extents, 0) * (1.0 if k < 2 else -1.0)
        y = item(b.half_extents, 1) * (1.0 if k % 2 == 0 else -1.0)
        corner = along_axes(a, add(d, add_scaled(scale(b.axes[0], x), b.axes[1], y)))
        for j in range(len(d)):
            at, half = item(corner, j), item(a.half_extents, j)
            corner = replace(corner, j, at - min(max(at, -half), half))
        if dot(corner, corner) < least:
            least, nearest = dot(corner, corner), corner
    return in_world(a, nearest)


@boxes.kernel
def apart_in_plane(a, b, d, normal, distance):
    """(distance, normal) of two boxes which a face parts by ``distance``: that of two corners, if no corner is above
    that face."""
    one, other = to_nearest_corner(a, b, d), negative(to_nearest_corner(b, a, negative(d)))
    way = one if length(one) <= length(other) else other
    true = length(way)
    return (true, divided(way, true)) if true > distance * (1.0 + CLOSE) else (distance, normal)


@boxes.kernel
def two_boxes(a, b, d):
    """In a plane the way out is across a face of one of them; apart, a face or two corners are nearest. In space a
    search finds ends of edges that are nearest."""
    if len(d) == 3:
        found, distance, normal, point = boxes_in_space(a, b, d)
        if found:
            return distance <= 0.0, -distance, normal, point
        return convex_convex(a, b, d, support, support, sharp, sharp)
    turn, from_b = (dot(a.axes[0], b.axes[0]), dot(a.axes[1], b.axes[0])), False
    axes, half, other, at = a.axes, a.half_extents, b.half_extents, along_axes(a, d)
    distance, axis = nearest_face(half, other, at, turn)
    at_b = along_axes(b, negative(d))
    distance_b, axis_b = nearest_face(other, half, at_b, turn)
    if distance_b > distance:
        distance, axis, from_b = distance_b, axis_b, True
        axes, half, other, at, turn = b.axes, b.half_extents, a.half_extents, at_b, (turn[0], -turn[1])
    side, beside = 1.0 if item(at, axis) >= 0.0 else -1.0, item(half, 1 - axis)
    low, high = nearest_edge(other, at, turn, axis, side)
    outward = scale(axes[axis], side)
    if (low > beside or high < -beside) and distance > CLOSE * (abs(item(at, 0)) + abs(item(at, 1)) + beside):
        distance, normal = apart_in_plane(a, b, d, negative(outward) if from_b else outward, distance)
        point = middle_of_overlap((a, b, support, support, 1.0), d, normal)
        return distance <= 0.0, -distance, normal, add_scaled(point, normal, 0.5 * distance)
    point = scale(outward, item(half, axis) + 0.5 * distance)
    point = add_scaled(point, axes[1 - axis], 0.5 * (max(low, -beside) + min(high, beside)))
    if from_b:
        return distance <= 0.0, -distance, negative(outward), add(d, point)
    return distance <= 0.0, -distance, outward, point


boxes.pair(BoxCollider, BoxCollider)(two_boxes)


@boxes.pair(AABBCollider, BoxCollider)
def level_and_turned_box(a, b, d):
    """Two boxes, one of which has the axes of the world."""
    return two_boxes(level(a, d), b, d)


@boxes.pair(CapsuleCollider, BoxCollider)
def capsule_turned_box(a, b, d):
    """As with a box that never turns, seen along its axes."""
    u = along_axes(b, a.axes[1])
    hit, depth, normal, point = capsule_and_box(Seen(a.radius, a.half_height, (u, u)), b, along_axes(b, d))
    return hit, depth, in_world(b, normal), in_world(b, point)


@boxes.pair(SphereCollider, BoxCollider)
def sphere_turned_box(a, b, d):
    """As a box that never turns, seen along its axes; the point is in the middle of the overlap."""
    hit, depth, normal, _ = ball_and_box(a, b, along_axes(b, d))
    normal = in_world(b, normal)
    return hit, depth, normal, scale(normal, a.radius - 0.5 * depth)

"""The contact of two convex shapes of any kind, from their supports: the farthest point in a direction.

A shape is all that lies within its rounding of its core: a sphere is a rounded point, a capsule a rounded segment, a
box a core without rounding. Distances are taken between the cores; the roundings are added at the end, exactly.
"""

from __future__ import annotations

import math

from ....framework.compilation import part
from ....framework.jit.stack_arrays import stack_array
from ....framework.vectors import add, add_scaled, divided, dot, length, replace, scale
from .epa2d import POLYGON_CORNERS as POLYGON_CORNERS
from .epa2d import polygon_depth
from .epa3d import POLYTOPE_CORNERS as POLYTOPE_CORNERS
from .epa3d import polytope_depth
from .gjk import LARGE_SCALE, SMALL_SCALE, closest_simplex, complete_simplex, support_points

SUPPORT_TILT = 1e-6  # radians; edges so close to parallel touch along their length, not at a corner
SMALLEST_UNIT, LARGEST_UNIT = 1e-300, 1e300


@part
def suitable_unit(pair, d):
    """The unit in which the largest of all coordinates is about 1; 2 if they are neither large nor small in unit 1."""
    extent = length(d)
    for side in range(2 * len(d)):
        axis = replace(scale(d, 0.0), side // 2, 1.0 if side % 2 == 0 else -1.0)
        point_a, point_b = support_points(pair, axis)
        extent = max(extent, max(length(point_a), length(point_b)))
    if extent == 0.0 or SMALL_SCALE < extent < LARGE_SCALE:
        return 2.0
    return min(max(1.0 / extent, SMALLEST_UNIT), LARGEST_UNIT)


@part
def middle_of_overlap(pair, d, normal):
    """2D: the point of a's surface in the middle of what a and b share at right angles to the normal.

    Supports a little to either side of the normal give both ends of an edge at right angles to it.
    """
    along = (-normal[1], normal[0])
    level, low, high = -math.inf, -math.inf, math.inf
    for turn in range(2):
        side = SUPPORT_TILT if turn == 0 else -SUPPORT_TILT
        point_a, point_b = support_points(pair, add_scaled(normal, along, side))
        at_a, at_b = dot(along, point_a), dot(along, add(d, point_b))
        level = max(level, dot(normal, point_a))
        if turn == 0:  # the high end of a, the low end of b
            high, low = min(high, at_a), max(low, at_b)
        else:
            high, low = min(high, at_b), max(low, at_a)
    return add_scaled(scale(normal, level), along, 0.5 * (low + high))


@part
def core_contact_2d(pair, d):
    """(fits, depth, normal, point of a's core): how two cores meet in 2D, all in units of 1 / unit.

    Not ``fits``: coordinates may be too large or small for the unit, which was 1.
    """
    of_a, of_b = stack_array(POLYGON_CORNERS, (0.0, 0.0)), stack_array(POLYGON_CORNERS, (0.0, 0.0))
    count, nearest, witness, size = closest_simplex(pair, d, of_a, of_b)
    if count < 0:
        return False, 0.0, nearest, witness
    if count == 0:
        distance = length(nearest)
        normal, depth = divided(nearest, distance), -distance
    else:
        count, normal, depth = complete_simplex(pair, d, of_a, of_b, count, size)
        if count > 0:
            normal, depth = polygon_depth(pair, d, of_a, of_b, size)
    return True, depth, normal, middle_of_overlap(pair, d, normal)


@part
def core_contact_3d(pair, d):
    """The same in 3D."""
    of_a, of_b = stack_array(POLYTOPE_CORNERS, (0.0, 0.0, 0.0)), stack_array(POLYTOPE_CORNERS, (0.0, 0.0, 0.0))
    count, nearest, witness, size = closest_simplex(pair, d, of_a, of_b)
    if count < 0:
        return False, 0.0, nearest, witness
    if count == 0:
        distance = length(nearest)
        return True, -distance, divided(nearest, distance), witness
    count, normal, depth = complete_simplex(pair, d, of_a, of_b, count, size)
    if count > 0:
        normal, depth, witness = polytope_depth(pair, d, of_a, of_b, size)
    return True, depth, normal, witness


@part
def convex_convex(a, b, d, support_a, support_b, rounding_a, rounding_b):
    """How two convex shapes meet: (hit, depth, normal, point), as from any pair function.

    a, b: parameters of the shapes; d: from a's centre to b's, a tuple of 2 or 3 numbers. ``support(shape, direction)``
    returns the point of the core, relative to the centre, that lies farthest in a direction of any length but zero;
    ``rounding(shape)`` the radius (0 or more) by which the shape extends beyond its core. Both are compiled functions.

    depth: how far b would have to move, along the normal at least, to part from a; negative: how far they are apart.
    Polytopes, rounded or not, have both exact but for rounding. The point is in the middle of the overlap (or the gap);
    in 2D, where edges lie on each other, also in the middle of what they share.
    """
    unit = 1.0
    while True:
        pair = (a, b, support_a, support_b, unit)
        if len(d) == 2:
            fits, depth, normal, point = core_contact_2d(pair, scale(d, unit))
        else:
            fits, depth, normal, point = core_contact_3d(pair, scale(d, unit))
        if fits:
            break
        unit = suitable_unit(pair, d)
    radius = rounding_a(a)
    depth = radius + rounding_b(b) + depth / unit
    point = add_scaled(divided(point, unit), normal, radius - 0.5 * depth)
    return depth >= 0.0, depth, normal, point

"""Expanding polytope algorithm in 2D: depth of the origin in the difference, by a polygon that grows inside it."""

from __future__ import annotations

import math

from ....framework.compilation import inlined, part
from ....framework.jit.stack_arrays import stack_array
from ....framework.vectors import dot, negative, row, store
from .gjk import GJK_ROUNDING, corner, edge, norm, refine_direction, support_points

POLYGON_CORNERS = 128


@inlined
def store_edge(of_a, of_b, following, normals, heights, i, d):
    """Note the outward normal of the edge from corner i on, and how far from the origin it is; no edge: infinity."""
    along = edge(of_a, of_b, i, following[i], d)
    size = norm(along)
    heights[i] = math.inf
    if size > 0.0:
        normal = (along[1] / size, -along[0] / size)
        store(normals, i, normal)
        heights[i] = dot(normal, corner(of_a, of_b, i, d))


@part
def polygon_depth(pair, d, of_a, of_b, size):
    """(normal from a to b, depth) for a triangle in the difference that holds the origin.

    The edge nearest to the origin is a lower bound, how far the difference reaches in the direction of any edge an
    upper one; each new corner splits the nearest edge. They meet for polygons; for smooth shapes the answer is the best
    upper bound, refined if there are more corners to find than there is room for.
    """
    following, heights = stack_array(POLYGON_CORNERS, 0), stack_array(POLYGON_CORNERS, 0.0)
    normals = stack_array(POLYGON_CORNERS, (0.0, 0.0))
    one, two = edge(of_a, of_b, 0, 1, d), edge(of_a, of_b, 0, 2, d)
    turned = 0 if one[0] * two[1] > one[1] * two[0] else 1  # if the corners go round clockwise
    for i in range(3):
        following[i] = (i + 1 + turned) % 3
    for i in range(3):
        store_edge(of_a, of_b, following, normals, heights, i, d)
    count, best, depth = 3, d, math.inf
    for _ in range(2 * POLYGON_CORNERS):
        i = 0
        for k in range(1, count):
            if heights[k] < heights[i]:
                i = k
        if not heights[i] < depth - GJK_ROUNDING * size:
            break
        outward = row(normals, i, d)
        if count == POLYGON_CORNERS:
            best, depth = refine_direction(pair, d, best, depth, size)
            break
        point_a, point_b = support_points(pair, negative(outward))
        store(of_a, count, point_a)
        store(of_b, count, point_b)
        found = corner(of_a, of_b, count, d)
        reach = dot(outward, found)
        if reach < depth:
            best, depth = outward, reach
        size = max(size, norm(found))
        start, end = edge(of_a, of_b, i, count, d), edge(of_a, of_b, count, following[i], d)
        if dot(start, start) == 0.0 or dot(end, end) == 0.0:
            heights[i] = math.inf  # as far out as it goes; what is left is rounding
            continue
        following[count], following[i] = following[i], count
        store_edge(of_a, of_b, following, normals, heights, i, d)
        store_edge(of_a, of_b, following, normals, heights, count, d)
        count += 1
    return negative(best), depth

"""Expanding polytope algorithm in 3D: depth of the origin in the difference, by a polytope that grows inside it.

Its ``surface`` is (faces, normals, heights, waiting): a row per face with its corners, counter-clockwise from outside;
its outward normal; its distance from the origin; the same for faces that may still move outwards, infinity for others.
"""

from __future__ import annotations

import math

from ....framework.compilation import inlined, part
from ....framework.jit.stack_arrays import stack_array
from ....framework.vectors import add_scaled, cross, divided, dot, negative, row, scale, store, sub
from .gjk import GJK_ROUNDING, corner, corner_of, edge, face_normal, norm, refine_direction, support_points

POLYTOPE_CORNERS = 64
POLYTOPE_FACES = 256  # a closed surface has twice as many as corners, less 4; rounding leaves folds in it
POLYTOPE_EDGES = 192
WIDEST, NARROWER, NARROWEST = 0.1, -0.5, 1e-8  # rad; the other way round each time
THIRDS = ((1.0, 0.0), (-0.5, 0.8660254037844386), (-0.5, -0.8660254037844386))  # of a circle
SAME_WAY = 0.9  # cosine: from faces that look the same way a search ends in the same minimum


@inlined
def store_face(of_a, of_b, surface, f, d):
    """Note the outward normal of face f and its distance from the origin; ``waiting`` is infinite if it has no area."""
    faces, normals, heights, waiting = surface
    i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
    normal = face_normal(of_a, of_b, i, j, k, d)
    size = norm(normal)
    if size > 0.0:
        normal = divided(normal, size)
        heights[f] = dot(normal, corner(of_a, of_b, i, d))
        waiting[f] = heights[f]
    else:
        heights[f] = 0.0
        waiting[f] = math.inf
    store(normals, f, normal)


@inlined
def remove_visible_faces(surface, count, edges, top, seen_from, slack, d):
    """Remove the faces visible from the new corner: (faces left, edges of the hole), -1 edges if there are too many.

    An edge whose reverse is taken away as well is inside the hole. So the surface stays closed whatever rounding lets
    the corner see.
    """
    faces, normals, heights, waiting = surface
    rim, f = 0, 0
    while f < count:
        if not (f == top or dot(row(normals, f, d), seen_from) - heights[f] > slack):
            f += 1
            continue
        for k in range(3):
            start, end = faces[f, k], faces[f, k + 1 if k < 2 else 0]
            e = 0
            while e < rim and not (edges[e, 0] == end and edges[e, 1] == start):
                e += 1
            if e < rim:
                rim -= 1
                edges[e, 0], edges[e, 1] = edges[rim, 0], edges[rim, 1]
            elif rim == POLYTOPE_EDGES:
                return count, -1
            else:
                edges[rim, 0], edges[rim, 1] = start, end
                rim += 1
        count -= 1
        top = f if top == count else (-1 if top == f else top)
        for k in range(3):
            faces[f, k] = faces[count, k]
        store(normals, f, row(normals, count, d))
        heights[f], waiting[f] = heights[count], waiting[count]
    return count, rim


@inlined
def witness_point(of_a, of_b, faces, heights, count, outward, depth, d):
    """The point of a that belongs to the point of the surface above the origin.

    Of the faces in question, several if they lie in one plane, the one that has it farthest from its rim.
    """
    inside, witness = -math.inf, row(of_a, faces[0, 0], d)
    for f in range(count):
        if not heights[f] <= depth:
            continue
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        one, two, three = corner(of_a, of_b, i, d), corner(of_a, of_b, j, d), corner(of_a, of_b, k, d)
        weight_i = dot(outward, cross(two, three))
        weight_j = dot(outward, cross(three, one))
        weight_k = dot(outward, cross(one, two))
        total = weight_i + weight_j + weight_k
        least = min(weight_i, min(weight_j, weight_k)) / total
        if total > 0.0 and least > inside:
            inside = least
            weight_i, weight_j, weight_k = max(weight_i, 0.0), max(weight_j, 0.0), max(weight_k, 0.0)
            witness = scale(row(of_a, i, d), weight_i)
            witness = add_scaled(witness, row(of_a, j, d), weight_j)
            witness = add_scaled(witness, row(of_a, k, d), weight_k)
            witness = divided(witness, weight_i + weight_j + weight_k)
    return witness


@part
def refine_kink(pair, d, best, depth, size):
    """(outward, depth) at a minimum where the depth may have a kink, as at a flat face of a round whole or along its
    rim: the normal of the face through the farthest points in three directions around the best one, or a step along the
    kink, against the least mean of their slopes; nearer each time that no step leads down."""
    spread = WIDEST
    for _ in range(8 * POLYTOPE_CORNERS):
        point_a, point_b = support_points(pair, negative(best))
        found = corner_of(point_a, point_b, d)
        slope = add_scaled(found, best, -dot(found, best))
        if not (norm(slope) > NARROWEST * size and abs(spread) > NARROWEST):
            break
        one = divided(slope, norm(slope))
        other, corners = cross(best, one), (found, found, found)
        for k in range(3):
            way = add_scaled(scale(one, THIRDS[k][0]), other, THIRDS[k][1])
            point_a, point_b = support_points(pair, negative(add_scaled(best, way, spread)))
            corners = (corners[1], corners[2], corner_of(point_a, point_b, d))
        normal, before = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0])), best
        for k in range(3):
            start, way = corners[k], sub(corners[k - 1], corners[k])
            start, way = add_scaled(start, before, -dot(start, before)), add_scaled(way, before, -dot(way, before))
            share, square = -dot(start, way), dot(way, way)
            if share > 0.0:
                start = add_scaled(start, way, min(share / square, 1.0))
            if dot(start, start) < dot(slope, slope):
                slope = start
        for k in range(2):
            height = norm(normal)
            if height > 0.0:
                normal = divided(normal, height if dot(normal, before) > 0.0 else -height)
                point_a, point_b = support_points(pair, negative(normal))
                reach = dot(normal, corner_of(point_a, point_b, d))
                if reach < depth:
                    best, depth = normal, reach
                elif k == 1:
                    spread *= NARROWER
            normal = add_scaled(best, slope, -abs(spread) / max(norm(slope), NARROWEST * size))
    return best, depth


@inlined
def refine_smooth(pair, d, surface, count, best, depth, size):
    """(normal, depth) at the least of the minima of smooth shapes near the best direction so far and near the lowest
    faces that look elsewhere."""
    _, normals, _, waiting = surface
    start, lowest = best, 0.0
    while lowest < depth:
        found, least = refine_direction(pair, d, start, math.inf, size)
        found, least = refine_kink(pair, d, found, least, size)
        if least < depth:
            best, depth = found, least
        lowest, other = math.inf, 0
        for f in range(count):
            normal = row(normals, f, d)
            if max(dot(normal, start), dot(normal, found)) > SAME_WAY:
                waiting[f] = math.inf
            if waiting[f] < lowest:
                lowest, other = waiting[f], f
        start, waiting[other] = row(normals, other, d), math.inf  # once each, whatever its normal is
    return best, depth


@part
def polytope_depth(pair, d, of_a, of_b, size):
    """(normal from a to b, depth, point of a) for a tetrahedron in the difference that holds the origin.

    The face nearest to the origin is a lower bound, how far the difference reaches in the direction of any face an
    upper one. They meet for polytopes; for smooth shapes the answer is the best upper bound, refined if
    there are more corners or faces than there is room for.
    """
    faces, edges = stack_array(POLYTOPE_FACES, (0, 0, 0)), stack_array(POLYTOPE_EDGES, (0, 0))
    normals = stack_array(POLYTOPE_FACES, (0.0, 0.0, 0.0))
    heights, waiting = stack_array(POLYTOPE_FACES, 0.0), stack_array(POLYTOPE_FACES, 0.0)
    surface = (faces, normals, heights, waiting)
    turned = 0 if dot(face_normal(of_a, of_b, 0, 1, 2, d), edge(of_a, of_b, 0, 3, d)) > 0.0 else 1
    for f in range(4):  # face f is opposite to corner f
        faces[f, 0] = 1 if f == 0 else 0
        faces[f, 1 + (f + turned) % 2] = 2 if f < 2 else 1
        faces[f, 2 - (f + turned) % 2] = 3 if f < 3 else 2
    used, count, rim, best, depth = 4, 0, 4, d, math.inf
    for _ in range(4 * POLYTOPE_CORNERS):
        for f in range(count, count + rim):  # the new ones
            store_face(of_a, of_b, surface, f, d)
        count, rim = count + rim, 0
        top = 0
        for f in range(1, count):
            if waiting[f] < waiting[top]:
                top = f
        if used == POLYTOPE_CORNERS:
            best, depth = refine_smooth(pair, d, surface, count, best, depth, size)
            break
        if not waiting[top] < depth - GJK_ROUNDING * size:
            break
        outward = row(normals, top, d)
        point_a, point_b = support_points(pair, negative(outward))
        store(of_a, used, point_a)
        store(of_b, used, point_b)
        found = corner(of_a, of_b, used, d)
        reach = dot(outward, found)
        if reach < depth:
            best, depth = outward, reach
        size = max(size, norm(found))
        known = 0
        while known < used:
            apart = edge(of_a, of_b, known, used, d)
            if dot(apart, apart) == 0.0:
                break
            known += 1
        if known < used or reach - heights[top] <= GJK_ROUNDING * size:
            waiting[top] = math.inf  # as far out as it goes; what is left is rounding
            continue
        count, rim = remove_visible_faces(surface, count, edges, top, found, GJK_ROUNDING * size, d)
        if rim < 0 or count + rim > POLYTOPE_FACES:
            rim, used = 0, POLYTOPE_CORNERS  # no room for the new ones
            continue
        for e in range(rim):
            faces[count + e, 0], faces[count + e, 1], faces[count + e, 2] = edges[e, 0], edges[e, 1], used
        used += 1
    witness = witness_point(of_a, of_b, faces, heights, count, best, depth + NARROWEST * size, d)
    return negative(best), depth, witness

"""The points in which two convex shapes touch: the corners of what their faces share.

The face of a shape is made of its farthest points in directions tilted a little from the normal: in 2D the two ends of
an edge, which many shapes tell themselves, in 3D the corners of a polygon, or two of an edge. Seen along the normal the
two faces are clipped by each other, and at each corner of what is left their heights give the gap. Neither face is the
reference for the other.

Roundings are added along the normal: a rounded edge that is tilted keeps the ends of its core.
"""

from __future__ import annotations

import math

from ....framework.compilation import inlined, part
from ....framework.elementary import cos, sin
from ....framework.jit.stack_arrays import stack_array
from ....framework.vectors import add, add_scaled, cross, dot, negative, replace, row, scale, smallest, store, sub
from ..linking.convex_by_address import convex_at, edge_by_address, rounding_by_address, support_by_address, tells_edge
from .edges import FACE_LOOKS, FINER, FLAT_FACE, SAME_POINT

MOST_POINTS = 4  # of a pair in 3D; 2 in 2D
DIRECTIONS = 8  # around the normal, in 3D: a face of more corners shows so many of them
START_DIRECTION = cos(math.pi / 8), sin(math.pi / 8)  # the first: off the axes, where boxes have two corners
SLANT = math.sqrt(0.5)  # sine and cosine of the way from one to the next
POINT_ROOM = 2 * DIRECTIONS  # each edge of a convex polygon that clips another adds at most one corner
STEEP = 0.83  # cosine: a normal nearer to the x axis takes the y axis for its basis
AS_DEEP = 1e-3  # of the size of what is shared: points are about as deep as each other
PREFERENCE = 0.01  # how much of that size is worth a place farther
PREFERRED = (0.61, 0.35, 0.71)  # any direction: of points that are equally good the farthest that way is kept


@part
def contact_points(state, rows, d, met, within, places, gaps):
    """Write up to 2 (2D) or 4 (3D) points in which two rows touch, and the gaps there; returns how many, at least 1.

    rows: (a, b). d: from the centre of a's shape to that of b's. met: (depth, normal, point) as the pair's function
    answers for these. within: (margin, tilt); points are left out whose gap exceeds that of the deepest, or 0, by more
    than the margin; faces count whose normals are within so many radians of that of the contact. places: relative to
    the centre of a's shape, in the middle between the surfaces. gaps: along the normal, negative where the shapes
    overlap.

    A shape without a support and without an end is a plane through the pair's point; another one may tell its edge
    there in a plane. Where there are no two faces that share something, the point is that of the pair.
    """
    depth, _, point = met
    parameters, shape, count = state.shapes.parameters, state.bodies.shape, 0
    a, b = convex_at(parameters[shape[rows[0]]], rows[0]), convex_at(parameters[shape[rows[1]]], rows[1])
    if may_have_face(state, a, d) and may_have_face(state, b, d):
        if len(d) == 2:
            count = points_2d((a, b), d, met, within, places, gaps)
        else:
            count = points_3d((a, b), d, met, within, places, gaps)
    if count == 0:
        store(places, 0, point)
        gaps[0] = -depth
        count = 1
    return count


@inlined
def may_have_face(state, shape, like):
    """Not balls, whose core is a point, nor what has neither a support nor the form of a plane: convex without end."""
    if len(like) == 2 and tells_edge(shape):  # its ends tell
        return True
    if shape[0] != 0:
        way = like
        for k in range(len(like)):
            way = replace(way, k, PREFERRED[k])
        return not (
            rounding_by_address(shape) > 0.0
            and is_same(support_by_address(shape, way), support_by_address(shape, negative(way)))
        )
    i = shape[3]
    return not state.shapes.concave[state.bodies.shape[i]] and smallest(state.bodies.half_extents[i]) == math.inf


@inlined
def is_same(one, two):
    """Whether two corners are one."""
    way = sub(two, one)
    return dot(way, way) <= SAME_POINT * SAME_POINT * dot(one, one)


@inlined
def keep_near(places, gaps, count, margin, like):
    """Leave out points whose gap exceeds that of the deepest, or 0, by more than the margin; returns how many are left.
    """
    deepest, kept = gaps[0], 0
    for k in range(1, count):
        deepest = min(deepest, gaps[k])
    for k in range(count):
        if gaps[k] <= margin + max(deepest, 0.0):
            store(places, kept, row(places, k, like))
            gaps[kept] = gaps[k]
            kept += 1
    return kept


# -- 2D -------------------------------------------------------------------------------------------


@inlined
def profile(shape, centre, normal, point, face):
    """(low, high, at, height, slope) of a face over the tangent: its ends, and its height at one place; both ends are
    one of what looks another way. face: (side: 1 if it looks along the normal, -1 against it, tilt, height if it is a
    plane)."""
    side, tilt, level = face
    if not tells_edge(shape):
        return -math.inf, math.inf, 0.0, level, 0.0
    along = (-normal[1], normal[0])
    one, two = edge_by_address(shape, scale(normal, side), sub(point, centre), tilt)
    one, way = add(centre, one), sub(two, one)
    at, reach, rise = dot(along, one), dot(along, way), dot(normal, way)
    if not abs(rise) < tilt * abs(reach):
        return at, at, at, level, 0.0
    height = dot(normal, one) + side * rounding_by_address(shape)
    return min(at, at + reach), max(at, at + reach), at, height, rise / reach


@part
def points_2d(pair, d, met, within, places, gaps):
    """Both ends of the interval that two edges share; 0 if they share none."""
    depth, normal, point = met
    margin, tilt = within
    level, along = dot(normal, point), (-normal[1], normal[0])
    of_a, of_b = (1.0, tilt, level + 0.5 * depth), (-1.0, tilt, level - 0.5 * depth)
    low_a, high_a, at_a, height_a, slope_a = profile(pair[0], scale(d, 0.0), normal, point, of_a)
    low_b, high_b, at_b, height_b, slope_b = profile(pair[1], d, normal, point, of_b)
    low, high = max(low_a, low_b), min(high_a, high_b)
    if not high - low > FLAT_FACE * min(high_a - low_a, high_b - low_b):
        return 0
    for k in range(2):
        at = low if k == 0 else high
        top, bottom = height_a + slope_a * (at - at_a), height_b + slope_b * (at - at_b)
        store(places, k, add_scaled(scale(along, at), normal, 0.5 * (top + bottom)))
        gaps[k] = bottom - top
    return keep_near(places, gaps, 2, margin, d)


# -- 3D: all in coordinates (x, y, height), which ``basis`` gives: two tangents and the normal ------


@inlined
def basis_of(normal):
    """Two tangents and the normal; the first tangent is the same for the opposite normal."""
    axis = (0.0, 1.0, 0.0) if abs(normal[0]) > STEEP else (1.0, 0.0, 0.0)
    along = add_scaled(axis, normal, -dot(axis, normal))
    along = scale(along, 1.0 / math.sqrt(dot(along, along)))
    return along, cross(normal, along), normal


@inlined
def coordinates(basis, vector):
    """Of a vector of the world."""
    return dot(basis[0], vector), dot(basis[1], vector), dot(basis[2], vector)


@inlined
def vector_in_basis(basis, x, y, height):
    """The vector of the world with these coordinates."""
    return add_scaled(add_scaled(scale(basis[0], x), basis[1], y), basis[2], height)


@part
def corners_around(shape, basis, side, tilt, corners):
    """Write the corners in directions around the normal, counter-clockwise as seen against it; returns how many."""
    count, outward = 0, scale(basis[2], side)
    x, y = tilt * START_DIRECTION[0], tilt * START_DIRECTION[1]
    for _ in range(DIRECTIONS):
        direction = add(outward, vector_in_basis(basis, x, y, 0.0))
        found = coordinates(basis, support_by_address(shape, direction))
        if count == 0 or not is_same(row(corners, count - 1, found), found):
            store(corners, count, found)
            count += 1
        x, y = SLANT * (x - y), SLANT * (x + y)
    while count > 1 and is_same(row(corners, 0, outward), row(corners, count - 1, outward)):
        count -= 1
    return count


@part
def slope_of(shape, basis, face, corners, count):
    """(whether the corners are those of a flat face, how its height changes with x, with y). face: as in profile."""
    side, tilt, _ = face
    first = row(corners, 0, basis[0])
    way = sub(row(corners, 1, first), first)
    size = dot(way, way)
    up = (-way[0] * way[2], -way[1] * way[2], way[0] * way[0] + way[1] * way[1])  # of an edge
    if count > 2:
        up = scale(up, 0.0)
    for k in range(2, count):
        following = sub(row(corners, k, first), first)
        up, way = add(up, cross(way, following)), following
        size = max(size, dot(way, way))
    square = dot(up, up)
    if not (up[2] > 0.0 and up[2] * up[2] >= (1.0 - 4.0 * tilt * tilt) * square):
        return False, 0.0, 0.0
    most = FLAT_FACE * math.sqrt(square * size)
    beyond = coordinates(basis, support_by_address(shape, scale(vector_in_basis(basis, up[0], up[1], up[2]), side)))
    if side * dot(up, sub(beyond, first)) > most:
        return False, 0.0, 0.0
    for k in range(1, count):
        if abs(dot(up, sub(row(corners, k, first), first))) > most:
            return False, 0.0, 0.0
    return True, -up[0] / up[2], -up[1] / up[2]


@part
def face_towards(shape, centre, basis, face, corners):
    """Write the corners of a face: (how many, how its height changes with x, with y). face: as in profile.

    0: a plane without end, whose height is that of the first corner. 1: no face and no edge.
    """
    side, tilt, level = face
    if shape[0] == 0:
        store(corners, 0, (0.0, 0.0, level))
        return 0, 0.0, 0.0
    for _ in range(FACE_LOOKS):
        count = corners_around(shape, basis, side, tilt, corners)
        if count == 1:
            break
        is_flat, along_x, along_y = slope_of(shape, basis, (side, tilt, level), corners, count)
        if is_flat:
            origin = add_scaled(coordinates(basis, centre), (0.0, 0.0, 1.0), side * rounding_by_address(shape))
            for k in range(count):
                store(corners, k, add(origin, row(corners, k, origin)))
            return count, along_x, along_y
        tilt *= FINER
    return 1, 0.0, 0.0


@inlined
def face_size(corners, count):
    """How far the others are from the first corner."""
    square = 0.0
    for k in range(1, count):
        x, y = corners[k, 0] - corners[0, 0], corners[k, 1] - corners[0, 1]
        square = max(square, x * x + y * y)
    return math.sqrt(square)


@part
def clip(subject, count, clipper, edges):
    """Cut from one polygon, or edge, in x and y what is outside of another; returns how many corners it has then.

    Both run counter-clockwise. Corners on the rim of the other are inside, and of several close together one is kept.
    """
    other = stack_array(POINT_ROOM, (0.0, 0.0, 0.0))
    near = FLAT_FACE * min(face_size(subject, count), face_size(clipper, edges))
    like = (0.0, 0.0, 0.0)
    for e in range(edges):
        start, end = row(clipper, e, like), row(clipper, e + 1 if e + 1 < edges else 0, like)
        along, kept = sub(end, start), 0
        length = math.sqrt(along[0] * along[0] + along[1] * along[1])
        inward = (-along[1] / length, along[0] / length, 0.0)
        for k in range(count):
            one, two = row(subject, k, like), row(subject, k + 1 if k + 1 < count else 0, like)
            inside_one, inside_two = dot(inward, sub(one, start)), dot(inward, sub(two, start))
            if inside_one >= -near and kept < POINT_ROOM:
                store(other, kept, one)
                kept += 1
            if (inside_one >= -near) != (inside_two >= -near) and kept < POINT_ROOM:
                share = min(max(inside_one / (inside_one - inside_two), 0.0), 1.0)
                store(other, kept, add_scaled(one, sub(two, one), share))
                kept += 1
        count = 0
        for k in range(kept):
            before = row(other, k - 1 if k > 0 else kept - 1, like)
            way = sub(row(other, k, like), before)
            if way[0] * way[0] + way[1] * way[1] > near * near or (count == 0 and k + 1 == kept):
                store(subject, count, row(other, k, like))
                count += 1
    return count


@part
def points_of_edges(of_a, of_b, width, within, found, gaps):
    """Both ends of what two nearly parallel edges share; 0 if they cross, or are not near at both. width: the sum of
    their roundings, which touch round about where the edges are beside each other."""
    margin, tilt = within
    like = (0.0, 0.0, 0.0)
    a, b = row(of_a, 0, like), row(of_b, 0, like)
    way_a, way_b = sub(row(of_a, 1, like), a), sub(row(of_b, 1, like), b)
    long_a, long_b = face_size(of_a, 2), face_size(of_b, 2)
    turned = (way_a[0] * way_b[1] - way_a[1] * way_b[0]) / (long_a * long_b)
    if not abs(turned) <= tilt:
        return 0
    same = way_a[0] * way_b[0] + way_a[1] * way_b[1] >= 0.0
    along = add_scaled(scale(way_a, 1.0 / long_a), way_b, (1.0 if same else -1.0) / long_b)
    size = math.sqrt(along[0] * along[0] + along[1] * along[1])
    along = (along[0] / size, along[1] / size, 0.0)
    at_a, at_b, reach_a, reach_b = dot(along, a), dot(along, b), dot(along, way_a), dot(along, way_b)
    low = max(min(at_a, at_a + reach_a), min(at_b, at_b + reach_b))
    high = min(max(at_a, at_a + reach_a), max(at_b, at_b + reach_b))
    narrow = FLAT_FACE * min(long_a, long_b)
    if not high - low > narrow:
        return 0
    for k in range(2):
        at = low if k == 0 else high
        on_a, on_b = add_scaled(a, way_a, (at - at_a) / reach_a), add_scaled(b, way_b, (at - at_b) / reach_b)
        way = sub(on_b, on_a)
        aside = way[1] * along[0] - way[0] * along[1]
        if abs(aside) >= max(width, narrow):
            return 0
        gaps[k] = way[2] + width - math.sqrt(max(width * width - aside * aside, 0.0))
        if gaps[k] > margin:
            return 0
        store(found, k, add_scaled(on_a, way, 0.5))
    return 2


@inlined
def best_of(values, scores, count, slack):
    """The one of the highest score among those that are within the slack of the highest value."""
    most, best = values[0], -1
    for k in range(1, count):
        most = max(most, values[k])
    for k in range(count):
        if values[k] >= most - slack and (best < 0 or scores[k] > scores[best]):
            best = k
    return best


@part
def reduce(found, gaps, count, preferred):
    """Keep four points in their order: one of the deepest, the farthest from it, the widest on both sides of that line.

    Of those that are about as deep the one farthest out: edges that nearly lie on each other cross anywhere.
    """
    values, scores, size = stack_array(POINT_ROOM, 0.0), stack_array(POINT_ROOM, 0.0), face_size(found, count)
    x = y = 0.0
    for k in range(count):
        x, y = x + found[k, 0] / count, y + found[k, 1] / count
    for k in range(count):
        out = (found[k, 0] - x) * (found[k, 0] - x) + (found[k, 1] - y) * (found[k, 1] - y)
        values[k], scores[k] = -gaps[k], out + PREFERENCE * size * dot(preferred, (found[k, 0], found[k, 1], 0.0))
    one = best_of(values, scores, count, AS_DEEP * size)
    x, y = found[one, 0], found[one, 1]
    for k in range(count):
        values[k] = (found[k, 0] - x) * (found[k, 0] - x) + (found[k, 1] - y) * (found[k, 1] - y)
    two = best_of(values, scores, count, FLAT_FACE * size * size)
    along_x, along_y = found[two, 0] - x, found[two, 1] - y
    for k in range(count):
        values[k] = along_x * (found[k, 1] - y) - along_y * (found[k, 0] - x)
    left = best_of(values, scores, count, FLAT_FACE * size * size)
    for k in range(count):
        values[k] = -values[k]
    right, kept = best_of(values, scores, count, FLAT_FACE * size * size), 0
    for k in range(count):
        if k in (one, two, left, right):
            store(found, kept, row(found, k, preferred))
            gaps[kept] = gaps[k]
            kept += 1
    return kept


@part
def points_3d(pair, d, met, within, places, gaps):
    """The corners of what two faces share, at most four; 0 if they share nothing."""
    depth, normal, point = met
    margin, tilt = within
    basis, level = basis_of(normal), dot(normal, point)
    of_a, of_b = stack_array(POINT_ROOM, (0.0, 0.0, 0.0)), stack_array(POINT_ROOM, (0.0, 0.0, 0.0))
    apart = stack_array(POINT_ROOM, 0.0)
    face = (1.0, tilt, level + 0.5 * depth)
    count_a, slope_ax, slope_ay = face_towards(pair[0], scale(d, 0.0), basis, face, of_a)
    if count_a == 1:
        return 0
    count_b, slope_bx, slope_by = face_towards(pair[1], d, basis, (-1.0, tilt, level - 0.5 * depth), of_b)
    if count_b == 1:
        return 0
    if count_a == 2 and count_b == 2:
        width = rounding_by_address(pair[0]) + rounding_by_address(pair[1])
        found = stack_array(2, (0.0, 0.0, 0.0))
        count = points_of_edges(of_a, of_b, width, within, found, apart)
    else:
        base_a, base_b = row(of_a, 0, d), row(of_b, 0, d)
        of_first = count_b == 0 or 0 < count_a <= count_b  # clip the one of fewer corners, which may be an edge
        found, other = (of_a, of_b) if of_first else (of_b, of_a)
        count, edges = (count_a, count_b) if of_first else (count_b, count_a)
        if edges > 0:
            count = clip(found, count, other, edges)
        for k in range(count):
            x, y = found[k, 0], found[k, 1]
            top = base_a[2] + slope_ax * (x - base_a[0]) + slope_ay * (y - base_a[1])
            bottom = base_b[2] + slope_bx * (x - base_b[0]) + slope_by * (y - base_b[1])
            found[k, 2], apart[k] = 0.5 * (top + bottom), bottom - top
    if count < 2:
        return 0
    count = keep_near(found, apart, count, margin, d)
    if count > MOST_POINTS:
        count = reduce(found, apart, count, coordinates(basis, PREFERRED))
    for k in range(count):
        store(places, k, vector_in_basis(basis, found[k, 0], found[k, 1], found[k, 2]))
        gaps[k] = apart[k]
    return count

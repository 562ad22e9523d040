"""The Minkowski difference of two shapes, and the simplex in it that comes nearest to the origin.

The difference of a and b is the set of all vectors from a point of a to a point of b. The shapes touch if it contains
the origin; its distance from the origin is that of the shapes, and the depth of the origin in it is their overlap. It
is never built: the supports of the two shapes give its farthest point in a direction.

``pair`` stands for both: (a, b, support of a, support of b, unit). Lengths are in units of 1 / unit.

A simplex has ``count`` corners, the newest first. Stored are the points of a and of b that they lead from and to, each
relative to its own centre, in the rows of ``of_a`` and ``of_b``: so an edge that comes from one shape alone is as exact
as that shape, however small it is against the other or far away.
"""

from __future__ import annotations

import math

from ....framework.compilation import inlined, part
from ....framework.jit.stack_arrays import stack_array
from ....framework.vectors import add, add_scaled, cross, divided, dot, item, negative, replace, row, scale, store, sub

GJK_ROUNDING = 2e-15  # of the coordinates: a few times what one support point may be off
FLAT_SIMPLEX = 1e-14  # of the coordinates: a thinner difference has no inside, a smaller distance no direction
SMALL_SCALE, LARGE_SCALE = 1e-50, 1e50  # coordinates in between can be squared twice
GJK_STEPS = 64  # boxes take 3 to 8, ellipsoids 15 to 40
REFINEMENTS = 24  # ellipsoids take 6 to 12
MAX_STALLS = 4  # steps that bring less than the rounding of the coordinates, as from one end of a long edge to another


@part
def support_points(pair, direction):
    """The points of a and of b where the difference reaches least far along ``direction``."""
    a, b, support_a, support_b, unit = pair
    return scale(support_a(a, direction), unit), scale(support_b(b, negative(direction)), unit)


@inlined
def corner_of(point_a, point_b, d):
    """The corner of the difference; that of b and a is the exact negative."""
    return add(d, sub(point_b, point_a))


@inlined
def corner(of_a, of_b, i, d):
    """Corner i."""
    return corner_of(row(of_a, i, d), row(of_b, i, d), d)


@inlined
def edge(of_a, of_b, i, k, d):
    """The vector from corner i to corner k."""
    return sub(sub(row(of_b, k, d), row(of_b, i, d)), sub(row(of_a, k, d), row(of_a, i, d)))


@inlined
def norm(a):
    """Euclidean length of a vector whose square neither overflows nor vanishes."""
    return math.sqrt(dot(a, a))


@inlined
def face_normal(of_a, of_b, i, j, k, d):
    """3D: a normal of the triangle of these corners, as long as twice its area; from its two shorter edges.

    On a long thin triangle two long edges are nearly parallel, and their product is mostly rounding.
    """
    one, two, three = edge(of_a, of_b, i, j, d), edge(of_a, of_b, j, k, d), edge(of_a, of_b, k, i, d)
    square_one, square_two, square_three = dot(one, one), dot(two, two), dot(three, three)
    if square_one >= square_two and square_one >= square_three:
        one, two = two, three
    elif square_two >= square_three:
        one, two = three, one
    return cross(one, two)


@inlined
def nearest_on_span(of_a, of_b, count, weights, d):
    """The point nearest to the origin on the line, plane or space through the corners, and their weights in it.

    All is relative to the corner nearest to the origin, so that the weights of distant corners, which may be tiny, are
    exact. On a face (count = d) the point is taken from the face's normal: its direction is good however near it is.
    """
    home, least = 0, math.inf
    for i in range(count):
        way = corner(of_a, of_b, i, d)
        if dot(way, way) < least:
            home, least = i, dot(way, way)
    base = corner(of_a, of_b, home, d)
    weights[home] = 1.0
    if count == 1:
        return base
    i = home + 1 if home + 1 < count else 0
    first = edge(of_a, of_b, home, i, d)
    if count == 2:
        weights[i] = -dot(base, first) / dot(first, first)
        weights[home] = 1.0 - weights[i]
        if len(d) == 2:
            normal = (-first[1], first[0])
            return scale(normal, dot(normal, base) / dot(first, first))
        result = add_scaled(base, first, weights[i])
        return add_scaled(result, first, -dot(result, first) / dot(first, first))  # once more: it may be short
    j = i + 1 if i + 1 < count else 0
    second = edge(of_a, of_b, home, j, d)
    if len(d) == 2:
        area = first[0] * second[1] - first[1] * second[0]
        weights[i] = (base[1] * second[0] - base[0] * second[1]) / area
        weights[j] = (base[0] * first[1] - base[1] * first[0]) / area
        weights[home] = 1.0 - weights[i] - weights[j]
        return scale(d, 0.0)
    normal = face_normal(of_a, of_b, home, i, j, d)
    if count == 3:
        square = dot(normal, normal)
        weights[i] = dot(normal, cross(second, base)) / square
        weights[j] = dot(normal, cross(base, first)) / square
        weights[home] = 1.0 - weights[i] - weights[j]
        return scale(normal, dot(normal, base) / square)
    k = j + 1 if j + 1 < count else 0
    third = edge(of_a, of_b, home, k, d)
    across_i, across_j = face_normal(of_a, of_b, home, j, k, d), face_normal(of_a, of_b, home, k, i, d)
    volume, doubt = dot(across_i, first), dot(across_i, across_i) * dot(first, first)
    other = dot(across_j, across_j) * dot(second, second)
    if other < doubt:
        volume, doubt = dot(across_j, second), other
    if dot(normal, normal) * dot(third, third) < doubt:
        volume = dot(normal, third)
    weights[i] = -dot(base, across_i) / volume
    weights[j] = -dot(base, across_j) / volume
    weights[k] = -dot(base, normal) / volume
    weights[home] = 1.0 - weights[i] - weights[j] - weights[k]
    return scale(d, 0.0)


@inlined
def reduce_simplex(of_a, of_b, weights, target, count, d):
    """Keep the corners of the feature nearest to the origin: (count, that point); ``weights`` are its weights.

    Wolfe's algorithm: move from the present point to the nearest point of the span; where that leaves the simplex, stop
    and drop the opposite corner. It ends after at most as many rounds as there are corners, whatever rounding does.
    """
    while True:
        nearest = nearest_on_span(of_a, of_b, count, target, d)
        leaving, way = -1, 2.0
        for i in range(count):
            if not target[i] > 0.0:  # nor is a share that is no number, from a simplex without volume
                until = weights[i] / (weights[i] - target[i]) if target[i] < weights[i] else 0.0
                if until <= way:
                    leaving, way = i, until
        if leaving < 0:
            for i in range(count):
                weights[i] = target[i]
            return count, nearest
        if way > 0.0:
            for i in range(count):
                weights[i] += way * (target[i] - weights[i])
        count -= 1
        store(of_a, leaving, row(of_a, count, d))
        store(of_b, leaving, row(of_b, count, d))
        weights[leaving] = weights[count]


@part
def closest_simplex(pair, d, of_a, of_b):
    """Walk through the difference towards the origin, from simplex to simplex (Gilbert, Johnson and Keerthi).

    Returns (count, nearest, witness, size). count 0: the origin is outside, ``nearest`` is the point of the difference
    nearest to it; otherwise the simplex of so many corners holds the origin, or is as near to it as can be told.
    witness: the point of a. size: of the coordinates, which rounding errors go with. count -1: they may be too large or
    too small for unit 1.
    """
    unit = pair[4]
    weights, target = stack_array(4, 0.0), stack_array(4, 0.0)
    direction = d
    if dot(d, d) == 0.0:
        direction = replace(d, 0, 1.0)
    nearest, witness = direction, d
    square, size_square, count, stalls = math.inf, dot(d, d), 0, 0
    for _ in range(GJK_STEPS):
        point_a, point_b = support_points(pair, direction)
        size_square = max(size_square, max(dot(point_a, point_a), dot(point_b, point_b)))
        if count == 0:
            if unit == 1.0 and not SMALL_SCALE * SMALL_SCALE < size_square < LARGE_SCALE * LARGE_SCALE:
                return -1, nearest, witness, 0.0
        else:
            # No point of the difference lies farther on this side; what is left is rounding.
            gain = dot(nearest, sub(sub(row(of_b, 0, d), point_b), sub(row(of_a, 0, d), point_a)))
            if not gain > GJK_ROUNDING * math.sqrt(size_square * square):
                break
            store(of_a, count, row(of_a, 0, d))
            store(of_b, count, row(of_b, 0, d))
            weights[count] = weights[0]
        store(of_a, 0, point_a)
        store(of_b, 0, point_b)
        weights[0] = 0.0 if count > 0 else 1.0
        count, direction = reduce_simplex(of_a, of_b, weights, target, count + 1, d)
        now = dot(direction, direction)
        if not now < square:
            stalls += 1
            if stalls > MAX_STALLS or not math.sqrt(now) <= math.sqrt(square) + GJK_ROUNDING * math.sqrt(size_square):
                break
        square, nearest = now, direction
        witness = scale(row(of_a, 0, d), weights[0])
        for i in range(1, count):
            witness = add_scaled(witness, row(of_a, i, d), weights[i])
        if square <= FLAT_SIMPLEX * FLAT_SIMPLEX * size_square:
            return count, nearest, witness, math.sqrt(size_square)
    return 0, nearest, witness, math.sqrt(size_square)


@inlined
def perpendicular_to(of_a, of_b, count, d):
    """A unit vector at right angles to a simplex of 1 to d corners."""
    axis = replace(scale(d, 0.0), 0, 1.0)
    result = axis
    if count > 1:
        first = edge(of_a, of_b, 0, 1, d)
        if len(d) == 2:
            result = (-first[1], first[0])
        elif count == 2:
            least = 0
            for k in range(len(d)):
                if abs(item(first, k)) < abs(item(first, least)):
                    least = k
            result = cross(first, replace(scale(d, 0.0), least, 1.0))
        else:
            result = face_normal(of_a, of_b, 0, 1, 2, d)
        size = norm(result)
        result = divided(result, size) if size > 0.0 else axis
    return result


@part
def complete_simplex(pair, d, of_a, of_b, count, size):
    """Add corners to a simplex that holds the origin until it has a volume: (count, normal, height).

    count 0: the difference is flat, and the origin in it; ``normal`` is across it and leads out over ``height``.
    """
    normal, height = d, 0.0
    while count <= len(d):
        ahead = perpendicular_to(of_a, of_b, count, d)
        if dot(ahead, d) < 0.0:
            ahead = negative(ahead)
        base = corner(of_a, of_b, 0, d)
        farthest, height = -1.0, math.inf
        for _ in range(2):
            point_a, point_b = support_points(pair, ahead)
            out = -dot(ahead, corner_of(point_a, point_b, d))
            reach = out + dot(ahead, base)
            if reach > farthest:
                farthest = reach
                store(of_a, count, point_a)
                store(of_b, count, point_b)
            if out < height:
                normal, height = ahead, out
            ahead = negative(ahead)
        if not farthest > FLAT_SIMPLEX * size:
            return 0, normal, height
        count += 1
    return count, normal, height


@part
def refine_direction(pair, d, outward, depth, size):
    """(outward, depth) at a local minimum of the depth, from a direction near it; for smooth shapes.

    Gradient descent with the step length of Barzilai and Borwein. The best direction of all rounds is returned, so that
    corners and edges, where the depth has no gradient, do no harm.
    """
    best, least = outward, depth
    before, slope_before, step = outward, outward, 1.0 / size
    for turn in range(REFINEMENTS):
        point_a, point_b = support_points(pair, negative(outward))
        found = corner_of(point_a, point_b, d)
        reach = dot(outward, found)
        slope = add_scaled(found, outward, -reach)
        if reach < least:
            best, least = outward, reach
        if not dot(slope, slope) > GJK_ROUNDING * size * size * 1e-3:  # the square: 1e-9 of the size
            break
        if turn > 0:
            way, change = sub(outward, before), sub(slope, slope_before)
            bend = dot(way, change)
            step = dot(way, way) / bend if bend > 0.0 else 2.0 * step
        before, slope_before = outward, slope
        outward = add_scaled(outward, slope, -step)
        turned = norm(outward)
        if not (turned > 0.0 and math.isfinite(turned)):
            break
        outward = divided(outward, turned)
    return best, least

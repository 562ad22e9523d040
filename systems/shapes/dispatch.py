"""What kernels call for shapes known by their number: each finds the linked function in the tables of the state.

They are compiled into the kernel that calls them, which itself is the same for all scenes.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.vectors import add_scaled, negative
from .linking.batches import SOUND, repeat_batch, turned_back
from .linking.mixing import friction_at as friction_at
from .linking.mixing import restitution_at as restitution_at
from .linking.mixing import restitution_of as restitution_of
from .linking.signatures import (
    call_batch,
    call_bounds,
    call_corner,
    call_evaluate,
    call_half_thickness,
    call_moments,
    call_rotated,
    call_sweep,
)  # fmt: skip

DEEPER = 2.0  # slops: how deep two shapes are looked at that may touch at a corner
OTHER_FACE = 0.9  # of that: a way out that is shorter is not that of the face that they touch with


@inlined
def pair_index(state, shape_a, shape_b):
    """Where the tables have the pair of two shapes, in either order."""
    count = state.shapes.count
    return shape_a * count + shape_b if shape_a <= shape_b else shape_b * count + shape_a


@inlined
def evaluate(state, shape_a, a, shape_b, b, d):
    """(hit, depth, normal, point) of rows a and b, d = centre of b - centre of a.

    The normal leads from a to b, the point is relative to a's centre; depth is negative while the two are apart. Two
    shapes that no plugin has a pair for never hit.
    """
    shapes, kind = state.shapes, pair_index(state, shape_a, shape_b)
    address, flipped, swapped = shapes.evaluate[kind], shapes.flipped[kind], shape_a > shape_b
    if address == 0:
        return False, -math.inf, d, d
    state.evaluations_counted += 1
    pa, pb = shapes.parameters[shape_a], shapes.parameters[shape_b]
    if swapped != flipped:
        pa, a, pb, b, d = pb, b, pa, a, negative(d)
    return turned_back(swapped, flipped, d, call_evaluate(address, state, pa, a, pb, b, d))


@inlined
def evaluate_batch(state, kind, start, stop):
    """Write the manifolds of the pairs ``bucket[start:stop]``, which are of that ``kind``."""
    address = state.shapes.batch[kind]
    if address != 0:
        state.evaluations_counted += stop - start
        if call_batch(address, state, start, stop) != SOUND:
            repeat_batch(state, start, stop)
    else:
        pairs, bucket = state.pairs, state.candidates.bucket
        for k in range(start, stop):
            pairs.hit[bucket[k]], pairs.depth[bucket[k]] = False, -math.inf


@part
def gives_way(state, sides, d, met, slop):
    """Whether two shapes that touch by less than the slop would, a little deeper, have a shorter way out along another
    normal: they touch where faces meet. Arguments as of :func:`is_corner_touch`."""
    (shape_a, a, shape_b, b), (depth, n) = sides, met
    if not -slop <= depth <= slop:
        return False
    _, deeper, _, _ = evaluate(state, shape_a, a, shape_b, b, add_scaled(d, n, depth - DEEPER * slop))
    return deeper < OTHER_FACE * DEEPER * slop


@inlined
def has_corner_rule(state, shape_a, shape_b):
    """Whether the pair says itself when it touches at a corner."""
    return state.shapes.corner[pair_index(state, shape_a, shape_b)] != 0


@inlined
def both_sharp(state, shape_a, shape_b):
    """Whether both have corners."""
    sharp = state.shapes.sharp
    return sharp[shape_a] and sharp[shape_b]


@inlined
def is_corner_touch(state, shape_a, a, shape_b, b, d, met, slop):
    """Whether the two touch by less than the slop and at a corner or an edge only, which is no contact. met: (depth,
    normal) there."""
    shapes, kind = state.shapes, pair_index(state, shape_a, shape_b)
    address = shapes.corner[kind]
    if address == 0:
        return both_sharp(state, shape_a, shape_b) and gives_way(state, (shape_a, a, shape_b, b), d, met, slop)
    pa, pb = shapes.parameters[shape_a], shapes.parameters[shape_b]
    if (shape_a > shape_b) != shapes.flipped[kind]:
        return call_corner(address, state, pb, b, pa, a, negative(d), slop)
    return call_corner(address, state, pa, a, pb, b, d, slop)


@inlined
def sweep(state, shape_a, a, shape_b, b, d, v):
    """(known, hit, time) of b moving by v relative to a: whether the pair has a sweep in closed form, and its answer.

    The tables have sweeps only after ``fill(..., sweeps=True)``.
    """
    shapes, kind = state.shapes, pair_index(state, shape_a, shape_b)
    address = shapes.sweep[kind]
    if address == 0:
        return False, False, 0.0
    pa, pb = shapes.parameters[shape_a], shapes.parameters[shape_b]
    if (shape_a > shape_b) != shapes.flipped[kind]:
        hit, time = call_sweep(address, state, pb, b, pa, a, negative(d), negative(v))
    else:
        hit, time = call_sweep(address, state, pa, a, pb, b, d, v)
    return True, hit, time


@inlined
def both_convex(state, shape_a, shape_b):
    """Whether a plane parts the two shapes wherever they do not touch."""
    concave = state.shapes.concave
    return not (concave[shape_a] or concave[shape_b])


@inlined
def half_extents(state, shape, i):
    """Half extents of the box around row i's shape, as it is in the world."""
    return call_bounds(state.shapes.bounds[shape], state, state.shapes.parameters[shape], i)


@inlined
def half_thickness(state, shape, i):
    """The least half extent of row i's shape along the axes of its body; infinity if rotation changes nothing."""
    shapes = state.shapes
    address = shapes.half_thickness[shape]
    return call_half_thickness(address, shapes.own_parameters[shape], i) if address != 0 else math.inf


@inlined
def second_moments(state, shape, i):
    """Measure, centre and second moments of row i's shape, not rotated; the shape must tell them."""
    return call_moments(state.shapes.moments[shape], state, state.shapes.own_parameters[shape], i)


@inlined
def write_rotated(state, shape, i):
    """Write row i's parameters as they are in the world."""
    shapes = state.shapes
    address, own, world = shapes.rotated[shape], shapes.own_parameters[shape], shapes.parameters[shape]
    if address != 0 and own != world:
        call_rotated(address, state, own, world, i, state.rotated)

"""All that is somewhere: which shapes touch the shape of a query, and how deep they are in each other; and which bodies
are near which, by the distances between their positions, whatever their shapes."""

from __future__ import annotations

import numpy as np

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import absolute, add, length, scale, shifted, sub
from ..broad_phase.tree.cells import REACH
from ..narrow_phase.one_way import is_one_way
from ..shapes.query import evaluate_against, query_half_extents
from .candidates import has_layer, is_wanted, make_find_all, to_collider

ALL_LAYERS = -1


# -- overlap ------------------------------------------------------------------------------------


@inlined
def box_of_query(state, batch, q):
    """(centre, low, high) of the box around the query's shape."""
    centre, half = batch.centre[q], batch.half[q]
    if batch.query.is_collider:
        half = query_half_extents(state, batch.query, q)
    return centre, sub(centre, half), add(centre, half)


@inlined
def may_touch(state, batch, q, centre, i):
    """Whether query q looks for row i, which is solid from all sides unless others are asked for too."""
    return is_wanted(state, batch, q, i) and (batch.one_way or not is_one_way(state, i))


@inlined
def touches(state, batch, q, centre, i):
    """Whether the shapes touch."""
    return evaluate_against(state, batch.query, q, state.bodies.shape[i], i, to_collider(state, centre, i))[0]


find_touching = make_find_all(box_of_query, may_touch, touches, in_grids=True)


@part
def note_depths(state, batch, q, begin, end):
    """Of the hits begin..end-1 of query q the depth, the point and the normal, from the body to the query's shape."""
    for k in range(begin, end):
        i = batch.row[k]
        d = to_collider(state, batch.centre[q], i)
        _, depth, normal, point = evaluate_against(state, batch.query, q, state.bodies.shape[i], i, d)
        batch.distance[k], batch.normal[k] = -depth, sub(zero_of(state), normal)
        batch.point[k] = add(batch.centre[q], point)


def find_overlaps(state, batch, moving, static, first, stop):
    """What touches the shapes of queries first..stop-1; colliders that ask are told how deep."""
    reached, begin = find_touching(state, batch, moving, static, first, stop), np.int64(0)
    for q in range(first, reached if batch.query.is_collider else first):
        note_depths(state, batch, q, begin, batch.end[q])
        begin = batch.end[q]
    return reached


# -- neighbours ---------------------------------------------------------------------------------


@inlined
def box_of_body(state, batch, q):
    """(centre, low, high) of the box around the sphere about the body of the query, with room for rounding."""
    centre, radius = state.bodies.position[batch.body[q]], batch.radius
    reach = shifted(scale(absolute(centre), REACH), radius * (1.0 + REACH))
    return centre, sub(centre, reach), add(centre, reach)


@inlined
def may_be_near(state, batch, q, centre, i):
    """Whether row i is another body and in the layers; bodies without a collider are in none but all."""
    in_layers = batch.mask[q] == ALL_LAYERS or (state.bodies.shape[i] >= 0 and has_layer(state, batch, q, i))
    return i != batch.body[q] and in_layers


@inlined
def is_neighbour(state, batch, q, centre, i):
    """Whether row i is within the radius."""
    return length(sub(state.bodies.position[i], centre)) <= batch.radius


find_near = make_find_all(box_of_body, may_be_near, is_neighbour, in_grids=False)


def find_neighbours(state, batch, points, unused, first, stop):
    """The neighbours of queries first..stop-1; ``points``: a tree of the bodies' positions, boxes without size."""
    return find_near(state, batch, points, unused, first, stop)

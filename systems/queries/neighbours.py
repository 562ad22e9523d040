"""Neighbours: which bodies are near which; distances between their positions, whatever their shapes."""

from __future__ import annotations

from ...framework.compilation import inlined
from ...framework.vectors import absolute, add, length, scale, shifted, sub
from ..broad_phase.tree.cells import REACH
from .candidates import has_layer, make_find_all

ALL_LAYERS = -1


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

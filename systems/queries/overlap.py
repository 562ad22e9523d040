"""Overlap: which shapes touch the shape of a query."""

from __future__ import annotations

from ...framework.compilation import inlined
from ...framework.vectors import add, sub
from ..shapes.query import evaluate_against
from .candidates import has_layer, make_find_all, to_collider


@inlined
def box_of_query(state, batch, q):
    """(centre, low, high) of the box around the query's shape."""
    centre, half = batch.centre[q], batch.half[q]
    return centre, sub(centre, half), add(centre, half)


@inlined
def may_touch(state, batch, q, centre, i):
    """Whether row i is in one of the layers."""
    return has_layer(state, batch, i)


@inlined
def touches(state, batch, q, centre, i):
    """Whether the shapes touch."""
    return evaluate_against(state, batch.query, q, state.bodies.shape[i], i, to_collider(state, centre, i))[0]


find_touching = make_find_all(box_of_query, may_touch, touches, in_grids=True)


def find_overlaps(state, batch, moving, static, first, stop):
    """What touches the shapes of queries first..stop-1."""
    return find_touching(state, batch, moving, static, first, stop)

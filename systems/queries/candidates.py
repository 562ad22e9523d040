"""What all queries share: which bodies a query is about, where their shapes are, and hits in the order of their ids."""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.vectors import add, add_scaled, item, sub

NO_ROOM = -1  # in place of a number of hits


@inlined
def boxes_overlap(tree, place, low, high):
    """Whether the box at that place of the tree's order and low..high have a point in common; false for nan."""
    d, hit = len(low), True
    for k in range(d):
        hit &= (item(low, k) <= tree.boxes[place, d + k]) & (tree.boxes[place, k] <= item(high, k))
    return hit


@inlined
def has_layer(state, batch, i):
    """Whether the layer of row i is one of those that the queries look for."""
    return state.colliders.layer[state.bodies.collider_slot[i], i] & batch.mask != 0


@inlined
def is_wanted(state, batch, q, i):
    """Whether query q looks for row i."""
    return has_layer(state, batch, i) and state.bodies.entity[i] != batch.excluded[q]


@inlined
def to_collider(state, point, i):
    """From a point to the centre of row i's shape."""
    return sub(add(state.bodies.position[i], state.bodies.offset[i]), point)


@inlined
def nan_vector(zero):
    """A vector of nan, in place of what is not found."""
    return add_scaled(zero, zero, math.nan)


@part
def order_by_entity(state, batch, begin, end):
    """Sort the hits begin..end-1 by id, and write the ids. Shellsort: rows of one kind of body are in order already."""
    row, ids = batch.row, state.bodies.entity
    gap = 1
    while gap < (end - begin) // 9:
        gap = 3 * gap + 1
    while gap > 0:
        for k in range(begin + gap, end):
            i = row[k]
            place = k
            while place >= begin + gap and ids[row[place - gap]] > ids[i]:
                row[place] = row[place - gap]
                place -= gap
            row[place] = i
        gap //= 3
    for k in range(begin, end):
        batch.entity[k] = ids[row[k]]

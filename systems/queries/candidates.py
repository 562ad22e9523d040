"""What all queries share: which bodies a query is about, where their shapes are, and hits in the order of their ids."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ...framework.compilation import inlined, part, pasted
from ...framework.vectors import add, add_scaled, item, sub
from ..broad_phase.tree.cells import cells_of, cover, parts_of

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


def make_find_all(box_of: Callable[..., Any], may_hit: Callable[..., bool], is_hit: Callable[..., bool]) -> Any:
    """find_all(state, batch, trees, first, stop) for queries that look for all bodies of some kind.

    It finds the hits of queries first..stop-1, by id, and returns the query to go on with once the hits are taken away.
    There must be room for as many hits as there are bodies: that is enough for one query.

    box_of
        (state, batch, q) -> (centre, low, high) of query q: the boxes of its hits overlap low..high
    may_hit, is_hit
        (state, batch, q, centre, i): whether row i is a hit; what costs little, and the rest
    """

    @pasted
    def find_in_tree(state, batch, tree, q, found):
        """Append the hits of one tree; returns how many there are then, or NO_ROOM."""
        centre, low, high = box_of(state, batch, q)
        for level in range(tree.levels + 1):
            if tree.level_end[level] == tree.level_begin[level]:
                continue
            runs = cover(tree, low, high, level)
            parts, wraps = parts_of(tree, level, runs)
            for piece in range(parts):
                begin, end = cells_of(tree, level, runs, piece, wraps)
                if found + (end - begin) > len(batch.row):
                    return NO_ROOM
                for place in range(begin, end):
                    i = tree.order[place]
                    if boxes_overlap(tree, place, low, high) and may_hit(state, batch, q, centre, i):
                        batch.row[found] = i
                        found += is_hit(state, batch, q, centre, i)
        return found

    @pasted
    def find_all(state, batch, trees, first, stop):
        found = np.int64(0)
        for q in range(first, stop):
            begin = found
            for tree in trees:
                if tree.count > 0 and found != NO_ROOM:
                    found = find_in_tree(state, batch, tree, q, found)
            if found == NO_ROOM:
                return q
            order_by_entity(state, batch, begin, found)
            batch.end[q] = found
        return stop

    return find_all

"""Overlap: which shapes touch the shape of a query."""

from __future__ import annotations

import numpy as np

from ...framework.compilation import pasted
from ...framework.vectors import add, sub
from ..broad_phase.tree.cells import cells_of, cover, parts_of
from ..shapes.query import evaluate_against
from .candidates import NO_ROOM, boxes_overlap, has_layer, order_by_entity, to_collider


@pasted
def find_in_tree(state, batch, tree, q, found):
    """Append the rows of one tree that query q touches; returns how many there are then, or NO_ROOM."""
    centre = batch.centre[q]
    low, high = sub(centre, batch.half[q]), add(centre, batch.half[q])
    for level in range(tree.levels + 1):
        if tree.level_end[level] == tree.level_begin[level]:
            continue
        runs = cover(tree, low, high, level)
        parts, wraps = parts_of(tree, level, runs)
        for part in range(parts):
            begin, end = cells_of(tree, level, runs, part, wraps)
            if found + (end - begin) > len(batch.row):
                return NO_ROOM
            for place in range(begin, end):
                i = tree.order[place]
                if boxes_overlap(tree, place, low, high) and has_layer(state, batch, i):
                    d = to_collider(state, centre, i)
                    batch.row[found] = i
                    found += evaluate_against(state, batch.query, q, state.bodies.shape[i], i, d)[0]
    return found


def find_overlaps(state, batch, moving, static, first, stop):
    """The hits of queries first..stop-1, by id; returns the query to go on with once the hits are taken away.

    There must be room for as many hits as there are bodies: that is enough for one query.
    """
    found = np.int64(0)
    for q in range(first, stop):
        begin = found
        for tree in (moving, static):
            if tree.count > 0 and found != NO_ROOM:
                found = find_in_tree(state, batch, tree, q, found)
        if found == NO_ROOM:
            return q
        order_by_entity(state, batch, begin, found)
        batch.end[q] = found
    return stop

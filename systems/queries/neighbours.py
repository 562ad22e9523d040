"""Neighbours: which bodies are near which; distances between their positions, whatever their shapes."""

from __future__ import annotations

import numpy as np

from ...framework.compilation import inlined, pasted
from ...framework.vectors import add, item, length, replace, sub
from ..broad_phase.tree.cells import REACH, cells_of, cover, parts_of
from .candidates import NO_ROOM, boxes_overlap, has_layer, order_by_entity

ALL_LAYERS = -1


@inlined
def search_box(centre, radius):
    """(low, high) of the box around a sphere, with room for rounding."""
    reach = centre
    for k in range(len(centre)):
        reach = replace(reach, k, radius * (1.0 + REACH) + REACH * abs(item(centre, k)))
    return sub(centre, reach), add(centre, reach)


@inlined
def is_in_layers(state, batch, i):
    """Whether row i is in the layers that are asked for; bodies without a collider are in none but all."""
    return batch.mask == ALL_LAYERS or (state.bodies.shape[i] >= 0 and has_layer(state, batch, i))


@pasted
def find_near(state, batch, points, q, found):
    """Append the rows near the body of query q; returns how many there are then, or NO_ROOM."""
    position, body, radius = state.bodies.position, batch.body[q], batch.radius
    centre = position[body]
    low, high = search_box(centre, radius)
    for level in range(points.levels + 1):
        if points.level_end[level] == points.level_begin[level]:
            continue
        runs = cover(points, low, high, level)
        parts, wraps = parts_of(points, level, runs)
        for part in range(parts):
            begin, end = cells_of(points, level, runs, part, wraps)
            if found + (end - begin) > len(batch.row):
                return NO_ROOM
            for place in range(begin, end):
                i = points.order[place]
                if i != body and boxes_overlap(points, place, low, high) and is_in_layers(state, batch, i):
                    batch.row[found] = i
                    found += length(sub(position[i], centre)) <= radius
    return found


def find_neighbours(state, batch, points, unused, first, stop):
    """The neighbours of queries first..stop-1, by id; returns the query to go on with, see find_overlaps.

    points
        a tree of the bodies' positions, boxes without size
    """
    found = np.int64(0)
    for q in range(first, stop):
        begin = found
        found = find_near(state, batch, points, q, found)
        if found == NO_ROOM:
            return q
        order_by_entity(state, batch, begin, found)
        batch.end[q] = found
    return stop

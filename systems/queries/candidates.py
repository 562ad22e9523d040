"""What all queries share: which bodies a query is about, where their shapes are, and hits in the order of their ids."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ...framework.compilation import inlined, part, pasted
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import absolute, add, filled, item, larger, replace, scale, sub
from ..bits import lowest_bit
from ..broad_phase.brute_force import boxes_overlap
from ..broad_phase.lanes import eight_at
from ..broad_phase.tree.cells import REACH, cells_of, cover, parts_of
from ..broad_phase.uniform_grid import LANES, cells_around, line_of, outline

NO_ROOM = -1  # in place of a number of hits


@inlined
def overlaps_tree_box(tree, place, low, high):
    """Whether the box at that place of the tree's order and low..high have a point in common; false for nan."""
    d, hit = len(low), True
    for k in range(d):
        hit &= (item(low, k) <= tree.boxes[place, d + k]) & (tree.boxes[place, k] <= item(high, k))
    return hit


@inlined
def is_box_near(state, i, low, high):
    """The same for the box of row i."""
    return boxes_overlap(low, high, state.bodies.lower[i], state.bodies.upper[i])


@inlined
def places_of(grid, cells, n):
    """(begin, end) of the boxes in line n of :func:`cells_around`; line -1 is what is outside of the grid."""
    if n < 0:
        return np.int64(0), np.int64(grid.outside_count)
    return line_of(grid, cells, n)


@inlined
def may_be_near_at(grid, n, start, end, outlined):
    """Bits of the boxes from ``start`` on in that line, up to LANES of them, that may overlap what is outlined."""
    code, guards = outlined
    some = (np.int64(1) << min(end - start, LANES)) - 1
    return some if n < 0 else eight_at(grid.codes, start, code, guards) & some


@inlined
def row_at(grid, n, place):
    """The row of a box in that line."""
    return np.int64(grid.outside[place] if n < 0 else grid.order[place])


@inlined
def box_rounding(point, low, high):
    """Per axis more than all rounding errors of distances between the point and boxes inside of low..high."""
    return scale(add(absolute(point), larger(absolute(low), absolute(high))), REACH)


@inlined
def box_at(tree, place):
    """The box at that place of the tree's order."""
    low = high = zero_of(tree)
    for k in range(len(low)):
        low, high = replace(low, k, tree.boxes[place, k]), replace(high, k, tree.boxes[place, len(low) + k])
    return low, high


@inlined
def has_layer(state, batch, q, i):
    """Whether the layer of row i is one of those that query q looks for."""
    return state.colliders.layer[state.bodies.collider_slot[i], i] & batch.mask[q] != 0


@part
def is_selected(state, batch, q, i):
    """Whether query q does not leave out row i; a collider that asks meets what a body with it would meet."""
    if batch.query.is_collider:
        colliders, slot, group = state.colliders, state.bodies.collider_slot[i], batch.group[q]
        if colliders.mask[slot, i] & batch.layer[q] == 0 or (group != 0 and colliders.group[slot, i] == group):
            return False
    count, left_out = batch.excluded_count, False
    for k in range(count * q, count * q + count):
        left_out |= batch.excluded[k] == state.bodies.entity[i]
    return not left_out


@inlined
def is_wanted(state, batch, q, i):
    """Whether query q looks for row i."""
    return has_layer(state, batch, q, i) and (not batch.selects or is_selected(state, batch, q, i))


@inlined
def to_collider(state, point, i):
    """From a point to the centre of row i's shape."""
    return sub(add(state.bodies.position[i], state.bodies.offset[i]), point)


@inlined
def nan_vector(zero):
    """A vector of nan, in place of what is not found."""
    return filled(zero, math.nan)


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


def make_find_all(
    box_of: Callable[..., Any], may_hit: Callable[..., bool], is_hit: Callable[..., bool], in_grids: bool
) -> Any:
    """find_all(state, batch, moving, static, first, stop) for queries that look for all bodies of some kind: in_grids,
    in those of the state that serve and else in two trees; or in the first tree alone.

    It finds the hits of queries first..stop-1, by id, and returns the query to go on with once the hits are taken away.
    There must be room for as many hits as there are bodies: that is enough for one query.

    box_of
        (state, batch, q) -> (centre, low, high) of query q: the boxes of its hits overlap low..high
    may_hit, is_hit
        (state, batch, q, centre, i): whether row i is a hit; what costs little, and the rest
    """

    @pasted
    def gather_of_tree(batch, tree, low, high, found):
        """Append the rows whose boxes in the tree overlap low..high; returns how many there are then, or NO_ROOM."""
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
                    batch.row[found] = tree.order[place]
                    found += overlaps_tree_box(tree, place, low, high)
        return found

    @pasted
    def gather_of_grid(state, batch, grid, low, high, found):
        """The same of a grid."""
        begin, outlined, cells, rows = found, outline(grid, low, high), cells_around(grid, low, high), batch.row
        for n in range(-1, cells[1]):
            first, end = places_of(grid, cells, n)
            if found + (end - first) > len(rows):
                return NO_ROOM
            for start in range(first, end, LANES):
                bits = may_be_near_at(grid, n, start, end, outlined)
                while bits != 0:
                    rows[found] = row_at(grid, n, start + lowest_bit(bits))
                    bits &= bits - 1
                    found += 1
        near = begin
        for k in range(begin, found):
            i = rows[k]
            rows[near] = i
            near += is_box_near(state, i, low, high)
        return near

    @pasted
    def keep_hits(state, batch, q, centre, begin, end):
        """Of these rows keep those that are hits; returns where they end."""
        found = begin
        for k in range(begin, end):
            i = batch.row[k]
            if may_hit(state, batch, q, centre, i):
                batch.row[found] = i
                found += is_hit(state, batch, q, centre, i)
        return found

    @pasted
    def find_all(state, batch, moving, static, first, stop):
        end = np.int64(0)
        for q in range(first, stop):
            begin, (centre, low, high) = end, box_of(state, batch, q)
            for turn in range(2 if in_grids else 1):
                tree, grid = (moving, state.grid) if turn == 0 else (static, state.static_grid)
                if end != NO_ROOM and in_grids and grid.serves:
                    end = gather_of_grid(state, batch, grid, low, high, end)
                if end != NO_ROOM and tree.count > 0:
                    end = gather_of_tree(batch, tree, low, high, end)
            if end == NO_ROOM:
                return q
            end = keep_hits(state, batch, q, centre, begin, end)
            order_by_entity(state, batch, begin, end)
            batch.end[q] = end
        return stop

    return find_all

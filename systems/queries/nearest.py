"""The nearest surface to a point: boxes around it that grow until nothing outside can be nearer."""

from __future__ import annotations

import math

from ...framework.compilation import inlined, pasted
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add_scaled, item, replace, sub
from ..broad_phase.tree.cells import cells_of, cover, parts_of, uncertainty
from ..shapes.query import evaluate_against
from .candidates import is_wanted, nan_vector, to_collider
from .records import ENDLESS

FIRST_BOX = 0.5  # half the size of the first box, in cells of the finest level; measured: 1 takes longer, as does 0.2


@inlined
def squared_gap(tree, place, point, slack):
    """Square of the distance from a point to a box of the tree, at most: less the uncertainty of both."""
    d, square = len(point), 0.0
    for k in range(d):
        gap = max(tree.boxes[place, k] - item(point, k), item(point, k) - tree.boxes[place, d + k])
        gap = max(gap - item(slack, k), 0.0)
        square += gap * gap
    return square


@pasted
def improve(state, batch, tree, q, begin, end, slack):
    """Compare what query q has as its nearest with the boxes begin..end-1 of the tree's order."""
    point, ids = batch.centre[q], state.bodies.entity
    for place in range(begin, end):
        best = batch.distance[q]
        outside = max(best, 0.0)
        if not squared_gap(tree, place, point, slack) <= outside * outside:
            continue
        i = tree.order[place]
        if not is_wanted(state, batch, q, i):
            continue
        d = to_collider(state, point, i)
        _, depth, normal, _ = evaluate_against(state, batch.query, q, state.bodies.shape[i], i, d)
        distance = -depth
        if not distance <= best:
            continue
        if distance == best and batch.row[q] >= 0 and ids[batch.row[q]] <= ids[i]:
            continue
        batch.row[q], batch.distance[q] = i, distance
        batch.normal[q] = sub(zero_of(state), normal)
        batch.point[q] = add_scaled(point, normal, distance)


@inlined
def first_reach(tree, point):
    """Half the size of the first box around the point: it reaches what is there."""
    cell, origin, lowest, highest = tree.finest_cell, tree.origin[0], tree.lowest[0], tree.highest[0]
    reach = FIRST_BOX * cell
    for k in range(len(point)):
        below = item(origin, k) + item(lowest, k) * cell - item(point, k)
        above = item(point, k) - item(origin, k) - item(highest, k) * cell
        reach = max(reach, max(below, above) + FIRST_BOX * cell)
    return reach


@inlined
def covers_all(tree, low, high):
    """Whether the box low..high holds everything that is in cells."""
    cell, origin, lowest, highest = tree.finest_cell, tree.origin[0], tree.lowest[0], tree.highest[0]
    covers = True
    for k in range(len(low)):
        covers &= item(low, k) <= item(origin, k) + item(lowest, k) * cell
        covers &= item(high, k) >= item(origin, k) + item(highest, k) * cell
    return covers


@pasted
def improve_from(state, batch, tree, q):
    """Compare what query q has as its nearest with a tree: first what is too large or too far out for cells, then
    boxes around the point, all levels of each, that grow."""
    point, top = batch.centre[q], tree.levels
    slack = uncertainty(tree, point)
    reach, level = 0.0, top
    while True:
        low, high = point, point
        for k in range(len(point)):
            low = replace(low, k, item(point, k) - reach - item(slack, k))
            high = replace(high, k, item(point, k) + reach + item(slack, k))
        if tree.level_end[level] > tree.level_begin[level]:
            runs = cover(tree, low, high, level)
            parts, wraps = parts_of(tree, level, runs)
            for part in range(parts):
                begin, end = cells_of(tree, level, runs, part, wraps)
                improve(state, batch, tree, q, begin, end, slack)
        if level < top - 1:
            level += 1
            continue
        best = batch.distance[q]
        if level == top:
            if tree.level_begin[top] == 0:  # all are in the top level
                return
            reach = first_reach(tree, point)
        elif best <= reach or covers_all(tree, low, high):
            return
        else:
            reach = best if batch.row[q] >= 0 else 2.0 * reach
        reach = min(reach, max(best, 0.0))
        level = 0


def find_nearest(state, batch, moving, static, first, stop):
    """The nearest surface to the centre of each query: row, id, distance, normal and point; -1, inf and nan if none."""
    nothing = nan_vector(zero_of(state))
    for q in range(first, stop):
        batch.row[q], batch.distance[q] = -1, min(batch.limit[q], ENDLESS)
        batch.normal[q], batch.point[q] = nothing, nothing
        for tree in (moving, static):
            if tree.count > 0:
                improve_from(state, batch, tree, q)
        i = batch.row[q]
        if i < 0:
            batch.entity[q], batch.distance[q] = -1, math.inf
        else:
            batch.entity[q] = state.bodies.entity[i]
    return stop

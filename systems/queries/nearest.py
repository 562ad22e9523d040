"""The nearest surface to a point: boxes around it that grow until nothing outside can be nearer."""

from __future__ import annotations

import math

from ...framework.compilation import inlined, pasted
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, add_scaled, at_most, dot, filled, larger, largest, shifted, sub
from ..bits import lowest_bit
from ..broad_phase.tree.cells import cells_of, cover, parts_of, uncertainty
from ..broad_phase.uniform_grid import LANES, cells_around, frame_of, outline
from ..shapes.query import evaluate_against
from ..shapes.tolerances import ENDLESS
from .candidates import box_at, box_rounding, is_wanted, may_be_near_at, nan_vector, places_of, row_at, to_collider

FIRST_BOX = 0.5  # half the size of the first box, in cells of the finest level; measured: 1 takes longer, as does 0.2


@inlined
def squared_gap(low, high, point, slack):
    """Square of the distance from a point to the box low..high, at most: less the uncertainty of both."""
    gap = larger(sub(larger(sub(low, point), sub(point, high)), slack), filled(point, 0.0))
    return dot(gap, gap)


@pasted
def improve_nearest(state, batch, q, i, gap):
    """Compare what query q has as its nearest with row i, the square of the distance to whose box is ``gap``."""
    point, ids, best, known = batch.centre[q], state.bodies.entity, batch.distance[q], batch.row[q]
    outside = max(best, 0.0)
    if gap <= outside * outside and is_wanted(state, batch, q, i):
        d = to_collider(state, point, i)
        _, depth, normal, _ = evaluate_against(state, batch.query, q, state.bodies.shape[i], i, d)
        distance = -depth
        if distance < best or (distance == best and not (known >= 0 and ids[known] <= ids[i])):
            batch.row[q], batch.distance[q] = i, distance
            batch.normal[q] = sub(zero_of(state), normal)
            batch.point[q] = add_scaled(point, normal, distance)


@inlined
def box_around(point, reach, slack):
    """The box that reaches so far from the point, and its uncertainty farther."""
    return sub(shifted(point, -reach), slack), add(shifted(point, reach), slack)


@inlined
def first_reach(tree, point):
    """Half the size of the first box around the point: it reaches what is there."""
    cell, origin = tree.finest_cell, tree.origin[0]
    below = sub(add_scaled(origin, tree.lowest[0], cell), point)
    above = add_scaled(sub(point, origin), tree.highest[0], -cell)
    return max(largest(larger(below, above)), 0.0) + FIRST_BOX * cell


@inlined
def covers_all(tree, low, high):
    """Whether the box low..high holds everything that is in cells."""
    cell, origin = tree.finest_cell, tree.origin[0]
    lowest, highest = add_scaled(origin, tree.lowest[0], cell), add_scaled(origin, tree.highest[0], cell)
    return at_most(low, lowest) and at_most(highest, high)


@pasted
def improve_from_tree(state, batch, tree, q):
    """Compare what query q has as its nearest with a tree: first what is too large or too far out for cells, then
    boxes around the point, all levels of each, that grow."""
    point, top = batch.centre[q], tree.levels
    slack = uncertainty(tree, point)
    reach, level = 0.0, top
    while True:
        low, high = box_around(point, reach, slack)
        if tree.level_end[level] > tree.level_begin[level]:
            runs = cover(tree, low, high, level)
            parts, wraps = parts_of(tree, level, runs)
            for part in range(parts):
                begin, end = cells_of(tree, level, runs, part, wraps)
                for place in range(begin, end):
                    lower, upper = box_at(tree, place)
                    improve_nearest(state, batch, q, tree.order[place], squared_gap(lower, upper, point, slack))
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


@pasted
def improve_from_grid(state, batch, grid, q):
    """The same with a grid: first what is outside of it, then boxes around the point that grow."""
    point, bodies = batch.centre[q], state.bodies
    lowest, highest = frame_of(grid)
    slack, begin = box_rounding(point, lowest, highest), -1
    reach = max(largest(larger(sub(lowest, point), sub(point, highest))), 0.0) + FIRST_BOX / grid.inverse_cell
    while True:
        reach = min(reach, max(batch.distance[q], 0.0))
        low, high = box_around(point, reach, slack)
        outlined, cells = outline(grid, low, high), cells_around(grid, low, high)
        for n in range(begin, cells[1]):
            first_place, end = places_of(grid, cells, n)
            for start in range(first_place, end, LANES):
                bits = may_be_near_at(grid, n, start, end, outlined)
                while bits != 0:
                    i = row_at(grid, n, start + lowest_bit(bits))
                    bits &= bits - 1
                    improve_nearest(state, batch, q, i, squared_gap(bodies.lower[i], bodies.upper[i], point, slack))
        best = batch.distance[q]
        if best <= reach or (at_most(low, lowest) and at_most(highest, high)):
            return
        reach, begin = (best if batch.row[q] >= 0 else 2.0 * reach), 0


def find_nearest(state, batch, moving, static, first, stop):
    """The nearest surface to the centre of each query: row, id, distance, normal and point; -1, inf and nan if none."""
    nothing = nan_vector(zero_of(state))
    for q in range(first, stop):
        batch.row[q], batch.distance[q] = -1, min(batch.limit[q], ENDLESS)
        batch.normal[q], batch.point[q] = nothing, nothing
        for turn in range(2):
            tree, grid = (moving, state.grid) if turn == 0 else (static, state.static_grid)
            if grid.serves:
                improve_from_grid(state, batch, grid, q)
            if tree.count > 0:
                improve_from_tree(state, batch, tree, q)
        i = batch.row[q]
        if i < 0:
            batch.entity[q], batch.distance[q] = -1, math.inf
        else:
            batch.entity[q] = state.bodies.entity[i]
    return stop

"""Casts: what a ray or a moving shape meets on a straight path, and where.

The path is cut into slices, a few cells long; through a tree, for each level by itself. The level whose next slice
begins first is searched first, and once that is beyond the nearest hit, nothing nearer can come.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, pasted
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, add_scaled, at_most, divided, item, larger, length, replace, smaller, sub
from ..bits import lowest_bit
from ..broad_phase.tree.cells import cells_of, cover, parts_of, uncertainty
from ..broad_phase.uniform_grid import LANES, cells_around, frame_of, outline
from ..shapes.query import query_half_extents
from ..shapes.tolerances import ENDLESS
from .candidates import box_at, box_rounding, is_wanted, may_be_near_at, nan_vector, places_of, row_at
from .first_touch import LAST_STEP, Path, first_touch_of_cast, is_met, touch_in_the_way

SLICE_SLACK = 1.0 + 4.0 * LAST_STEP  # so that bodies at the nearest distance are all tested, in whatever order

SLICE = 3.0  # cells; measured: 2 is as good, 6 is worse
SHORTEST = 2.2250738585072014e-308  # m, the smallest normal number: at a length of 0 the distance is 0 too


# -- the path ------------------------------------------------------------------------------------


@inlined
def inverse_of(direction):
    """1 / direction, per axis; a huge number in place of infinity along an axis on which it does not move."""
    result = direction
    for k in range(len(direction)):
        along = item(direction, k)
        result = replace(result, k, 1.0 / along if abs(along) > 1.0 / ENDLESS else ENDLESS)
    return result


@inlined
def cast_path(state, batch, q, rounding):
    """The path of query q; rounding: what half extents exceed those of the query's shape by."""
    start, direction = batch.centre[q], batch.direction[q]
    half = add(query_half_extents(state, batch.query, q), rounding)
    return Path(start, direction, inverse_of(direction), half)


@inlined
def box_interval(lower, upper, path, reach):
    """(enter, leave) of the path as far as ``reach`` and the box lower..upper; enter > leave if they never meet.

    What has no shape has a box of nan: nothing meets that.
    """
    back, front = sub(path.start, path.half), add(path.start, path.half)
    enter, leave = 0.0, reach if at_most(lower, upper) else -1.0
    for k in range(len(back)):
        one = (item(lower, k) - item(front, k)) * item(path.inverse, k)
        two = (item(upper, k) - item(back, k)) * item(path.inverse, k)
        low, high = (one, two) if one < two else (two, one)
        enter = low if low > enter else enter
        leave = high if high < leave else leave
    return enter, leave


@inlined
def slice_box(path, begin, end):
    """(low, high) of the box around the query's shape on the path from begin to end."""
    one, two = add_scaled(path.start, path.direction, begin), add_scaled(path.start, path.direction, end)
    return sub(smaller(one, two), path.half), add(larger(one, two), path.half)


# -- slices --------------------------------------------------------------------------------------


@inlined
def begin_slices(batch, tree):
    """Note the levels of the tree that hold anything; returns how many."""
    used = 0
    for level in range(tree.levels + 1):
        if tree.level_end[level] > tree.level_begin[level]:
            batch.slice_level[used], batch.slice_begin[used] = level, 0.0
            used += 1
    return used


@inlined
def earliest_slice(batch, used):
    """Which of the levels in use has the next slice that begins first."""
    earliest = 0
    for other in range(1, used):
        if batch.slice_begin[other] < batch.slice_begin[earliest]:
            earliest = other
    return earliest


@inlined
def slice_end(tree, level, begin, enter, leave):
    """Where the slice of a level that begins there ends; enter, leave: where the path crosses the tree's extent."""
    end = math.inf
    if level < tree.levels and begin < leave and enter <= leave:
        end = enter
        if begin >= enter:
            end = min(begin + SLICE / (tree.inverse_cell * tree.level_scale[level]), leave)
        if not end > begin:
            end = leave
    return end


# -- hits ----------------------------------------------------------------------------------------


@inlined
def keep_hit(state, batch, q, i, path, touch):
    """Take row i as what query q meets, unless it has met something before that."""
    distance, normal, point = touch
    ids, place = state.bodies.entity, q
    if distance > batch.search_limit[q]:
        return
    if batch.only_nearest:
        known = batch.row[q]
        if distance == batch.search_limit[q] and known >= 0 and ids[known] <= ids[i]:
            return
        batch.search_limit[q] = distance
    else:
        place = batch.hit_count
        batch.hit_count = place + 1
    batch.row[place], batch.distance[place] = i, distance
    batch.normal[place] = sub(zero_of(state), normal)
    batch.point[place] = add(add_scaled(path.start, path.direction, distance), point)


@pasted
def cast_at(state, batch, q, path, i, box, between):
    """Test row i if the path enters its box in the slice from between[0] to between[1]: each has its turn in one."""
    reach = batch.search_limit[q] * SLICE_SLACK
    enter, leave = box_interval(box[0], box[1], path, batch.limit[q] * SLICE_SLACK)  # whatever it has met before
    if enter <= min(leave, reach) and between[0] <= enter < between[1] and is_wanted(state, batch, q, i):
        touch = first_touch_of_cast(state, batch, q, i, path, leave, reach)
        if batch.against:
            touch = touch_in_the_way(state, batch, q, i, path, leave, reach, touch)
        touches, distance, normal, point = touch
        if touches and is_met(state, batch, q, i, path, distance, normal):
            keep_hit(state, batch, q, i, path, (distance, normal, point))


@pasted
def cast_in_grid(state, batch, grid, q):
    """What query q meets of the bodies in a grid: first of those outside of it, then slice by slice."""
    (lowest, highest), limits = frame_of(grid), batch.search_limit
    path = cast_path(state, batch, q, box_rounding(batch.centre[q], lowest, highest))
    enter, leave = box_interval(lowest, highest, path, math.inf)
    meets, first = enter <= leave and enter <= limits[q] * SLICE_SLACK, -1
    enter, leave = (enter, leave) if meets else (0.0, 0.0)
    begin = enter
    while True:
        reach = limits[q] * SLICE_SLACK
        end = min(begin + SLICE / grid.inverse_cell, leave)
        low, high = slice_box(path, begin, min(end, reach))
        outlined, cells = outline(grid, low, high), cells_around(grid, low, high)
        last = end == leave or not end > begin
        for n in range(first, cells[1] if meets else 0):
            first_place, behind = places_of(grid, cells, n)
            between = (-math.inf if n < 0 or begin == enter else begin, math.inf if n < 0 or last else end)
            for start in range(first_place, behind, LANES):
                bits = may_be_near_at(grid, n, start, behind, outlined)
                while bits != 0:
                    i = row_at(grid, n, start + lowest_bit(bits))
                    bits &= bits - 1
                    cast_at(state, batch, q, path, i, (state.bodies.lower[i], state.bodies.upper[i]), between)
        if last or not end <= limits[q] * SLICE_SLACK:
            return
        begin, first = end, 0


@pasted
def cast_in_tree(state, batch, tree, q):
    """The same of the bodies in a tree; nearly all cells in use lie in its extent."""
    path = cast_path(state, batch, q, uncertainty(tree, batch.centre[q]))
    enter, leave = box_interval(tree.origin[0], add(tree.origin[0], tree.extent[0]), path, math.inf)
    used = begin_slices(batch, tree)
    while used > 0:
        turn = earliest_slice(batch, used)
        level, begin = batch.slice_level[turn], batch.slice_begin[turn]
        reach = batch.search_limit[q] * SLICE_SLACK
        if not begin <= reach:
            break
        end = slice_end(tree, level, begin, enter, leave)
        batch.slice_begin[turn] = end
        low, high = slice_box(path, begin, min(end, reach))
        runs = cover(tree, low, high, level)
        parts, wraps = parts_of(tree, level, runs)
        for part in range(parts):
            first, behind = cells_of(tree, level, runs, part, wraps)
            for place in range(first, behind):
                cast_at(state, batch, q, path, tree.order[place], box_at(tree, place), (begin, end))


# -- batches -------------------------------------------------------------------------------------


@inlined
def begin_cast(state, batch, q):
    """Unit vector and limit of query q (of shapes the length of the way), and nothing found."""
    way = batch.direction[q]
    size = length(way)
    batch.direction[q] = divided(way, size) if size > 0.0 else way
    limit = min(batch.limit[q] if batch.is_ray else size, ENDLESS)
    batch.limit[q] = batch.search_limit[q] = limit
    if batch.only_nearest:
        batch.row[q], batch.entity[q], batch.distance[q], batch.fraction[q] = -1, -1, math.inf, 1.0
        batch.normal[q] = batch.point[q] = nan_vector(zero_of(state))


@inlined
def end_cast(state, batch, q, place):
    """Id and fraction of a hit; of a ray its point, which is more exact than the middle of a contact."""
    i, distance, limit = batch.row[place], batch.distance[place], batch.limit[q]
    if i >= 0:
        batch.entity[place] = state.bodies.entity[i]
        batch.fraction[place] = distance / max(limit, SHORTEST) if limit < ENDLESS else 0.0
        if batch.is_ray:
            batch.point[place] = add_scaled(batch.centre[q], batch.direction[q], distance)


def find_hits(state, batch, moving, static, first, stop):
    """What each query meets first, in its row; or, not ``only_nearest``, all that the only query meets, in any order.

    Returns the number of hits if they are of one query, else that of queries.
    """
    batch.hit_count = 0
    for q in range(first, stop):
        begin_cast(state, batch, q)
        for turn in range(2):
            tree, grid = (moving, state.grid) if turn == 0 else (static, state.static_grid)
            if grid.serves:
                cast_in_grid(state, batch, grid, q)
            if tree.count > 0:
                cast_in_tree(state, batch, tree, q)
    count = stop if batch.only_nearest else batch.hit_count
    for place in range(count):
        end_cast(state, batch, place if batch.only_nearest else 0, place)
    return count

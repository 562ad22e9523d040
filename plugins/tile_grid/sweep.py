"""The time when a moving shape first touches a tile."""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.jit.stack_arrays import stack_array
from ...framework.vectors import add, add_scaled, dot, length, sub
from .cells import BLOCK
from .contact import box_on_map, cells_under, searched
from .faces import plugin
from .rectangles import (
    EMPTY,
    MIXED,
    TIE,
    WAITING,
    contents,
    faces_like,
    grid_of,
    halved,
    load_cells,
    rectangle,
    store_cells,
)
from .shapes import core_of, meet_rectangle

LOOKS = 100  # iterations for the time of a touch; a graze takes about 30
ROUNDING = 4e-16  # of the distance: smaller gaps count as none


@plugin.kernel
def passing(low, high, v, start, stop, enter, leave):
    """The part of the time from ``enter`` to ``leave`` in which low to high, moving by v, overlaps start to stop."""
    if v == 0.0:
        return enter, leave if high >= start and low <= stop else -1.0
    one, two = (start - high) / v, (stop - low) / v
    return max(enter, min(one, two)), min(leave, max(one, two))


@part
def passing_cells(box, v, cells, tile, until):
    """The part of the time until ``until`` in which a box, moving by v, overlaps a rectangle or nearly does."""
    tie = TIE * tile
    enter, leave = passing(box[0], box[1], v[0], cells[0] * tile - tie, cells[2] * tile + tie, 0.0, until)
    return passing(box[2], box[3], v[1], cells[1] * tile - tie, cells[3] * tile + tie, enter, leave)


@part
def first_touch(a, b, d, v, support, rounding):
    """When a moving shape first touches a tile, by testing all rectangles of tiles along its path, nearest first.

    Each is found as between convex shapes: a plane lies in the gap, and motion up to the plane is safe.
    """
    grid, tile = grid_of(a.packed), a.tile_size
    columns, rows = grid[1], grid[2]
    middle = (0.5 * columns * tile, 0.5 * rows * tile)
    at = add(d, middle)
    core, radius = core_of(b, support), rounding(b)
    box = box_on_map(core, radius, at)
    waiting = stack_array(WAITING, (0, 0, 0, 0))
    left, right, lower, upper = min(v[0], 0.0), max(v[0], 0.0), min(v[1], 0.0), max(v[1], 0.0)
    tie = TIE * tile  # as passing_cells has it
    swept = box[0] + left - tie, box[1] + right + tie, box[2] + lower - tie, box[3] + upper + tie
    touched = cells_under(swept, tile, (columns, rows))[1]
    small = max(touched[2] - touched[0], touched[3] - touched[1]) < BLOCK
    store_cells(waiting, 0, searched(touched, 0 if small else BLOCK, (columns, rows)))
    count, best = 1, math.inf
    while count > 0:
        count -= 1
        cells = load_cells(waiting, count)
        enter, leave = passing_cells(box, v, cells, tile, min(best, 1.0))
        if not enter <= leave:
            continue
        inside, found = contents(grid, cells)
        if inside == EMPTY:
            continue
        if found != cells:
            cells = found
            enter, leave = passing_cells(box, v, cells, tile, min(best, 1.0))
            if not enter <= leave:
                continue
        if inside == MIXED:
            count = halved(waiting, count, cells, v[0] < 0.0, v[1] < 0.0)
            continue
        extent, centre = rectangle(cells, tile, middle)
        time = enter
        for look in range(LOOKS):
            way = sub(add_scaled(d, v, time), centre)
            touches, deep, n, _ = meet_rectangle(extent, b, core, radius, way, support, rounding)
            rate = -dot(v, n)
            touches |= -deep <= ROUNDING * length(way) and (look > 0 or rate > 0.0)
            if touches or not rate > 0.0:
                break
            further = time - deep / rate
            if further > min(best, 1.0):
                break
            touches = look == LOOKS - 1 or not further > time
            if touches:
                break
            time = further
        if touches and faces_like(n, a.faces):
            best = min(best, time)
    return best <= 1.0, best

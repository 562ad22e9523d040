"""The time when a moving shape first touches a tile."""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.jit.stack_arrays import stack_array
from ...framework.vectors import add, add_scaled, dot, length, sub
from ..standard_shapes import convex_convex
from .collider import plugin
from .rectangles import (
    TIE,
    WAITING,
    box_around,
    cells_in,
    faces_like,
    halved,
    load_cells,
    rectangle,
    sharp,
    store_cells,
    tile_support,
    tiles_in,
)

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
def first_touch(a, b, d, v, support, rounding):
    """When a moving shape first touches a tile, by testing all rectangles of tiles along its path, nearest first.

    Each is found as between convex shapes: a plane lies in the gap, and motion up to the plane is safe.
    """
    sums, tile = a.sums, a.tile_size
    columns = int(sums[0, 0])
    stride = columns + 1
    rows = (len(sums) - 1) // stride - 1
    middle = (0.5 * columns * tile, 0.5 * rows * tile)
    at = add(d, middle)
    left, right, lower, upper = box_around(b, support, rounding(b))
    left, right, lower, upper = at[0] + left, at[0] + right, at[1] + lower, at[1] + upper
    waiting = stack_array(WAITING, (0, 0, 0, 0))
    store_cells(waiting, 0, (0, 0, columns, rows))
    count, best = 1, math.inf
    tie = TIE * tile
    while count > 0:
        count -= 1
        cells = load_cells(waiting, count)
        inside = tiles_in(sums, stride, cells)
        if inside == 0.0:
            continue
        x0, y0, x1, y1 = cells
        enter, leave = passing(left, right, v[0], x0 * tile - tie, x1 * tile + tie, 0.0, min(best, 1.0))
        enter, leave = passing(lower, upper, v[1], y0 * tile - tie, y1 * tile + tie, enter, leave)
        if not enter <= leave:
            continue
        if inside < cells_in(cells):
            count = halved(waiting, count, cells, v[0] < 0.0, v[1] < 0.0)
            continue
        extent, centre = rectangle(cells, tile, middle)
        time = enter
        for look in range(LOOKS):
            way = sub(add_scaled(d, v, time), centre)
            touches, deep, n, _ = convex_convex(extent, b, way, tile_support, support, sharp, rounding)
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

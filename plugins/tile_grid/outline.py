"""The outline of a map whose tiles are not all full: straight runs of edges, solid on their right.

Everything stands on a lattice of half tiles: a point (X, Y) is X half tiles right of the map's lower left corner and Y
above it. A tile has up to five edges: what its neighbours leave open of its four sides, and the line across its cell.
Edges that go on straight are one run, as far as a given rectangle of cells goes; a run knows the edges before and after
it, so that it meets a shape as the segment of a chain does, and nothing catches where two runs meet. Where tiles touch
at a point only, no gap is between them.

A one-way cell is no tile here. Its upper side goes on from the tile beside it, see :func:`beside_one_way`.
"""

from __future__ import annotations

import collections
import math

from ...framework.compilation import part
from .cells import SHAPE
from .faces import plugin
from .materials import LINES, TileShape
from .surface import code_of

FULL, UPPER_HALF, ONE_WAY = int(TileShape.FULL), int(TileShape.UPPER_HALF), int(TileShape.ONE_WAY)
NO_TILE, SHAPE_BITS = -1, SHAPE.bit_length() - 1
BOTTOM, RIGHT, TOP, LEFT, LINE, EDGES = range(6)
BEYOND, AT, BEFORE = range(3)  # where a run ends: at an inner corner it reaches into what follows
LOWER, UPPER, WHOLE = 1, 2, 3  # halves of a side; of BOTTOM and TOP the left and the right one
SIDES = (  # of each TileShape: which halves of BOTTOM, RIGHT, TOP, LEFT it fills
    (3, 3, 3, 3), (3, 3, 0, 0), (3, 0, 0, 3), (0, 0, 3, 3), (0, 3, 3, 0),
    (3, 1, 0, 0), (3, 3, 0, 1), (3, 1, 0, 3), (3, 0, 0, 1),
    (0, 2, 3, 3), (0, 0, 3, 2), (0, 2, 3, 0), (0, 3, 3, 2),
    (3, 1, 0, 1), (0, 2, 3, 2), (0, 0, 0, 0),
)  # fmt: skip
FILLED = tuple(bottom | right << 2 | top << 4 | left << 6 for bottom, right, top, left in SIDES)
ACROSS = tuple(x0 | y0 << 2 | x1 << 4 | y1 << 6 for x0, y0, x1, y1 in LINES)  # lines; 0: none

# The edges before and after, 0, 0 where there is none. short: it ends AT that corner, or a little BEFORE it, since it
# must not reach bodies that are at another corner of the outline in the same point, or on a one-way cell.
Run = collections.namedtuple("Run", "x0 y0 x1 y1 before_x before_y after_x after_y short_start short_end")


@part
def shape_at(grid, x, y):
    """The shape of a cell; NO_TILE if it is empty or beyond the map."""
    if x < 0 or y < 0 or x >= grid[1] or y >= grid[2]:
        return NO_TILE
    code = code_of(grid, x, y)
    return code >> SHAPE_BITS if code > 0 else NO_TILE


@part
def is_one_way_cell(grid, x, y):
    """Whether it is solid from above only."""
    return shape_at(grid, x, y) == ONE_WAY


@part
def filled_side(grid, x, y, side):
    """Which halves of a side the cell fills."""
    shape = shape_at(grid, x, y)
    return 0 if shape == NO_TILE else (FILLED[shape] >> (2 * side)) & WHOLE


@part
def open_side(grid, x, y, side):
    """Which halves of a side it fills and the cell beside it does not."""
    filled = filled_side(grid, x, y, side)
    if filled == 0:
        return 0
    if side == BOTTOM:
        return filled & ~filled_side(grid, x, y - 1, TOP)
    if side == RIGHT:
        return filled & ~filled_side(grid, x + 1, y, LEFT)
    if side == TOP:
        return filled & ~filled_side(grid, x, y + 1, BOTTOM)
    return filled & ~filled_side(grid, x - 1, y, RIGHT)


@part
def edge_of(grid, x, y, k):
    """(whether there is one, start, end) of edge k of a cell."""
    if k == LINE:
        shape = shape_at(grid, x, y)
        line = 0 if shape == NO_TILE else ACROSS[shape]
        return line != 0, 2 * x + (line & 3), 2 * y + (line >> 2 & 3), 2 * x + (line >> 4 & 3), 2 * y + (line >> 6)
    halves = open_side(grid, x, y, k)
    low, high = 1 if halves == UPPER else 0, 1 if halves == LOWER else 2
    if k == BOTTOM:
        return halves != 0, 2 * x + high, 2 * y, 2 * x + low, 2 * y
    if k == RIGHT:
        return halves != 0, 2 * x + 2, 2 * y + high, 2 * x + 2, 2 * y + low
    if k == TOP:
        return halves != 0, 2 * x + low, 2 * y + 2, 2 * x + high, 2 * y + 2
    return halves != 0, 2 * x, 2 * y + low, 2 * x, 2 * y + high


@plugin.kernel
def turn_of(ux, uy, wx, wy):
    """How far an edge turns from another: to the left from 0 to 2, to the right from 0 to -2."""
    cross, along = ux * wy - uy * wx, ux * wx + uy * wy
    if cross == 0:
        return 0.0 if along > 0 else -2.0
    turn = 1.0 - along / math.sqrt((ux * ux + uy * uy) * (wx * wx + wy * wy))
    return turn if cross > 0 else -turn


@plugin.kernel
def is_on_side(side, x, y):
    """Whether a point of a cell's border, in half tiles from its lower left corner, is on a side; on LINE it may be."""
    if side == BOTTOM:
        return y == 0
    if side == RIGHT:
        return x == 2
    if side == TOP:
        return y == 2
    return side == LINE or x == 0


@part
def joined(grid, x, y, ux, uy, forward):
    """(turn, edge, whether there are several) of the edge that begins at a point where one with direction u ends; or,
    not forward, that ends where one begins. Of several it is the leftmost; a turn below -2: there is none."""
    best, best_x, best_y, count = -3.0, 0, 0, 0
    for cell_x in range((x - 1) >> 1, (x >> 1) + 1):
        for cell_y in range((y - 1) >> 1, (y >> 1) + 1):
            if shape_at(grid, cell_x, cell_y) == NO_TILE:
                continue
            for k in range(EDGES):
                if not is_on_side(k, x - 2 * cell_x, y - 2 * cell_y):
                    continue
                there, x0, y0, x1, y1 = edge_of(grid, cell_x, cell_y, k)
                if not there or (x0 != x or y0 != y if forward else x1 != x or y1 != y):
                    continue
                wx, wy, count = x1 - x0, y1 - y0, count + 1
                turn = turn_of(ux, uy, wx, wy) if forward else turn_of(wx, wy, ux, uy)
                if turn > best:
                    best, best_x, best_y = turn, wx, wy
    return best, best_x, best_y, count > 1


@plugin.kernel
def end_of(turn, pinched):
    """Where a run ends at a corner that is one of several in that point."""
    if not pinched or turn <= 0.0:
        return BEYOND
    return AT if turn <= 1.0 else BEFORE


@plugin.kernel
def on_map(cells, x, y):
    """Whether a point is in a rectangle of cells, or on its border."""
    return 2 * cells[0] <= x <= 2 * cells[2] and 2 * cells[1] <= y <= 2 * cells[3]


@part
def run_from(grid, cells, start, end):
    """(whether it begins here, Run) of the run that an edge is part of, within a rectangle of cells."""
    (x0, y0), (x1, y1) = start, end
    ux, uy = x1 - x0, y1 - y0
    turn, before_x, before_y, pinched = joined(grid, x0, y0, ux, uy, False)
    short_start = end_of(turn, pinched)
    begins = not (turn == 0.0 and on_map(cells, x0 - before_x, y0 - before_y))
    turn, after_x, after_y, pinched = joined(grid, x1, y1, ux, uy, True) if begins else (0.0, 0, 0, False)
    while begins and turn == 0.0 and on_map(cells, x1 + after_x, y1 + after_y):
        x1, y1 = x1 + after_x, y1 + after_y
        turn, after_x, after_y, pinched = joined(grid, x1, y1, ux, uy, True)
    short_end = end_of(turn, pinched)
    return begins, beside_one_way(
        grid, Run(x0, y0, x1, y1, before_x, before_y, after_x, after_y, short_start, short_end)
    )


@part
def beside_one_way(grid, run):
    """A run whose end is beside a one-way cell, at the height of its upper side: there a floor goes on, and a wall is
    shorter by what a body on that cell may have sunk in."""
    x0, y0, x1, y1, before_x, before_y, after_x, after_y, short_start, short_end = run
    ux, uy = x1 - x0, y1 - y0
    if x0 & 1 == 0 and y0 & 1 == 0:
        if ux > 0 and before_x == 0 and before_y > 0 and is_one_way_cell(grid, (x0 >> 1) - 1, (y0 >> 1) - 1):
            before_x, before_y = 2, 0
        elif ux == 0 and uy < 0 and before_x > 0 and is_one_way_cell(grid, x0 >> 1, (y0 >> 1) - 1):
            before_x, before_y, short_start = 0, -1, BEFORE
    if x1 & 1 == 0 and y1 & 1 == 0:
        if ux > 0 and after_x == 0 and after_y < 0 and is_one_way_cell(grid, x1 >> 1, (y1 >> 1) - 1):
            after_x, after_y = 2, 0
        elif ux == 0 and uy > 0 and after_x > 0 and is_one_way_cell(grid, (x1 >> 1) - 1, (y1 >> 1) - 1):
            after_x, after_y, short_end = 0, 1, BEFORE
    return Run(x0, y0, x1, y1, before_x, before_y, after_x, after_y, short_start, short_end)


@part
def one_way_run(grid, cells, x, y):
    """(whether it begins at this cell, Run) of the upper sides of one-way cells, within a rectangle of cells."""
    begins = is_one_way_cell(grid, x, y) and not (x > cells[0] and is_one_way_cell(grid, x - 1, y))
    stop = x
    while begins and stop < cells[2] and is_one_way_cell(grid, stop, y):
        stop += 1
    x0, x1, top = 2 * x, 2 * stop, 2 * y + 2
    before_x, before_y, after_x, after_y = 2, 0, 2, 0
    if not is_one_way_cell(grid, x - 1, y):
        turn, before_x, before_y, _ = joined(grid, x0, top, 2, 0, False)
        if turn <= -2.0 or before_x < 0:
            before_x, before_y = 0, 0
    if not is_one_way_cell(grid, stop, y):
        turn, after_x, after_y, _ = joined(grid, x1, top, 2, 0, True)
        if turn <= -2.0 or after_x < 0:
            after_x, after_y = 0, 0
    return begins, Run(x0, top, x1, top, before_x, before_y, after_x, after_y, BEYOND, BEYOND)


@part
def next_run(grid, cells, one_way, at):
    """(the number of the next edge to look at, whether there is a run, Run): the next run within a rectangle of cells
    from edge number ``at`` on; of one-way cells alone, or of all others."""
    x0, y0, x1, y1 = cells
    width, run = x1 - x0, Run(0, 0, 0, 0, 0, 0, 0, 0, BEYOND, BEYOND)
    count = width * (y1 - y0) * EDGES
    while at < count:
        cell, k = at // EDGES, at % EDGES
        x, y = x0 + cell % width, y0 + cell // width
        shape = shape_at(grid, x, y)
        if shape == NO_TILE or (shape == ONE_WAY) != one_way:
            at = (cell + 1) * EDGES
            continue
        at += 1
        if one_way:
            at = (cell + 1) * EDGES
            begins, run = one_way_run(grid, cells, x, y)
            if begins:
                return at, True, run
        else:
            there, from_x, from_y, to_x, to_y = edge_of(grid, x, y, k)
            if there:
                begins, run = run_from(grid, cells, (from_x, from_y), (to_x, to_y))
                if begins:
                    return at, True, run
    return at, False, run


@part
def any_shaped(grid, cells):
    """Whether some tile in a rectangle is not full."""
    for y in range(cells[1], cells[3]):
        for x in range(cells[0], cells[2]):
            if code_of(grid, x, y) >= SHAPE:
                return True
    return False


@part
def is_inside(grid, tile, place):
    """Whether a place, from the map's lower left corner, is in a tile."""
    if not (0.0 <= place[0] < grid[1] * tile and 0.0 <= place[1] < grid[2] * tile):
        return False
    x, y = int(place[0] / tile), int(place[1] / tile)
    shape = shape_at(grid, x, y)
    if shape < 0 or shape == ONE_WAY:
        return False
    line = ACROSS[shape]
    if line == 0:
        return True
    x0, y0 = 2 * x + (line & 3), 2 * y + (line >> 2 & 3)
    ux, uy = (line >> 4 & 3) - (line & 3), (line >> 6) - (line >> 2 & 3)
    return ux * (2.0 * place[1] / tile - y0) - uy * (2.0 * place[0] / tile - x0) <= 0.0

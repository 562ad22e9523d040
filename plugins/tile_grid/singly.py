"""The deepest or nearest of the tiles of a map, each for itself: what holds where no face of the outline does.

Faces between tiles count as others do, so this is for shapes that are apart from all tiles, or deep in one.
"""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.jit.stack_arrays import stack_array
from ...framework.vectors import add, divided, dot, length, negative, sub
from ...systems.bits import lowest_bit
from ..standard_shapes import convex_convex, sharp
from .cells import BLOCK
from .contact import box_on_map, cells_under, gaps_of_boxes
from .faces import ALL, ONE_WAYS, WALLS, plugin
from .materials import TileShape
from .outline import ACROSS, NO_TILE, ONE_WAY, shape_at
from .rectangles import (
    EMPTY,
    SLANT,
    TIE,
    WAITING,
    bits_of,
    cells_in,
    contents,
    faces_like,
    grid_of,
    halved,
    load_cells,
    rectangle,
    store_cells,
)
from .shapes import core_of, meet_rectangle

CORNERS = 4
FURTHER = 2.0  # the next search goes so many times as far, if nothing was there


def packed_corners(shape: TileShape) -> int:
    """Places of the corners in half tiles, 4 bits each; of a one-way cell the ends of its upper side."""
    corners = shape.corners or ((1.0, 1.0), (0.0, 1.0))
    places = [int(2 * x) | int(2 * y) << 2 for x, y in corners]
    places += places[-1:] * (CORNERS - len(places))
    return sum(place << 4 * k for k, place in enumerate(places))


PLACES = tuple(packed_corners(shape) for shape in TileShape)


@plugin.kernel
def corner_support(tile, direction):
    """The corner of a tile (packed corners, half its side) that is farthest in a direction, from its cell's middle."""
    best, most, places, half = (0.0, 0.0), -math.inf, tile[0], tile[1]
    for _ in range(CORNERS):
        corner = (half * ((places & 3) - 1), half * ((places >> 2 & 3) - 1))
        along = dot(corner, direction)
        if along > most:
            best, most = corner, along
        places >>= 4
    return best


@part
def meet_tile(a, b, shape, d, core, support, rounding):
    """How a shape and a tile meet, d from the middle of the tile's cell to the shape; as a pair."""
    half = 0.5 * a.tile_size
    if shape == 0:
        return meet_rectangle((half, half), b, core, rounding(b), d, support, rounding)
    return convex_convex((PLACES[shape], half), b, d, corner_support, support, sharp, rounding)


@plugin.kernel
def is_face_of(faces, shape, n):
    """Whether a contact of a tile belongs to the selected faces; a slope is with the walls, as a run of the outline."""
    line = ACROSS[shape]
    if faces == ALL or line == 0:
        return faces_like(n, faces)
    ux, uy = (line >> 4 & 3) - (line & 3), (line >> 6) - (line >> 2 & 3)
    if uy != 0 and abs(n[0] * ux + n[1] * uy) <= SLANT:
        return faces == WALLS
    return faces_like(n, faces)


@plugin.kernel
def shape_within(grid, x, y, one_way):
    """The shape of a cell among those that are looked at, one-way cells or all others; else NO_TILE."""
    shape = shape_at(grid, x, y)
    return shape if (shape == ONE_WAY) == one_way else NO_TILE


@part
def gap_over_line(b, shape, d, half, support):
    """How far the core of a shape is, at least, from a tile's line on its open side; d from the middle of its cell."""
    line = ACROSS[shape]
    if line == 0:
        return -math.inf
    x, y = (line & 3) - 1, (line >> 2 & 3) - 1
    way = 1.0 * ((line >> 4 & 3) - 1 - x), 1.0 * ((line >> 6) - 1 - y)
    out = divided((-way[1], way[0]), length(way))
    return dot(out, add(d, support(b, negative(out)))) - half * (out[0] * x + out[1] * y)


@part
def may_be_deeper(box, cells, tile, depth):
    """Whether a shape with that box may overlap a rectangle of cells by more, or be nearer to it."""
    gap_x, gap_y = gaps_of_boxes(box, cells, tile)
    gap = length((gap_x, gap_y)) if gap_x > 0.0 and gap_y > 0.0 else max(gap_x, gap_y)
    return -gap > depth + TIE * tile


@part
def deepest_tile(a, b, d, least, reach, support, rounding):
    """(whether they touch, depth, normal, point) of the tile that a shape overlaps most, or is nearest to; the depth is
    -inf if none is deeper than ``least``, or with another face than those selected. reach: how far it looks first."""
    grid, tile, one_way = grid_of(a.packed), a.tile_size, a.faces == ONE_WAYS
    size, middle = (grid[1], grid[2]), (0.5 * grid[1] * tile, 0.5 * grid[2] * tile)
    core, radius = core_of(b, support), rounding(b)
    at = add(d, middle)
    box = box_on_map(core, radius, at)
    waiting = stack_array(WAITING, (0, 0, 0, 0))
    depth, normal, point, own = least, (0.0, 1.0), d, False
    while True:
        area = cells_under((box[0] - reach, box[1] + reach, box[2] - reach, box[3] + reach), tile, size)[1]
        store_cells(waiting, 0, area)
        count = 1
        while count > 0:
            count -= 1
            block = load_cells(waiting, count)
            if not may_be_deeper(box, block, tile, depth):
                continue
            if max(block[2] - block[0], block[3] - block[1]) > BLOCK:
                inside, block = contents(grid, block)
                if inside != EMPTY:
                    right = at[0] >= 0.5 * (block[0] + block[2]) * tile
                    count = halved(waiting, count, block, right, at[1] >= 0.5 * (block[1] + block[3]) * tile)
                continue
            rows, above = block[3] - block[1], at[1] >= 0.5 * (block[1] + block[3]) * tile
            for row in range(rows):
                y = block[3] - 1 - row if above else block[1] + row
                bits = bits_of(grid, y, block[0], block[2] - block[0])
                while bits != 0:
                    x = block[0] + lowest_bit(bits)
                    bits &= bits - 1
                    cell = (x, y, x + 1, y + 1)
                    if not may_be_deeper(box, cell, tile, depth):
                        continue
                    shape = shape_within(grid, x, y, one_way)
                    if shape == NO_TILE:
                        continue
                    centre = rectangle(cell, tile, middle)[1]
                    away = sub(d, centre)
                    if radius - gap_over_line(b, shape, away, 0.5 * tile, support) <= depth + TIE * tile:
                        continue
                    _, deep, n, p = meet_tile(a, b, shape, away, core, support, rounding)
                    if deep > depth:
                        depth, normal, point = deep, n, add(centre, p)
                        own = one_way or is_face_of(a.faces, shape, n)
        if depth >= -reach or cells_in(area) == size[0] * size[1]:
            return own and depth >= 0.0, depth if own else -math.inf, normal, point
        reach = min(-depth, FURTHER * reach)

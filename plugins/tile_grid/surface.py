"""What a shape touches of a map: the cell, and its material."""

from __future__ import annotations

import math

from ...framework.compilation import part
from .cells import CODE_BITS, CODES_HEAD, CODES_POWER, HEAD, PER_CODE_WORD
from .faces import plugin
from .materials import FRICTION, MOST, OWN, RESTITUTION, RUN_X, RUN_Y, WIDTH
from .rectangles import cell_at, grid_of

INSIDE = 1e-3  # of a tile: how far behind the surface the cell is looked for
BESIDE = 0.5  # the same, to both sides, where there is none


@plugin.kernel
def first_code(grid):
    """The index of the two numbers before the table of materials; that of the sums, if the map has none."""
    return HEAD + grid[2] * grid[3]


@part
def code_of(grid, x, y):
    """The material and shape of a cell of a map that has such; 0 of an empty one."""
    packed, start = grid[0], first_code(grid)
    words = (grid[1] + PER_CODE_WORD - 1) >> CODES_POWER
    at = start + CODES_HEAD + int(packed[start, 0]) * WIDTH + y * words + (x >> CODES_POWER)
    return (int(packed[at, 0]) >> (CODE_BITS * (x & (PER_CODE_WORD - 1)))) & ((1 << CODE_BITS) - 1)


@part
def number_touched(grid, tile, point, normal):
    """The number of the material at a point of the surface, from the map's lower left corner, where the normal leads
    away from the map. On a seam it is that of the tile to the left, or below, and beyond an edge that of the next."""
    x, y = point[0] - INSIDE * tile * normal[0], point[1] - INSIDE * tile * normal[1]
    along = abs(normal[1]) >= abs(normal[0])
    for look in range(4):
        beside = (-INSIDE, INSIDE, -BESIDE, BESIDE)[look] * tile
        column = cell_at((x + (beside if along else 0.0)) / tile, grid[1])
        row = cell_at((y + (0.0 if along else beside)) / tile, grid[2])
        number = code_of(grid, column, row) & MOST
        if number > 0:
            return number
    return 0


@part
def material_touched(a, point, normal):
    """(friction, restitution, surface velocity) of a map where it is touched; nan: as the collider has it."""
    grid, tile = grid_of(a.packed), a.tile_size
    start = first_code(grid)
    if start == grid[4]:
        return math.nan, math.nan, (math.nan, math.nan)
    at = point[0] + 0.5 * grid[1] * tile, point[1] + 0.5 * grid[2] * tile
    number = number_touched(grid, tile, at, normal)
    row = start + CODES_HEAD + (number if number < int(grid[0][start, 0]) else 0) * WIDTH
    packed = grid[0]
    friction = math.nan if packed[row + FRICTION, 0] == OWN else packed[row + FRICTION, 0]
    return friction, packed[row + RESTITUTION, 0], (packed[row + RUN_X, 0], packed[row + RUN_Y, 0])

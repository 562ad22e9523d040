"""The straight part of a map's surface that a shape touches, so that what spins lies on it with both of its corners."""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.vectors import dot, length
from .faces import ONE_WAYS
from .outline import next_run
from .rectangles import SLANT, cell_at, grid_of, is_tile
from .surface import first_code

FOLLOWED = 32  # tiles: how far to both sides the face of full tiles is followed,
AROUND = 2  # and a run of the outline of others
APART = 0.5  # half tiles: how far from a run a point may be that is on it
PARALLEL = 1.0 - 1e-9  # cosine: so nearly a run has the normal of the contact


@part
def has_face_at(grid, cell, step):
    """Whether a cell is a tile, and the next one, a step up, down or aside, is empty or beyond the map."""
    (x, y), (next_x, next_y) = cell, (cell[0] + step[0], cell[1] + step[1])
    if not (0 <= x < grid[1] and 0 <= y < grid[2] and is_tile(grid, x, y)):
        return False
    return not (0 <= next_x < grid[1] and 0 <= next_y < grid[2] and is_tile(grid, next_x, next_y))


@part
def followed(grid, cell, step, along):
    """The number of cells, at most FOLLOWED, by which a face goes on beyond a cell."""
    count, beyond = 0, (cell[0] + along[0], cell[1] + along[1])
    while count < FOLLOWED and has_face_at(grid, beyond, step):
        count, beyond = count + 1, (beyond[0] + along[0], beyond[1] + along[1])
    return count


@part
def face_of_tiles(grid, normal, at):
    """Both ends, counter-clockwise, of the face of full tiles at a place, with a normal along the tiles; else twice the
    place. Places are in tiles, from the map's lower left corner."""
    level, ahead = abs(normal[0]) <= SLANT, 1 if normal[0] + normal[1] > 0.0 else -1
    if not level and abs(normal[1]) > SLANT:
        return at, at
    across, place = (at[1], math.floor(at[0])) if level else (at[0], math.floor(at[1]))
    line = math.floor(across + 0.5)
    inside = line - 1 if ahead > 0 else line
    step, along = ((0, ahead), (1, 0)) if level else ((ahead, 0), (0, 1))
    for look in range(2):  # on a seam, or where a face ends, the cell may be the one before
        cell = (place - look, inside) if level else (inside, place - look)
        if has_face_at(grid, cell, step):
            low = 1.0 * (place - look - followed(grid, cell, step, (-along[0], -along[1])))
            high = 1.0 * (place - look + 1 + followed(grid, cell, step, along))
            one, two = ((low, 1.0 * line), (high, 1.0 * line)) if level else ((1.0 * line, low), (1.0 * line, high))
            return (one, two) if level != (ahead > 0) else (two, one)
    return at, at


@part
def run_at(grid, one_way, normal, at):
    """The same of the nearest run of the outline, whatever its normal."""
    x, y = cell_at(at[0], grid[1]), cell_at(at[1], grid[2])
    cells = max(x - AROUND, 0), max(y - AROUND, 0), min(x + AROUND + 1, grid[1]), min(y + AROUND + 1, grid[2])
    one, two, least, edge, there = at, at, APART, 0, True
    while there:
        edge, there, run = next_run(grid, cells, one_way, edge)
        way, back = (1.0 * (run.x1 - run.x0), 1.0 * (run.y1 - run.y0)), (2.0 * at[0] - run.x0, 2.0 * at[1] - run.y0)
        size, outward = length(way), (-way[1], way[0])
        along, away = dot(way, back), abs(dot(outward, back))
        if not there or dot(outward, normal) <= PARALLEL * size or not away < least * size:
            continue
        if -APART * size <= along <= (size + APART) * size:
            least, one, two = away / size, (0.5 * run.x1, 0.5 * run.y1), (0.5 * run.x0, 0.5 * run.y0)
    return one, two


@part
def face_touched(a, normal, point):
    """Both ends, counter-clockwise, of the straight part of a map's surface at a point, with this normal; twice the
    point if there is none."""
    grid, tile = grid_of(a.packed), a.tile_size
    half_x, half_y = 0.5 * grid[1], 0.5 * grid[2]
    at = point[0] / tile + half_x, point[1] / tile + half_y
    if first_code(grid) == grid[4]:
        one, two = face_of_tiles(grid, normal, at)
    else:
        one, two = run_at(grid, a.faces == ONE_WAYS, normal, at)
    return (tile * (one[0] - half_x), tile * (one[1] - half_y)), (tile * (two[0] - half_x), tile * (two[1] - half_y))

"""The straight part of a map's surface that a shape touches, so that what spins lies on it with both of its corners."""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.vectors import dot, length
from .faces import ONE_WAYS
from .outline import EDGES, TOP, edge_of, is_one_way_cell, joined
from .rectangles import SLANT, cell_at, grid_of, is_tile
from .surface import first_code

FOLLOWED = 32  # tiles: how far to both sides the face of full tiles is followed,
AROUND = 3  # edges, likewise, of the outline of others
APART = 0.5  # half tiles: how far from an edge a point may be that is on it
PARALLEL = 1.0 - 1e-9  # cosine: so nearly an edge has the normal of the contact


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
def goes_on(grid, one_way, at, way, forward):
    """(whether the outline goes straight on at the end of an edge, or before its start, the way of what is there)."""
    x, y = at
    if one_way:
        return is_one_way_cell(grid, (x >> 1) - (0 if forward else 1), (y >> 1) - 1), 2, 0
    turn, ux, uy, _ = joined(grid, x, y, way[0], way[1], forward)
    return turn == 0.0, ux, uy


@part
def straight_through(grid, one_way, start, end):
    """Both ends, the other way round, of what is straight of the outline through an edge, at most AROUND edges more at
    either of them; places in tiles."""
    (x0, y0), (x1, y1) = start, end
    way = x1 - x0, y1 - y0
    for _ in range(AROUND):
        on, ux, uy = goes_on(grid, one_way, (x1, y1), way, True)
        x1, y1 = x1 + (ux if on else 0), y1 + (uy if on else 0)
        before, ux, uy = goes_on(grid, one_way, (x0, y0), way, False)
        x0, y0 = x0 - (ux if before else 0), y0 - (uy if before else 0)
    return (0.5 * x1, 0.5 * y1), (0.5 * x0, 0.5 * y0)


@part
def edge_at(grid, one_way, normal, at):
    """The same of the nearest edge of the outline, whatever its normal."""
    x, y = cell_at(at[0], grid[1]), cell_at(at[1], grid[2])
    found, least, start, end = False, APART, (0, 0), (0, 0)
    for cell_x in range(x - 1, x + 2):
        for cell_y in range(y - 1, y + 2):
            for k in range(EDGES):
                there, x0, y0, x1, y1 = edge_of(grid, cell_x, cell_y, k)
                if one_way:
                    there, x0, y0 = k == TOP and is_one_way_cell(grid, cell_x, cell_y), 2 * cell_x, 2 * cell_y + 2
                    x1, y1 = x0 + 2, y0
                if not there:
                    continue
                way, back = (1.0 * (x1 - x0), 1.0 * (y1 - y0)), (2.0 * at[0] - x0, 2.0 * at[1] - y0)
                size, outward, along = length(way), (-way[1], way[0]), dot(way, back)
                away = abs(dot(outward, back)) / size
                beside = abs(along - 0.5 * size * size) > (0.5 * size + APART) * size
                if dot(outward, normal) > PARALLEL * size and away < least and not beside:
                    found, least, start, end = True, away, (x0, y0), (x1, y1)
    return straight_through(grid, one_way, start, end) if found else (at, at)


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
        one, two = edge_at(grid, a.faces == ONE_WAYS, normal, at)
    return (tile * (one[0] - half_x), tile * (one[1] - half_y)), (tile * (two[0] - half_x), tile * (two[1] - half_y))

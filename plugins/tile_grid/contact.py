"""The deepest contact of a shape with a map of tiles.

Faces of a rectangle that border on other tiles are internal. Contacts with them are ignored, unless the shape is so
deep inside that it meets no other faces.
"""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.jit.stack_arrays import stack_array
from ...framework.vectors import add, divided, length, sub
from .cells import BLOCK
from .faces import ALL, WALLS
from .rectangles import (
    EMPTY,
    MIXED,
    SLANT,
    TIE,
    WAITING,
    cell_at,
    cells_in,
    contents,
    faces_like,
    gaps,
    grid_of,
    grown_within,
    grows_further,
    halved,
    has_tiles,
    hidden,
    load_cells,
    rectangle,
    store_cells,
)
from .shapes import core_of, meet_rectangle

DEEP = 16  # tiles: rectangles extend at most this far beyond a shape, so depth inside solid rock is exact up to it
SEEN = 8  # recent rectangles that are not tested again


@part
def box_on_map(core, radius, at):
    """The box around the shape: left, right, lower, upper end relative to the map's lower left corner."""
    left, right, lower, upper = core[0] - radius, core[1] + radius, core[2] - radius, core[3] + radius
    return at[0] + left, at[0] + right, at[1] + lower, at[1] + upper


@part
def cells_under(box, tile, size):
    """First column and row, last column and row under a box; and the rectangle of cells that it touches.

    A shape that ends exactly where a cell begins touches that cell and the one before.
    """
    left, right, lower, upper = box
    first_column, last_column = cell_at(left / tile, size[0]), cell_at(right / tile, size[0])
    first_row, last_row = cell_at(lower / tile, size[1]), cell_at(upper / tile, size[1])
    x0, y0 = first_column, first_row
    if x0 > 0 and left <= x0 * tile:
        x0 -= 1
    if y0 > 0 and lower <= y0 * tile:
        y0 -= 1
    return (first_column, first_row, last_column, last_row), (x0, y0, last_column + 1, last_row + 1)


@part
def around(cells, ring, size):
    """The rectangle with so many more cells on each side, as far as the map goes."""
    x0, y0, x1, y1 = cells
    return max(x0 - ring, 0), max(y0 - ring, 0), min(x1 + ring, size[0]), min(y1 + ring, size[1])


@part
def searched(cells, ring, size):
    """The area to search: whole blocks where it is large."""
    x0, y0, x1, y1 = around(cells, ring, size)
    if ring < BLOCK:
        return x0, y0, x1, y1
    x1, y1 = min((x1 + BLOCK - 1) & -BLOCK, size[0]), min((y1 + BLOCK - 1) & -BLOCK, size[1])
    return x0 & -BLOCK, y0 & -BLOCK, x1, y1


@part
def ring_with_tiles(grid, ring, touched, size):
    """By how many cells more to enlarge the area around a shape until it contains tiles; -1: there are none."""
    if ring == 0:  # most are near tiles, or far from all
        return 1
    if not has_tiles(grid, searched(touched, BLOCK, size)):
        ring = BLOCK
    while True:
        cells = searched(touched, ring, size)
        if has_tiles(grid, cells):
            return ring
        if cells_in(cells) == size[0] * size[1]:
            return -1
        ring = 2 * ring + 1 if 2 * ring + 1 < BLOCK - 1 else max(BLOCK, 2 * ring)


@part
def ring_to_search(ring, nearest, inner_depth, faces, tile, size):
    """By how many cells the searched area must be enlarged to contain the nearest face.

    A shape may be farther from a near tile than its box is; then another tile may be nearer.
    """
    need = ring if nearest <= 0.0 else int(min(nearest / tile, 1.0 * size[0] + size[1])) + 1
    if inner_depth > 0.0 and nearest == math.inf:
        need = ring  # deep inside
    if faces != ALL:
        need = max(need, 1)  # floors may be nearer than the requested walls, or the reverse
    return need


@part
def contains_cells(seen, count, cells):
    """True if one of the first ``count`` stored rectangles is this one."""
    k = 0
    while k < count and load_cells(seen, k) != cells:
        k += 1
    return k < count


@part
def gaps_of_boxes(box, cells, tile):
    """How far a box is from a rectangle along x and y (negative: overlap)."""
    gap_left, gap_right = gaps(box[0], box[1], cells[0], cells[2], tile)
    gap_lower, gap_upper = gaps(box[2], box[3], cells[1], cells[3], tile)
    return max(gap_left, gap_right), max(gap_lower, gap_upper)


@part
def is_farther(box, cells, tile, square):
    """True if a rectangle is farther away from a box than the root of ``square``."""
    gap_x, gap_y = gaps_of_boxes(box, cells, tile)
    apart_x, apart_y = max(gap_x, 0.0), max(gap_y, 0.0)
    return apart_x * apart_x + apart_y * apart_y > square


@part
def width_above_face(box, cells, n, tile):
    """How much of a box is above the face of a rectangle that has the normal n."""
    if abs(n[0]) > abs(n[1]):
        return min(box[3], cells[3] * tile) - max(box[2], cells[1] * tile)
    return min(box[1], cells[2] * tile) - max(box[0], cells[0] * tile)


@part
def deepest_contact(a, b, d, support, rounding):
    """The contact with the rectangle of tiles that the shape overlaps most, or is nearest to."""
    grid, tile = grid_of(a.packed), a.tile_size
    columns, rows = grid[1], grid[2]
    size, middle = (columns, rows), (0.5 * columns * tile, 0.5 * rows * tile)
    at = add(d, middle)
    core, radius = core_of(b, support), rounding(b)
    box = box_on_map(core, radius, at)
    under, touched = cells_under(box, tile, size)
    # How far rectangles may grow beyond the shape: cut ends must never be the nearest way out.
    beyond = DEEP + max(touched[2] - touched[0], touched[3] - touched[1]) - 1
    limits = around(touched, beyond, size)
    waiting, seen = stack_array(WAITING, (0, 0, 0, 0)), stack_array(SEEN, (0, 0, 0, 0))
    ring, count, tested = 0, 1, 0
    store_cells(waiting, 0, touched)
    hit, depth, normal, point, width = False, -math.inf, (0.0, 1.0), (0.0, 0.0), 0.0
    # The deepest wall and floor (ceiling) contacts: signed depth along their axis.
    wall, floor = 0.0, 0.0
    # The deepest internal face, for a shape so far inside that it meets no other faces.
    inner_depth, inner_normal, inner_point = -math.inf, (0.0, 1.0), (0.0, 0.0)
    nearest = math.inf  # distance of the nearest face of any kind
    nearest_square = math.inf  # squared limit of the distance between boxes
    tie = TIE * tile
    while True:
        if count == 0:
            if tested == 0:
                need = ring_with_tiles(grid, ring, touched, size)
            else:
                need = ring_to_search(ring, nearest, inner_depth, a.faces, tile, size)
            if need <= ring:
                break
            ring, count = need, 1
            store_cells(waiting, 0, searched(touched, ring, size))
        count -= 1
        block = load_cells(waiting, count)
        if is_farther(box, block, tile, nearest_square):
            continue
        inside, block = contents(grid, block)
        if inside == EMPTY or is_farther(box, block, tile, nearest_square):
            continue
        if inside == MIXED:
            across, up = at[0] >= 0.5 * (block[0] + block[2]) * tile, at[1] >= 0.5 * (block[1] + block[3]) * tile
            count = halved(waiting, count, block, across, up)
            continue
        cells = block
        for turn in range(2):
            if turn == 1 and not grows_further(grid, block, cells, limits):
                continue  # to the same
            cells = grown_within(grid, block, limits, turn == 0)
            if contains_cells(seen, min(tested, SEEN), cells):
                continue
            store_cells(seen, tested % SEEN, cells)
            tested += 1
            gap_x, gap_y = gaps_of_boxes(box, cells, tile)
            if -max(gap_x, gap_y) < min(depth, 0.0) - tie:  # the depth is at most the overlap of the boxes
                continue
            extent, centre = rectangle(cells, tile, middle)
            touches, deep, n, p = meet_rectangle(extent, b, core, radius, sub(d, centre), support, rounding)
            if hidden(grid, cells, n, under):
                if deep > inner_depth:
                    inner_depth, inner_normal, inner_point = deep, n, add(centre, p)
                continue
            nearest = min(nearest, -deep)
            reach = max(nearest, 0.0 if a.faces == ALL else tile) * (1.0 + 1e-9)  # search distance
            nearest_square = reach * reach
            if not faces_like(n, a.faces):
                continue
            if deep > abs(wall) and abs(n[1]) <= SLANT:
                wall = deep if n[0] > 0.0 else -deep
            elif deep > abs(floor) and abs(n[0]) <= SLANT:
                floor = deep if n[1] > 0.0 else -deep
            # Of two equally deep contacts take the one with more of the shape above the face.
            along = width_above_face(box, cells, n, tile)
            if deep > depth + tie or (deep >= depth - tie and along > width):
                hit, depth, normal, point, width = touches, deep, n, add(centre, p), along
    if nearest > 0.0 and inner_depth > 0.0 and a.faces != WALLS:
        return True, inner_depth, inner_normal, inner_point
    if wall != 0.0 and floor != 0.0:  # in a corner: combine both into one contact
        depth = length((wall, floor))
        normal = divided((wall, floor), depth)
    return hit, depth, normal, point

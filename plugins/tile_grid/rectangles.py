"""Rectangles of cells: (x0, y0, x1, y1) stands for columns x0 to x1, rows y0 to y1 (from below), with exclusive ends.

Counting their tiles, growing them, and their shapes.
"""

from __future__ import annotations

from ...framework.compilation import part
from .collider import ALL, FLOORS, plugin

WAITING = 64  # capacity of the stack of blocks to search: two for each halving of the map
SLANT = 1e-9  # radians; faces that lean by less count as parallel to the tiles
TIE = 1e-9  # of a tile: contacts whose depths differ by less count as equally deep


@plugin.kernel
def load_cells(stored, i):
    """The rectangle in a row of an array."""
    return stored[i, 0], stored[i, 1], stored[i, 2], stored[i, 3]


@plugin.kernel
def store_cells(stored, i, cells):
    """Store a rectangle in a row of an array."""
    stored[i, 0], stored[i, 1], stored[i, 2], stored[i, 3] = cells


@plugin.kernel
def tiles_in(sums, stride, cells):
    """The number of tiles in a rectangle."""
    x0, y0, x1, y1 = cells
    low, high = 1 + y0 * stride, 1 + y1 * stride
    return (sums[high + x1, 0] - sums[high + x0, 0]) - (sums[low + x1, 0] - sums[low + x0, 0])


@plugin.kernel
def cells_in(cells):
    """The number of its cells."""
    return (cells[2] - cells[0]) * (cells[3] - cells[1])


@plugin.kernel
def full(sums, stride, cells):
    """True if all its cells are tiles."""
    return tiles_in(sums, stride, cells) == cells_in(cells)


@plugin.kernel
def moved_side(cells, side, way):
    """The rectangle with its side (left, right, lower, upper) moved outwards."""
    x0, y0, x1, y1 = cells
    if side == 0:
        return x0 - way, y0, x1, y1
    if side == 1:
        return x0, y0, x1 + way, y1
    if side == 2:
        return x0, y0 - way, x1, y1
    return x0, y0, x1, y1 + way


@part
def grown(sums, stride, cells, side, room):
    """A rectangle full of tiles with one side moved outwards, by at most ``room``, as far as it stays full."""
    low, high = 0, max(room, 0)
    step = high  # most often it can grow by all or by nothing
    while low < high:
        if full(sums, stride, moved_side(cells, side, step)):
            low = step
        else:
            high = step - 1
        step = 1 if low == 0 and step == max(room, 0) else (low + high + 1) // 2
    return moved_side(cells, side, low)


@plugin.kernel
def cell_at(way, count):
    """The cell of a coordinate, in tiles from the map's edge; the edge cell for one outside the map, or NaN."""
    if not way > 0.0:
        return 0
    if way >= count:
        return count - 1
    return int(way)


@plugin.kernel
def gaps(low, high, first, last, tile):
    """Distance, in metres, of the interval low to high from cells first to last, on both sides (negative: inside)."""
    return low - last * tile, first * tile - high


@plugin.kernel
def tile_support(half, direction):
    """A corner of a rectangle."""
    return (half[0] if direction[0] >= 0.0 else -half[0], half[1] if direction[1] >= 0.0 else -half[1])


@plugin.kernel
def sharp(half):
    return 0.0


@plugin.kernel
def halved(waiting, count, cells, right_first, upper_first):
    """Push both halves of a rectangle, cut across its longer side, at index ``count``; the first one goes on top."""
    x0, y0, x1, y1 = cells
    cut_x, cut_y = x1, y1  # of the left or lower half
    if x1 - x0 >= y1 - y0:
        cut_x = (x0 + x1) // 2
        second_first = right_first
    else:
        cut_y = (y0 + y1) // 2
        second_first = upper_first
    for turn in range(2):
        if (turn == 1) == second_first:
            waiting[count, 0] = cut_x if cut_x < x1 else x0
            waiting[count, 1] = cut_y if cut_y < y1 else y0
            waiting[count, 2], waiting[count, 3] = x1, y1
        else:
            waiting[count, 0], waiting[count, 1], waiting[count, 2], waiting[count, 3] = x0, y0, cut_x, cut_y
        count += 1
    return count


@plugin.kernel
def box_around(b, support, around):
    """Left, right, lower and upper end of a shape, relative to its centre."""
    left, right = support(b, (-1.0, 0.0))[0] - around, support(b, (1.0, 0.0))[0] + around
    return left, right, support(b, (0.0, -1.0))[1] - around, support(b, (0.0, 1.0))[1] + around


@plugin.kernel
def rectangle(cells, tile, middle):
    """Its half extents, and its centre relative to that of the map."""
    x0, y0, x1, y1 = cells
    extent = (0.5 * (x1 - x0) * tile, 0.5 * (y1 - y0) * tile)
    return extent, (0.5 * (x0 + x1) * tile - middle[0], 0.5 * (y0 + y1) * tile - middle[1])


@plugin.kernel
def faces_like(n, faces):
    """True if a contact with that normal belongs to the selected faces."""
    return faces == ALL or (abs(n[1]) >= abs(n[0])) == (faces == FLOORS)


@plugin.kernel
def solid(sums, stride, cells):
    """True if the cells are all tiles; there are none beyond the map."""
    x0, y0, x1, y1 = cells
    if x0 < 0 or y0 < 0 or x1 >= stride or 1 + (y1 + 1) * stride > len(sums):
        return False
    return full(sums, stride, cells)


@part
def hidden(sums, stride, cells, n, under):
    """True if the face or corner where a shape meets a rectangle is internal: it borders on other tiles.

    n: the contact's normal; under: first column and row, last column and row under the shape's box.
    """
    x0, y0, x1, y1 = cells
    column0, row0, column1, row1 = under
    beside = x1 if n[0] > 0.0 else x0 - 1
    above = y1 if n[1] > 0.0 else y0 - 1
    if abs(n[0]) > SLANT and abs(n[1]) > SLANT:
        x, y = x1 - 1 if n[0] > 0.0 else x0, y1 - 1 if n[1] > 0.0 else y0
        side = solid(sums, stride, (beside, y, beside + 1, y + 1))
        return side or solid(sums, stride, (x, above, x + 1, above + 1))
    if abs(n[0]) > SLANT:
        first, last = min(max(row0, y0), y1 - 1), min(max(row1, y0), y1 - 1)
        return solid(sums, stride, (beside, first, beside + 1, last + 1))
    first, last = min(max(column0, x0), x1 - 1), min(max(column1, x0), x1 - 1)
    return solid(sums, stride, (first, above, last + 1, above + 1))

"""Rectangles of cells: (x0, y0, x1, y1) stands for columns x0 to x1, rows y0 to y1 (from below), with exclusive ends.

Whether they are full of tiles or empty, growing them, and their shapes. Small ones are read by the bits of their rows,
large ones by the sums over blocks; see :mod:`.cells` for both.
"""

from __future__ import annotations

from ...framework.compilation import part
from ...systems.bits import highest_bit, lowest_bit
from .cells import BITS, BLOCK, HEAD, PER_BLOCK, PER_NUMBER
from .faces import ALL, FLOORS, plugin

EMPTY, MIXED, FULL = range(3)
ALL_BITS = 2**BITS - 1
MOST_BITS = 62  # read at once
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
def grid_of(packed):
    """A map as the functions here take it: its array, columns and rows of cells, numbers in a row of bits, the index of
    the first sum over blocks, and numbers in a row of these."""
    columns, rows = int(packed[0, 0]), int(packed[1, 0])
    words, width = (columns + BITS - 1) >> PER_NUMBER, ((columns + BLOCK - 1) >> PER_BLOCK) + 1
    sums = width * (((rows + BLOCK - 1) >> PER_BLOCK) + 1)
    return packed, columns, rows, words, len(packed) - sums, width


@plugin.kernel
def is_tile(grid, x, y):
    """Whether that cell is a tile."""
    return (int(grid[0][HEAD + y * grid[3] + (x >> PER_NUMBER), 0]) >> (x & (BITS - 1))) & 1 == 1


@plugin.kernel
def row_is(grid, y, x0, x1, tiles):
    """Whether columns x0 to x1 of a row, one at least, are all tiles, or all empty."""
    packed, at, flip = grid[0], HEAD + y * grid[3], 0 if tiles else ALL_BITS
    first, last = at + (x0 >> PER_NUMBER), at + ((x1 - 1) >> PER_NUMBER)
    low, high = ALL_BITS << (x0 & (BITS - 1)) & ALL_BITS, ALL_BITS >> (-x1 & (BITS - 1))
    if first == last:
        low &= high
        return (int(packed[first, 0]) ^ flip) & low == low
    if (int(packed[first, 0]) ^ flip) & low != low or (int(packed[last, 0]) ^ flip) & high != high:
        return False
    k = first + 1
    while k < last and int(packed[k, 0]) ^ flip == ALL_BITS:
        k += 1
    return k == last


@part
def alike(grid, cells, tiles):
    """Whether all cells of a rectangle are tiles, or all empty."""
    y = cells[1]
    while y < cells[3] and row_is(grid, y, cells[0], cells[2], tiles):
        y += 1
    return y >= cells[3]


@plugin.kernel
def tiles_in_blocks(grid, x0, y0, x1, y1):
    """The number of tiles in columns x0 to x1 and rows y0 to y1 of blocks."""
    packed, low, high = grid[0], grid[4] + y0 * grid[5], grid[4] + y1 * grid[5]
    return (packed[high + x1, 0] - packed[high + x0, 0]) - (packed[low + x1, 0] - packed[low + x0, 0])


@plugin.kernel
def cells_in(cells):
    """The number of its cells."""
    return (cells[2] - cells[0]) * (cells[3] - cells[1])


@part
def contents_by_blocks(grid, cells):
    """Like :func:`contents`, for large rectangles: the blocks in it and around it, and strips along its sides."""
    x0, y0, x1, y1 = cells
    columns, rows = grid[1], grid[2]
    left, lower = x0 >> PER_BLOCK, y0 >> PER_BLOCK
    right, upper = (x1 + BLOCK - 1) >> PER_BLOCK, (y1 + BLOCK - 1) >> PER_BLOCK
    count = tiles_in_blocks(grid, left, lower, right, upper)
    if count == 0.0:
        return EMPTY
    around = left * BLOCK, lower * BLOCK, min(right * BLOCK, columns), min(upper * BLOCK, rows)
    if count == cells_in(around):
        return FULL
    if around == cells:
        return MIXED
    left, lower = (x0 + BLOCK - 1) >> PER_BLOCK, (y0 + BLOCK - 1) >> PER_BLOCK
    right, upper = right if x1 == columns else x1 >> PER_BLOCK, upper if y1 == rows else y1 >> PER_BLOCK
    if left >= right or lower >= upper:
        tiles = is_tile(grid, x0, y0)
        return (FULL if tiles else EMPTY) if alike(grid, cells, tiles) else MIXED
    count = tiles_in_blocks(grid, left, lower, right, upper)
    within = left * BLOCK, lower * BLOCK, min(right * BLOCK, columns), min(upper * BLOCK, rows)
    if count > 0.0 and count < cells_in(within):
        return MIXED
    tiles, i0, j0, i1, j1 = count > 0.0, within[0], within[1], within[2], within[3]
    same = alike(grid, (x0, y0, x1, j0), tiles) and alike(grid, (x0, j1, x1, y1), tiles)
    same = same and (x0 == i0 or alike(grid, (x0, j0, i0, j1), tiles))
    same = same and (x1 == i1 or alike(grid, (i1, j0, x1, j1), tiles))
    return (FULL if tiles else EMPTY) if same else MIXED


@plugin.kernel
def has_tiles(grid, cells):
    """Whether the rectangle has any."""
    if cells_in(cells) > BLOCK * BLOCK:
        return contents_by_blocks(grid, cells) != EMPTY
    return not alike(grid, cells, False)


@plugin.kernel
def bits_of(grid, y, x0, count):
    """The bits of ``count`` columns of a row, at most MOST_BITS, from column x0 on."""
    packed, at, shift = grid[0], HEAD + y * grid[3] + (x0 >> PER_NUMBER), x0 & (BITS - 1)
    bits, known = int(packed[at, 0]) >> shift, BITS - shift
    while known < count:
        at += 1
        bits |= int(packed[at, 0]) << known
        known += BITS
    return bits & ((1 << count) - 1)


@part
def contents(grid, cells):
    """Whether a rectangle is EMPTY, FULL of tiles or MIXED, and the rectangle: a small one without empty rows and
    columns at its sides."""
    x0, y0, x1, y1 = cells
    if x1 - x0 > BLOCK or y1 - y0 > BLOCK:
        return contents_by_blocks(grid, cells), cells
    some, every, rows, lower, upper = 0, -1, 0, y1, y1
    for y in range(y0, y1):
        bits = bits_of(grid, y, x0, x1 - x0)
        if bits != 0:
            some, every = some | bits, every & bits
            rows, lower, upper = rows + 1, min(lower, y), y + 1
    if some == 0:
        return EMPTY, (x0, y1, x0, y1)
    first, last = lowest_bit(some), highest_bit(some)
    full = every == (2 << last) - (1 << first) and rows == upper - lower
    return FULL if full else MIXED, (x0 + first, lower, x0 + last + 1, upper)


@part
def full_rows(grid, cells, way, room):
    """How many rows above a rectangle (way 1) or below it (-1) are full of tiles, at most ``room``."""
    x0, y0, x1, y1 = cells
    y, count = y1 if way > 0 else y0 - 1, 0
    while count < room and row_is(grid, y, x0, x1, True):
        y += way
        count += 1
    return count


@part
def full_columns(grid, cells, way, room):
    """How many columns right of a rectangle (way 1) or left of it (-1) are full of tiles, at most ``room``."""
    x0, y0, x1, y1 = cells
    count = 0
    while count < room:
        some = min(room - count, MOST_BITS)
        start = x1 + count if way > 0 else x0 - count - some
        gaps = 0
        for y in range(y0, y1):
            gaps |= bits_of(grid, y, start, some) ^ ((1 << some) - 1)
        if gaps != 0:
            return count + (lowest_bit(gaps) if way > 0 else some - 1 - highest_bit(gaps))
        count += some
    return count


@part
def grown_within(grid, cells, limits, wide_first):
    """A rectangle full of tiles, grown within limits: first in width, then in height; or the other way round."""
    x0, y0, x1, y1 = cells
    for turn in range(2):
        if (turn == 0) == wide_first:
            left, right = full_columns(grid, cells, -1, x0 - limits[0]), full_columns(grid, cells, 1, limits[2] - x1)
            x0, x1 = x0 - left, x1 + right
        else:
            lower, upper = full_rows(grid, cells, -1, y0 - limits[1]), full_rows(grid, cells, 1, limits[3] - y1)
            y0, y1 = y0 - lower, y1 + upper
        cells = x0, y0, x1, y1
    return cells


@part
def grows_further(grid, block, cells, limits):
    """Whether a block grows higher, within limits, than what it has grown to, first in width: ``cells``."""
    x0, _, x1, _ = block
    below, above = cells[1] - 1, cells[3]
    return (below >= limits[1] and row_is(grid, below, x0, x1, True)) or (
        above < limits[3] and row_is(grid, above, x0, x1, True)
    )


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
def halved(waiting, count, cells, right_first, upper_first):
    """Push both halves of a rectangle, cut across its longer side, at index ``count``; the first one goes on top.

    Large ones are cut between blocks.
    """
    x0, y0, x1, y1 = cells
    cut_x, cut_y = x1, y1  # of the left or lower half
    unit = -BLOCK if max(x1 - x0, y1 - y0) > 2 * BLOCK else -1
    if x1 - x0 >= y1 - y0:
        cut_x = ((x0 + x1) >> 1) & unit
        second_first = right_first
    else:
        cut_y = ((y0 + y1) >> 1) & unit
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
def rectangle(cells, tile, middle):
    """Its half extents, and its centre relative to that of the map."""
    x0, y0, x1, y1 = cells
    extent = (0.5 * (x1 - x0) * tile, 0.5 * (y1 - y0) * tile)
    return extent, (0.5 * (x0 + x1) * tile - middle[0], 0.5 * (y0 + y1) * tile - middle[1])


@plugin.kernel
def faces_like(n, faces):
    """True if a contact with that normal belongs to the selected faces."""
    return faces == ALL or (abs(n[1]) >= abs(n[0])) == (faces == FLOORS)


@part
def solid(grid, cells):
    """True if the cells are all tiles; there are none beyond the map."""
    x0, y0, x1, y1 = cells
    if x0 < 0 or y0 < 0 or x1 > grid[1] or y1 > grid[2]:
        return False
    return alike(grid, cells, True)


@part
def hidden(grid, cells, n, under):
    """True if the face or corner where a shape meets a rectangle is internal: it borders on other tiles.

    n: the contact's normal; under: first column and row, last column and row under the shape's box.
    """
    x0, y0, x1, y1 = cells
    column0, row0, column1, row1 = under
    next_to = x1 if n[0] > 0.0 else x0 - 1
    above = y1 if n[1] > 0.0 else y0 - 1
    if abs(n[0]) > SLANT and abs(n[1]) > SLANT:
        x, y = x1 - 1 if n[0] > 0.0 else x0, y1 - 1 if n[1] > 0.0 else y0
        side = solid(grid, (next_to, y, next_to + 1, y + 1))
        return side or solid(grid, (x, above, x + 1, above + 1))
    if abs(n[0]) > SLANT:
        first, last = min(max(row0, y0), y1 - 1), min(max(row1, y0), y1 - 1)
        return solid(grid, (next_to, first, next_to + 1, last + 1))
    first, last = min(max(column0, x0), x1 - 1), min(max(column1, x0), x1 - 1)
    return solid(grid, (first, above, last + 1, above + 1))

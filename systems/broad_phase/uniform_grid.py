"""A uniform grid for boxes of about one size, spread about evenly: what most scenes consist of, and twice as fast there
as the tree of :mod:`.tree`, which serves all others.

Cells are at least as large as the largest box, and a box is in the cell of its middle: it overlaps only boxes of its
own cell and of those around. One counting sort brings the boxes into the order of their cells, row by row, so that
neighbour cells of one row are one range of boxes. A box looks at the later ones of its own and the next cell, and at
three cells of each row that comes later: one row in 2D, four in 3D.

Each box has a code: its corners in small integers, all in one number, 14 bits for each coordinate in 2D, 9 in 3D, and a
free bit above each. Lower corners come first, then the largest integer minus the upper corners. Rounding down keeps
order, so codes of boxes that overlap do too: one subtraction rules out most candidates, and four or eight are looked at
together (:mod:`.lanes`). Exact corners are compared only for the others.

Nothing branches on the result of a single comparison: results are always written, and the counter moves on or not. A
mispredicted branch costs more than the test it would avoid.
"""

from __future__ import annotations

import math

from numpy import int64

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import at_most, item, replace
from ..bits import lowest_bit
from .brute_force import boxes_overlap
from .lanes import code_bits, eight_at, four_at, guard_bits, outline_of_code
from .records import HIGHEST, LARGEST_EXTENT, LOWEST

CELLS_PER_BOX = 2.0  # at most; cells grow where there is more room than that
SPARE_CELLS = 64
CROWDED = 8.0  # mean number of boxes in a box's cell from which the tree is faster
LOOSE = 1.0 + 2.0**-16  # cells exceed the largest box by this factor, which covers all rounding
CELL_SLACK = 2.0**-16  # the same for boxes that are not in the grid, in cells
LARGEST_EDGE = 1.0 - CELL_SLACK  # of a box that is not in the grid and for which the cells around its own are enough
FARTHEST = 2.0**28  # distance from the origin, in boxes, up to which LOOSE and CELL_SLACK cover rounding
FULLEST = 64  # most boxes in one cell
NOTE_CHUNK = 1024  # notes tested at a time; they stay in the first-level cache
OUTSIDE_MAX = 64  # boxes that may stay outside a grid
LONGEST = 128  # notes of one box: 2 and 4 * 3 cells, all of them full, by eights, with some to spare
LANES = 8  # codes that may be read past the last one
NOTE = 12  # pairs that one note may stand for: 4 and 8 lanes

FULL = -1  # in place of a number of pairs: there may not be room for all


@inlined
def frame_of(grid):
    """(lower, upper) corner of what holds all boxes in the grid."""
    low = high = zero_of(grid)
    for k in range(len(low)):
        low, high = replace(low, k, grid.frame[LOWEST + k]), replace(high, k, grid.frame[HIGHEST + k])
    return low, high


@part
def choose_cells(grid, count):
    """Size and number of cells, with one empty cell around; returns whether a grid may suit so many boxes."""
    frame, zero = grid.frame, zero_of(grid)
    largest, farthest = frame[LARGEST_EXTENT], 0.0
    for q in range(len(zero)):
        farthest = max(farthest, max(abs(frame[LOWEST + q]), abs(frame[HIGHEST + q])))
    if not farthest < largest * FARTHEST:  # also if a box is infinite, if none has a size, or if there is none
        return False
    inverse = 1.0 / (largest * LOOSE)
    while True:
        inside, row, layer, total = 1.0, 1.0, 1.0, 1.0
        for q in range(len(zero)):
            cells = math.floor((frame[HIGHEST + q] - frame[LOWEST + q]) * inverse) + 1.0
            inside *= cells
            layer = total
            total *= cells + 2.0
            row = total if q == 0 else row
        if total <= CELLS_PER_BOX * count + SPARE_CELLS:
            break
        inverse *= 0.9
    grid.inverse_cell, grid.row, grid.layer, grid.total = inverse, int(row), int(layer), int(total)
    return count <= CROWDED * inside


@part
def find_cells(grid, lower, upper, start, count):
    """The cell of each box, invalid ones behind the last; afterwards directory[key + 1] is where cell ``key`` begins.

    Returns whether the boxes are spread evenly enough.
    """
    inverse, row, layer, total = grid.inverse_cell, grid.row, grid.layer, grid.total
    keys, directory, (origin, _) = grid.keys, grid.directory, frame_of(grid)
    for k in range(total + 3):
        directory[k] = 0
    for i in range(count):
        key, valid = 0, True
        low, high = lower[start + i], upper[start + i]
        for q in range(len(origin)):
            fits = item(low, q) <= item(high, q)
            valid &= fits
            middle = 0.5 * (item(low, q) + item(high, q)) if fits else item(origin, q)
            at = int64((middle - item(origin, q)) * inverse) + 1
            key += at if q == 0 else at * (row if q == 1 else layer)
        key = key if valid else total
        keys[i] = key
        directory[key + 2] += 1
    crowding, fullest, before = 0, 0, 0
    for k in range(2, total + 2):
        found = int64(directory[k])
        crowding += found * found
        fullest = max(fullest, found)
        before += found
        directory[k] = before
    return fullest <= FULLEST and crowding <= CROWDED * count


@part
def choose_codes(grid):
    """What coordinates are multiplied by to become the integers of codes."""
    frame, scale = grid.frame, zero_of(grid)
    _, largest = code_bits(len(scale))
    for q in range(len(scale)):
        scale = replace(scale, q, largest / (frame[HIGHEST + q] - frame[LOWEST + q] + 1.0 / grid.inverse_cell))
    grid.scale[0] = scale


@inlined
def code_of(grid, low, high):
    """The code of a box that is in the frame."""
    scale, code, (field, largest) = grid.scale[0], int64(0), code_bits(len(low))
    for q in range(len(low)):
        origin, shift = grid.frame[LOWEST + q], q * field
        code |= int64((item(low, q) - origin) * item(scale, q)) << shift
        code |= (largest - int64((item(high, q) - origin) * item(scale, q))) << (shift + len(low) * field)
    return code


@part
def place_in_grid(grid, lower, upper, start, count):
    """The counting sort's last pass; afterwards directory[key] is where cell ``key`` begins."""
    total, keys, directory, order, cells = grid.total, grid.keys, grid.directory, grid.order, grid.cells
    for i in range(count):
        key = keys[i]
        if key == total:  # invalid
            continue
        place = directory[key + 1]
        directory[key + 1] += 1
        order[place], cells[place] = start + i, key
        grid.codes[place] = code_of(grid, lower[start + i], upper[start + i])


@part
def build_grid(grid, lower, upper, start, count):
    """Sort ``count`` rows from ``start`` on of these columns into the cells; ``grid.suits``: whether they are even
    enough for it."""
    grid.suits = choose_cells(grid, count) and find_cells(grid, lower, upper, start, count)
    if grid.suits:
        choose_codes(grid)
        place_in_grid(grid, lower, upper, start, count)


@inlined
def is_near_cell(grid, key, low, high):
    """Whether a box is in the frame, and reaches over the edges of that cell by no more than half a cell: it may be
    there wherever its middle is."""
    inverse, left, near = grid.inverse_cell, key, True
    for q in range(len(low) - 1, -1, -1):
        origin, stride = grid.frame[LOWEST + q], 1 if q == 0 else grid.row if q == 1 else grid.layer
        at = left // stride
        left -= at * stride
        near &= (item(low, q) >= origin) & (item(high, q) <= grid.frame[HIGHEST + q])
        near &= (item(low, q) - origin) * inverse >= at - 1.5
        near &= (item(high, q) - origin) * inverse <= at + 0.5
    return near


@part
def move_in_grid(grid, i, low, high):
    """Row i has left the box that the grid has of it, and now has this one. It stays in its cell if it is near that, or
    is outside of the grid now. No more than OUTSIDE_MAX can be."""
    count, key = grid.outside_count, int64(grid.keys[i - grid.first])
    for k in range(count):
        if grid.outside[k] == i:
            return
    for place in range(grid.directory[key], grid.directory[key + 1] if key < grid.total else 0):
        if grid.order[place] == i:
            if is_near_cell(grid, key, low, high):
                grid.codes[place] = code_of(grid, low, high)
                return
            grid.codes[place] = guard_bits(len(low))  # overlaps nothing
    grid.suits &= count < OUTSIDE_MAX
    if grid.suits:
        grid.outside[count] = i
        grid.outside_count = count + 1


@part
def look_around(grid, start, count):
    """Note what may overlap the boxes from ``start`` on, until ``notes`` may be full.

    A note: a box's row, two places in the order, and bits. Bit k below 4 stands for the box k places behind the first,
    others for the one k - 4 places behind the second. Returns (notes, box to go on with).
    """
    directory, order, cells, codes, notes = grid.directory, grid.order, grid.cells, grid.codes, grid.notes
    row, layer, d = grid.row, grid.layer, len(zero_of(grid))
    guards = guard_bits(d)
    one, held, room, i = int64(1), int64(0), len(notes) - LONGEST, start
    while i < count and held < room:
        key, code, here, after = cells[i], outline_of_code(codes[i], d), order[i], i + 1
        length = directory[key + 2] - after
        bits = four_at(codes, after, code, guards) & ((one << min(length, 4)) - 1)
        longest = length + 4
        for k in range(1 if d == 2 else 4):
            at = key + (row if k == 0 else layer + (k - 2) * row)
            begin = directory[at - 1]
            length = directory[at + 2] - begin
            longest = max(longest, length)
            bits |= (eight_at(codes, begin, code, guards) & ((one << min(length, 8)) - 1)) << 4
            notes[held, 0] = here
            notes[held, 1] = after
            notes[held, 2] = begin
            notes[held, 3] = bits
            held += bits != 0
            bits = int64(0)
        if longest > 8:  # seldom: what is left of the ranges
            for k in range(-1, 1 if d == 2 else 4):
                at = key + (row if k <= 0 else layer + (k - 2) * row)
                begin = directory[at - 1] + 8 if k >= 0 else after + 4
                stop = directory[at + 2] if k >= 0 else directory[key + 2]
                while begin < stop:
                    bits = eight_at(codes, begin, code, guards) & ((one << min(stop - begin, 8)) - 1)
                    notes[held, 0] = here
                    notes[held, 2] = begin
                    notes[held, 3] = bits << 4
                    held += bits != 0
                    begin += 8
        i += 1
    return held, i


@part
def test_notes(state, held, found):
    """Compare exact corners; returns the number of pairs, or FULL."""
    grid, lower, upper, candidates = state.grid, state.bodies.lower, state.bodies.upper, state.candidates
    order, notes, first, second = grid.order, grid.notes, candidates.first, candidates.second
    room = len(first)
    for r in range(held):
        here, bits = notes[r, 0], int64(notes[r, 3])
        low, high = lower[here], upper[here]
        if found + NOTE > room:
            return FULL
        while bits != 0:
            k = lowest_bit(bits)
            bits &= bits - 1
            there = order[notes[r, 1] + k if k < 4 else notes[r, 2] + k - 4]
            first[found] = here
            second[found] = there
            found += boxes_overlap(low, high, lower[there], upper[there])
    return found


@part
def outline(grid, low, high):
    """What codes of boxes are subtracted from to see whether they may overlap this one, which may reach out of the
    grid; and a guard bit above each coordinate."""
    frame, scale, code, d = grid.frame, grid.scale[0], int64(0), len(low)
    field, largest = code_bits(d)
    for q in range(d):
        origin, unit = frame[LOWEST + q], item(scale, q)
        before = int64(min(max((item(low, q) - origin) * unit, 0.0), float(largest)))
        behind = int64(min(max((item(high, q) - origin) * unit, 0.0), float(largest)))
        code |= (behind << (q * field)) | ((largest - before) << ((d + q) * field))
    return code | guard_bits(d), guard_bits(d)


@inlined
def line_around(grid, key, k, d):
    """The cell in the middle of line k of those around cell ``key``: 3 in 2D, 9 in 3D."""
    return key + (k - 1) * grid.row if d == 2 else key + (k % 3 - 1) * grid.row + (k // 3 - 1) * grid.layer


@part
def look_near(state, grid, start, stop, found):
    """Pairs of rows start..stop-1, which are not in the grid, with what of it overlaps their boxes; returns as
    ``test_notes``.

    Most boxes are inside of the frame and no longer than a cell: only the cells around their middle count. For others
    there is ``look_inside``.
    """
    order, directory, codes = grid.order, grid.directory, grid.codes
    lower, upper, first = state.bodies.lower, state.bodies.upper, state.candidates.first
    second, row, layer, inverse = state.candidates.second, grid.row, grid.layer, grid.inverse_cell
    (origin, end), d, one = frame_of(grid), len(zero_of(grid)), int64(1)
    guards = guard_bits(d)
    width = 8 if d == 2 else 7  # boxes of a line that bits stand for
    for i in range(start, stop):
        low, high, fits = lower[i], upper[i], found + 64 <= len(first)
        for q in range(d):
            edge = (item(high, q) - item(low, q)) * inverse
            fits &= (item(low, q) >= item(origin, q)) & (item(high, q) <= item(end, q))
            fits &= (edge <= LARGEST_EDGE) & (edge >= 0.0)
        bits, longest, key, code = int64(0), 64, 0, guards
        if fits:
            longest, (code, _) = 0, outline(grid, low, high)
            for q in range(d):
                at = int64((0.5 * (item(low, q) + item(high, q)) - item(origin, q)) * inverse) + 1
                key += at if q == 0 else at * (row if q == 1 else layer)
            for k in range(3 if d == 2 else 9):
                at = line_around(grid, key, k, d)
                begin = directory[at - 1]
                length = directory[at + 2] - begin
                longest = max(longest, length)
                bits |= (eight_at(codes, begin, code, guards) & ((one << min(length, width)) - 1)) << (k * width)
        if longest > width:
            bits, found = int64(0), look_inside(state, grid, i, low, high, found)
            if found == FULL:
                return FULL
        while bits != 0:
            k = lowest_bit(bits)
            bits &= bits - 1
            line = k // width
            there = order[directory[line_around(grid, key, line, d) - 1] + k - line * width]
            first[found], second[found] = there, i
            found += boxes_overlap(low, high, lower[there], upper[there])
    return found


@inlined
def cells_around(grid, low, high):
    """Cells whose boxes may overlap low..high, which is valid: (first cell, lines, lines a layer, cells a line)."""
    frame, inverse, first, lines, across = grid.frame, grid.inverse_cell, int64(0), int64(1), int64(1)
    width = int64(0)
    for q in range(len(low)):
        origin = frame[LOWEST + q]
        end = int64((frame[HIGHEST + q] - origin) * inverse) + 1.0
        start = int64(min(max((item(low, q) - origin) * inverse - 0.5 - CELL_SLACK, 0.0), end))
        stop = int64(min(max((item(high, q) - origin) * inverse + 0.5 + CELL_SLACK, -1.0), end - 1.0))
        length = max(stop - start + 1, 0)
        first += (start + 1) * (1 if q == 0 else grid.row if q == 1 else grid.layer)
        width = length if q == 0 else width
        across = length if q == 1 else across
        lines *= length if q > 0 else 1
    return first, lines, across, width


@inlined
def line_of(grid, cells, n):
    """(begin, end): the places of the boxes in line n of :func:`cells_around`."""
    first, _, across, width = cells
    layer = 0 if n < across else n // across  # a division takes longer than all the rest
    at = first + (n - layer * across) * grid.row + layer * grid.layer
    return int64(grid.directory[at]), int64(grid.directory[at + width])


@part
def look_inside(state, grid, i, low, high, found):
    """Pairs of body i, which is not in the grid, with what of it overlaps this box of any size; returns as
    ``test_notes``."""
    lower, upper, order, codes, one = state.bodies.lower, state.bodies.upper, grid.order, grid.codes, int64(1)
    first, second = state.candidates.first, state.candidates.second
    room = len(first)
    if not at_most(low, high):
        return found
    code, guards = outline(grid, low, high)
    cells = cells_around(grid, low, high)
    for n in range(cells[1]):
        place, behind = line_of(grid, cells, n)
        if found + (behind - place) > room:
            return FULL
        for start in range(place, max(behind, place + 1), 8):  # at least once: a branch less to foresee
            bits = eight_at(codes, start, code, guards) & ((one << min(behind - start, 8)) - 1)
            while bits != 0:
                there = order[start + lowest_bit(bits)]
                bits &= bits - 1
                first[found] = there
                second[found] = i
                found += boxes_overlap(low, high, lower[there], upper[there])
    return found

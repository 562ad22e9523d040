"""The tree's layout: which cell a box belongs to, and all boxes in the order of their cells.

A body sits in one cell of one level: the deepest level whose cells are at least as large as its box, in the cell
that holds the box's centre. Its box then reaches at most half a cell over the cell's border (a *loose* quadtree or
octree). There are no nodes and no pointers: each level is a row-major grid of cell numbers, ``x + w y + w h z``, and
one counting sort over all levels brings the bodies into the order of their cells. A directory says where each begins.

Cell numbers are taken modulo the number of cells of the level, so a level covers all space with a finite directory:
objects outside the trimmed bounds share cells with objects inside, and the box test tells them apart. Running off
the end of a row leads into the next one, which costs a false candidate and saves a branch.

Rounding: coordinates are taken relative to the origin first, and a box counts as larger than it is by REACH times its
distance from the origin. That covers every rounding error on the way to the cell number and bounds cell
numbers to 2**38 per axis; whatever is farther out sits on a coarser level, at last in the one cell of the top level.
"""

from __future__ import annotations

import math

import numpy as np

from ....framework.compilation import kernel
from ....framework.vectors import item, replace

MAX_LEVELS = 60
BRUTE_FORCE_BELOW = 24  # so few objects are quicker tested all with all than sorted
SAMPLE = 256  # objects that the bounds and the cell size are estimated from
TRIMMED = 3  # the sample's extreme values kept per side; the last of them is its 1 % or 99 % quantile
MARGIN = 1.0 / 40.0  # of the trimmed extent, added per side: evenly spread objects are then all inside
CELLS_PER_OBJECT = 3.0  # size of the finest level's directory
CROWDED = 24.0  # mean number of objects in an object's cell from which finer cells are tried
TOO_MANY = 64  # objects too large or too far out for all levels, from which coarser levels are added
REACH = 2.0**-38  # relative rounding error granted to every box
NEARLY_EQUAL = 1.2  # the largest of the sample against its 99 % quantile: below it that is no other size
ABOVE_SAMPLE = 1.02  # what the largest of all may exceed the largest of the sample by
LOOSE = 1.0 + 2.0**-16  # the finest cell exceeds the typical box by this, so that REACH does not push it a level up
SMALLEST_CELL = 1e-290
LARGEST_SAMPLE = 1e150
CODE_BITS = 60

# Columns of ``table``, one row per level: level 0 is the finest, row ``levels`` the top level, row ``levels + 1`` the
# boxes that are in no level because they are empty or NaN. A cell's number is SHIFT plus index times STRIDE per axis.
BASE, CELLS, SHIFT, BEGIN, END, STRIDE = range(6)
TABLE_COLUMNS = 8

# Places in ``frame``; those apart by 3 hold one value per axis.
ORIGIN, LOWEST, HIGHEST, EXTENT, WIDTH = 0, 3, 6, 9, 12  # WIDTH: cells of level 0 that the directory has
INVERSE, SMALL, LEVELS, FINE, CROWDING = 15, 16, 17, 18, 19
EXTREMES = 20  # 2 * TRIMMED values for each axis and for the size
SCALES = EXTREMES + 4 * 2 * TRIMMED
FRAME_SIZE = SCALES + MAX_LEVELS + 2


def directory_size(count: int) -> int:
    """Entries that the directory of ``count`` objects may need.

    Level 0 has at most CELLS_PER_OBJECT * count + 64 cells; all coarser levels together at most 1.5 times that, if
    none of them has its least number, 27 in 3D; guard rows add two thirds at most.
    """
    return int(6 * CELLS_PER_OBJECT * count) + 150 * (MAX_LEVELS + 2)


@kernel
def choose_frame(lower, upper, start, stop, frame, like):
    """Origin, trimmed extent per axis, finest cell and number of levels, from a sample of the objects."""
    d = len(like)
    count = stop - start
    for k in range(EXTREMES, EXTREMES + 8 * TRIMMED):
        frame[k] = np.inf
    # The TRIMMED smallest values of each quantity, and of its negative, ascending. The last quantity is the size.
    taken = 0
    for k in range(min(count, SAMPLE)):
        # Multiplicative hashing: a plain stride would pick a single column out of a lattice.
        row = start + (k if count <= SAMPLE else (((k * 2654435761) & 0xFFFFFFFF) * count) >> 32)
        size = 0.0
        usable = True
        for q in range(d):
            low, high = lower[row, q], upper[row, q]
            usable &= (high >= low) & (low > -LARGEST_SAMPLE) & (high < LARGEST_SAMPLE)
            size = max(size, high - low)
        if usable:
            taken += 1
            for q in range(2 * d + 2):
                value = 0.5 * (lower[row, q >> 1] + upper[row, q >> 1]) if q < 2 * d else size
                value = -value if q & 1 else value
                for i in range(EXTREMES + q * TRIMMED, EXTREMES + (q + 1) * TRIMMED):
                    kept = frame[i]
                    frame[i] = min(kept, value)
                    value = max(kept, value)
    if taken == 0:
        for k in range(EXTREMES, EXTREMES + 8 * TRIMMED):
            frame[k] = 0.0
    trim = EXTREMES + min(taken // 85, TRIMMED - 1)
    longest = SMALLEST_CELL
    for q in range(d):
        extent = -frame[trim + (2 * q + 1) * TRIMMED] - frame[trim + 2 * q * TRIMMED]
        frame[ORIGIN + q] = frame[trim + 2 * q * TRIMMED] - MARGIN * extent
        frame[EXTENT + q] = extent + 2.0 * MARGIN * extent
        longest = max(longest, frame[EXTENT + q])
    small = frame[trim + 2 * d * TRIMMED]
    large = -frame[trim + (2 * d + 1) * TRIMMED]

    budget = CELLS_PER_OBJECT * count + 64.0
    cell = max(longest / budget, SMALLEST_CELL)
    total = np.inf
    while total > budget:
        cell *= 1.1
        total = 1.0
        for q in range(d):
            total *= max(3.0, frame[EXTENT + q] / cell + 1.0)
    largest = -frame[EXTREMES + (2 * d + 1) * TRIMMED]
    if largest < NEARLY_EQUAL * large:
        large = ABOVE_SAMPLE * largest  # all of a size: one level holds them
    # A whole number of halvings below the large boxes: boxes of equal size fit their cell tightly.
    halved = max(large, cell)
    while 0.5 * halved >= max(cell, small):
        halved *= 0.5
    frame[FINE] = halved * LOOSE
    frame[INVERSE] = 1.0 / frame[FINE]
    frame[SMALL] = small
    for q in range(d):
        frame[WIDTH + q] = frame[EXTENT + q] * frame[INVERSE]
    levels = 0.0
    if count > BRUTE_FORCE_BELOW:
        levels = 1.0
        longest *= frame[INVERSE]
        while longest >= 1.0:
            longest *= 0.5
            levels += 1.0
    frame[LEVELS] = levels


@kernel
def assign_cells(lower, upper, start, stop, directory, keys, table, frame, like):
    """Lay out the levels, find each object's cell and count; returns whether the cells suit the scene.

    Crowding is the sum of squared cell counts: twice the candidates within cells.
    """
    d = len(like)
    levels = int(frame[LEVELS])
    base = 0
    scale = 1.0
    for level in range(levels + 2):
        cells = 1
        outer = 1
        table[level, BASE] = base
        frame[SCALES + level] = scale if level < levels else 0.0
        for q in range(d):
            table[level, STRIDE + q] = cells if level < levels else 0
            outer = cells
            cells *= max(3, int(frame[WIDTH + q] * scale) + 1)
        # Two rows of guard cells: whatever is inside the bounds then has its neighbours without wrapping round.
        table[level, CELLS] = cells + 2 * outer if level < levels else 1
        table[level, SHIFT] = outer + 1 if level < levels else 0
        base += table[level, CELLS]
        scale *= 0.5

    used = table[levels + 1, BASE] + 1
    for k in range(used + 2):
        directory[k] = 0
    origin, lowest, highest = like, like, like
    for q in range(d):
        origin = replace(origin, q, frame[ORIGIN + q])
    inverse = frame[INVERSE]
    for row in range(start, stop):
        size = 0.0
        valid, tame = True, True
        middle = like
        for q in range(d):
            valid &= upper[row, q] >= lower[row, q]
            low = lower[row, q] - item(origin, q)
            high = upper[row, q] - item(origin, q)
            reach = (high - low) + REACH * (abs(low) + abs(high))
            tame &= reach < np.inf  # also false for NaN, from two equal infinities
            size = max(size, reach)
            middle = replace(middle, q, 0.5 * (low + high) * inverse)
        size *= inverse
        # Sizes up to 1 in finest cells belong to level 0, up to 2 to level 1, up to 4 to level 2: the binary exponent.
        level = min(max(((np.float64(size).view(np.int64) - 1) >> 52) - 1022, 0), levels)
        level = level if valid & tame & (size < 1e300) else levels
        place = np.uint64(level)  # indices without a sign are taken as they are
        number = table[place, SHIFT]
        for q in range(d):
            at = item(middle, q) if level < levels else 0.0
            lowest = replace(lowest, q, at if at < item(lowest, q) else item(lowest, q))
            highest = replace(highest, q, at if at > item(highest, q) else item(highest, q))
            number += np.int64(math.floor(at * frame[np.uint64(SCALES) + place])) * table[place, STRIDE + q]
        if number < 0 or number >= table[place, CELLS]:
            number %= table[place, CELLS]
        key = number + table[place, BASE] if valid else used - 1
        keys[np.uint64(row - start)] = key
        directory[np.uint64(key + 2)] += 1
    for q in range(d):
        frame[LOWEST + q] = item(lowest, q)
        frame[HIGHEST + q] = item(highest, q)

    crowding = 0.0
    total = 0
    finest = table[0, CELLS] if levels > 0 else 0
    for k in range(used):
        found = directory[k + 2]
        crowding += float(found) * float(found) if k < finest else 0.0
        total += found
        directory[k + 2] = total
    for level in range(levels + 2):
        table[level, BEGIN] = directory[table[level, BASE] + 1]
        table[level, END] = directory[table[level, BASE] + table[level, CELLS] + 1]
    frame[CROWDING] = crowding
    found = table[0, END] - table[0, BEGIN]
    top = table[levels, END] - table[levels, BEGIN]
    return levels == 0 or (crowding <= CROWDED * found and top <= TOO_MANY + (stop - start) // 256)


@kernel
def place(lower, upper, start, stop, directory, keys, order, cells, boxes, codes, frame, like):
    """The counting sort's last pass: objects in the order of their cells, with copies of their boxes, and codes.

    Afterwards directory[key] is where cell ``key`` begins. A code is a box in small integers, all in one number: 14
    bits for each corner's coordinate in 2D, 9 in 3D, and a free bit above each. Lower corners come first, then the
    largest integer minus the upper corners. Rounding down and clamping keep order: the codes of boxes that overlap do.
    """
    d = len(like)
    field = CODE_BITS // (2 * d)
    largest = (1 << (field - 1)) - 1
    scale, offset = like, like
    for q in range(d):
        scale = replace(scale, q, largest / (frame[EXTENT + q] + frame[FINE]))
        offset = replace(offset, q, frame[ORIGIN + q] - 0.5 * frame[FINE])
    for row in range(start, stop):
        key = np.uint64(keys[row - start])
        at = np.uint64(directory[key + np.uint64(1)])
        directory[key + np.uint64(1)] += 1
        order[at] = row
        cells[at] = key
        code = 0
        for q in range(d):
            low, high = lower[row, q], upper[row, q]
            boxes[at, q] = low
            boxes[at, d + q] = high
            low = min(max((low - item(offset, q)) * item(scale, q), 0.0), float(largest))
            high = min(max((high - item(offset, q)) * item(scale, q), 0.0), float(largest))
            code |= int(low) << (q * field)
            code |= (largest - int(high)) << ((d + q) * field)
        codes[at] = code

"""The tree's layout: the cell of each box, and all boxes in the order of their cells.

A box is in one cell of one level: the deepest level whose cells are at least as large as the box, in the cell that
holds the box's centre. It then reaches at most half a cell over the cell's border (a *loose* quadtree or octree). There
are no nodes and no pointers: each level is a row-major grid of cell numbers, ``x + w y + w h z``, and one counting sort
over all levels brings the boxes into the order of their cells. A directory says where each begins.

Cell numbers are taken modulo the number of cells of the level, so a level covers all space with a finite directory:
boxes outside the trimmed bounds share cells with boxes inside, and the box test tells them apart. Running off the end
of a row leads into the next one, which costs a false candidate and saves a branch.

Rounding: coordinates are taken relative to the origin first, and a box counts as larger than it is by REACH times its
distance from the origin. That covers every rounding error on the way to the cell number and bounds cell numbers to
2**38 per axis; what is farther out is on a coarser level, at last in the one cell of the top level.
"""

from __future__ import annotations

import math

import numpy as np

from ....framework.compilation import part
from ....framework.jit.records.record_type import zero_of
from ....framework.vectors import item, replace, scale, shifted
from ..lanes import code_bits
from .cells import REACH

MAX_LEVELS = 60
SAMPLE = 256  # boxes that the bounds and the cell size are estimated from
TRIMMED = 3  # the sample's extreme values kept per side; the last of them is its 1 % or 99 % quantile
CELL_MARGIN = 1.0 / 40.0  # of the trimmed extent, added per side: evenly spread boxes are then all inside
TREE_CELLS_PER_BOX = 3.0  # size of the finest level's directory
CROWDED_LEVEL = 24.0  # mean number of boxes in a box's cell from which finer cells are tried
TOO_MANY = 64  # boxes too large or too far out for all levels, from which coarser levels are added
NEARLY_EQUAL = 1.2  # the largest of the sample against its 99 % quantile: below it that is no other size
ABOVE_SAMPLE = 1.02  # what the largest of all may exceed the largest of the sample by
LOOSE_CELL = 1.0 + 2.0**-16  # the finest cell per typical box, so that REACH does not push it a level up
SMALLEST_CELL = 1e-290  # m; its inverse is finite
LARGEST_SAMPLE = 1e150  # m; coordinates beyond it do not enter the estimates

CROWDED_CELLS, SUITS = 0, 1  # what a pass over all boxes returns


def directory_size(count: int) -> int:
    """Entries that the directory of ``count`` boxes may need.

    Level 0 has at most TREE_CELLS_PER_BOX * count + 64 cells; all coarser levels together at most 1.5 times that, if
    none of them has its least number, 27 in 3D; guard rows add two thirds at most.
    """
    return int(6 * TREE_CELLS_PER_BOX * count) + 150 * (MAX_LEVELS + 2)


@part
def place_in_one_cell(tree):
    """Brute force: all valid boxes in the one cell of the top level; codes of 0 rule nothing out."""
    lower, upper, boxes, count, d = tree.lower, tree.upper, tree.boxes, 0, len(zero_of(tree))
    directory = tree.directory
    for i in range(tree.start, tree.stop):
        low, high, valid = lower[i], upper[i], True
        for q in range(d):
            valid &= item(low, q) <= item(high, q)
            boxes[count, q], boxes[count, d + q] = item(low, q), item(high, q)
        tree.order[count], tree.cells[count], tree.codes[count] = i, 0, 0
        count += valid
    zero = zero_of(tree)
    tree.origin[0], tree.lowest[0], tree.highest[0] = zero, zero, zero
    tree.finest_cell = tree.inverse_cell = tree.level_scale[0] = 0.0
    tree.levels, tree.count = 0, count
    tree.level_base[0], tree.level_cells[0], tree.level_shift[0] = 0, 1, 0
    for q in range(3):
        tree.level_stride[0, q] = 0
    tree.level_begin[0], tree.level_end[0] = 0, count
    directory[0], directory[1], directory[2] = 0, count, count


@part
def sample_extremes(tree):
    """The TRIMMED smallest values of each quantity of a sample, and of its negative; the last quantity is the size.

    Returns the size of the sample without boxes that are of no use.
    """
    lower, upper, extremes = tree.lower, tree.upper, tree.extremes
    start, count, d, taken = tree.start, tree.stop - tree.start, len(zero_of(tree)), 0
    for q in range(2 * d + 2):
        for i in range(TRIMMED):
            extremes[q, i] = math.inf
    for k in range(min(count, SAMPLE)):
        # Multiplicative hashing: a plain stride would pick a single column out of a lattice.
        row = start + (k if count <= SAMPLE else (((k * 2654435761) & 0xFFFFFFFF) * count) >> 32)
        size, usable = 0.0, True
        low, high = lower[row], upper[row]
        for q in range(d):
            usable &= (item(high, q) >= item(low, q)) & (item(low, q) > -LARGEST_SAMPLE)
            usable &= item(high, q) < LARGEST_SAMPLE
            size = max(size, item(high, q) - item(low, q))
        if usable:
            taken += 1
            for q in range(2 * d + 2):
                value = 0.5 * (item(low, q >> 1) + item(high, q >> 1)) if q < 2 * d else size
                value = -value if q & 1 else value
                for i in range(TRIMMED):
                    kept = extremes[q, i]
                    extremes[q, i] = min(kept, value)
                    value = max(kept, value)
    for q in range(2 * d + 2 if taken == 0 else 0):
        for i in range(TRIMMED):
            extremes[q, i] = 0.0
    return taken


@part
def choose_finest_cell(tree, longest, small, large):
    """Size of the finest cell, for a trimmed extent whose longest edge is ``longest`` and boxes of small..large."""
    extent, d = tree.extent[0], len(zero_of(tree))
    budget = TREE_CELLS_PER_BOX * (tree.stop - tree.start) + 64.0
    cell, total = max(longest / budget, SMALLEST_CELL), math.inf
    while total > budget:
        cell *= 1.1
        total = 1.0
        for q in range(d):
            total *= max(3.0, item(extent, q) / cell + 1.0)
    largest = -tree.extremes[2 * d + 1, 0]
    if largest < NEARLY_EQUAL * large:
        large = ABOVE_SAMPLE * largest  # all of one size: one level holds them
    # A whole number of halvings below the large boxes: boxes of equal size fit their cell tightly.
    halved = max(large, cell)
    while 0.5 * halved >= max(cell, small):
        halved *= 0.5
    return halved * LOOSE_CELL


@part
def choose_tree_cells(tree):
    """Origin, trimmed extent per axis, finest cell and number of levels, from a sample of the boxes."""
    extremes, d = tree.extremes, len(zero_of(tree))
    trim = min(sample_extremes(tree) // 85, TRIMMED - 1)
    longest, origin, extents = SMALLEST_CELL, zero_of(tree), zero_of(tree)
    for q in range(d):
        extent = -extremes[2 * q + 1, trim] - extremes[2 * q, trim]
        origin = replace(origin, q, extremes[2 * q, trim] - CELL_MARGIN * extent)
        extents = replace(extents, q, extent + 2.0 * CELL_MARGIN * extent)
        longest = max(longest, item(extents, q))
    tree.origin[0], tree.extent[0] = origin, extents
    tree.smallest_box = extremes[2 * d, trim]
    tree.finest_cell = choose_finest_cell(tree, longest, tree.smallest_box, -extremes[2 * d + 1, trim])
    tree.inverse_cell = 1.0 / tree.finest_cell
    tree.width[0] = scale(extents, tree.inverse_cell)
    levels = 1
    longest *= tree.inverse_cell
    while longest >= 1.0:
        longest *= 0.5
        levels += 1
    tree.levels = levels


@part
def build_levels(tree):
    """Number the cells of all levels; returns how many there are, with the one for invalid boxes."""
    levels, width, base, shrink = tree.levels, tree.width[0], 0, 1.0
    for level in range(levels + 2):
        cells, outer = 1, 1
        tree.level_base[level] = base
        tree.level_scale[level] = shrink if level < levels else 0.0
        for q in range(len(width)):
            tree.level_stride[level, q] = cells if level < levels else 0
            outer = cells
            cells *= max(3, int(item(width, q) * shrink) + 1)
        # Two rows of guard cells: what is inside the bounds then has its neighbours without wrapping round.
        tree.level_cells[level] = cells + 2 * outer if level < levels else 1
        tree.level_shift[level] = outer + 1 if level < levels else 0
        base += tree.level_cells[level]
        shrink *= 0.5
    return base


@part
def find_tree_cells(tree, used):
    """The cell of each box; directory[k + 2] counts those in cell k. Notes the bounds of the centres."""
    lower, upper, keys, directory, levels = tree.lower, tree.upper, tree.keys, tree.directory, tree.levels
    start, origin, inverse, zero = tree.start, tree.origin[0], tree.inverse_cell, zero_of(tree)
    base, cells, shift, shrink = tree.level_base, tree.level_cells, tree.level_shift, tree.level_scale
    stride, lowest, highest = tree.level_stride, zero, zero
    for row in range(start, tree.stop):
        size, valid, tame, middle = 0.0, True, True, zero
        low_corner, high_corner = lower[row], upper[row]
        for q in range(len(zero)):
            valid &= item(high_corner, q) >= item(low_corner, q)
            low = item(low_corner, q) - item(origin, q)
            high = item(high_corner, q) - item(origin, q)
            reach = (high - low) + REACH * (abs(low) + abs(high))
            tame &= reach < math.inf  # also false for nan, from two equal infinities
            size = max(size, reach)
            middle = replace(middle, q, 0.5 * (low + high) * inverse)
        size *= inverse
        # Sizes up to 1 in finest cells belong to level 0, up to 2 to level 1, up to 4 to level 2: the binary exponent.
        level = min(max(((np.float64(size).view(np.int64) - 1) >> 52) - 1022, 0), levels)
        level = level if valid & tame & (size < 1e300) else levels
        number = shift[level]
        for q in range(len(zero)):
            at = item(middle, q) if level < levels else 0.0
            lowest = replace(lowest, q, at if at < item(lowest, q) else item(lowest, q))
            highest = replace(highest, q, at if at > item(highest, q) else item(highest, q))
            number += np.int64(math.floor(at * shrink[level])) * stride[level, q]
        if number < 0 or number >= cells[level]:
            number %= cells[level]
        key = number + base[level] if valid else used - 1
        keys[row - start] = key
        directory[key + 2] += 1
    tree.lowest[0], tree.highest[0] = lowest, highest


@part
def assign_cells(tree):
    """Lay out the levels, find the cell of each box and count; returns SUITS, or CROWDED_CELLS if others may be better.

    Crowding is the sum of squared cell counts: twice the candidates within cells.
    """
    levels, directory, used = tree.levels, tree.directory, build_levels(tree)
    begin, end = tree.level_begin, tree.level_end
    for k in range(used + 2):
        directory[k] = 0
    find_tree_cells(tree, used)
    crowding, total, finest = 0.0, 0, tree.level_cells[0]
    for k in range(used):
        found = directory[k + 2]
        crowding += float(found) * float(found) if k < finest else 0.0
        total += found
        directory[k + 2] = total
    for level in range(levels + 2):
        base = tree.level_base[level]
        begin[level] = directory[base + 1]
        end[level] = directory[base + tree.level_cells[level] + 1]
    tree.crowding, tree.count = crowding, end[levels]
    found = end[0] - begin[0]
    top = end[levels] - begin[levels]
    suits = crowding <= CROWDED_LEVEL * found and top <= TOO_MANY + (tree.stop - tree.start) // 256
    return SUITS if suits else CROWDED_CELLS


@part
def place_in_tree(tree):
    """The counting sort's last pass: boxes in the order of their cells, and their codes.

    Afterwards directory[key] is where cell ``key`` begins. A code is a box in small integers, all in one number: 14
    bits for each corner's coordinate in 2D, 9 in 3D, and a free bit above each. Lower corners come first, then the
    largest integer minus the upper corners. Rounding down and clamping keep order: the codes of boxes that overlap do.
    """
    keys, directory, order, cells, boxes = tree.keys, tree.directory, tree.order, tree.cells, tree.boxes
    units, offset, d = zero_of(tree), shifted(tree.origin[0], -0.5 * tree.finest_cell), len(zero_of(tree))
    start, (field, largest) = tree.start, code_bits(d)
    for q in range(d):
        units = replace(units, q, largest / (item(tree.extent[0], q) + tree.finest_cell))
    for row in range(start, tree.stop):
        key = keys[row - start]
        at = directory[key + 1]
        directory[key + 1] += 1
        order[at], cells[at] = row, key
        code, low_corner, high_corner = np.int64(0), tree.lower[row], tree.upper[row]
        for q in range(d):
            low, high = item(low_corner, q), item(high_corner, q)
            boxes[at, q], boxes[at, d + q] = low, high
            low = min(max((low - item(offset, q)) * item(units, q), 0.0), float(largest))
            high = min(max((high - item(offset, q)) * item(units, q), 0.0), float(largest))
            code |= np.int64(low if low == low else 0.0) << (q * field)
            code |= (largest - np.int64(high if high == high else 0.0)) << ((d + q) * field)
        tree.codes[at] = code


# -- passes, called from Python: (tree, tree) -> code -----------------------------------------------------


def build_one_cell(tree, _):
    """For brute force."""
    place_in_one_cell(tree)
    return SUITS


def build_tree(tree, _):
    """Put the boxes of the record into cells; on CROWDED_CELLS Python tries others."""
    choose_tree_cells(tree)
    result = assign_cells(tree)
    if result == SUITS:
        place_in_tree(tree)
    return result


def assign_again(tree, _):
    """The cells have changed."""
    return assign_cells(tree)


def finish_tree(tree, _):
    """After Python has settled on the cells."""
    place_in_tree(tree)
    return SUITS

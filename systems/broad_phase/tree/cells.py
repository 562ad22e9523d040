"""Which cells of a tree a box may meet: what pairs, queries and casts walk through::

    for level in range(tree.levels + 1):
        if tree.level_end[level] > tree.level_begin[level]:
            runs = cover(tree, low, high, level)
            parts, wraps = parts_of(tree, level, runs)
            for part in range(parts):
                begin, end = cells_of(tree, level, runs, part, wraps)
                for i in range(begin, end): ...  # tree.order[i] is the row, tree.boxes[i, k] its box
"""

from __future__ import annotations

import math

from numpy import int64

from ....framework.compilation import inlined
from ....framework.vectors import absolute, add, add_scaled, item, larger, scale, shifted

HALF_CELL = 0.5 + 2.0**-30  # how far a box reaches over its cell, in cells, rounding included
TREE_FARTHEST = 2.0**39  # no box of a level is in a cell beyond this number (see REACH)
REACH = 2.0**-38  # relative rounding error granted to every box


@inlined
def cover(tree, low, high, level):
    """Cells of ``level`` whose boxes may overlap low..high: (number of the first, cells a run, runs, layers of runs).

    No run: nothing there. One run of at least the level's cells: all of it. Runs never overlap each other.
    """
    shrink = tree.level_scale[level]
    scale = tree.inverse_cell * shrink
    origin, lowest, highest = tree.origin[0], tree.lowest[0], tree.highest[0]
    first, size, stride = tree.level_shift[level], tree.level_cells[level], tree.level_stride
    span, n0, n1, n2 = int64(1), int64(1), int64(1), int64(1)
    for q in range(len(low)):
        # Clamping to what is there keeps numbers small and makes a floor of any length cost no more than the scene.
        least = max(item(lowest, q) * shrink, -TREE_FARTHEST)
        most = min(item(highest, q) * shrink, TREE_FARTHEST)
        bottom = (item(low, q) - item(origin, q)) * scale - HALF_CELL
        top = (item(high, q) - item(origin, q)) * scale + HALF_CELL
        bottom = bottom if bottom >= least else least  # in this order nan (infinity times 0) becomes the bound
        top = top if top <= most else most
        if bottom > most or top < least:
            return first, int64(0), int64(0), int64(0)
        index = int64(math.floor(bottom))
        length = int64(math.floor(top)) - index + 1
        if length <= 0:
            return first, int64(0), int64(0), int64(0)
        n0 = length if q == 0 else n0
        n1 = length if q == 1 else n1
        n2 = length if q == 2 else n2
        first += index * stride[level, q]
        span += (length - 1) * stride[level, q]
    if span >= size:  # always so for the top level's only cell
        return int64(0), size, int64(1), int64(1)
    row, layer = stride[level, 1], stride[level, 2]
    if n0 >= row:  # runs as long as a row join into one
        n0, n1 = n0 + (n1 - 1) * row, int64(1)
        if n0 >= layer:
            n0, n2 = n0 + (n2 - 1) * layer, int64(1)
    elif n1 * row >= layer:
        n1, n2 = n1 + (n2 - 1) * (layer // row), int64(1)
    return first, n0, n1, n2


@inlined
def parts_of(tree, level, runs):
    """How many parts the runs of :func:`cover` have, and whether any wraps round (0 or 1).

    If one does, each run has two parts, of which the first is what lies beyond the level's end.
    """
    first, n0, n1, n2 = runs
    last = first + (n1 - 1) * tree.level_stride[level, 1] + (n2 - 1) * tree.level_stride[level, 2]
    wraps = 1 if first < 0 or last + n0 > tree.level_cells[level] else 0
    return (n1 * n2) << wraps, wraps


@inlined
def cells_of(tree, level, runs, part, wraps):
    """(begin, end): the boxes begin..end-1, in the tree's order, in one part."""
    first, n0, n1, n2 = runs
    base, size, directory = tree.level_base[level], tree.level_cells[level], tree.directory
    run = part >> wraps
    layer = 0 if n2 == 1 else run // n1  # a division takes longer than all the rest
    number = first + (run - layer * n1) * tree.level_stride[level, 1] + layer * tree.level_stride[level, 2]
    if wraps == 0:
        return directory[base + number], directory[base + number + n0]
    number %= size
    beyond = max(number + n0 - size, 0)
    if part & 1 == 0:
        return directory[base], directory[base + beyond]
    return directory[base + number], directory[base + number + n0 - beyond]


@inlined
def uncertainty(tree, point):
    """Per axis more than all rounding errors of distances between the point and the boxes that are in cells."""
    origin, fine = tree.origin[0], tree.finest_cell
    lowest, highest = add_scaled(origin, tree.lowest[0], fine), add_scaled(origin, tree.highest[0], fine)
    return scale(shifted(add(absolute(point), larger(absolute(lowest), absolute(highest))), fine), REACH)

"""Candidate pairs of one tree or of two: ranges first, then one flat loop over what they hold.

Objects that may overlap a given one lie in a few rows of cells, and a row of cells is one range of the sorted objects.
Pass 1 writes these ranges, pass 2 tests their members. Neither pass branches on what it finds: range and pair
are written always, and the counter moves on or not. A mispredicted branch costs more than the test it would avoid.

Pass 2 looks at the boxes' codes first (see :func:`build.place`): one subtraction rules out most candidates, and
exact corners are compared only for the others.

Integers handed from kernel to kernel are variables, never literals: numba compiles a callee once more for a literal.
"""

from __future__ import annotations

import math

import numpy as np
from numba.cpython.unsafe.tuple import tuple_setitem

from ....framework.compilation import inlined, kernel, part
from ....framework.vectors import item, replace
from .build import BASE, BEGIN, CELLS, CODE_BITS, END, HIGHEST, INVERSE, LEVELS, LOWEST, ORIGIN, SCALES, SHIFT, STRIDE

HALF_CELL = 0.5 + 2.0**-30  # how far a box reaches over its cell, rounding included
FARTHEST = 2.0**39  # no box of a level is in a cell beyond this number (see REACH)
CHUNK = 2048  # candidates tested at a time; they stay in the first-level cache
BLOCK = 4  # members of a range looked at together
SPARE = 64  # room at the end of the ranges
RANGES_PER_OBJECT = 12  # most that one level's pass writes per object


@inlined
def cover(low, high, table, frame, level):
    """Cells of ``level`` whose objects may overlap the box: (number of the first, cells a run, runs, layers of runs).

    No run: nothing there. One run of at least the level's cells: all of it. Runs never overlap each other.
    """
    d = len(low)
    shrink = frame[SCALES + level]
    scale = frame[INVERSE] * shrink
    first = table[level, SHIFT]
    span = np.int64(1)
    lengths = (np.int64(1), np.int64(1), np.int64(1))
    for q in range(d):
        # Clamping to what is there keeps numbers small and makes a floor of any length cost no more than the scene.
        least = max(frame[LOWEST + q] * shrink, -FARTHEST)
        most = min(frame[HIGHEST + q] * shrink, FARTHEST)
        bottom = (item(low, q) - frame[ORIGIN + q]) * scale - HALF_CELL
        top = (item(high, q) - frame[ORIGIN + q]) * scale + HALF_CELL
        bottom = bottom if bottom >= least else least  # in this order NaN (infinity times 0) becomes the bound
        top = top if top <= most else most
        if bottom > most or top < least:
            return first, np.int64(0), np.int64(0), np.int64(0)
        index = np.int64(math.floor(bottom))
        length = np.int64(math.floor(top)) - index + 1
        if length <= 0:
            return first, np.int64(0), np.int64(0), np.int64(0)
        lengths = tuple_setitem(lengths, q, length)
        first += index * table[level, STRIDE + q]
        span += (length - 1) * table[level, STRIDE + q]
    n0, n1, n2 = lengths
    if span >= table[level, CELLS]:  # always so for the top level's only cell
        return np.int64(0), table[level, CELLS], np.int64(1), np.int64(1)
    row, layer = table[level, STRIDE + 1], table[level, STRIDE + 2]
    if n0 >= row:  # runs as long as a row join into one
        n0, n1 = n0 + (n1 - 1) * row, np.int64(1)
        if n0 >= layer:
            n0, n2 = n0 + (n2 - 1) * layer, np.int64(1)
    elif n1 * row >= layer:
        n1, n2 = n1 + (n2 - 1) * (layer // row), np.int64(1)
    return first, n0, n1, n2


@part
def _write_run(ranges, found, owner, number, length, directory, base, cells):
    """Append the objects of cells number..number + length - 1 (modulo ``cells``) as one range, or two if it wraps."""
    number %= cells
    beyond = number + length - cells
    ranges[found, 0] = owner
    ranges[found, 1] = directory[base]
    ranges[found, 2] = directory[base + max(beyond, 0)]
    found += ranges[found, 2] > ranges[found, 1]
    ranges[found, 0] = owner
    ranges[found, 1] = directory[base + number]
    ranges[found, 2] = directory[base + number + length - max(beyond, 0)]
    return found + (ranges[found, 2] > ranges[found, 1])


@kernel
def ranges_within_levels(table, frame, directory, cells, ranges, like):
    """Pass 1 between objects of one level. Returns (ranges, candidates, number of levels that hold objects).

    ``ranges`` must have room for RANGES_PER_OBJECT per object, and SPARE.
    """
    d = len(like)
    levels = int(frame[LEVELS])
    found = np.int64(0)
    in_use = 0
    one, three = np.int64(1), np.int64(3)
    for level in range(levels + 1):
        # Each object with the later ones of its cell and with half of the neighbour cells.
        base, size = table[level, BASE], table[level, CELLS]
        row, layer = table[level, STRIDE + 1], table[level, STRIDE + 2]
        begin, end = table[level, BEGIN], table[level, END]
        in_use += end > begin
        farthest = row + 2 if d == 2 else layer + row + 2  # from there on numbers would run over the level's end
        safe = directory[base + max(size - farthest, 0)]
        for i in range(begin, end):
            key = cells[i]
            ranges[found, 0] = i
            ranges[found, 1] = i + 1
            if i < safe:
                stop = directory[key + 2]
                ranges[found, 2] = stop
                found += stop > i + 1
            else:
                stop = directory[key + 1]
                ranges[found, 2] = stop
                found += stop > i + 1
                if level < levels:
                    found = _write_run(ranges, found, i, key - base + 1, one, directory, base, size)
            if level < levels:
                for k in range(1 if d == 2 else 4):
                    at = key - 1 + (row if k == 0 else layer + (k - 2) * row)
                    if i < safe:
                        first = directory[at]
                        stop = directory[at + 3]
                        ranges[found, 0] = i
                        ranges[found, 1] = first
                        ranges[found, 2] = stop
                        found += stop > first
                    else:
                        found = _write_run(ranges, found, i, at - base, three, directory, base, size)
    candidates = np.int64(0)
    for r in range(found):
        candidates += ranges[r, 2] - ranges[r, 1]
    return found, candidates, in_use


@kernel
def ranges_between(
    table_a, frame_a, directory_a, boxes_a, table_b, frame_b, directory_b, boxes_b, ranges, found, within, like
):  # fmt: skip
    """Pass 1 between two trees, or, ``within`` one given twice, between its levels; appended to ``found`` ranges.

    Ranges of b owned by objects of a come first, then ranges of a owned by objects of b: the cheaper side of each pair
    of levels looks into the other. Returns (end of the first kind, end of all, candidates among the new ones), or
    (-1, -1, 0) if ``ranges`` is too short.
    """
    before, middle = found, found
    for turn in range(2):
        for a in range(int(frame_a[LEVELS]) + 1):
            for b in range(a + 1 if within else 0, int(frame_b[LEVELS]) + 1):
                if table_a[a, END] > table_a[a, BEGIN] and table_b[b, END] > table_b[b, BEGIN]:
                    forth = _cost(table_a, frame_a, a, table_b, frame_b, b, like)
                    back = _cost(table_b, frame_b, b, table_a, frame_a, a, like)
                    if turn == 0 and forth <= back:
                        found = _ranges_across(
                            table_a, boxes_a, a, table_b, frame_b, directory_b, b, ranges, found, like
                        )
                    elif turn == 1 and not (forth <= back):
                        found = _ranges_across(
                            table_b, boxes_b, b, table_a, frame_a, directory_a, a, ranges, found, like
                        )
                    if found < 0:
                        return found, found, np.int64(0)
        if turn == 0:
            middle = found
    candidates = np.int64(0)
    for r in range(before, found):
        candidates += ranges[r, 2] - ranges[r, 1]
    return middle, found, candidates


@part
def _cost(table_a, frame_a, a, table_b, frame_b, b, like):
    """Estimated cost of looking with the objects of level a into level b: runs of cells and candidates in them."""
    size = frame_a[SCALES + a] * frame_a[INVERSE]  # 1 / cell; 0 for the top level, whose boxes may have any size
    reach = frame_b[SCALES + b] * frame_b[INVERSE] / size + 2.0
    runs, share = 1.0, 1.0
    for q in range(len(like)):
        extent = (frame_b[HIGHEST + q] - frame_b[LOWEST + q]) * frame_b[SCALES + b] + 1.0
        across = reach if reach < extent else extent  # NaN: extent
        share *= across / extent
        runs *= across if q > 0 else 1.0
    objects = float(table_a[a, END] - table_a[a, BEGIN])
    return objects * (4.0 + 3.0 * runs + share * float(table_b[b, END] - table_b[b, BEGIN]))


@part
def _ranges_across(table_a, boxes_a, a, table_b, frame_b, directory_b, b, ranges, found, like):
    """Each object of level a with the objects of level b in reach; -1 if ``ranges`` is too short."""
    d = len(like)
    base, size = table_b[b, BASE], table_b[b, CELLS]
    for i in range(table_a[a, BEGIN], table_a[a, END]):
        low, high = like, like
        for q in range(d):
            low = replace(low, q, boxes_a[i, q])
            high = replace(high, q, boxes_a[i, d + q])
        first, n0, n1, n2 = cover(low, high, table_b, frame_b, b)
        if found + 2 * n1 * n2 + SPARE > len(ranges):
            return np.int64(-1)
        for z in range(n2):
            for y in range(n1):
                at = first + y * table_b[b, STRIDE + 1] + z * table_b[b, STRIDE + 2]
                if at < 0 or at + n0 > size:
                    found = _write_run(ranges, found, i, at, n0, directory_b, base, size)
                else:
                    begin, end = directory_b[base + at], directory_b[base + at + n0]
                    ranges[found, 0] = i
                    ranges[found, 1] = begin
                    ranges[found, 2] = end
                    found += end > begin
    return found


@kernel
def overlapping(
    ranges, position, stop, boxes_a, order_a, codes_a, boxes_b, order_b, codes_b, owners, members, first, second,
    state, like,
):  # fmt: skip
    """Pass 2: write the pairs whose boxes overlap, from range ``position`` on, until the output may not suffice.

    Owners index boxes_a, members boxes_b; codes_a must be in the frame of codes_b, or zeros, which overlap all.
    state[0] is the number of pairs so far. Returns the range to continue at. Ranges are used up on the way.
    """
    d = len(like)
    field = CODE_BITS // (2 * d)
    guards, full = np.int64(0), np.int64(0)
    for _ in range(2 * d):
        guards = (guards << field) | (1 << (field - 1))
        full = (full << field) | ((1 << (field - 1)) - 1)
    half = np.int64(field * d)
    lower_half = (np.int64(1) << half) - 1
    pairs = np.uint64(state[0])
    room = np.uint64(max(len(first) - CHUNK, 0))
    at = np.uint64(position)
    last = np.uint64(stop)
    while at < last and pairs <= room:
        held = np.uint64(0)
        while at < last and held <= np.uint64(CHUNK - BLOCK):
            owner, begin, end = ranges[at, 0], ranges[at, 1], ranges[at, 2]
            code = codes_a[np.uint64(owner)]
            code = (full - ((code >> half) | ((code & lower_half) << half))) | guards
            for k in range(BLOCK):
                member = begin + k
                clear = (code - codes_b[np.uint64(member)]) & guards
                owners[held] = owner
                members[held] = member
                held += np.uint64((clear == guards) & (member < end))
            ranges[at, 1] = begin + BLOCK
            at += np.uint64(begin + BLOCK >= end)
        before = pairs
        for k in range(held):
            a, b = np.uint64(owners[k]), np.uint64(members[k])
            hit = True
            for q in range(d):
                hit &= (boxes_a[a, q] <= boxes_b[b, d + q]) & (boxes_b[b, q] <= boxes_a[a, d + q])
            first[pairs] = owners[k]
            second[pairs] = members[k]
            pairs += np.uint64(hit)
        for k in range(before, pairs):
            first[k] = order_a[first[k]]
            second[k] = order_b[second[k]]
    state[0] = np.int64(pairs)
    return np.int64(at)

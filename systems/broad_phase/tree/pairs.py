"""Candidate pairs of one tree or of two: ranges first, then one flat loop over what they hold.

Boxes that may overlap a given one lie in a few rows of cells, and a row of cells is one range of the sorted boxes.
Pass 1 writes these ranges, pass 2 tests their members. Neither pass branches on the result of a test: range and pair
are always written, and the counter moves on or not. A mispredicted branch costs more than the test it would avoid.

Pass 2 looks at the boxes' codes first (see :func:`.build.place_in_tree`): one subtraction rules out most candidates,
and exact corners are compared only for the others.
"""

from __future__ import annotations

import math

import numpy as np

from ....framework.compilation import part
from ....framework.jit.records.record_type import zero_of
from ....framework.vectors import item, replace
from ..lanes import guard_bits, outline_of_code
from .cells import cover

RANGE_CHUNK = 2048  # candidates tested at a time; they stay in the first-level cache
TEST_BLOCK = 4  # members of a range looked at together; codes are read so far past the last one
SPARE_RANGES = 64  # room at the end of the ranges
RANGES_PER_BOX = 12  # most that one level's pass writes per box

DONE, MORE_RANGES, MORE_PAIRS = 0, 1, 2  # what a pass returns


@part
def write_range(tree, found, owner, begin, end):
    """Append a range, unless it is empty; returns how many there are."""
    ranges = tree.ranges
    ranges[found, 0] = owner
    ranges[found, 1] = begin
    ranges[found, 2] = end
    return found + (end > begin)


@part
def write_run(tree, found, owner, cells_of, level, number, length):
    """Append the boxes of cells number..number + length - 1 (modulo the level's) as one range, or two if it wraps.

    cells_of: the tree whose cells these are.
    """
    directory, base, size = cells_of.directory, cells_of.level_base[level], cells_of.level_cells[level]
    number %= size
    beyond = max(number + length - size, 0)
    found = write_range(tree, found, owner, directory[base], directory[base + beyond])
    return write_range(tree, found, owner, directory[base + number], directory[base + number + length - beyond])


@part
def ranges_of_level(tree, level, found):
    """Each box of a level with the later ones of its cell and with half of the neighbour cells; returns as above."""
    directory, cells, levels, d = tree.directory, tree.cells, tree.levels, len(zero_of(tree))
    base, size = tree.level_base[level], tree.level_cells[level]
    row, layer = tree.level_stride[level, 1], tree.level_stride[level, 2]
    farthest = row + 2 if d == 2 else layer + row + 2  # from there on numbers would run over the level's end
    safe = directory[base + max(size - farthest, 0)]
    for i in range(tree.level_begin[level], tree.level_end[level]):
        key = np.int64(cells[i])
        if i < safe:
            found = write_range(tree, found, i, i + 1, directory[key + 2])
        else:
            found = write_range(tree, found, i, i + 1, directory[key + 1])
            if level < levels:
                found = write_run(tree, found, i, tree, level, key - base + 1, 1)
        for k in range(0 if level == levels else 1 if d == 2 else 4):
            at = key - 1 + (row if k == 0 else layer + (k - 2) * row)
            if i < safe:
                found = write_range(tree, found, i, directory[at], directory[at + 3])
            else:
                found = write_run(tree, found, i, tree, level, at - base, 3)
    return found


@part
def note_ranges(tree, found):
    """So many ranges, and how many boxes they hold; or, below 0, that there was no room for all. Returns a code."""
    if found < 0:
        return MORE_RANGES
    ranges, candidates = tree.ranges, 0
    for r in range(found):
        candidates += np.int64(ranges[r, 2]) - ranges[r, 1]
    tree.range_count, tree.candidates = found, candidates
    tree.next_range = tree.pair_count = 0
    return DONE


@part
def cost_of(tree, a, other, b):
    """Estimated cost of looking with the boxes of level a into level b: runs of cells and candidates in them."""
    size = tree.level_scale[a] * tree.inverse_cell  # 1 / cell; 0 for the top level, whose boxes may have any size
    scale, lowest, highest = other.level_scale[b], other.lowest[0], other.highest[0]
    reach = scale * other.inverse_cell / size + 2.0 if size > 0.0 else math.inf
    runs, share = 1.0, 1.0
    for q in range(len(lowest)):
        extent = (item(highest, q) - item(lowest, q)) * scale + 1.0
        across = reach if reach < extent else extent  # nan: extent
        share *= across / extent
        runs *= across if q > 0 else 1.0
    boxes = float(tree.level_end[a] - tree.level_begin[a])
    return boxes * (4.0 + 3.0 * runs + share * float(other.level_end[b] - other.level_begin[b]))


@part
def ranges_across(tree, owners, a, members, b, found):
    """Each box of level a of ``owners`` with those of level b of ``members`` in reach; -1 if there is no room."""
    boxes, directory, d = owners.boxes, members.directory, len(zero_of(tree))
    base, size = members.level_base[b], members.level_cells[b]
    row, layer, room = members.level_stride[b, 1], members.level_stride[b, 2], len(tree.ranges) - SPARE_RANGES
    low, high = zero_of(tree), zero_of(tree)
    for i in range(owners.level_begin[a], owners.level_end[a]):
        for q in range(d):
            low, high = replace(low, q, boxes[i, q]), replace(high, q, boxes[i, d + q])
        first, n0, n1, n2 = cover(members, low, high, b)
        if found + 2 * n1 * n2 > room:
            return -1
        for z in range(n2):
            for y in range(n1):
                at = first + y * row + z * layer
                if at < 0 or at + n0 > size:
                    found = write_run(tree, found, i, members, b, at, n0)
                else:
                    found = write_range(tree, found, i, directory[base + at], directory[base + at + n0])
    return found


@part
def ranges_between(tree, other, found, within):
    """Append ranges between two trees or, ``within`` one given twice, between its levels; -1 if there is no room.

    Ranges of ``other`` owned by boxes of ``tree`` come first; from ``range_middle`` on it is the other way round: of
    each pair of levels the cheaper one looks into the other.
    """
    for turn in range(2):
        for a in range(tree.levels + 1):
            for b in range(a + 1 if within else 0, other.levels + 1):
                if tree.level_end[a] > tree.level_begin[a] and other.level_end[b] > other.level_begin[b]:
                    forth = cost_of(tree, a, other, b) <= cost_of(other, b, tree, a)
                    if forth == (turn == 0):
                        owners, level = (tree, a) if forth else (other, b)
                        members, into = (other, b) if forth else (tree, a)
                        found = ranges_across(tree, owners, level, members, into, found)
                    if found < 0:
                        return found
        if turn == 0:
            tree.range_middle = found
    return found


@part
def pick_candidates(tree, owners, members, stop, with_codes):
    """Into the chunk: what the codes do not rule out, from ``next_range`` on until it may be full; returns how many."""
    ranges, owner_codes, codes = tree.ranges, owners.codes, members.codes
    chunk_owners, chunk_members, d = tree.chunk_owners, tree.chunk_members, len(zero_of(tree))
    guards, at, held = guard_bits(d), tree.next_range, 0
    while at < stop and held <= RANGE_CHUNK - TEST_BLOCK:
        owner, begin, end = ranges[at, 0], ranges[at, 1], ranges[at, 2]
        code = owner_codes[owner] if with_codes else np.int64(0)  # the frames of two trees differ; 0 overlaps all
        code = outline_of_code(code, d)
        for k in range(TEST_BLOCK):
            member = begin + k
            clear = (code - codes[member]) & guards
            chunk_owners[held] = owner
            chunk_members[held] = member
            held += (clear == guards) & (member < end)
        ranges[at, 1] = begin + TEST_BLOCK
        at += begin + TEST_BLOCK >= end
    tree.next_range = at
    return held


@part
def test_ranges(tree, owners, members, stop, swapped, with_codes):
    """Pass 2: write the pairs whose boxes overlap, from ``next_range`` to ``stop``; returns DONE or MORE_PAIRS.

    swapped: owners are boxes of the other tree. with_codes: both are in one frame. Ranges are used up on the way.
    """
    boxes_a, boxes_b, first, second = owners.boxes, members.boxes, tree.first, tree.second
    chunk_owners, chunk_members, d = tree.chunk_owners, tree.chunk_members, len(zero_of(tree))
    pairs = tree.pair_count
    while tree.next_range < stop:
        if pairs + RANGE_CHUNK > len(first):
            tree.pair_count = pairs
            return MORE_PAIRS
        held = pick_candidates(tree, owners, members, stop, with_codes)
        before = pairs
        for k in range(held):
            a, b, hit = chunk_owners[k], chunk_members[k], True
            for q in range(d):
                hit &= (boxes_a[a, q] <= boxes_b[b, d + q]) & (boxes_b[b, q] <= boxes_a[a, d + q])
            first[pairs], second[pairs] = a, b
            pairs += hit
        for k in range(before, pairs):
            a, b = owners.order[first[k]], members.order[second[k]]
            first[k], second[k] = (b, a) if swapped else (a, b)
    tree.pair_count = pairs
    return DONE


# -- passes, called from Python: (tree, other) -> code ----------------------------------------------------


def find_ranges_within(tree, _):
    """Pass 1 for the pairs of one tree. There must be room for RANGES_PER_BOX per box, and SPARE_RANGES."""
    found, in_use = 0, 0
    for level in range(tree.levels + 1):
        found = ranges_of_level(tree, level, found)
        in_use += tree.level_end[level] > tree.level_begin[level]
    return note_ranges(tree, ranges_between(tree, tree, found, True) if in_use > 1 else found)


def find_ranges_between(tree, other):
    """Pass 1 for the pairs of two trees."""
    return note_ranges(tree, ranges_between(tree, other, 0, False))


def test_within(tree, other):
    """Pass 2 for the pairs of one tree."""
    return test_ranges(tree, tree, tree, tree.range_count, False, True)


def test_between(tree, other):
    """Pass 2 for the pairs of two trees."""
    for turn in range(2):
        owners, members = (tree, other) if turn == 0 else (other, tree)
        stop = tree.range_middle if turn == 0 else tree.range_count
        if test_ranges(tree, owners, members, stop, turn == 1, False) != DONE:
            return MORE_PAIRS
    return DONE

"""A uniform grid for boxes of about one size, spread about evenly: what most scenes consist of, and twice as fast there
as the tree of :mod:`broad_phase.tree.tree`, which serves all others.

Cells are at least as large as the largest box, and a box is in the cell of its middle: it overlaps only boxes of its
own cell and of those around. One counting sort brings the objects into the order of their cells, row by row, so that
neighbour cells of one row are one range of objects. An object looks at the later ones of its own and the next cell, and
at three cells of each row that comes later: one row in 2D, four in 3D.

Each object has a code, its box in small integers, all in one number: 14 bits for each corner's coordinate in 2D, 9 in
3D, and a free bit above each. Lower corners come first, then the largest integer minus the upper corners. Rounding down
keeps order, so codes of boxes that overlap do too: one subtraction rules out most candidates, and four or eight are
looked at together (:mod:`lanes`). Exact corners are compared only for the others.

Nothing branches on what a single comparison finds: results are written always, and the counter moves on or not. A
mispredicted branch costs more than the test it would avoid.
"""

from __future__ import annotations

import math

import numpy as np
from numba.cpython.unsafe.tuple import tuple_setitem
from numpy.typing import NDArray

from ...framework.compilation import kernel, part
from ...framework.vectors import item, replace
from .lanes import eight_at, four_at, lowest_bit
from .tree.tree import CANDIDATE_LIMIT

CELLS_PER_OBJECT = 2.0  # at most; cells grow where there is more room than that
SPARE_CELLS = 64
CROWDED = 8.0  # mean number of objects in an object's cell from which the tree is faster
LOOSE = 1.0 + 2.0**-16  # cells exceed the largest box by this, which covers all rounding
SLACK = 2.0**-16  # the same for boxes from outside, in cells
FARTHEST = 2.0**28  # in boxes, from the origin of coordinates: the limit for that
FULLEST = 64  # most objects in one cell
CODE_BITS = 60
CHUNK = 1024  # records tested at a time; they stay in the first-level cache
LONGEST = 128  # records of one object: 2 and 4 * 3 cells, all of them full, by eights, with some to spare
LANES = 8  # codes that may be read past the last one

# Places in ``frame``, apart by 3: one value per axis. The largest is the longest edge of any box.
LOWEST, HIGHEST, LARGEST = 0, 3, 6
FRAME_SIZE = 7

UNEVEN, FULL = -1, -2  # what the kernel returns in place of a number of pairs


@part
def count_cells(frame, count, like):
    """(1 / cell, cells a row, cells a layer, cells), with one empty cell around; 1 / cell is 0 if no grid suits."""
    largest = frame[LARGEST]
    farthest = 0.0
    for q in range(len(like)):
        farthest = max(farthest, max(abs(frame[LOWEST + q]), abs(frame[HIGHEST + q])))
    if not farthest < largest * FARTHEST:  # also if a box is infinite, or none has a size, or there is none
        return 0.0, np.int64(0), np.int64(0), np.int64(0)
    inverse = 1.0 / (largest * LOOSE)
    while True:
        inside = 1.0
        row, layer, total = 1.0, 1.0, 1.0
        for q in range(len(like)):
            cells = math.floor((frame[HIGHEST + q] - frame[LOWEST + q]) * inverse) + 1.0
            inside *= cells
            layer = total
            total *= cells + 2.0
            row = total if q == 0 else row
        if total <= CELLS_PER_OBJECT * count + SPARE_CELLS:
            break
        inverse *= 0.9
    if count > CROWDED * inside:
        inverse = 0.0
    return inverse, np.int64(row), np.int64(layer), np.int64(total)


@part
def find_cells(lower, upper, count, frame, inverse, row, layer, total, keys, directory, like):
    """Each object's cell, those of invalid boxes behind the last; then directory[key + 1] is where cell key begins.

    Returns whether the objects are spread evenly enough.
    """
    d = len(like)
    for k in range(total + 3):
        directory[k] = 0
    origin = like
    for q in range(d):
        origin = replace(origin, q, frame[LOWEST + q])
    for i in range(count):
        key = np.int64(0)
        valid = True
        for q in range(d):
            low, high = lower[i, q], upper[i, q]
            valid &= low <= high
            at = np.int64((0.5 * (low + high) - item(origin, q)) * inverse) + 1
            key += at if q == 0 else at * (row if q == 1 else layer)
        key = key if valid else total
        keys[i] = key
        directory[np.uint64(key) + np.uint64(2)] += 1
    crowding, fullest, before = np.int64(0), np.int64(0), np.int64(0)
    for k in range(2, total + 2):
        found = np.int64(directory[k])
        crowding += found * found
        fullest = max(fullest, found)
        before += found
        directory[k] = before
    return fullest <= FULLEST and crowding <= CROWDED * count


@part
def place_objects(lower, upper, count, frame, inverse, keys, directory, order, cells, codes, like):
    """The counting sort's last pass; afterwards directory[key] is where cell ``key`` begins."""
    d = len(like)
    field = CODE_BITS // (2 * d)
    largest = (1 << (field - 1)) - 1
    scale, origin = like, like
    for q in range(d):
        origin = replace(origin, q, frame[LOWEST + q])
        scale = replace(scale, q, largest / (frame[HIGHEST + q] - frame[LOWEST + q] + 1.0 / inverse))
    for i in range(count):
        key = np.uint64(keys[i])
        place = np.uint64(directory[key + np.uint64(1)])
        directory[key + np.uint64(1)] += 1
        order[place] = i
        cells[place] = key
        code = np.int64(0)
        for q in range(d):
            code |= np.int64((lower[i, q] - item(origin, q)) * item(scale, q)) << (q * field)
            code |= (largest - np.int64((upper[i, q] - item(origin, q)) * item(scale, q))) << ((d + q) * field)
        codes[place] = code


@part
def _look_around(start, count, row, layer, directory, order, cells, codes, work, like):
    """Write records of what may overlap the objects from ``start`` on, until ``work`` may be full.

    A record: an object's row, two places in the order, and bits. Bit k below 4 stands for the object k places behind
    the first, others for the one k places behind the second. Returns (records, object to go on with).
    """
    d = len(like)
    field = CODE_BITS // (2 * d)
    half = np.int64(field * d)
    lower_half = (np.int64(1) << half) - 1
    guards, full = np.int64(0), np.int64(0)
    for _ in range(2 * d):
        guards = (guards << field) | (1 << (field - 1))
        full = (full << field) | ((1 << (field - 1)) - 1)
    four, eight, one = np.int64(4), np.int64(8), np.int64(1)
    held, room = np.uint64(0), np.uint64(len(work) - LONGEST)
    i = start
    while i < count and held < room:
        key = np.int64(cells[np.uint64(i)])
        code = codes[np.uint64(i)]
        code = (full - ((code >> half) | ((code & lower_half) << half))) | guards
        here = order[np.uint64(i)]
        after = i + 1
        length = np.int64(directory[np.uint64(key + 2)]) - after
        bits = four_at(codes, after, code, guards) & ((one << min(length, four)) - 1)
        longest = length + 4
        for k in range(1 if d == 2 else 4):
            at = key + (row if k == 0 else layer + (k - 2) * row)
            begin = np.int64(directory[np.uint64(at - 1)])
            length = np.int64(directory[np.uint64(at + 2)]) - begin
            longest = max(longest, length)
            bits |= (eight_at(codes, begin, code, guards) & ((one << min(length, eight)) - 1)) << four
            work[held, 0] = here
            work[held, 1] = after
            work[held, 2] = begin
            work[held, 3] = bits
            held += np.uint64(bits != 0)
            bits = np.int64(0)
        if longest > 8:  # seldom: what is left of the ranges
            for k in range(-1, 1 if d == 2 else 4):
                at = key + (row if k <= 0 else layer + (k - 2) * row)
                begin = np.int64(directory[np.uint64(at - 1)]) + 8 if k >= 0 else after + 4
                stop = np.int64(directory[np.uint64(at + 2 if k >= 0 else key + 2)])
                while begin < stop:
                    bits = eight_at(codes, begin, code, guards) & ((one << min(stop - begin, eight)) - 1)
                    work[held, 0] = here
                    work[held, 2] = begin
                    work[held, 3] = bits << four
                    held += np.uint64(bits != 0)
                    begin += 8
        i += 1
    return held, i


@part
def _test(held, work, lower, upper, order, first, second, found, like):
    """Compare exact corners; returns the number of pairs, or FULL if there may not be room for all."""
    for r in range(held):
        record = np.uint64(r)
        here = np.uint64(work[record, 0])
        bits = np.int64(work[record, 3])
        if found + 12 > len(first):
            return np.int64(FULL)
        while bits != 0:
            k = lowest_bit(bits)
            bits &= bits - 1
            at = work[record, 1] + k if k < 4 else work[record, 2] + k - 4
            there = np.uint64(order[np.uint64(at)])
            hit = True
            for q in range(len(like)):
                hit &= (lower[here, q] <= upper[there, q]) & (lower[there, q] <= upper[here, q])
            first[found] = here
            second[found] = there
            found += hit
    return found


@part
def look_inside(
    rows, lower, upper, frame, inverse, row, layer, directory, order, first, second, found, like
):  # fmt: skip
    """Pairs of objects in the grid with boxes of any size, of ``rows`` that are not in it; returns as ``_test``."""
    d = len(like)
    one = np.int64(1)
    origin, last = like, like
    for q in range(d):
        origin = replace(origin, q, frame[LOWEST + q])
        last = replace(last, q, math.floor((frame[HIGHEST + q] - frame[LOWEST + q]) * inverse))
    for k in range(len(rows)):
        i = np.uint64(rows[k])
        begin, end = (one, one, one), (one, one, one)
        for q in range(d):
            low, high = lower[i, q], upper[i, q]
            valid = low <= high
            low = min(max((low - item(origin, q)) * inverse - 0.5 - SLACK, 0.0), item(last, q) + 1.0)
            high = min(max((high - item(origin, q)) * inverse + 0.5 + SLACK, -1.0), item(last, q))
            begin = tuple_setitem(begin, q, np.int64(low if valid else 0.0) + 1)
            end = tuple_setitem(end, q, np.int64((high if valid else -1.0) + 1.0))
        for z in range(begin[2], end[2] + 1):
            for y in range(begin[1], end[1] + 1):
                at = y * row + (z * layer if d == 3 else 0)
                place = np.int64(directory[np.uint64(at + begin[0])])
                behind = np.int64(directory[np.uint64(at + max(end[0] + 1, begin[0]))])
                if found + (behind - place) > len(first):
                    return np.int64(FULL)
                while place < behind:
                    there = np.uint64(order[np.uint64(place)])
                    hit = True
                    for q in range(d):
                        hit &= (lower[i, q] <= upper[there, q]) & (lower[there, q] <= upper[i, q])
                    first[np.uint64(found)] = there
                    second[np.uint64(found)] = i
                    found += hit
                    place += 1
    return found


@kernel
def even_pairs(
    lower, upper, inside, others, frame, keys, directory, order, cells, codes, work, first, second, like
):  # fmt: skip
    """Write the overlapping pairs of rows 0..inside-1 with each other and with the rows ``others`` (k,).

    Returns how many, UNEVEN if a grid does not suit the first rows, or FULL if the output is too short.
    """
    inverse, row, layer, total = count_cells(frame, inside, like)
    if inverse == 0.0:
        return np.int64(UNEVEN)
    if not find_cells(lower, upper, inside, frame, inverse, row, layer, total, keys, directory, like):
        return np.int64(UNEVEN)
    place_objects(lower, upper, inside, frame, inverse, keys, directory, order, cells, codes, like)
    count = np.int64(directory[total])  # without invalid boxes
    at, found = np.int64(0), np.int64(0)
    while at < count and found >= 0:
        held, at = _look_around(at, count, row, layer, directory, order, cells, codes, work, like)
        found = _test(held, work, lower, upper, order, first, second, found, like)
    if found >= 0:
        found = look_inside(
            others, lower, upper, frame, inverse, row, layer, directory, order, first, second, found, like
        )
    return found


class EvenGrid:
    """Overlaps among the boxes of the first rows, and of these with some that follow; made anew each time."""

    def __init__(self, dimensions: int) -> None:
        self._like = (0.0,) * dimensions
        self._work = np.empty((CHUNK + LONGEST, 4), np.int32)
        self._first, self._second = np.empty(0, np.int32), np.empty(0, np.int32)
        self._reserve(0)

    def pairs(
        self, lower: NDArray[np.float64], upper: NDArray[np.float64], frame: NDArray[np.float64], inside: int,
        others: NDArray[np.int32],
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]] | None:  # fmt: skip
        """Rows (first, second) of all overlapping pairs of rows 0..inside-1, and of these with rows ``others`` (k,).

        frame (FRAME_SIZE,): the lowest and the highest coordinates of the boxes of rows 0..inside-1, and their longest
        edge. None if a grid does not suit them, or if there are more pairs than allowed: the tree counts them. The
        arrays are views that hold until the next call.
        """
        if inside > len(self._keys):
            self._reserve(inside)
        while True:
            found = even_pairs(
                lower, upper, inside, others, frame, self._keys, self._directory, self._order, self._cells,
                self._codes, self._work, self._first, self._second, self._like,
            )  # fmt: skip
            if found == UNEVEN:
                return None
            if found != FULL:
                return self._first[:found], self._second[:found]
            if len(self._first) >= CANDIDATE_LIMIT:
                return None
            room = 2 * len(self._first)
            self._first, self._second = np.empty(room, np.int32), np.empty(room, np.int32)

    def _reserve(self, capacity: int) -> None:
        self._keys, self._order, self._cells = (np.empty(capacity, np.int32) for _ in range(3))
        self._codes = np.zeros(capacity + LANES, np.int64)
        self._directory = np.empty(int(CELLS_PER_OBJECT * capacity) + SPARE_CELLS + 4, np.int32)
        if len(self._first) < 4 * capacity + 64:
            self._first, self._second = (np.empty(4 * capacity + 64, np.int32) for _ in range(2))

"""Queries of single boxes against one tree; candidates are tested at once, without the range buffers of the pairs."""

from __future__ import annotations

from ..framework.compilation import inlined, kernel
from ..framework.vectors import item, row
from .tree_build import BASE, BEGIN, CELLS, END, LEVELS, STRIDE
from .tree_pairs import cover

SORTED_HERE = 64  # results up to this many are sorted by insertion; longer ones by numpy, from Python


@inlined
def _scan(low, high, begin, end, boxes, order, rows, found):
    """Append the rows of the sorted objects begin..end-1 that overlap; -1 if there is no room for all."""
    d = len(low)
    if found < 0 or found + (end - begin) > len(rows):
        return -1
    for k in range(begin, end):
        hit = True
        for q in range(d):
            hit &= (item(low, q) <= boxes[k, d + q]) & (boxes[k, q] <= item(high, q))
        rows[found] = order[k]
        found += hit
    return found


@kernel
def query_box(low, high, table, frame, directory, order, boxes, rows, found):
    """Append the rows whose box overlaps low..high (tuples) to ``rows``, in ascending order if they are few.

    Returns the new length, or -1 if ``rows`` may be too short: a run of cells must fit before it is tested.
    """
    start = found
    for q in range(len(low)):
        if not (item(low, q) <= item(high, q)):  # NaN or empty: overlaps nothing
            return found
    for level in range(int(frame[LEVELS]) + 1):
        if table[level, END] > table[level, BEGIN]:
            first, n0, n1, n2 = cover(low, high, table, frame, level)
            base, size = table[level, BASE], table[level, CELLS]
            for k in range(n1 * n2):
                number = first + (k % n1) * table[level, STRIDE + 1] + (k // n1) * table[level, STRIDE + 2]
                beyond = 0
                if number < 0 or number + n0 > size:
                    number %= size
                    beyond = max(number + n0 - size, 0)
                    begin, end = directory[base], directory[base + beyond]
                    found = _scan(low, high, begin, end, boxes, order, rows, found)
                begin, end = directory[base + number], directory[base + number + n0 - beyond]
                found = _scan(low, high, begin, end, boxes, order, rows, found)
    if found - start <= SORTED_HERE:
        for i in range(start + 1, found):
            value = rows[i]
            k = i
            while k > start and rows[k - 1] > value:
                rows[k] = rows[k - 1]
                k -= 1
            rows[k] = value
    return found


@kernel
def query_boxes(lower, upper, table, frame, directory, order, boxes, rows, offsets, begin, like):
    """query_box for the boxes from ``begin`` on; returns the box to continue at once ``rows`` is larger."""
    for i in range(begin, len(lower)):
        low, high = row(lower, i, like), row(upper, i, like)
        found = query_box(low, high, table, frame, directory, order, boxes, rows, offsets[i])
        if found < 0:
            return i
        offsets[i + 1] = found
    return len(lower)

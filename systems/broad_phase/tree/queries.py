"""Queries of single boxes against one tree; candidates are tested at once, without the range buffers of the pairs."""

from __future__ import annotations

from ....framework.compilation import inlined, kernel
from ....framework.vectors import item, replace, row
from .build import BASE, BEGIN, CELLS, END, FINE, HIGHEST, LEVELS, LOWEST, ORIGIN, REACH, STRIDE
from .pairs import cover

SORTED_HERE = 64  # results up to this many are sorted by insertion; longer ones by numpy, from Python


@inlined
def parts_of(first, n0, n1, n2, table, level):
    """How many parts the runs of cells have that :func:`pairs.cover` has found, and whether any wraps round.

    If one does, each run has two parts, of which the first is what lies beyond the level's end.
    """
    last = first + (n1 - 1) * table[level, STRIDE + 1] + (n2 - 1) * table[level, STRIDE + 2]
    wraps = 1 if first < 0 or last + n0 > table[level, CELLS] else 0
    return (n1 * n2) << wraps, wraps


@inlined
def cells_of(part, wraps, first, n0, n1, n2, table, directory, level):
    """The sorted objects begin..end-1 in one part."""
    base, size = table[level, BASE], table[level, CELLS]
    run = part >> wraps
    layer = 0 if n2 == 1 else run // n1  # a division takes longer than all the rest
    number = first + (run - layer * n1) * table[level, STRIDE + 1] + layer * table[level, STRIDE + 2]
    if wraps == 0:
        return directory[base + number], directory[base + number + n0]
    number %= size
    beyond = max(number + n0 - size, 0)
    if part & 1 == 0:
        return directory[base], directory[base + beyond]
    return directory[base + number], directory[base + number + n0 - beyond]


@inlined
def uncertainty(point, frame):
    """Per axis more than all rounding errors of distances between the point and the boxes that are in cells."""
    result = point
    for k in range(len(point)):
        lowest = abs(frame[ORIGIN + k] + frame[LOWEST + k] * frame[FINE])
        highest = abs(frame[ORIGIN + k] + frame[HIGHEST + k] * frame[FINE])
        result = replace(result, k, REACH * (abs(item(point, k)) + max(lowest, highest) + frame[FINE]))
    return result


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
            parts, wraps = parts_of(first, n0, n1, n2, table, level)
            for part in range(parts):
                begin, end = cells_of(part, wraps, first, n0, n1, n2, table, directory, level)
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

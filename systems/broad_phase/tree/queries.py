"""Queries of single boxes against one tree; candidates are tested at once, without the ranges of the pairs."""

from __future__ import annotations

from ....framework.compilation import part
from ....framework.vectors import item
from .cells import cells_of, cover, parts_of

SORTED_HERE = 64  # results up to this many are sorted by insertion; longer ones by numpy, from Python

ANSWERED, MORE_FOUND = 0, 1  # what the pass returns


@part
def scan(tree, low, high, begin, end, found):
    """Append the rows of the boxes begin..end-1 of the tree's order that overlap; -1 if there is no room for all."""
    boxes, order, rows, d = tree.boxes, tree.order, tree.found, len(low)
    if found < 0 or found + (end - begin) > len(rows):
        return -1
    for k in range(begin, end):
        hit = True
        for q in range(d):
            hit &= (item(low, q) <= boxes[k, d + q]) & (boxes[k, q] <= item(high, q))
        rows[found] = order[k]
        found += hit
    return found


@part
def sort_rows(rows, start, stop):
    """By insertion: there are few."""
    for i in range(start + 1, stop):
        value = rows[i]
        k = i
        while k > start and rows[k - 1] > value:
            rows[k] = rows[k - 1]
            k -= 1
        rows[k] = value


@part
def query_box(tree, low, high, start):
    """Append the rows of boxes that overlap low..high to ``found``, in ascending order if they are few.

    Returns the new length, or -1 if there may not be room: a run of cells must fit before it is tested.
    """
    found, valid = start, True
    for q in range(len(low)):
        valid &= item(low, q) <= item(high, q)
    for level in range(tree.levels + 1 if valid else 0):  # nan or empty: overlaps nothing
        if tree.level_end[level] > tree.level_begin[level]:
            runs = cover(tree, low, high, level)
            parts, wraps = parts_of(tree, level, runs)
            for part_of_run in range(parts):
                begin, end = cells_of(tree, level, runs, part_of_run, wraps)
                found = scan(tree, low, high, begin, end, found)
    if found - start <= SORTED_HERE:
        sort_rows(tree.found, start, found)
    return found


def query_boxes(tree, _):
    """A pass (see :mod:`.passes`): the boxes from ``query_done`` on; MORE_FOUND if there is no room for the next."""
    for i in range(tree.query_done, tree.query_count):
        found = query_box(tree, tree.query_lower[i], tree.query_upper[i], tree.offsets[i])
        if found < 0:
            tree.query_done = i
            return MORE_FOUND
        tree.offsets[i + 1] = found
    return ANSWERED

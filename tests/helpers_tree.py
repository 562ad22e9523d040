"""Boxes asked of a spatial tree: the walk through its cells that the kernels of queries make, without bodies."""

from __future__ import annotations

from functools import cache

import numpy as np

from carom.framework.compilation import kernel
from carom.framework.jit.records.record_type import record_at, zero_of
from carom.framework.vectors import item, row
from carom.systems.broad_phase.records import TREE
from carom.systems.broad_phase.tree.cells import cells_of, cover, parts_of


@cache
def _query(dimensions):
    tree_at = record_at(TREE, dimensions)

    @kernel
    def query_box(address, lower, upper, rows):
        tree = tree_at(address)
        found, valid = 0, True
        low, high = row(lower, 0, zero_of(tree)), row(upper, 0, zero_of(tree))
        for q in range(len(low)):
            valid &= item(low, q) <= item(high, q)
        for level in range(tree.levels + 1 if valid else 0):  # nan or empty: overlaps nothing
            if tree.level_end[level] > tree.level_begin[level]:
                runs = cover(tree, low, high, level)
                parts, wraps = parts_of(tree, level, runs)
                for part in range(parts):
                    begin, end = cells_of(tree, level, runs, part, wraps)
                    for k in range(begin, end):
                        hit = True
                        for q in range(len(low)):
                            hit &= item(low, q) <= tree.boxes[k, len(low) + q]
                            hit &= tree.boxes[k, q] <= item(high, q)
                        if hit and found < len(rows):
                            rows[found] = tree.order[k]
                            found += 1
        return found

    return query_box


def query(tree, lower, upper):
    """Rows whose box overlaps the one from ``lower`` to ``upper``, ascending; what is found twice is there twice."""
    rows = np.empty(2 * len(tree.rows), np.int64)
    box = (np.array([corner], float) for corner in (lower, upper))
    return np.sort(rows[: _query(tree.dimensions)(tree.record.address, *box, rows)])

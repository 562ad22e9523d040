"""Better cells for scenes whose bounds say nothing about their density: distant clusters, heavy tails.

Finer cells than the directory can cover wrap round, and distant places share them; coarser levels are added for what is
too large or too far out for all others. This runs seldom and only directs passes over the boxes: plain Python.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ....framework.elementary import exponent_of, power
from .build import CROWDED_LEVEL, LOOSE_CELL, MAX_LEVELS, SMALLEST_CELL, TOO_MANY, TREE_CELLS_PER_BOX

IMPROVED = 0.7  # finer cells are kept if they bring crowding below this share of what it was


def refine(tree: Any, assign: Callable[[], int]) -> None:
    """Change the cells of a tree's record until ``assign`` (one pass over all boxes) returns SUITS, or nothing helps.

    At most MAX_LEVELS passes, seldom more than two.
    """
    before, count = tree.crowding, tree.stop - tree.start
    for _ in range(MAX_LEVELS):
        former = tree.finest_cell, tree.inverse_cell, tree.levels, tree.width.copy()
        levels, cell = tree.levels, tree.finest_cell
        if levels == MAX_LEVELS - 1:
            return
        if tree.level_end[levels] - tree.level_begin[levels] > TOO_MANY + count // 256:
            tree.levels = MAX_LEVELS - 1
            assign()
            continue
        if before <= CROWDED_LEVEL * (tree.level_end[0] - tree.level_begin[0]) or cell <= 2.0 * tree.smallest_box:
            return
        finer = max(_spacing(tree), tree.smallest_box * LOOSE_CELL, SMALLEST_CELL)
        if finer > 0.5 * cell:
            return
        tree.finest_cell, tree.inverse_cell = finer, 1.0 / finer
        # The directory stays as large as it is, with equal widths: it no longer covers the extent.
        widest = max(2.0, power(float(TREE_CELLS_PER_BOX * count), 1.0 / tree.dimensions) - 1.0)
        tree.width[0] = np.minimum(tree.extent[0] / finer, widest)
        tree.levels = min(MAX_LEVELS - 1, levels + exponent_of(cell / finer))
        assign()
        if tree.crowding > IMPROVED * before:  # the boxes are in one place: the former cells again
            tree.finest_cell, tree.inverse_cell, tree.levels, tree.width[:] = former
            assign()
            return
        before = tree.crowding


def _spacing(tree: Any) -> float:
    """Mean distance of the boxes in the fullest cell of level 0: the cell size that would part them; 0 if it is 0."""
    counts = np.diff(tree.directory[1 : tree.level_cells[0] + 2])
    fullest = int(np.argmax(counts))
    inside = tree.start + np.flatnonzero(tree.keys[: tree.stop - tree.start] == fullest)
    middle = 0.5 * (tree.lower[inside] + tree.upper[inside])
    widest = float(np.max(np.ptp(middle, axis=0)))
    return widest / power(float(counts[fullest]), 1.0 / tree.dimensions)

"""Better cells for scenes whose bounds say nothing about their density: distant clusters, heavy tails.

Finer cells than the directory can cover wrap round, and distant places share them; coarser levels are added for what is
too large or too far out for all others. This runs seldom and only directs passes over the objects: plain Python.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .build import (
    BEGIN,
    CELLS,
    CELLS_PER_OBJECT,
    CROWDED,
    CROWDING,
    END,
    EXTENT,
    FINE,
    INVERSE,
    LEVELS,
    LOOSE,
    MAX_LEVELS,
    SMALL,
    SMALLEST_CELL,
    TOO_MANY,
    WIDTH,
)

IMPROVED = 0.7  # finer cells are kept if they bring crowding below this share of what it was


def refine(
    assign: Callable[[], bool],
    lower: np.ndarray,
    upper: np.ndarray,
    directory: np.ndarray,
    keys: np.ndarray,
    table: np.ndarray,
    frame: np.ndarray,
) -> None:
    """Change ``frame`` until ``assign`` (one pass over all objects) finds nothing to complain of, or nothing helps.

    ``lower, upper, keys`` are those of the objects alone. At most MAX_LEVELS passes, seldom more than two.
    """
    before = frame[CROWDING]
    for _ in range(MAX_LEVELS):
        former = frame.copy()
        levels, cell = int(frame[LEVELS]), frame[FINE]
        if levels == MAX_LEVELS - 1:
            return
        if table[levels, END] - table[levels, BEGIN] > TOO_MANY + len(keys) // 256:
            frame[LEVELS] = MAX_LEVELS - 1
            assign()
            continue
        if before <= CROWDED * (table[0, END] - table[0, BEGIN]) or cell <= 2.0 * frame[SMALL]:
            return
        finer = max(_spacing(lower, upper, directory, keys, table), frame[SMALL] * LOOSE, SMALLEST_CELL)
        if finer > 0.5 * cell:
            return
        frame[FINE], frame[INVERSE] = finer, 1.0 / finer
        d = lower.shape[1]
        # The directory stays as large as it is, with equal widths: it no longer covers the extent.
        widest = max(2.0, (CELLS_PER_OBJECT * len(keys)) ** (1 / d) - 1.0)
        frame[WIDTH : WIDTH + d] = np.minimum(frame[EXTENT : EXTENT + d] / finer, widest)
        frame[LEVELS] = min(MAX_LEVELS - 1, levels + np.ceil(np.log2(cell) - np.log2(finer)))
        assign()
        if frame[CROWDING] > IMPROVED * before:  # the objects are in one place: the former cells again
            frame[:] = former
            assign()
            return
        before = frame[CROWDING]


def _spacing(
    lower: np.ndarray, upper: np.ndarray, directory: np.ndarray, keys: np.ndarray, table: np.ndarray
) -> float:
    """Mean distance of the objects in the fullest cell of level 0: the cell size that would part them; 0 if it is 0."""
    counts = np.diff(directory[1 : table[0, CELLS] + 2])
    fullest = int(np.argmax(counts))
    inside = keys == fullest
    middle = 0.5 * (lower[inside] + upper[inside])
    widest = float(np.max(np.ptp(middle, axis=0)))
    return widest / float(counts[fullest]) ** (1.0 / lower.shape[1])

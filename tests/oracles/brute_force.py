"""All against all: the definition of an overlapping pair, for any boxes, NaN and infinities included."""

from __future__ import annotations

import numpy as np


def overlaps(lower: np.ndarray, upper: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Mask of the boxes that share a point with low..high. A box with NaN, or empty (lower above upper), never does."""
    real = np.all(lower <= upper, axis=1) & bool(np.all(low <= high))
    return real & np.all(lower <= high, axis=1) & np.all(low <= upper, axis=1)


def all_pairs(lower: np.ndarray, upper: np.ndarray) -> set[tuple[int, int]]:
    found = set()
    for i in range(len(lower)):
        later = np.flatnonzero(overlaps(lower[i + 1 :], upper[i + 1 :], lower[i], upper[i]))
        found.update((i, i + 1 + int(j)) for j in later)
    return found

"""The canonical order of pairs: by the smaller entity id, then by the larger."""

from __future__ import annotations

import numpy as np

from ..framework.compilation import kernel


@kernel
def sort_by_counting(key, order, count, starts, result):
    """Stable counting sort of order[:count] by ``key[order]``; keys are below len(starts) - 1."""
    for i in range(len(starts)):
        starts[i] = 0
    for i in range(count):
        starts[key[order[i]] + 1] += 1
    for i in range(1, len(starts)):
        starts[i] += starts[i - 1]
    for i in range(count):
        k = key[order[i]]
        result[starts[k]] = order[i]
        starts[k] += 1


def order_of_pairs(a: np.ndarray, b: np.ndarray, rank: np.ndarray) -> np.ndarray:
    """Indices that sort pairs of rows (a, b); ``rank`` is the place of a row by its entity's id."""
    first, second = rank[a], rank[b]
    if 8 * len(a) < len(rank):  # counting would spend its time on bodies that touch nothing
        return np.argsort(first * len(rank) + second, kind="stable")
    starts, half, order = np.empty(len(rank) + 1, np.int64), np.empty(len(a), np.int64), np.arange(len(a))
    sort_by_counting(second, order, len(a), starts, half)
    sort_by_counting(first, half, len(a), starts, order)
    return order

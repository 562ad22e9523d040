"""Fewer cases than all combinations of parameters: every two values of two parameters still meet."""

from __future__ import annotations

import itertools

import pytest


def pairwise(*values) -> list[tuple]:
    """Combinations of one value of each list, in which all pairs of values of two lists occur. Always the same ones."""
    pairs = list(itertools.combinations(range(len(values)), 2))
    every = list(itertools.product(*map(range, map(len, values))))

    bits = {}  # of each pair of values, the number of a bit
    for case in every:
        for i, j in pairs:
            bits.setdefault((i, case[i], j, case[j]), len(bits))
    covered = [sum(1 << bits[i, case[i], j, case[j]] for i, j in pairs) for case in every]
    missing, chosen = (1 << len(bits)) - 1, []
    while missing:
        best = max(range(len(every)), key=lambda k: (covered[k] & missing).bit_count())
        missing &= ~covered[best]
        chosen.append(every[best])
    return [tuple(of[k] for of, k in zip(values, case, strict=True)) for case in sorted(chosen)]


def half(first, second) -> list:
    """Combinations of one value of each, of which every second one is long: each value occurs in the others, too."""
    return [
        pytest.param(one, other, marks=[pytest.mark.long] * ((j + k) % 2))
        for j, one in enumerate(first) for k, other in enumerate(second)
    ]  # fmt: skip

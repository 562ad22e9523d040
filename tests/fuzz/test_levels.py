"""Random levels with characters, always the same ones; ``python -m tests.fuzz.levels`` plays others."""

from __future__ import annotations

import pytest
from fuzz.levels import play

both = pytest.mark.parametrize("d", [2, 3])
QUICK, STEPS, MANY = {2: 8, 3: 4}, 60, 5000  # levels, each with four characters


def wrong(d: int, first: int, stop: int, steps: int) -> dict[int, dict[str, str]]:
    """What went wrong, by seed."""
    found = {seed: play(d, seed, steps, goes_back=seed % 10 == 0)[0].first for seed in range(first, stop)}
    return {seed: said for seed, said in found.items() if said}


@both
@pytest.mark.slow
def test_characters_never_float_stick_jitter_or_come_into_walls(d):
    assert wrong(d, 0, QUICK[d], STEPS) == {}


@both
@pytest.mark.long
def test_nor_in_thousands_of_levels(d):
    assert wrong(d, QUICK[d], MANY, 250) == {}

"""Programs over the public API, always the same ones; ``python -m tests.fuzz.programs`` plays others."""

from __future__ import annotations

import pytest
from fuzz.programs import run


@pytest.mark.slow
def test_programs_keep_their_promises():
    for seed in range(200):
        run(seed)


@pytest.mark.long
def test_thousands_of_programs_keep_their_promises():
    for seed in range(200, 20_000):
        run(seed)

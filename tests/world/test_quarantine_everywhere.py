"""Values that cannot be, in every column of every body of small worlds; checked indices: test_checked_build."""

from __future__ import annotations

import pytest
from helpers_poison import MODES, complaints, scenes

pytestmark = [pytest.mark.slow, pytest.mark.early]

# Each mode takes every second or third body, each mode others: all shapes that move in each, all bodies over the three.
# Every column of every body gets two of the four values, and every column of every world all of them. Every second of
# these bodies waits for the long run.
SHARES = {"mixed 2D": 3, "mixed 3D": 2, "platformer": 1}


def cases():
    for name, build in scenes():
        kind, _, mode = name.rpartition(" ")
        first, share = MODES.index(mode), SHARES[kind]
        for part, marks in enumerate(((), pytest.mark.long)):
            victims = slice(first % share + part * share, None, 2 * share)
            yield pytest.param(build, victims, first, id=f"{name} {part}", marks=marks)


@pytest.mark.parametrize(("build", "victims", "first"), list(cases()))
def test_values_that_cannot_be_in_every_column_of_every_body(build, victims, first):
    """nan, inf, -inf and -1: others stay finite, and as if it was deleted if a fault names the body."""
    assert list(complaints(build, victims, first)) == []

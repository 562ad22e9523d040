"""Columns of records in compiled code: vectors whose components are apart, what is one number in 2D, rows on the stack.
"""

from __future__ import annotations

import numpy as np
import pytest

from carom.framework.compilation import kernel
from carom.framework.jit.records.record import make_record
from carom.framework.jit.records.record_type import record_at, zero_of
from carom.framework.jit.records.schema import Schema, floats, integer, vectors
from carom.framework.jit.records.stack_record import stack_record
from carom.framework.vectors import add, scale

ROWS = 5
PAIRS = Schema(
    "Pairs",
    unshared=True,
    rows=integer(),
    way=vectors(apart=True),
    spin=vectors(apart=True, flat=1),
    beside=vectors(flat=0),
    turn=vectors(flat=1),
    weight=floats(),
)
SCRATCH = Schema("Scratch", unshared=True, way=vectors(apart=True), spin=vectors(apart=True, flat=1), weight=floats())
make_scratch = stack_record(SCRATCH, ROWS)


def kernel_of(d):
    """Each way becomes itself and its spin, times its weight."""
    at = record_at(PAIRS, d)

    @kernel
    def rewrite(address: int) -> int:
        pairs = at(address)
        scratch = make_scratch(zero_of(pairs))
        for k in range(pairs.rows):
            scratch.way[k], scratch.spin[k], scratch.weight[k] = pairs.way[k], pairs.spin[k], pairs.weight[k]
        for k in range(pairs.rows):
            moved = add(add(scratch.way[k], scratch.spin[k]), pairs.beside[k])
            pairs.way[k] = scale(moved, scratch.weight[k])
            pairs.turn[k] = pairs.spin[k]
        return 0

    return rewrite


@pytest.mark.plain
@pytest.mark.parametrize("d", [2, 3])
def test_columns_hold_what_they_are_given(d):
    pairs, random = make_record(PAIRS, d), np.random.default_rng(d)
    pairs.reserve(2, "way")
    pairs.way[:] = kept = random.normal(size=(d, 2))
    names = [name for name in PAIRS.fields if name != "rows"]
    pairs.reserve(ROWS, *names)
    assert (pairs.way[:, :2] == kept).all()
    assert pairs.way.shape == (d, ROWS) == (d, pairs.rows_of("way"))
    assert [pairs.spin.shape, pairs.turn.shape, pairs.beside.shape] == (
        [(1, ROWS), (ROWS, 1), (ROWS, 0)] if d == 2 else [(3, ROWS), (ROWS, 3), (ROWS, 3)]
    )
    way, spin, weight = random.normal(size=(d, ROWS)), random.normal(size=pairs.spin.shape), random.normal(size=ROWS)
    pairs.rows, pairs.way[:], pairs.spin[:], pairs.weight[:] = ROWS, way, spin, weight
    kernel_of(d)(pairs.address)
    whole = np.zeros((d, ROWS))
    whole[: len(spin)] = spin
    assert (pairs.way == (way + whole) * weight).all()
    assert (pairs.turn == spin.T).all()

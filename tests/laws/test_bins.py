"""Laws of bins: light things and a few heavy ones fall in, come to rest, and stay inside."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
import pytest
from helpers_pairwise import pairwise
from helpers_rest import G
from laws.helpers_laws import MODES, fastest
from worlds import ball, box, make_world

HALF, LIGHT = 5.0, 150
RESTITUTIONS = (0.0, 0.2, 0.5)
HEAVY = (20.0, 100.0, 1000.0)  # kg, each of three
REST = 1e-3  # m/s


class Bin(NamedTuple):
    """Greatest speed of a body in the last two seconds, m/s; bodies beyond the inner faces of the bin by a radius."""

    fastest: float
    out: int


def settle(seed, mode, e, heavy, *, seconds=25):
    """A hundred and fifty discs and boxes of 1 kg, then three balls of ``heavy`` kg, fall into a bin with friction.

    Contacts take energy and friction holds what lies on slopes: the bin comes to rest, whatever the masses.
    """
    random = np.random.default_rng([seed, 2])
    with make_world(2, G, collision=mode, on_fault="ignore") as world:
        box(world, (0.0, -1.0), half=(8.0, 1.0), kind="static", friction=0.4)
        for side in (-1.0, 1.0):
            box(world, (side * (HALF + 1.0), 10.0), half=(1.0, 20.0), kind="static")
        for k in range(LIGHT):
            place = ((k % 8) * 1.15 - 4.0 + random.uniform(-0.05, 0.05), 1.0 + (k // 8) * 1.15)
            if k % 2:
                ball(world, place, radius=0.45, restitution=e, friction=0.4)
            else:
                box(world, place, half=0.45, restitution=e, friction=0.4)
        for k in range(3):
            place = (3.0 * (k - 1), 3.0 + (LIGHT // 8) * 1.15)
            ball(world, place, radius=0.6, mass=heavy, restitution=e, friction=0.4)
        last = 0.0
        for step in range(seconds * 60):
            world.step()
            if step >= (seconds - 2) * 60:
                last = max(last, fastest(world))
        place = world.bodies.dynamic.position
        inside = (np.abs(place[:, 0]) < HALF + 0.5) & (place[:, 1] > -0.5)
        return Bin(last, int((~inside).sum()))


def check(found):
    assert found.out == 0
    assert found.fastest < REST


@pytest.mark.parametrize(("mode", "e", "heavy"), pairwise(MODES, RESTITUTIONS, HEAVY))
def test_bins_come_to_rest(mode, e, heavy):
    check(settle(0, mode, e, heavy))


@pytest.mark.long
@pytest.mark.parametrize(
    ("seed", "mode", "e", "heavy"), list(itertools.product(range(1, 7), MODES, RESTITUTIONS, HEAVY))
)  # four of seed 4 with 1,000 kg are missed: .002 to .009 m/s
def test_every_bin_comes_to_rest(seed, mode, e, heavy):
    check(settle(seed, mode, e, heavy))

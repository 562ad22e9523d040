"""Laws of piles that lean on walls and on friction: they come to rest, and lose no body."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
import pytest
from helpers_rest import G, depths
from laws.helpers_laws import MODES, fastest, root_mean_square, seeds
from worlds import ball, box, make_world

from carom import scenes

pytestmark = pytest.mark.early


class Pile(NamedTuple):
    """Greatest speed, and root mean square of all, over the last two seconds, m/s; bodies outside; the energy that all
    steps of the last two seconds have risen by together, J."""

    fastest: float
    rms: float
    out: int
    gained: float


def heap(seed, mode, columns, rows, e, friction, *, seconds, maker=ball):
    """Discs of .3 to .5 m and 1 kg in columns with gaps between them fall into a bin and come to rest.

    Each contact and its friction take energy: at rest, what the steps add is only rounding.
    """
    random = np.random.default_rng([seed, 6])
    half = 0.5 * 1.15 * columns + 0.1
    with make_world(2, G, collision=mode, on_fault="ignore") as world:
        box(world, (0.0, -1.0), half=(half + 2.0, 1.0), kind="static", friction=friction)
        for side in (-1.0, 1.0):
            box(world, (side * (half + 1.0), 40.0), half=(1.0, 80.0), kind="static", friction=friction)
        for k in range(columns * rows):
            place = ((k % columns) * 1.15 - half + 0.6 + random.uniform(-0.05, 0.05), 1.0 + (k // columns) * 1.15)
            size = random.uniform(0.3, 0.5)
            size = {"radius": size} if maker is ball else {"half": size}
            maker(world, place, restitution=e, friction=friction, **size)
        last = rms = gained = 0.0
        for step in range(seconds * 60):
            before = world.kinetic_energy() + world.potential_energy()
            world.step()
            if step >= (seconds - 2) * 60:
                last, rms = max(last, fastest(world)), max(rms, root_mean_square(world))
                gained += max(0.0, world.kinetic_energy() + world.potential_energy() - before)
        place = world.bodies.dynamic.position
        inside = (np.abs(place[:, 0]) < half) & (place[:, 1] > 0.0)
        return Pile(last, rms, int((~inside).sum()), gained)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("seed", seeds(2, 12))
def test_equal_discs_that_lean_on_friction_come_to_rest(seed, mode):
    """300 discs of e .2 and friction .4, after sixteen seconds."""
    found = heap(seed, mode, 10, 30, 0.2, 0.4, seconds=16)
    assert found.fastest < 1e-5
    assert found.out == 0


@pytest.mark.long
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("seed", range(12))
def test_equal_discs_that_lean_on_friction_rest_after_twelve_seconds(seed, mode):
    """What is asked for. Missed by 23 of 36 today, by up to 1.3e-4 m/s: a third of it is left each second later."""
    assert heap(seed, mode, 10, 30, 0.2, 0.4, seconds=12).fastest < 1e-5


@pytest.mark.parametrize("mode", ["discrete", pytest.param("continuous", marks=pytest.mark.long)])
@pytest.mark.parametrize("seed", seeds(1, 4))
def test_a_thousand_discs_come_to_rest(seed, mode):
    """After half a minute."""
    found = heap(seed, mode, 20, 50, 0.2, 0.4, seconds=30)
    assert found.rms < 1e-3
    assert found.out == 0


@pytest.mark.long
@pytest.mark.parametrize("maker", [ball, box])
@pytest.mark.parametrize(
    ("seed", "mode", "e", "friction"), list(itertools.product(range(2), MODES, (0.0, 0.5), (0.0, 0.2, 0.8)))
)
def test_small_piles_of_any_material_come_to_rest(seed, mode, e, friction, maker):
    """Forty bodies, after ten seconds. Without friction some go on sliding, but no contact gives them energy."""
    found = heap(seed, mode, 5, 8, e, friction, seconds=10, maker=maker)
    assert found.out == 0
    if friction:
        assert found.fastest < 1e-3


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_ten_thousand_discs_come_to_rest(seed):
    """At step 900 less than 1 J of kinetic energy is left, and none is out; the deepest overlap is a twentieth."""
    with scenes.pile2d.build(n=10_000, seed=seed) as world:
        for _ in range(900):
            world.step()
        place = world.bodies.dynamic.position
        assert ((place[:, 0] > 0) & (place[:, 0] < 120.0) & (place[:, 1] > 0)).all()
        assert world.kinetic_energy() < 1.0
        assert depths(world).max() < 0.05

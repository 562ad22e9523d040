"""Laws of overlapping spawns: what is created in each other parts slowly, and nothing is thrown or pressed out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from helpers_rest import G
from laws.helpers_laws import MODES, beyond, fastest, seeds, walls
from worlds import ball, box, make_world

HALF, WALL = 3.0, 2.0


class Spawn(NamedTuple):
    """The farthest coordinate of a body at any step, m, and the faults of the world."""

    farthest: float
    faults: list[str]


def corner(seed, mode):
    """Two to seven bodies of 1 kg at random places, in each other, in walls and in two static discs, in a room of 6 m.

    They have no more energy than their speeds and their height, and are pushed out of each other slowly: none comes
    beyond the outer faces of the walls.
    """
    random = np.random.default_rng([seed, 3])
    rate, substeps = int(random.choice([30, 60, 120])), int(random.choice([1, 2, 4, 8]))
    e = float(random.choice([0.0, 0.5]))
    with make_world(2, G, collision=mode, dt=1 / rate, substeps=substeps, on_fault="ignore") as world:
        walls(world, HALF, WALL, friction=0.5)
        for _ in range(2):
            ball(world, random.uniform(-HALF, HALF, 2), kind="static", radius=random.uniform(0.3, 1.2))
        for _ in range(random.integers(2, 8)):
            place, speed = random.uniform(-HALF, HALF, 2), 2.0 * random.normal(size=2)
            size = random.uniform(0.2, 1.5)
            if random.random() < 0.7:
                ball(world, place, speed, radius=size, restitution=e, friction=0.5)
            else:
                box(world, place, speed, half=size, restitution=e, friction=0.5)
        farthest = 0.0
        for _ in range(20):
            world.step()
            place = np.abs(world.bodies.dynamic.position)
            if not np.isfinite(place).all():
                return Spawn(np.inf, list(world.faults))
            farthest = max(farthest, float(place.max()))
        return Spawn(farthest, list(world.faults))


def out(first, count, mode):
    """Seeds whose rooms a body has left, with how far it went."""
    found = {seed: corner(seed, mode).farthest for seed in range(first, first + count)}
    return {seed: farthest for seed, farthest in found.items() if not farthest <= HALF + WALL}


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_nothing_is_thrown_out_of_a_tight_room(mode):
    assert out(0, 30, mode) == {}


@pytest.mark.long
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("first", range(30, 3330, 300))
def test_nothing_is_thrown_out_of_ten_thousand_tight_rooms(mode, first):
    assert out(first, 300, mode) == {}


# -- no room ---------------------------------------------------------------------------------------


class Crowd(NamedTuple):
    """Greatest speed at any step, m/s; bodies beyond the middle of the walls; faults that do not say "no room"."""

    fastest: float
    out: int
    others: list[str]


def crowd(seed, mode, *, steps=80):
    """Five hundred discs of 0.6 m, 141 m² in all, in a room of 100 m² without gravity: they cannot all have room.

    What has none is not pushed harder and harder: speeds stay below those at which two overlapping bodies part.
    """
    random = np.random.default_rng([seed, 4])
    with make_world(2, collision=mode, on_fault="ignore") as world:
        walls(world, 5.0, 2.0)
        for _ in range(500):
            ball(world, random.uniform(-4.4, 4.4, 2), radius=0.3)
        most, lost = 0.0, 0
        for _ in range(steps):
            world.step()
            most, lost = max(most, fastest(world)), max(lost, beyond(world, 6.0))
        return Crowd(most, lost, [text for text in world.faults if "no room" not in text])


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("seed", seeds(1, 8, known=(5,)))
def test_a_crowd_without_room_stays_slow(seed, mode):
    found = crowd(seed, mode)
    assert found.fastest < 1.5
    assert found.out == 0
    assert found.others == []


def point(seed, mode, d):
    """A hundred bodies within a thousandth of their size of one point, of 1e-3 to 1e3 kg: the greatest speed, m/s."""
    random = np.random.default_rng([seed, 5])
    with make_world(d, collision=mode, on_fault="ignore") as world:
        for _ in range(100):
            ball(world, 1e-3 * random.normal(size=d), mass=10.0 ** random.uniform(-3.0, 3.0))
        most = 0.0
        for _ in range(60):
            world.step()
            most = max(most, fastest(world))
        return most


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("seed", seeds(1, 4))
def test_unequal_bodies_at_one_point_part_slowly(seed, mode, d):
    """At most two sizes a second, however light some are."""
    assert point(seed, mode, d) < 2.0

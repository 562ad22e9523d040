"""Rooms of mixed masses, sizes and speeds: no body that others push passes a wall, in any mode's valid range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from worlds import ball, both_dimensions, box, make_world

HALF = 10.0  # m, half width of the rooms
BODIES = 60
SECONDS, WAY = 2.0, 2000.0  # s and m: as long as each room is played, at most so far as its bodies then go
IMPACTS = 50_000  # or until there were so many: in rooms of light bodies between fast heavy ones there are 800,000


@dataclass(frozen=True)
class Room:
    """How one room is filled; walls and radius in m, speed in m/s."""

    dt: float
    wall: float
    radius: float
    smallest: float
    masses: float
    speed: float
    restitution: float


def drawn(mode, seed):
    """A room within the valid range of the mode: discrete up to 10 m/s at 60 Hz with walls of at least one radius,
    the others 1 to 1e4 m/s, walls of 1 cm to 2 m, sizes to 1:100, steps of 1/20 to 1/240 s; masses to 1:1e6.

    In discrete bodies of mixed masses do not bounce well: elastic impacts share energy evenly, so that a light body
    among heavy ones of 10 m/s would reach sqrt(M / m) 10 m/s."""
    random = np.random.default_rng([seed, 15])
    e, masses = random.choice([0.0, 0.3, 0.8, 1.0]), random.choice([0.0, 1.0, 2.0, 3.0])
    if mode == "discrete":
        e = e if masses == 0.0 else min(e, 0.3)
        return Room(1 / 60, random.choice([0.6, 2.0]), 0.6, 0.6, masses, random.uniform(1.0, 10.0), e)
    smallest = 0.6 * random.choice([1.0, 0.1, 0.01])
    dt, wall = 1 / random.choice([20, 60, 240]), random.choice([0.01, 0.1, 2.0])
    return Room(dt, wall, 0.6, smallest, masses, 10.0 ** random.uniform(0.0, 4.0), e)


def check_room(d, mode, room, seed, gravity=9.81):
    """Play it; at no step is a body beyond the outer face of a wall."""
    random = np.random.default_rng(seed)
    world = make_world(d, gravity, collision=mode, dt=room.dt)
    for axis in range(d):
        for side in (-1.0, 1.0):
            place, half = np.zeros(d), np.full(d, HALF + room.wall)
            place[axis], half[axis] = side * (HALF + 0.5 * room.wall), 0.5 * room.wall
            box(world, place, half=half, kind="static", restitution=room.restitution)
    side = 8 if d == 2 else 4
    for k in range(BODIES):
        place = (np.array(np.unravel_index(k, (side,) * d)) - 0.5 * (side - 1)) * 2.2
        way = random.normal(size=d)
        ball(
            world, place, room.speed * way / np.linalg.norm(way), radius=np.exp(random.uniform(*np.log((room.smallest,
            room.radius)))), mass=10.0 ** random.uniform(-room.masses, room.masses), restitution=room.restitution,
        )  # fmt: skip
    for _ in range(max(10, round(min(SECONDS, WAY / room.speed) / room.dt))):
        world.step()
        place = world.bodies.dynamic.position
        assert np.isfinite(place).all(), (seed, world.step_count)
        outside = np.flatnonzero((np.abs(place) > HALF + room.wall).any(axis=1))
        assert not len(outside), (seed, world.step_count, outside, world.faults[:1])
        if world.stats().counters["impacts"] > IMPACTS:
            break
    assert len(world.bodies.dynamic) == BODIES
    world.close()


MODES = ("discrete", "continuous", "event_driven")


FEW = [(d, mode, seed) for d in (2, 3) for mode in MODES for seed in range(4)]


@pytest.mark.parametrize(("d", "mode", "seed"), FEW)
def test_nobody_leaves_a_room(d, mode, seed):
    check_room(d, mode, drawn(mode, seed), seed)


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    "first", [4, 14, *(pytest.param(first, marks=pytest.mark.long) for first in range(24, 104, 10))]
)
def test_nobody_leaves_a_hundred_rooms(d, mode, first):
    for seed in range(first, first + 10):
        check_room(d, mode, drawn(mode, seed), seed)


@pytest.mark.parametrize("mode", ["continuous", "event_driven"])
@pytest.mark.parametrize("wall", [0.1, 2.0])
def test_masses_of_one_to_a_million_stay(mode, wall):
    """As it was found: nine of ten such rooms lost a body, one of twelve made NaN at dt 1/20."""
    for seed, dt in ((1, 1 / 60), (2, 1 / 20)):
        check_room(2, mode, Room(dt, wall, 0.6, 0.6, 3.0, 10.0, 0.3), seed)


@pytest.mark.parametrize("seed", range(2))
def test_masses_of_one_to_a_million_stay_in_discrete(seed):
    """At most 10 m/s at 60 Hz, walls of at least one radius."""
    check_room(2, "discrete", Room(1 / 60, 2.0, 0.6, 0.6, 3.0, 10.0, 0.3), seed)

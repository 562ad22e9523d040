"""Rooms of bodies at up to 1e4 m/s: what is swept passes no wall, however thin it is and whatever pushes it."""

from __future__ import annotations

import numpy as np
import pytest
from worlds import ball, both_dimensions, box, make_world

HALF = 10.0  # m, half width of the rooms
IMPACTS = 20_000  # a room ends after so many: light bodies between fast heavy ones have forty times as many


@pytest.mark.parametrize("mode", ["continuous", "event_driven"])
@both_dimensions
@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(4, 100))])
def test_nothing_leaves_a_room_at_any_speed(seed, d, mode):
    """Sixty bodies of 1 to 1e4 m/s, sizes to 1:100, masses to 1:1e6; walls of 1 cm to 2 m, steps of 1/20 to 1/240 s."""
    random = np.random.default_rng([seed, 15])
    e, masses = random.choice([0.0, 0.3, 0.8, 1.0]), random.choice([0.0, 1.0, 2.0, 3.0])
    smallest, dt = 0.6 * random.choice([1.0, 0.1, 0.01]), 1 / random.choice([20, 60, 240])
    wall, speed = random.choice([0.01, 0.1, 2.0]), 10.0 ** random.uniform(0.0, 4.0)
    with make_world(d, 9.81, collision=mode, dt=dt) as world:
        for axis in range(d):
            for side in (-1.0, 1.0):
                place, half = np.zeros(d), np.full(d, HALF + wall)
                place[axis], half[axis] = side * (HALF + 0.5 * wall), 0.5 * wall
                box(world, place, half=half, kind="static", restitution=e)
        row = 8 if d == 2 else 4
        for k in range(60):
            place = (np.array(np.unravel_index(k, (row,) * d)) - 0.5 * (row - 1)) * 2.2
            way, radius = random.normal(size=d), np.exp(random.uniform(*np.log((smallest, 0.6))))
            mass = 10.0 ** random.uniform(-masses, masses)
            ball(world, place, speed * way / np.linalg.norm(way), radius=radius, mass=mass, restitution=e)
        for _ in range(max(10, round(min(2.0, 2000.0 / speed) / dt))):
            world.step()
            place = world.bodies.dynamic.position
            assert (np.abs(place) <= HALF + wall).all(), (world.step_count, world.faults[:1])
            if world.stats().counters["impacts"] > IMPACTS:
                break
        assert len(place) == 60

"""Laws of containment: in rooms of any masses, sizes, speeds and walls, no body comes out."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from helpers_pairwise import pairwise
from laws.helpers_laws import SWEPT, beyond, seeds, walls
from worlds import METHODS, ball, both_dimensions, box, make_world

from carom import RigidBody, Transform
from carom.plugins.rotation import BoxCollider, Rotation, Spin

TOO_FAST = "so fast that discrete collisions may miss"
IMPACTS = 50_000  # of a room, then it ends: elastic bodies of very different masses have millions


class Kept(NamedTuple):
    """Bodies out of the room at any step; the faults."""

    out: int
    faults: list[str]


def room(seed, mode):
    """A room drawn by its seed: 2D or 3D, walls of 1 cm to 2 m, 20 to 120 bodies with masses to 1:1e6, sizes to 1:10,
    speeds of 3 to 100 m/s, at 60 or 20 Hz, with gravity, friction, sleeping and any integrator.

    What is swept cannot pass a wall, whoever pushes it.
    """
    random = np.random.default_rng([seed, 8])
    d = 2 if random.random() < 0.7 else 3
    rate, wall = int(random.choice([60, 20])), float(random.choice([0.01, 0.1, 2.0]))
    masses, e = float(random.choice([1.0, 10.0, 100.0, 1e3, 1e3, 1e3])), float(random.choice([0.0, 0.3, 0.8, 1.0]))
    speed, gravity = float(random.choice([3.0, 10.0, 30.0, 100.0])), float(random.choice([0.0, 9.81, 9.81, 50.0]))
    method = str(random.choice(METHODS)) if random.random() < 0.4 else "semi_implicit_euler"
    count, half = int(random.choice([20, 60, 120])), float(random.choice([4.0, 7.0, 10.0]))
    makers = ((ball, ball), (box, box), (ball, box))[random.integers(3)]
    friction = None if random.random() < 0.5 else 0.5
    smallest, sleeping = float(random.choice([1.0, 3.0, 10.0])), bool(random.random() < 0.3)
    settings = {"collision": mode, "dt": 1 / rate, "integrator": method, "sleeping": sleeping}
    with make_world(d, gravity, on_fault="ignore", **settings) as world:
        walls(world, half, wall, restitution=e, friction=friction)
        row = int(np.ceil(count ** (1 / d)))
        cell = 2 * half / row
        for k in range(count):
            place = (np.array(np.unravel_index(k, (row,) * d)) + 0.5) * cell - half
            way = random.normal(size=d)
            size = min(0.45 * cell, 0.6) * smallest ** -random.uniform(0.0, 1.0)
            mass, maker = masses ** random.uniform(-1.0, 1.0), makers[random.integers(2)]
            size = {"radius": size} if maker is ball else {"half": size}
            velocity = speed * way / np.linalg.norm(way)
            maker(world, place, velocity, mass=mass, restitution=e, friction=friction, **size)
        out = 0
        for _ in range(150):
            world.step()
            out = max(out, beyond(world, half + wall))
            if out or world.stats().counters["impacts"] > IMPACTS:
                break
        return Kept(out, list(world.faults))


def too_fast(found):
    return any(TOO_FAST in text for text in found.faults)


@pytest.mark.parametrize("mode", SWEPT)
@pytest.mark.parametrize("seed", seeds(3, 500))
def test_what_is_swept_stays_inside(seed, mode):
    found = room(seed, mode)
    assert found.out == 0, found.faults[-1:]


@pytest.mark.slow
@pytest.mark.parametrize("seed", seeds(9, 500))
def test_discrete_bodies_stay_inside_or_are_called_too_fast(seed):
    found = room(seed, "discrete")
    assert found.out == 0 or too_fast(found), found.faults[-1:]


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.45, 0.55, 0.9])
def test_what_is_struck_into_a_thin_wall_stays_or_is_called_too_fast(share):
    """What is struck within a step meets nothing else until the next, which pushes it out on the side where its centre
    is: in a step it may go half its size and that of the wall, half as far as what flies freely. Any phase, any gap."""
    for k in range(0, 100, 3):
        with make_world(2, collision="discrete", on_fault="ignore") as world:
            box(world, (10.0, 0.0), half=(0.005, 20.0), kind="static", restitution=1.0)
            way, gap = share * 1.01, (0.01, 0.1, 0.2, 0.3, 0.4)[k % 5]
            ball(world, (9.495 - gap, 0.0), radius=0.5, restitution=1.0)
            ball(world, (8.47 - gap - (3 + k / 100) * way, 0.0), (60 * way, 0.0), radius=0.5, restitution=1.0)
            for _ in range(12):
                world.step()
            told = any(TOO_FAST in text for text in world.faults)
            assert told == (share > 0.5)
            assert told or (world.bodies.dynamic.position[:, 0] < 10.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("mode", SWEPT)
@pytest.mark.parametrize("seed", seeds(5, 1000, known=(508, 2073, 2905, 3539)))
def test_what_is_swept_stays_inside_under_any_pull(seed, mode):
    """Ten to thirty bodies of 1 m behind walls of 5 cm: gravity moves them by .03 to 3 m in a step from rest, so far
    that between two impacts within a step they fall through what they lie on."""
    random = np.random.default_rng([seed, 16])
    dt, maker, half, wall = 1 / 60, (ball, box)[random.integers(2)], 6.0, 0.05
    pull, speed = 10 ** random.uniform(-1.5, 0.5), 10 ** random.uniform(-1.5, 1.5)
    with make_world(2, pull / dt**2, collision=mode, on_fault="ignore") as world:
        walls(world, half, wall, restitution=1.0)
        cells = random.permutation(36)[: random.integers(10, 31)]
        for place in 2.0 * np.stack(np.unravel_index(cells, (6, 6)), axis=1) - 5.0:
            way = random.normal(size=2)
            maker(world, place, speed / dt * way / np.linalg.norm(way), restitution=float(random.choice([0.3, 1.0])))
        for _ in range(60):
            world.step()
            assert beyond(world, half + wall) == 0, (world.step_count, world.faults[-1:])


@pytest.mark.slow
@pytest.mark.parametrize("mode", SWEPT)
@both_dimensions
@pytest.mark.parametrize("seed", seeds(2, 100))
def test_nothing_leaves_a_room_at_any_speed(seed, d, mode):
    """Sixty bodies of 1 to 1e4 m/s, sizes to 1:100, masses to 1:1e6; walls of 1 cm to 2 m, steps of 1/20 to 1/240 s."""
    random = np.random.default_rng([seed, 15])
    e, masses = random.choice([0.0, 0.3, 0.8, 1.0]), random.choice([0.0, 1.0, 2.0, 3.0])
    smallest, dt = 0.6 * random.choice([1.0, 0.1, 0.01]), 1 / random.choice([20, 60, 240])
    wall, speed, half = random.choice([0.01, 0.1, 2.0]), 10.0 ** random.uniform(0.0, 4.0), 10.0
    with make_world(d, 9.81, collision=mode, dt=dt) as world:
        walls(world, half, wall, restitution=e)
        row = 8 if d == 2 else 4
        for k in range(60):
            place = (np.array(np.unravel_index(k, (row,) * d)) - 0.5 * (row - 1)) * 2.2
            way, radius = random.normal(size=d), np.exp(random.uniform(*np.log((smallest, 0.6))))
            mass = 10.0 ** random.uniform(-masses, masses)
            ball(world, place, speed * way / np.linalg.norm(way), radius=radius, mass=mass, restitution=e)
        # Light ones between fast heavy ones have forty times as many impacts.
        for _ in range(max(10, round(min(2.0, 2000.0 / speed) / dt))):
            world.step()
            assert beyond(world, half + wall) == 0, (world.step_count, world.faults[:1])
            if world.stats().counters["impacts"] > 20_000:
                break
        assert len(world.bodies.dynamic) == 60


@pytest.mark.parametrize(("mode", "e"), pairwise(SWEPT, (0.0, 0.5)))
@pytest.mark.parametrize("seed", seeds(6, 600, known=(67, 119, 168)))
def test_no_arrow_passes_a_wall_however_both_are_turned(seed, mode, e):
    """Both 2 cm thick: how thin they are does not depend on how they are turned, nor which pairs are swept."""
    random = np.random.default_rng(seed)
    leans, turned, speed = random.uniform(0.5, 1.1), random.uniform(0, 6.3), random.uniform(2, 12)
    out = np.array((-math.sin(leans), math.cos(leans)))
    with make_world(collision=mode) as world:
        world.add_plugin(Rotation())
        world.create_entity(Transform((0, 0), leans), BoxCollider((5, 0.01), restitution=e))
        arrow = RigidBody(linear_velocity=-out * speed)
        world.create_entity(Transform(1.5 * out, turned), arrow, Spin(), BoxCollider((0.5, 0.01), restitution=e))
        for _ in range(60):
            world.step()
            assert world.bodies.dynamic.position[0] @ out > -0.05

"""The same in space, where the axis about which a bar turns moves: impacts find it as it is turned at their time."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from rotation.helpers_turning import box, part, turning_world
from scipy.spatial.transform import Rotation as Turn
from worlds import MODES
from worlds import run as take

from carom.components import AABBCollider, RigidBody, Transform
from carom.plugins import terrain
from carom.plugins.rotation import Spin
from carom.plugins.terrain import create_height_field

pytestmark = [pytest.mark.slow, pytest.mark.compiled]

HALF, FASTEST, APART, STEPS, CELL = np.array((1.0, 0.01, 0.01)), 500.0, 60.0, 15, 1.5
MOMENTS = np.array((2e-4, 1.0001, 1.0001)) / 3.0  # of 1 kg
EDGE = 4 * CELL  # from the middle of the ground


def level_of(heights, x, z):
    """The height of the ground of one bar; far below beside it."""
    i, j = np.floor((x + EDGE) / CELL).astype(int), np.floor((z + EDGE) / CELL).astype(int)
    on = (i >= 0) & (i < 8) & (j >= 0) & (j < 8)
    i, j = np.where(on, i, 0), np.where(on, j, 0)
    u, v = (x + EDGE) / CELL - i, (z + EDGE) / CELL - j
    a, b, c, d = heights[i, j], heights[i + 1, j], heights[i, j + 1], heights[i + 1, j + 1]
    level = np.where(u + v < 1, a + (b - a) * u + (c - a) * v, d + (c - d) * (1 - u) + (b - d) * (1 - v))
    return np.where(on, level, -9.0)


def turns_of(bodies):
    return Turn.from_quat(bodies.rotation.reshape(-1, 4)[:, [1, 2, 3, 0]])


def motion_of(world, bodies, bars):
    """(kinetic energies, angular momenta about the vertical) of the bars."""
    spins = np.array([part(world, bar, Spin).angular_velocity for bar in bars])
    turns = turns_of(bodies)
    own = turns.apply(spins, inverse=True)
    energy = 0.5 * (bodies.linear_velocity**2).sum(1) + 0.5 * (MOMENTS * own**2).sum(1)
    return energy, turns.apply(MOMENTS * own)[:, 1]


def run(mode, ground, e, friction, seed, count):
    """(how many bars have their middle behind the ground after some step; how deep any ever is in it; how far any has
    changed its energy, and its angular momentum about the vertical, as parts of these)."""
    random, passed, deepest = np.random.default_rng(seed), np.zeros(count, bool), 0.0
    heights = random.uniform(-0.5, 0.5, (count, 9, 9)) * (ground == "mesh")
    turns = Turn.from_quat(random.normal(size=(count, 4)))
    axes, rates = random.normal(size=(count, 3)), random.uniform(-FASTEST, FASTEST, count)
    spins = axes / np.linalg.norm(axes, axis=1)[:, None] * rates[:, None]
    high = 0.5 + np.abs(turns.as_matrix()[:, 1]) @ HALF + random.uniform(0.02, 3.0, count)
    velocities = random.uniform(-10, 10, (count, 3))
    velocities[:, 1] = random.uniform(-30, 0, count)
    material: Any = {"restitution": e, "friction": friction}
    with turning_world(3, 0, terrain.plugin, collision=mode, on_fault="ignore") as world:
        bars = []
        for k in range(count):
            x = k * APART
            if ground == "mesh":
                create_height_field(world, heights[k], CELL, position=(x - EDGE, 0, -EDGE), **material)
            else:
                wall = AABBCollider((EDGE, 0.02, EDGE), **material)
                world.create_entity(Transform((x, -0.02, 0)), RigidBody(kind="static"), wall)
            turn = turns[k].as_quat()[[3, 0, 1, 2]]
            bars.append(box(world, (x, high[k], 0), HALF, velocities[k], spins[k], turn, **material))
        motions: list[tuple] = []
        for _ in range(STEPS):
            world.step()
            bodies, gaps = world.bodies.dynamic, []
            motions.append(motion_of(world, bodies, bars))
            along = turns_of(bodies).as_matrix()[:, :, 0]
            for share in np.linspace(-1, 1, 41):
                at = bodies.position + share * along
                gaps.append([p[1] - level_of(heights[k], p[0] - k * APART, p[2]) for k, p in enumerate(at)])
            passed |= np.abs(np.array(gaps[20]) + 1.0) < 1.0
            deepest = max(deepest, -np.min(np.where(np.array(gaps[20]) > -2.0, gaps, 0.0)))
        changed = [np.max(np.abs(b - a) / (1.0 + np.abs(a))) for a, b in zip(motions[0], motions[-1], strict=True)]
        return passed.sum(), deepest, *changed


@pytest.mark.parametrize("mode", MODES[1:])
@pytest.mark.parametrize("ground", ["wall", "mesh"])
@pytest.mark.parametrize("count", [8, pytest.param(300, marks=pytest.mark.long)])
def test_no_thin_bar_passes_through_ground_in_space(count, ground, mode):
    for e, friction in ((0.0, 0.0), (0.0, 0.5), (1.0, 0.5)):
        passed, deepest, *_ = run(mode, ground, e, friction, 13, count)
        assert passed == 0
        assert deepest < 0.1


@pytest.mark.parametrize("mode", MODES[1:])
@pytest.mark.parametrize("ground", ["wall", "mesh"])
def test_smooth_elastic_bars_keep_their_energy_however_far_they_turn_in_a_step(ground, mode):
    passed, _, energy, spin = run(mode, ground, 1.0, 0.0, 17, 10)
    assert passed == 0
    assert energy < 1e-9
    assert ground == "mesh" or spin < 1e-9  # smooth level ground does not turn about the vertical


def places_after(mode, parts):
    """Where twelve bars and plates are, and how fast, after two steps of 1/60 s in which they strike a wall; each step
    in so many parts."""
    random, count = np.random.default_rng(5), 12
    turns = Turn.from_quat(random.normal(size=(count, 4)))
    halves = np.array(((1.0, 0.01, 0.01), (1.0, 0.5, 0.02)))[np.arange(count) % 2]
    axes = random.normal(size=(count, 3))
    rates = random.uniform(-1, 1, count) * np.where(halves[:, 1] < 0.1, FASTEST, 10)
    spins = axes / np.linalg.norm(axes, axis=1)[:, None] * rates[:, None]
    high = (np.abs(turns.as_matrix()[:, 1]) * halves).sum(1) + 0.1
    velocities = random.uniform(-10, 10, (count, 3)) - (0, 10, 0)
    material: Any = {"restitution": 0.5, "friction": 0.3}
    with turning_world(3, collision=mode, on_fault="ignore", dt=1 / 60 / parts) as world:
        wall = AABBCollider((99.0, 0.5, 9.0), **material)
        world.create_entity(Transform((50, -0.5, 0)), RigidBody(kind="static"), wall)
        for k in range(count):
            turn = turns[k].as_quat()[[3, 0, 1, 2]]
            box(world, (9 * k, high[k], 0), halves[k], velocities[k], spins[k], turn, **material)
        take(world, 2 * parts)
        return world.bodies.dynamic.position.copy(), world.bodies.dynamic.linear_velocity.copy()


@pytest.mark.parametrize("mode", MODES[1:])
def test_what_strikes_a_wall_leaves_it_the_same_in_steps_of_any_length(mode):
    (coarse, fast), (fine, slow) = places_after(mode, 1), places_after(mode, 32)
    astray, faster = np.sort(np.abs(coarse - fine).max(axis=1)), np.sort(np.abs(fast - slow).max(axis=1))
    assert astray[-3] < 1e-4  # two strike several times, each of which multiplies what is uncertain
    assert astray[-1] < 0.02
    assert faster[-3] < 1e-2


def beyond_wall(mode, rate, seed):
    """(bodies behind a wall of 2 cm, faults of those that turn too far), of fifty arrows of 5 to 120 m/s in 0.6 s."""
    random, count = np.random.default_rng(seed), 50
    with turning_world(3, 0, terrain.plugin, collision=mode, on_fault="ignore", dt=1 / rate) as world:
        wall = AABBCollider((0.01, 500.0, 90.0), friction=0.5)
        world.create_entity(Transform((0, 0, 0)), RigidBody(kind="static"), wall)
        for k in range(count):
            half = random.uniform(0.1, 0.6) * np.array((1.0, *10 ** random.uniform(-2.0, -0.7, 2)))
            way, turn = random.normal(size=3), random.normal(size=4)
            way[0] = abs(way[0]) + random.choice([0.1, 1.0, 10.0])
            speed = 5.0 * 24 ** random.uniform()
            place, spin = (-0.7 - random.uniform(0, 3), 5.0 * (k - count / 2), 0), random.normal(0, 30, 3) * (k % 2)
            velocity = speed * way / np.linalg.norm(way)
            box(world, place, half, velocity, spin, turn / np.linalg.norm(turn), group=1, friction=0.5)
        take(world, round(0.6 * rate))
        told = sum("turns so far" in text for text in world.faults)
        return int((~(world.bodies.dynamic.position[:, 0] <= 0.0)).sum()), told


def throws():
    for seed, rate in itertools.product(range(12), (60, 20)):
        marks = [pytest.mark.long] if seed > 0 else []
        yield pytest.param(seed, rate, marks=marks)


@pytest.mark.parametrize("mode", MODES[1:])
@pytest.mark.parametrize(("seed", "rate"), list(throws()))
def test_no_arrow_passes_a_thin_wall(seed, rate, mode):
    """At restitution 0 each strike turns it: about its length by the speed over its width, at some 1,000 rad/s."""
    assert beyond_wall(mode, rate, seed)[0] == 0


@pytest.mark.parametrize("mode", MODES[1:])
@pytest.mark.parametrize("spin", [1e4, 1e6])
def test_what_spins_at_any_rate_stays_between_walls(spin, mode):
    """Or a fault names it: of looks that would follow it 4,096 are taken."""
    for e, friction in ((0.0, 0.5), (1.0, 0.0)):
        with turning_world(3, 0, terrain.plugin, collision=mode, on_fault="ignore") as world:
            for x in (-2, 2):
                wall = AABBCollider((1.0, 1e7, 1e7), restitution=e, friction=friction)
                world.create_entity(Transform((x, 0, 0)), RigidBody(kind="static"), wall)
            material = {"restitution": e, "friction": friction}
            box(world, (0, 0, 0), (0.5, 0.25, 0.25), (3.0, 0, 0), np.array((0.3, 0.2, 1.0)) * spin, **material)
            for _ in range(8):
                world.step()
                inside = abs(world.bodies.dynamic.position[0, 0]) < 1.0
                assert inside or any("turns so far" in text for text in world.faults)

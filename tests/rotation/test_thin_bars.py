"""Bars that are thin and spin fast pass through no ground in swept modes, however they meet it."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_pairwise import half
from rotation.helpers_turning import box, turning_world, wall
from worlds import MODES

from carom.components import AABBCollider, RigidBody, Transform
from carom.plugins import half_space, terrain
from carom.plugins.half_space import HalfSpaceCollider
from carom.plugins.rotation import BoxCollider
from carom.plugins.terrain import create_chain

pytestmark = [pytest.mark.slow, pytest.mark.compiled]

HALF, FASTEST, APART, STEPS = (1.0, 0.01), 500.0, 60.0, 15
NODES = np.arange(-12.0, 12.1, 1.5)


def lay_ground(world, ground, places, heights, **material):
    if ground == "half-space":
        world.create_entity(Transform((0, 0)), RigidBody(kind="static"), HalfSpaceCollider((0, 1), **material))
    for x, levels in zip(places, heights, strict=True):
        if ground == "chain":
            create_chain(world, np.stack((x + NODES, levels), 1), **material)
        elif ground != "half-space":
            shape = {"wall": AABBCollider, "box": BoxCollider}[ground]((25.0, 0.02), **material)
            world.create_entity(Transform((x, -0.02)), RigidBody(kind="static"), shape)


def lowest(bodies, places, heights, ground):
    """Of each bar: how far its middle, and the lowest point between its ends, are above the ground."""
    turned = np.stack((np.cos(bodies.rotation), np.sin(bodies.rotation)), 1)
    gaps = []
    for share in np.linspace(-1, 1, 41):
        at = bodies.position + share * turned
        levels = [np.interp(x, NODES, row) for x, row in zip(at[:, 0] - places, heights, strict=True)]
        gaps.append(at[:, 1] - (levels if ground == "chain" else 0.0))
    return gaps[20], np.min(gaps, axis=0)


def count_passed(mode, ground, e, friction, seed, count):
    """How many bars have their middle behind the ground after some step, and how deep the line from end to end ever
    is in it."""
    random, passed, deepest = np.random.default_rng(seed), np.zeros(count, bool), 0.0
    places, angles = np.arange(count) * APART, random.uniform(-3, 3, count)
    heights = random.uniform(-0.5, 0.5, (count, len(NODES)))
    high = 0.5 + np.abs(np.sin(angles)) + 0.01 + random.uniform(0.02, 3.0, count)
    velocities = np.stack((random.uniform(-10, 10, count), random.uniform(-30, 0, count)), 1)
    with turning_world(2, 0, terrain.plugin, half_space.plugin, collision=mode, on_fault="ignore") as world:
        lay_ground(world, ground, places, heights, restitution=e, friction=friction)
        for k in range(count):
            place, spin = (places[k], high[k]), random.uniform(-FASTEST, FASTEST)
            box(world, place, HALF, velocities[k], spin, angles[k], restitution=e, friction=friction)
        for _ in range(STEPS):
            world.step()
            middle, least = lowest(world.bodies.dynamic, places, heights, ground)
            passed |= middle < 0.0
            deepest = max(deepest, -least.min())
    return passed.sum(), deepest


@pytest.mark.parametrize(("mode", "ground"), half(MODES[1:], ("wall", "box", "half-space", "chain")))
@pytest.mark.parametrize("count", [25, pytest.param(500, marks=pytest.mark.long)])
def test_no_thin_bar_passes_through_ground(count, ground, mode):
    for e, friction in ((0.0, 0.0), (0.0, 0.5), (0.5, 0.0), (1.0, 0.5)):
        passed, deepest = count_passed(mode, ground, e, friction, 13, count)
        assert passed == 0
        assert deepest < 0.1


@pytest.mark.parametrize("mode", MODES[1:])
def test_a_step_ends_for_a_bar_that_is_caught_in_a_thin_wall(mode):
    """It reaches through one wall beside another one, and turns: what it slides along it touches again at once."""
    rough = {"restitution": 1.0, "friction": 0.5}
    with turning_world(dt=0.05, collision=mode, on_fault="ignore") as world:
        for place, half in (((4.01, 0), (0.01, 4.02)), ((0, -4.01), (4.02, 0.01))):
            wall(world, place, half, **rough)
        box(world, (3.366, -3.812), (0.3257, 0.01), (12.987, 0), 2.126, 8.542, **rough)
        world.step()
        assert 0 < world.stats().counters["capped_impacts"] < 1000


def test_no_bar_is_pushed_through_a_thin_wall_by_another_one():
    """Six elastic bars at 5 rad a step in a room whose walls are as thin: one strikes another against a wall, again and
    again within a step."""
    random, rough = np.random.default_rng(891), {"restitution": 1.0, "friction": 0.5}
    with turning_world(dt=0.05, collision="event_driven", on_fault="ignore") as world:
        for axis in range(2):
            for side in (-1, 1):
                place, half = np.zeros(2), np.full(2, 3.02)
                place[axis], half[axis] = 3.01 * side, 0.01
                wall(world, place, half, **rough)
        for _ in range(6):
            place, angle = random.uniform(-2, 2, 2), random.uniform(-3, 3)
            box(world, place, (0.33, 0.01), 20 * random.normal(size=2), 50 * random.normal(), angle, **rough)
        for _ in range(40):
            world.step()
            assert abs(world.bodies.dynamic.position).max() < 3.0


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("dt", [1 / 20, 1 / 60])
def test_what_contacts_have_turned_is_put_out_of_walls_as_it_stands_then(dt, mode):
    """Bars that spin fall in a room: where a step ends no corner is deeper in a wall than half of their width."""
    for seed in range(6):
        random, half = np.random.default_rng([seed, 5]), []
        with turning_world(2, 9.81, dt=dt, collision=mode, on_fault="ignore") as world:
            for place in ((3.5, 0), (-3.5, 0), (0, 3.5), (0, -3.5)):
                wall(world, place, (0.5, 4) if place[0] else (4, 0.5), friction=0.5)
            for k in range(8):
                half.append((random.uniform(0.2, 0.5), random.uniform(0.02, 0.05)))
                place, angle = (-2.1 + 1.4 * (k % 4), -1 + 2 * (k // 4)), random.uniform(-3, 3)
                box(world, place, half[-1], random.normal(0, 4, 2), random.normal(0, 60), angle, friction=0.5)
            h = np.array(half)
            for _ in range(round(1.5 / dt)):
                world.step()
                c, s = np.cos(world.bodies.dynamic.rotation)[:, None], np.sin(world.bodies.dynamic.rotation)[:, None]
                reach = np.hstack((abs(c), abs(s))) * h[:, :1] + np.hstack((abs(s), abs(c))) * h[:, 1:]
                deep = (abs(world.bodies.dynamic.position) + reach).max(axis=1) - 3.0
                assert (deep < h[:, 1]).all()


@pytest.mark.parametrize("mode", MODES[1:])
@pytest.mark.parametrize("spin", [1e4, 1e6])
def test_what_spins_at_any_rate_stays_between_walls(spin, mode):
    """Or a fault names it: of looks that would follow it 4,096 are taken."""
    for e, friction in ((0.0, 0.5), (1.0, 0.0)):
        with turning_world(2, 0, terrain.plugin, half_space.plugin, collision=mode, on_fault="ignore") as world:
            for x in (-2, 2):
                wall = AABBCollider((1.0, 1e7, 1e7)[:2], restitution=e, friction=friction)
                world.create_entity(Transform((x, 0, 0)[:2]), RigidBody(kind="static"), wall)
            material = {"restitution": e, "friction": friction}
            box(world, (0, 0, 0)[:2], (0.5, 0.25), (3.0, 0, 0)[:2], spin, **material)
            for _ in range(8):
                world.step()
                inside = abs(world.bodies.dynamic.position[0, 0]) < 1.0
                assert inside or any("turns so far" in text for text in world.faults)

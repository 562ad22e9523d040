"""Laws of bounds: a step ends, finite numbers stay finite, and nothing is lost without a fault that names it."""

from __future__ import annotations

import itertools
import re
from typing import NamedTuple

import numpy as np
import pytest
from helpers_rest import G, tower
from laws.helpers_laws import MODES, SWEPT, cases, seeds, walls
from worlds import ball, box, floor, make_world

from carom.framework import StepError

TOO_FAST = "so fast that discrete collisions may miss"
MOST_ROUNDS = 1000  # searches of pairs that a step may take


class End(NamedTuple):
    """Bodies that are not finite; those that have gone farther than they could by themselves; entities in the faults;
    whether one of these says that a body is too fast for discrete collisions; the most rounds of pairs in a step."""

    broken: int
    lost: list[int]
    named: set[int]
    too_fast: bool
    rounds: int


def play(world, steps, *, limit=np.inf, change=None):
    """Step, and count; lost are bodies farther than ``limit`` from the origin along an axis."""
    rounds = before = 0
    for step in range(steps):
        if change is not None:
            change(step)
        world.step()
        now = world.stats().counters["rounds"]
        rounds, before = max(rounds, now - before), now
    moving = world.bodies.dynamic
    finite = np.isfinite(moving.position).all(axis=1) & np.isfinite(moving.linear_velocity).all(axis=1)
    lost = moving.entity[~(np.abs(moving.position) <= limit).all(axis=1)].tolist()
    named = {int(number) for text in world.faults for number in re.findall(r"entity (\d+)", text)}
    too_fast = any(TOO_FAST in text for text in world.faults)
    return End(int((~finite).sum()), lost, named, too_fast, rounds)


def check(found, mode="event_driven"):
    """A discrete world names only the fastest of those that are too fast for it in a step."""
    assert found.broken == 0
    assert set(found.lost) <= found.named or (mode == "discrete" and found.too_fast)
    assert found.rounds <= MOST_ROUNDS


# -- masses ----------------------------------------------------------------------------------------

HEAPS = list(itertools.product(range(20), (0.0, 0.5, 1.0), MODES))


def mixed_heap(seed, e, mode):
    """A heap of 1e-12, 1 and 1e12 kg in a room: 1e24 between two bodies that touch."""
    random = np.random.default_rng([seed, 12])
    with make_world(2, G, collision=mode, on_fault="ignore") as world:
        walls(world, 4.0, 2.0, restitution=e, friction=0.4)
        for k in range(36):
            place = (np.array((k % 6, k // 6)) - 2.5) * 1.2 + random.uniform(-0.1, 0.1, 2)
            mass = float(random.choice([1e-12, 1.0, 1e12]))
            (ball, box)[k % 2](world, place, 3.0 * random.normal(size=2), mass=mass, restitution=e, friction=0.4)
        return play(world, 25, limit=6.0)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "e", "mode"), cases(HEAPS, 3))
def test_masses_of_1e_minus_12_and_1e12_in_one_island(seed, e, mode):
    """A light elastic body between a heavy one and a wall bounces pi/2 sqrt(M / m) = 1e12 times before these part: a
    step gives up after a bounded number of looks."""
    check(mixed_heap(seed, e, mode), mode)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("masses", [(1e-12, 1e12), (1e12, 1e-12), (1e-12, 1e-12, 1e12), (1e12, 1e-12, 1e12)])
def test_stacks_of_1e_minus_12_and_1e12(masses, mode):
    """None comes through the floor."""
    with make_world(2, G, collision=mode, on_fault="ignore") as world:
        floor(world)
        tower(world, len(masses), masses=masses)
        check(play(world, 120))
        assert (world.bodies.dynamic.position[:, 1] > 0.0).all()


# -- places ----------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("count", [200, pytest.param(1000, marks=pytest.mark.long)])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("e", [0.0, 1.0])
def test_bodies_at_exactly_one_place(e, mode, count):
    with make_world(2, collision=mode, on_fault="ignore") as world:
        for _ in range(count):
            ball(world, (0.0, 0.0), restitution=e)
        check(play(world, 5, limit=10.0))


@pytest.mark.long
def test_ten_thousand_bodies_at_one_place():
    """Fifty million pairs: either the step refuses them and no body moves, or all stay finite and near."""
    with make_world(2, on_fault="ignore") as world:
        for _ in range(10_000):
            ball(world, (0.0, 0.0))
        try:
            check(play(world, 1, limit=10.0))
        except StepError:
            assert (world.bodies.position == 0.0).all()


# -- speeds ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", ["kinematic", "dynamic"])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("seed", seeds(1, 10))
def test_a_body_at_1e9_through_a_heap(seed, e, kind, mode):
    """Through thirty bodies that rest or fly: what it strikes may go as fast, but is finite, and the step ends."""
    random = np.random.default_rng([seed, 13])
    with make_world(2, G, collision=mode, on_fault="ignore") as world:
        floor(world)
        for k in range(30):
            place = ((k % 6) * 1.02, 0.5 + (k // 6) * 1.01)
            (ball, box)[k % 2](world, place, restitution=e, mass=10.0 ** random.uniform(-2, 2), friction=0.4)
        ball(world, (-1e9 / 60, 2.0), (1e9, 0.0), kind=kind, mass=100.0, restitution=e)
        found = play(world, 30)
        assert found.broken == 0
        assert found.rounds <= MOST_ROUNDS


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("speed", [1e3, 1e6, 1e9])
def test_a_kinematic_wall_at_any_speed_against_bodies_in_a_room(speed, mode):
    """It ends beyond the room within a step or two; bodies between it and the wall have no room."""
    with make_world(2, collision=mode, on_fault="ignore") as world:
        walls(world, 4.0, 2.0)
        for k in range(16):
            (ball, box)[k % 2](world, (np.array((k % 4, k // 4)) - 1.5) * 1.5)
        box(world, (-5.0, 0.0), (speed, 0.0), half=(0.5, 3.5), kind="kinematic")
        found = play(world, 10)
        assert found.broken == 0
        assert found.rounds <= MOST_ROUNDS


# -- steps -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("factor", [0.1, 10.0])
@pytest.mark.parametrize("seed", seeds(2, 10))
def test_steps_that_change_tenfold(seed, factor, mode):
    """A heap at rest under a load, whose steps become ten times longer or shorter, and again as before, every five.

    What was remembered as an impulse acted for another time: it may not throw what it holds. A heap may collapse in
    steps of a sixth of a second, but its energy, counted from the floor, does not rise.
    """
    random = np.random.default_rng([seed, 14])
    with make_world(2, G, collision=mode, on_fault="ignore") as world:
        walls(world, 4.0, 2.0, friction=0.4)
        for k in range(30):
            place = ((k % 6) * 1.1 - 2.75 + random.uniform(-0.05, 0.05), -3.4 + (k // 6) * 1.1)
            (ball, box)[k % 2](world, place, mass=1.0 if k < 24 else 100.0, friction=0.4)
        for _ in range(120):
            world.step()

        on_floor = -G * 4.0 * float(world.bodies.dynamic.mass.sum())
        energies = []

        def change(step):
            energies.append(world.kinetic_energy() + world.potential_energy() - on_floor)
            if step % 5 == 0:
                world.settings = world.settings.replace(dt=1 / 60 * (factor if step % 10 == 0 else 1.0))

        check(play(world, 60, limit=4.0, change=change))
        assert np.diff(energies).max() < 0.005 * energies[0]


# -- rounds ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", SWEPT)
@pytest.mark.parametrize("seed", seeds(2, 30))
def test_a_step_ends(seed, mode):
    """Elastic bodies of masses to 1:1e6 in narrow gaps at up to 1e4 m/s: more impacts than can be counted in a step."""
    random = np.random.default_rng([seed, 15])
    with make_world(2, collision=mode, dt=1 / 20, on_fault="ignore") as world:
        walls(world, 2.0, 1.0, restitution=1.0)
        for k in range(16):
            place = (np.array((k % 4, k // 4)) - 1.5) * 1.001
            speed = 10.0 ** random.uniform(0.0, 4.0) * random.normal(size=2)
            mass = 10.0 ** random.uniform(-3.0, 3.0)
            e = float(random.choice([0.0, 0.5, 1.0]))
            (ball, box)[k % 2](world, place, speed, mass=mass, restitution=e, **{("radius", "half")[k % 2]: 0.5})
        check(play(world, 5, limit=3.0))

"""Laws of what is squeezed: a wall that moves presses bodies against one that stands, and lets them go."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from laws.helpers_laws import MODES, cases, fastest, seeds
from worlds import ball, box, make_world

from carom.components import RigidBody, Transform
from carom.framework import Settings, World
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation, Spin


class Release(NamedTuple):
    """Greatest speed in sizes a second after the release; bodies behind one of the walls at any step; faults."""

    fastest: float
    behind: int
    faults: list[str]


def squeeze(seed, mode, count, speed, e=0.0, *, d=2, maker=ball, deepest=0.5):
    """A row of ``count`` bodies of 1 m in a closed channel 1.1 m wide, between its end and a plate that comes at
    ``speed`` m/s.

    The plate comes until a share ``deepest`` of the row's length is overlap, stands for half a second and goes as fast
    as it came. Overlap is no spring: what has been squeezed parts slowly, whatever the depth.
    """
    random = np.random.default_rng([seed, 7])
    size = {"radius": 0.5} if maker is ball else {"half": 0.5}
    across = d - 1
    with make_world(d, collision=mode, on_fault="ignore") as world:
        box(world, (-1.0, *(0.0,) * across), half=(1.0, *(3.0,) * across), kind="static", restitution=e)
        for axis in range(across):
            for side in (-1.0, 1.0):
                place, half = np.zeros(d), np.full(d, 3.0)
                place[axis + 1], half[axis + 1], half[0] = side * (0.55 + 1.0), 1.0, 40.0
                box(world, place, half=half, kind="static", restitution=e)
        for k in range(count):
            place = 1e-3 * random.normal(size=d)
            place[0] += 0.5 + k + 2e-3 * (k + 1)
            maker(world, place, mass=10.0 ** random.uniform(-1.0, 1.0), restitution=e, **size)
        start = count + 0.5
        press = box(
            world, (start + 1.0, *(0.0,) * across), (-speed, *(0.0,) * across), half=(1.0, *(0.5,) * across),
            kind="kinematic", restitution=e,
        )  # fmt: skip
        plate = world.component_for_entity(press, RigidBody)
        coming = round((start - count * (1.0 - deepest)) / speed / world.settings.dt)
        after, behind = 0.0, 0
        for step in range(coming + 90):
            if step in (coming, coming + 30):
                plate.linear_velocity = (0.0 if step == coming else speed, *(0.0,) * across)
            world.step()
            place, face = world.bodies.dynamic.position, world.bodies.position[world.bodies.row_of(press), 0] - 1.0
            x, aside = place[:, 0], np.abs(place[:, 1:]).max(axis=1)
            behind = max(behind, int((~((x > 0.0) & (x < max(face, 0.5) + 0.5) & (aside < 0.55))).sum()))
            if step > coming + 30:
                after = max(after, fastest(world))
        return Release(after, behind, list(world.faults))


CASES = [(1, 1.0), (3, 1.0), (1, 10.0), (3, 10.0), (8, 3.0)]


@pytest.mark.parametrize("maker", [ball, box])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("count", "speed"), CASES)
@pytest.mark.parametrize("seed", seeds(1, 6))
def test_what_is_let_go_parts_slowly(seed, count, speed, mode, maker):
    found = squeeze(seed, mode, count, speed, maker=maker)
    assert found.behind == 0
    assert found.fastest < 2.0


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("seed", seeds(1, 6))
def test_what_bounces_is_let_go_slowly(seed, mode):
    """The walls' own speed is what a bounce may give: the bodies are slow against what was squeezed, at e .5 too."""
    found = squeeze(seed, mode, 3, 1.0, e=0.5)
    assert found.behind == 0
    assert found.fastest < 2.0


@pytest.mark.parametrize("mode", cases(MODES, 1))
def test_what_is_let_go_in_space_parts_slowly(mode):
    found = squeeze(0, mode, 3, 3.0, d=3)
    assert found.behind == 0
    assert found.fastest < 2.0


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("maker", [ball, box])
def test_two_plates_meet_a_body_at_the_same_time(mode, e, maker):
    """Impulses of the two plates cancel each other, however high they are: there is no solution, and no nan."""
    world = make_world(2, 0.0, collision=mode, dt=1 / 64, on_fault="ignore")
    for side in (-1.0, 1.0):
        box(world, (side * 1.75, 0.0), (-side * 32.0, 0.0), half=(1.0, 2.0), kind="kinematic", restitution=e)
    maker(world, (0.0, 0.0), restitution=e)
    for _ in range(3):
        world.step()
        assert np.isfinite(world.bodies.position).all()
        assert np.isfinite(world.bodies.linear_velocity).all()


def behind_a_thin_wall(seed, mode, rate, count=2):
    """How many of some boxes that turn have been behind a wall of 5 cm, against which a plate of 8 m/s presses them."""
    random = np.random.default_rng([seed, 21])
    settings = Settings(dt=1 / rate, collision=mode, on_fault="ignore")
    with World(Physics(2, gravity=0), Rotation(), settings=settings) as world:
        for place, half in (((3.025, 0), (0.025, 4)), ((0, 4), (5, 1)), ((0, -4), (5, 1))):
            world.create_entity(Transform(place), BoxCollider(half, friction=0.5))
        press = RigidBody(kind="kinematic", linear_velocity=(8, 0))
        plate = world.create_entity(Transform((-1, 0)), press, BoxCollider((1, 3.5)))
        for y in np.linspace(-2.4, 2.4, count):
            half, velocity = random.uniform(0.1, 0.4, 2), random.normal(0, 3, 2)
            place, angle, spin = (random.uniform(1, 2.5), y), random.uniform(-3, 3), random.normal(0, 5)
            body, box_ = RigidBody(linear_velocity=velocity), BoxCollider(half, friction=0.5)
            world.create_entity(Transform(place, angle), body, Spin(spin), box_)
        coming, behind = round(2.9 / 8 * rate), np.zeros(count, bool)  # then there are ten centimetres left
        for step in range(coming + rate // 2):
            if step == coming:
                world.component_for_entity(plate, RigidBody).linear_velocity = (0, 0)
            world.step()
            behind |= world.bodies.dynamic.position[:, 0] > 3.0
        return int(behind.sum())


@pytest.mark.slow
@pytest.mark.parametrize("rate", [20, 30, 60])
@pytest.mark.parametrize("mode", MODES[1:])
def test_what_turns_stays_in_front_of_the_wall(mode, rate):
    """The plate puts it out of itself, through the wall; what stands still has the last word."""
    assert sum(behind_a_thin_wall(seed, mode, rate) for seed in range(10)) == 0

"""Section C: springs at their limits, crowds created in each other, scenes seen from a moving frame."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_motion import METHODS
from oracles import integrators_naive as naive
from worlds import ball, both_dimensions, box, make_world, run

from carom.components import RigidBody, Transform
from carom.framework import Settings, World
from carom.lab import step_limits
from carom.plugins import Physics
from carom.plugins.springs import Springs

pytestmark = pytest.mark.early

MODES = ("discrete", "continuous", "event_driven")
DT = 1 / 60


def sprung(rate, **settings):
    """A body of 1 kg on a linear spring of angular frequency ``rate``, 1/s, stretched by 1 m."""
    springs = Springs()
    world = World(Physics(2), springs, settings=Settings(dt=1.0, **settings))
    nail = world.create_entity(Transform((0.0, 0.0)), RigidBody(kind="static"))
    body = world.create_entity(Transform((1.0, 0.0)), RigidBody())
    springs.connect(nail, body, 0.0, stiffness=rate**2)
    return world, body


@pytest.mark.parametrize("method", [name for name in METHODS if name != "explicit_euler"])
def test_c16_below_its_limit_bounded_above_it_told(method):
    """0.99 and 1.01 of each limit: bounded, and within what suggest_dt allows; growing, and beyond it."""
    limit = naive.stability_limit(method, 1.0, 0.0)
    for share in (0.99, 1.01):
        world, body = sprung(share * limit, integrator=method)
        stable = step_limits(world).stability
        assert stable == pytest.approx(1.0 / share, rel=1e-3)
        run(world, 300)
        amplitude = abs(world.bodies.position[world.bodies.row_of(body), 0])
        assert (amplitude < 20.0) == (share < 1.0)
        assert (stable > world.settings.dt) == (share < 1.0)


@pytest.mark.parametrize("mode", MODES)
def test_c16_the_world_says_that_a_spring_is_too_stiff(mode):
    """The fault of the springs plugin at w dt = 2, not below."""
    for share, told in ((0.99, False), (1.01, True)):
        world, _ = sprung(2.0 * share, collision=mode)
        run(world, 3)
        assert any("spring" in str(fault) for fault in world.faults) == told


@both_dimensions
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("e", [0.5, 1.0])
def test_c23_galilean_in_every_mode(mode, d, e):
    """A velocity added to all: relative motion is the same to 1e-9, in impacts and after them."""

    def cluster(drift):
        world = make_world(d, collision=mode)
        random = np.random.default_rng(23)
        for k in range(16):
            place = np.zeros(d)
            place[:2] = 1.6 * np.array([k % 4, k // 4])
            place += random.uniform(-0.1, 0.1, d)
            speed = random.normal(size=d) - 0.3 * (place - 2.4)
            (box, ball)[k % 2](world, place, speed + drift, restitution=e, mass=random.uniform(0.5, 2.0))
        run(world, 60)
        counted = world.stats().counters
        assert counted["impacts"] > 10
        return world.bodies.position - drift * 60 * DT, world.bodies.linear_velocity - drift

    for still, drifting in zip(cluster(np.zeros(d)), cluster(np.array([1e3, -7e2, 0.0])[:d]), strict=True):
        np.testing.assert_allclose(drifting, still, rtol=0, atol=1e-9)


@pytest.mark.parametrize("mode", MODES)
def test_c23_a_stack_on_a_moving_floor(mode):
    """Bodies at rest on a floor that moves along with them: they stay where they are on it."""

    def stack(drift):
        world = make_world(2, 9.81, collision=mode)
        box(world, (0.0, -0.5), (drift, 0.0), half=(50.0, 0.5), kind="kinematic")
        for k in range(4):
            (box, ball)[k % 2](world, (0.0, 0.5 + k), (drift, 0.0))
        run(world, 60)
        moving = world.bodies.dynamic
        return moving.position - (drift * 60 * DT, 0.0), moving.linear_velocity - (drift, 0.0)

    for still, drifting in zip(stack(0.0), stack(1e3), strict=True):
        np.testing.assert_allclose(drifting, still, rtol=0, atol=1e-9)

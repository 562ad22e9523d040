"""Section C: extreme masses, restitutions, sizes, speeds: the stated result, and all stays finite."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_extremes import DT, makers
from worlds import EPS, Conserved, ball, both_dimensions, box, make_world, position, run, velocity

from carom.components import RigidBody
from carom.framework import Settings


@pytest.mark.parametrize("ratio", [1e12, 1e-12, 1e15, 1e-15])
@pytest.mark.parametrize("e", [0.5, 1.0])
def test_c8_mass_ratios_between_walls(ratio, e):
    """A light body bounces between a heavy one and a wall: it never tunnels, and energy does not grow."""
    world = make_world()
    wall = box(world, (0.0, 0.0), kind="static", restitution=e)
    light, heavy = ball(world, 1.1, 0.0, restitution=e), ball(world, 2.5, -0.5, mass=ratio, restitution=e)
    kept = Conserved(world)
    run(world, 300)
    assert position(world, wall)[0] == 0
    assert position(world, light)[0] > 0.5
    assert position(world, heavy)[0] > position(world, light)[0]
    kept.check(momentum=False)


def test_c9_restitution_above_one_gains():
    """Allowed: e = 1.5 multiplies the relative speed by 1.5 and the energy of the apex by 2.25."""
    world = make_world()
    box(world, 0.0, kind="static")
    a = ball(world, -1.01, 1.0, restitution=1.5)
    run(world, 3)
    assert velocity(world, a)[0] == -1.5


@makers
@pytest.mark.parametrize("tiny", [1e-310, 5e-324])
def test_c10_denormal_sizes_and_velocities(maker, tiny):
    """No NaN and no crash; a neighbour of ordinary size is not affected or bounces as it should."""
    world = make_world()
    size = {"radius" if maker is ball else "half": tiny}
    maker(world, (0.0, 5.0), tiny, restitution=1.0, **size)
    maker(world, (tiny, 5.0), -tiny, restitution=1.0, **size)
    a, b = ball(world, -0.51, 1.0, restitution=1.0), ball(world, 0.51, -1.0)
    small = maker(world, (0.0, -0.501), (tiny, 1.0), **size)  # under the pair, which it may touch
    kept = Conserved(world)
    run(world, 30)
    kept.check()
    assert velocity(world, a)[0] == pytest.approx(-1.0, abs=1.5)
    assert world.entity_exists(small)
    assert np.isfinite(velocity(world, b)).all()


def test_c10_denormal_masses():
    """The smallest mass with a finite inverse works, two of them exchange velocities."""
    world = make_world()
    a, b = (ball(world, x, v, mass=1e-307, restitution=1.0) for x, v in ((-0.51, 1.0), (0.51, -1.0)))
    run(world, 3)
    assert (velocity(world, a)[0], velocity(world, b)[0]) == (-1.0, 1.0)


@pytest.mark.parametrize("dt", [0.0, -1 / 60, math.nan, math.inf, "fast"])
def test_c11_steps_must_be_positive(dt):
    with pytest.raises(ValueError, match=r"Settings\.dt"):
        Settings(dt=dt)


@both_dimensions
def test_c12_huge_velocities(d):
    """v . v overflows at 1e154: 1e300 still bounces; 1e308 is refused, and written it affects no other body."""
    for speed in (1e150, 1e200, 1e300):
        world = make_world(d, dt=1e-3 / speed)
        a, b = ball(world, -0.501, speed, restitution=1.0), ball(world, 0.501, -speed)
        run(world, 3)
        assert velocity(world, a)[0] == pytest.approx(-speed, rel=4 * EPS)
        assert velocity(world, b)[0] == pytest.approx(speed, rel=4 * EPS)
    world = make_world(d)
    for speed in (1e308, -1e308):
        with pytest.raises(ValueError, match=r"RigidBody\.linear_velocity must be at most 1e\+307"):
            ball(world, 0.0, speed)
    for x, speed in ((0.0, 1e308), (0.9, -1e308)):
        fast = ball(world, x, restitution=1.0)
        world.component_for_entity(fast, RigidBody).linear_velocity[0] = speed
    a = ball(world, (0.0, 50.0, 0.0)[:d], 1.0)
    run(world, 10)
    assert velocity(world, a)[0] == 1
    assert position(world, a)[0] == pytest.approx(10 * DT)
    assert len(world.bodies) == 3


@both_dimensions
@pytest.mark.parametrize(("maker", "size"), [(ball, {"radius": 0.0}), (box, {"half": 0.0})])
def test_c13_points_bounce(d, maker, size):
    """A point on a box, on a ball and on a sheet without thickness (B9); points need an overlap at a step's end."""
    for target in (
        lambda w: box(w, 0.0, kind="static"),
        lambda w: ball(w, 0.0, kind="static"),
        lambda w: ball(w, 0.5, radius=1.0, kind="static"),
    ):
        world = make_world(d)
        target(world)
        a = maker(world, -0.51, 1.0, restitution=0.5, **size)
        run(world, 2)
        assert velocity(world, a)[0] == -0.5
    world = make_world(d)
    box(world, 0.0, half=(0.0, *(1.0,) * (d - 1)), kind="static")
    a = ball(world, -0.51, 1.0, restitution=0.5)
    run(world, 2)
    assert velocity(world, a)[0] == -0.5

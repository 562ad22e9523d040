"""``collision="event_driven"``: impacts in order of time (B16, B17), infinite sequences, exact flight."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_modes import MODES, along, mode_world, positions, strikes, velocities
from helpers_pairwise import pairwise
from worlds import Conserved, ball, both_dimensions, box, make_world, position, run, velocity

from carom.components import RigidBody, Transform
from carom.framework import ForceSystem, Settings
from carom.scenes import galperin

DT, G = 1 / 60, 9.81


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mode", "maker", "speed", "gap", "arriving"),
    pairwise(("discrete", *MODES), (ball, box), (1.0, 120.0), (0.0, 1e-6, 0.01), (1, 2, 3, 4)),
)
def test_b16_cradle(mode, maker, speed, gap, arriving):
    """k arrive, k leave at any gap: positions are the sorted free flights plus the widths of the bodies."""
    world = mode_world(mode, max_impacts_per_step=20)
    speed = 1.0 if mode == "discrete" else speed
    start = np.arange(5) * (1 + gap)
    start[:arriving] -= 0.3 + np.arange(arriving)[::-1] * gap
    speeds = np.where(np.arange(5) < arriving, speed, 0.0)
    row = [maker(world, x, v, restitution=1.0) for x, v in zip(start, speeds, strict=True)]
    kept, seen = Conserved(world), 0
    for step in range(1, 61):
        seen += np.count_nonzero(strikes(world, 1).impulse > 1e-12 * speed)  # what rounding leaves may touch again
        if step in (1, 15, 20, 60):
            flown = np.sort(start - np.arange(5) + speeds * step * DT) + np.arange(5)
            np.testing.assert_allclose(positions(world, row)[:, 0], flown, rtol=1e-13, atol=1e-12)
    np.testing.assert_allclose(velocities(world, row)[:, 0], np.sort(speeds), atol=1e-12 * speed)
    assert seen == arriving * (5 - arriving)
    kept.check()


def check_galperin(settings, digits, seconds):
    """ceil(pi / atan(sqrt(m/M))) - 1 impacts, the j-th at 2 - 1 / (sqrt(M) tan(j atan(sqrt(m/M))))."""
    world = galperin.build(settings, digits=digits)
    energy = world.kinetic_energy()
    hits = strikes(world, round(seconds / settings.dt))
    ratio = 10.0**digits
    count = math.ceil(math.pi / math.atan(1 / ratio)) - 1
    assert len(hits) == count == galperin.impacts(digits)
    assert world.kinetic_energy() == pytest.approx(energy, rel=1e-9)
    assert world.stats().counters["capped_impacts"] == 0
    j = np.arange(1, count + 1)
    np.testing.assert_allclose(hits.time, 2 - 1 / (ratio * np.tan(j * math.atan(1 / ratio))), atol=1e-8)
    assert (hits.entity_a == np.where(j % 2, 2, 1)).all()  # blocks, wall, blocks, wall...
    return hits


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "dt", "digits"), pairwise(MODES, (1 / 240, 1 / 60, 1.0), (0, 1, 2, 3)))
def test_b17_galperin(mode, dt, digits):
    """Several impacts of one pair in a step: at dt = 1 all but the first and the last few fall into one."""
    settings = Settings(collision=mode, dt=dt, max_impacts_per_step=10_000)
    hits = check_galperin(settings, digits, 9.0)
    if dt == 1.0 and digits >= 2:
        assert np.count_nonzero((hits.time > 1) & (hits.time < 3) & (hits.entity_a == 1)) > 100


@pytest.mark.slow
@pytest.mark.parametrize("digits", [5, pytest.param(6, marks=pytest.mark.long)])
def test_b17_galperin_3141592(digits):
    check_galperin(Settings(collision="event_driven"), digits, 6.0)


@both_dimensions
@pytest.mark.parametrize("dt", [1 / 60, 1 / 7, 1.0, 5.0])
def test_flight_is_the_exact_parabola(d, dt):
    """Gravity, its scale, constant and applied forces: rounding at any dt, the same bits for any integrator."""
    found = []
    for integrator in ("semi_implicit_euler", "rk4"):
        world = make_world(d, G, dt=dt, collision="event_driven", integrator=integrator)
        force, push = np.array(along(d, 3.0, 1.0, -2.0)), np.array(along(d, 0.5, 4.0, 1.0))
        body = RigidBody(2.0, along(d, 1.0, 10.0, -3.0), constant_force=force, gravity_scale=0.5)
        flier = world.create_entity(Transform(along(d, 0.0, 3.0)), body)
        run(world, 3)
        world.component_for_entity(flier, RigidBody).apply_force(push)
        run(world, 4)
        a, b = np.array(along(d, 0.0, -0.5 * G)) + force / 2, push / 2
        v3, x3 = along(d, 1.0, 10.0, -3.0) + a * 3 * dt, along(d, 0.0, 3.0) + np.array(
            along(d, 1.0, 10.0, -3.0)) * 3 * dt + a * (3 * dt) ** 2 / 2
        v4, x4 = v3 + (a + b) * dt, x3 + v3 * dt + (a + b) * dt**2 / 2
        v7, x7 = v4 + a * 3 * dt, x4 + v4 * 3 * dt + a * (3 * dt) ** 2 / 2
        np.testing.assert_allclose(velocity(world, flier), v7, rtol=1e-14)
        np.testing.assert_allclose(position(world, flier), x7, rtol=1e-14)
        found.append((velocity(world, flier).tolist(), position(world, flier).tolist()))
    assert found[0] == found[1]


class Anchor(ForceSystem):
    """A spring of 4 N/m to the origin."""

    def add_forces(self, bodies, time):
        bodies.force[:] -= 4.0 * bodies.position


def deviation(n, exact, *systems, gravity=0.0, **body):
    """Deviation from the exact (position, velocity) after 1 s in n steps, from (1, 0) with (0.5, 2)."""
    world = make_world(gravity=gravity, dt=1 / n, collision="event_driven")
    for system in systems:
        world.add_system(system())
    flier = world.create_entity(Transform((1.0, 0.0)), RigidBody(1.0, (0.5, 2.0), **body))
    run(world, n)
    return np.abs(np.concatenate((position(world, flier) - exact[0], velocity(world, flier) - exact[1]))).max()


def test_other_forces_are_of_second_order():
    """Half the step, a quarter of the error, within 5 %; without gravity the damped velocity is exact."""
    x, v = np.array((1.0, 0.0)), np.array((0.5, 2.0))
    sag = np.array((0.0, -G / 4))
    spring = [
        sag + (x - sag) * math.cos(2.0) + v / 2 * math.sin(2.0), v * math.cos(2.0) - 2 * (x - sag) * math.sin(2.0)
    ]  # fmt: skip
    coarse, fine = (deviation(n, spring, Anchor, gravity=G) for n in (50, 100))
    assert coarse / fine == pytest.approx(4, rel=0.05)
    assert coarse < (2 / 50) ** 2 * 3 * 2  # z^2 of the amplitude of 3 m, 6 m/s

    c, g = 1.5, np.array((0.0, -G))
    fade = math.exp(-c)
    damped = [x + g / c + (v - g / c) * (1 - fade) / c, v * fade + g * (1 - fade) / c]
    coarse, fine = (deviation(n, damped, gravity=G, linear_damping=c) for n in (50, 100))
    assert coarse / fine == pytest.approx(4, rel=0.05) or coarse < 1e-12
    world = make_world(collision="event_driven")
    flier = world.create_entity(Transform((0.0, 0.0)), RigidBody(1.0, (3.0, 0.0), linear_damping=c))
    run(world, 60)
    assert velocity(world, flier)[0] == pytest.approx(3.0 * fade, rel=1e-13)

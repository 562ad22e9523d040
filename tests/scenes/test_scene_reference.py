"""Scenes with results in closed form, to 1e-12 or the order of the method; fast balls in each collision mode."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_modes import strikes
from helpers_rest import energy

from carom.framework import Settings
from carom.scenes import bouncing, orbit, shots, spring, thermal_gas

OMEGA = 2 * math.pi


def run(world, seconds):
    """The world after the number of steps nearest to that many seconds."""
    for _ in range(round(seconds / world.settings.dt)):
        world.step()
    return world


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stiffness", "damping"), [(OMEGA**2, 0.0), (OMEGA**2, 0.5), (OMEGA**2, 5.0), (10.0, 0.1), (0.0, 2.0)]
)
def test_spring_with_any_stiffness_and_damping_follows_its_formula(stiffness, damping):
    """RK4: phase error omega t (omega dt)^4 / 120 = 1.6e-10 at 1/1000 s; twice that, for damping adds to it."""
    settings = Settings(dt=1 / 1000, integrator="rk4")
    with spring.build(settings, stiffness=stiffness, damping=damping) as world:
        run(world, 2.0)
        t, half = world.time, damping / 2
        root = np.emath.sqrt(stiffness - half**2)
        expected = math.exp(-half * t) * (np.cos(root * t) + half * np.sin(root * t) / root).real
        assert world.bodies.position[0, 0] == pytest.approx(expected, abs=3.2e-10)


@pytest.mark.parametrize("eccentricity", [0.0, 0.6, 0.9])
def test_orbit_has_the_energy_and_momentum_of_its_ellipse(eccentricity):
    with orbit.build(eccentricity=eccentricity) as world:
        (x, y), (u, v) = world.bodies.position[0], world.bodies.linear_velocity[0]
        assert energy(world) == pytest.approx(-0.5, rel=1e-14)
        assert x * v - y * u == pytest.approx(math.sqrt(1 - eccentricity**2), rel=1e-14)


def test_bouncing_from_another_height():
    with bouncing.build(n=1, height=0.1) as world:  # on the ground from the start
        run(world, 0.5)
        assert world.bodies.dynamic.position[0].tolist() == pytest.approx([0.0, 0.1], abs=1e-3)
    with bouncing.build(n=2, height=8.0) as world:
        assert energy(world) == pytest.approx(2 * 98.1 * 8.0, rel=1e-14)
        hits = strikes(world, 120)
        np.testing.assert_allclose(hits.time, [math.sqrt(2 * 7.9 / 9.81)] * 2, rtol=1e-12)


@pytest.mark.parametrize(("n", "eta", "seed"), [(400, 0.3, 0), (400, 0.3, 7), (4, 0.01, 0), (100, 0.78, 1)])
def test_thermal_gas_starts_warm_and_at_rest_as_a_whole(n, eta, seed):
    """kT = <v^2> / 2 = 1, momentum 0, and the requested fraction of the box."""
    with thermal_gas.build(seed=seed, n=n, eta=eta) as world:
        moving, length = world.bodies.dynamic, thermal_gas.side(n, eta)
        assert (moving.linear_velocity**2).sum() / (2 * n) == pytest.approx(1.0, rel=1e-13)
        np.testing.assert_allclose(world.momentum(), 0.0, atol=1e-12)
        assert n * math.pi / 4 / length**2 == pytest.approx(eta, rel=1e-14)
        if n == 400:  # 800 normal components: kurtosis 3, within three of its standard deviations
            assert np.mean(moving.linear_velocity**4) == pytest.approx(3.0, abs=3 * math.sqrt(24 / 800))


STEPS = 6
STEP = shots.SPEED / 60  # metres
FLOWN = shots.START + STEP * STEPS  # free flight
FREE = shots.APART - 2 * shots.RADIUS  # between the plates
ROUNDING = 1e-12 * shots.END


def after_six_steps(**settings):
    """{lane: positions (balls, 2) from the left to the right at the start}, and the world."""
    world = shots.build(Settings(**settings))
    heights = world.bodies.dynamic.position[:, 1].copy()
    for _ in range(STEPS):
        world.step()
    positions = world.bodies.dynamic.position.copy()
    world.close()
    return {height: positions[heights == height] for height in np.unique(heights)}, world


def to_and_fro(way):
    """The height of the ball between the plates after a path of ``way`` metres down and up."""
    phase = (way + FREE / 2) % (2 * FREE)
    return shots.PLATES + FREE / 2 - min(phase, 2 * FREE - phase)


@pytest.mark.parametrize("mode", ["continuous", "event_driven"])
@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "velocity_verlet", "rk4"])
def test_what_sweeps_finds_every_ball_where_it_must_be(mode, integrator):
    """Reflections at planes, balls as points that pass through each other, one normal of (7, 24) / 25."""
    lanes, world = after_six_steps(collision=mode, integrator=integrator)
    post = np.array((shots.POST, shots.GRAZE - shots.OFF_CENTRE))
    touch = post + (shots.POST_RADIUS + shots.RADIUS) * np.array((-7, 24)) / 25
    gone = STEP * STEPS - (touch[0] - shots.START)
    expected = {
        shots.GRAZE: [touch + gone * np.array((527, 336)) / 625],
        shots.WALL: [(2 * (shots.WALL_FACE - shots.RADIUS) - FLOWN, shots.WALL)],
        shots.HEAD_ON: [
            (shots.OPPOSITE - STEP * STEPS - 2 * shots.RADIUS, shots.HEAD_ON),
            (FLOWN + 2 * shots.RADIUS, shots.HEAD_ON),
        ],
        shots.GHOST: [(2 * (shots.SHIELD_FACE - shots.RADIUS) - FLOWN, shots.GHOST), (shots.TARGET, shots.GHOST)],
        shots.FREE: [(FLOWN, shots.FREE)],
        shots.PLATES: [(FLOWN, to_and_fro(STEP * STEPS))],
    }
    for height, places in expected.items():
        np.testing.assert_allclose(lanes[height], places, rtol=0, atol=ROUNDING)
    assert not world.faults


def test_discrete_passes_through_thin_things_and_meets_a_ghost():
    """All fly on but the ball found inside the target, which takes its velocity, past the shield."""
    lanes, world = after_six_steps(collision="discrete")
    met = shots.TARGET - shots.TARGET_RADIUS - shots.RADIUS
    expected = {
        shots.GRAZE: [(FLOWN, shots.GRAZE)],
        shots.WALL: [(FLOWN, shots.WALL)],
        shots.HEAD_ON: [(FLOWN, shots.HEAD_ON), (shots.OPPOSITE - STEP * STEPS, shots.HEAD_ON)],
        shots.GHOST: [(met, shots.GHOST), (shots.TARGET + FLOWN - met, shots.GHOST)],
        shots.FREE: [(FLOWN, shots.FREE)],
        shots.PLATES: [(FLOWN, shots.PLATES - STEP * STEPS)],
    }
    for height, places in expected.items():
        np.testing.assert_allclose(lanes[height], places, rtol=0, atol=ROUNDING)
    (fault,) = world.faults
    assert "so fast that discrete collisions may miss what it passes" in fault

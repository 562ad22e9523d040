"""Integrators under constant force and on springs, to the rounding of matrix powers: A7, B1 to B3, C7."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_motion import DRIFT, ORDERS, STIFFNESS, all_methods, damped_oscillation, matrix_powers, oscillators, record
from oracles import integrators_naive as naive
from worlds import EPS, make_world, run

from carom.components import RigidBody, Transform
from carom.framework import ForceSystem


def throw(method, dt, steps, *, v0, g, vx=0.0, d=2):
    """Positions and velocities of one body thrown upwards from the origin, (steps + 1, d)."""
    world = make_world(d, gravity=g, dt=dt, integrator=method)
    world.create_entity(Transform((0.0,) * d), RigidBody(3.0, (vx, v0, 0.0)[:d]))
    positions, velocities = record(world, steps)
    return positions[:, 0], velocities[:, 0]


def closed_form(method, dt, steps, v0, g):
    """Height at each step: the parabola, plus or minus g dt t / 2 for the Euler methods."""
    t = dt * np.arange(steps + 1)
    return v0 * t - g * t * t / 2 + DRIFT.get(method, 0) * g * dt * t / 2


# B1: v0, g (per second), Hz, and the published apex of EE, SI and the others
ARCS = [
    *((240.0, 450.0, hz, *apex) for hz, *apex in (
        (60, 66.0, 62.0, 64.0), (30, 68.0, 60.0, 64.0), (20, 70.125, 58.125, 63.9375), (15, 72.0, 56.0, 64.0),
        (10, 76.5, 52.5, 63.75),
    )),
    *((12.0, 30.0, hz, *apex) for hz, *apex in (
        (30, 2.6, 2.2, 2.4), (60, 2.5, 2.3, 2.4), (144, 2.441840, 2.358507, None), (240, 2.425, 2.375, 2.4),
    )),
]  # fmt: skip


@pytest.mark.slow
@all_methods
@pytest.mark.parametrize(("v0", "g", "hz", "ee", "si", "others"), ARCS)
def test_jump_arc(method, v0, g, hz, ee, si, others):
    """B1: every point of the arc, its apex, and where it lands."""
    dt, vx = 1 / hz, 7.0
    n0 = v0 / (g * dt)
    whole = n0 == pytest.approx(round(n0), abs=1e-9)
    sign = DRIFT.get(method, 0)
    landing = round(2 * n0) + sign if whole else math.ceil(2 * n0) + sign
    positions, velocities = throw(method, dt, landing + 1, v0=v0, g=g, vx=vx)
    scale = v0 * v0 / (2 * g)
    height = positions[:, 1]
    steps = np.arange(landing + 2)
    np.testing.assert_allclose(height, closed_form(method, dt, landing + 1, v0, g), rtol=0, atol=1e-12 * scale)
    np.testing.assert_allclose(velocities[:, 1], v0 - steps * g * dt, rtol=0, atol=1e-12 * v0)
    np.testing.assert_allclose(positions[:, 0], vx * steps * dt, rtol=0, atol=1e-12 * scale)

    apex, n, k = height.max(), round(n0), math.floor(n0 + 1e-9)
    f = n0 - k
    formula = g * dt * dt / 2 * {1: (k + 1) * (k + 2 * f), -1: k * (k - 1 + 2 * f), 0: n * (2 * n0 - n)}[sign]
    assert apex == pytest.approx(formula, rel=1e-12)
    published = {1: ee, -1: si, 0: others}[sign]
    if published is not None:
        assert apex == pytest.approx(published, abs=5e-7)
    if sign == 0:
        assert scale - g * dt * dt / 8 <= apex * (1 + 1e-12)
        assert apex <= scale * (1 + 1e-12)
    if whole:
        assert abs(height[landing]) <= 1e-12 * scale  # back on the ground in exactly that step
        assert (height[1:landing] > 1e-6 * scale).all()
        assert positions[landing, 0] == pytest.approx(vx * (2 * n0 + sign) * dt, rel=1e-12)


@pytest.mark.slow
@all_methods
@pytest.mark.parametrize("dt", [1e-9, 1e-6, 0.25, 1.0, 10.0])
def test_extreme_steps_keep_the_closed_form(method, dt):
    """C7: B1 from a nanosecond to ten seconds, along the second axis of a 3D world."""
    v0, g, steps = 12.0, 30.0, 500
    positions, velocities = throw(method, dt, steps, v0=v0, g=g, d=3)
    expected = closed_form(method, dt, steps, v0, g)
    speeds = v0 - g * dt * np.arange(steps + 1)
    tolerance = 10 * steps * EPS
    np.testing.assert_allclose(positions[:, 1], expected, rtol=0, atol=tolerance * np.abs(expected).max())
    np.testing.assert_allclose(velocities[:, 1], speeds, rtol=0, atol=tolerance * np.abs(speeds).max())
    assert not positions[:, ::2].any()


def energy_ratio(positions, velocities, stiffness):
    """E / E0 of bodies of mass 1 on springs; (steps, n)."""
    energy = velocities[..., 0] ** 2 + stiffness * positions[..., 0] ** 2
    return energy / energy[0]


Z = np.array([0.1, 0.5, 1.1, 1.9, 1.99])  # omega dt, below the limit 2; at 1 six samples repeat for ever


@pytest.mark.slow
@pytest.mark.parametrize(("steps", "tenth"), [(2400, 800), pytest.param(40_000, 2000, marks=pytest.mark.long)])
@pytest.mark.parametrize("method", ["semi_implicit_euler", "velocity_verlet"])
def test_undamped_spring_stays_in_its_energy_band(method, steps, tenth):
    """B2, C17: E/E0 in [1/(1+z/2), 1/(1-z/2)] (SI), [1-z^2/4, 1] (VV), in the first and in the last tenth alike, and
    SI's invariant; the tolerance leaves room for a drift of 2.5e-14 a step, 1e-6 in 4e7 steps."""
    tolerance, world = 1e-9, oscillators(method, 1.0, Z**2)
    early = record(world, tenth)
    run(world, steps - 2 * tenth)
    late = record(world, tenth)
    low, high = {
        "semi_implicit_euler": (1 / (1 + Z / 2), 1 / (1 - Z / 2)),
        "velocity_verlet": (1 - Z**2 / 4, np.ones_like(Z)),
    }[method]
    for positions, velocities in (early, late):
        energy = (velocities[..., 0] ** 2 + Z**2 * positions[..., 0] ** 2) / Z**2
        assert (energy >= low * (1 - tolerance)).all()
        assert (energy <= high * (1 + tolerance)).all()
        # and the whole band is covered: dense samples come near both ends
        np.testing.assert_allclose(energy.min(axis=0), low, rtol=5e-3)
        np.testing.assert_allclose(energy.max(axis=0), high, rtol=5e-3)
        if method == "semi_implicit_euler":
            x, v = positions[..., 0], velocities[..., 0]
            invariant = v**2 + Z**2 * x**2 - Z**2 * x * v
            np.testing.assert_allclose(invariant, np.broadcast_to(Z**2, invariant.shape), rtol=tolerance)


@pytest.mark.slow
def test_yoshida_keeps_the_energy_of_a_spring():
    """B2's band for the fourth order: a symplectic method's energy oscillates by O(z^4) and does not drift."""
    z = np.array([0.05, 0.1, 0.2])
    ratio = energy_ratio(*record(oscillators("yoshida4", 1.0, z**2), 1600), z**2)
    early, late = np.abs(ratio[:800] - 1).max(axis=0), np.abs(ratio[800:] - 1).max(axis=0)
    np.testing.assert_allclose(early, late, rtol=1e-2)
    np.testing.assert_allclose(np.log2(early[1:] / early[:-1]), 4.0, rtol=0.02)


DAMPING_RATIOS = np.array([0.0, 0.05, 0.5, 1.0, 1.5])  # under, critically and over-damped


@pytest.mark.slow
@all_methods
def test_damped_spring_is_the_matrix_power(method):
    """B3: 400 steps of every damping equal the textbook method's matrix power at rounding; mass 2 instead of 1."""
    dt, steps = 1 / 100, 400
    drag = 2 * DAMPING_RATIOS * math.sqrt(STIFFNESS)
    world = oscillators(method, dt, 2 * STIFFNESS, 2 * drag, x0=0.7, v0=-2.0, mass=2.0)
    positions, velocities = record(world, steps)
    for i, c in enumerate(drag):
        expected = matrix_powers(method, STIFFNESS, c, dt, steps, 0.7, -2.0)
        scale = np.abs(expected).max(axis=0)
        got = np.column_stack((positions[:, i, 0], velocities[:, i, 0]))
        np.testing.assert_allclose(got / scale, expected / scale, rtol=0, atol=10 * steps * EPS)


@pytest.mark.slow
@all_methods
def test_observed_order(method):
    """B3: the error after 4/5 of a period falls by 2^p within 5 %; Yoshida's composition only without damping."""
    zetas = DAMPING_RATIOS[:1] if method == "yoshida4" else DAMPING_RATIOS
    drag = 2 * zetas * math.sqrt(STIFFNESS)
    exact = np.array([damped_oscillation(zeta, 0.8) for zeta in zetas])
    errors = []
    for steps in (200, 400):
        positions, velocities = record(oscillators(method, 1 / steps, STIFFNESS, drag), 4 * steps // 5)
        got = np.column_stack((positions[-1, :, 0], velocities[-1, :, 0]))
        errors.append(np.hypot(*((got - exact) / (1.0, math.sqrt(STIFFNESS))).T))
    orders = np.log2(errors[0] / errors[1])
    np.testing.assert_allclose(orders, ORDERS[method], rtol=0.05)


class Pushes(ForceSystem):
    """A force that depends on time alone: F = 6 t."""

    def add_forces(self, bodies, time):
        bodies.force[:, 0] += 6.0 * time


@all_methods
def test_forces_that_depend_on_time(method):
    """Stages use their own time: x'' = 6 t gives x = t^3 by RK4 and Yoshida, the textbook's steps by the others."""
    dt, steps = 0.125, 40
    world = make_world(dt=dt, integrator=method)
    world.create_entity(Transform((0, 0)), RigidBody())
    world.add_system(Pushes())
    positions, velocities = record(world, steps)
    x, v = naive.trajectory(method, 0.0, 0.0, dt, steps, lambda x, v, t: 6 * t)
    np.testing.assert_allclose(positions[:, 0, 0], x, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(velocities[:, 0, 0], v, rtol=1e-12, atol=1e-13)
    if ORDERS[method] == 4:
        t = dt * np.arange(steps + 1)
        np.testing.assert_allclose(positions[:, 0, 0], t**3, rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(velocities[:, 0, 0], 3 * t**2, rtol=1e-12, atol=1e-13)


# -- bodies that attract each other: the figure eight (published and measured figures)


class NewtonianGravity(ForceSystem):
    """Bodies of mass 1 that attract each other, G = 1."""

    def add_forces(self, bodies, time):
        bodies.force[:] += self.pull(bodies.position)

    def pull(self, x):
        apart = x[None] - x[:, None]
        cube = np.sum(apart**2, axis=2) ** 1.5
        np.fill_diagonal(cube, 1.0)
        return np.sum(apart / cube[..., None], axis=1)


# B5: return error after one period with 1000 and 10000 steps
FIGURE_EIGHT = {
    "explicit_euler": (0.86, 0.081),
    "semi_implicit_euler": (1.0e-2, 1.0e-3),
    "velocity_verlet": (6.4e-5, 6.7e-7),
    "rk4": (2.4e-8, 3e-8),
    "yoshida4": (None, 3e-8),  # not published; limited by the eight digits of the start as RK4 is
}


@pytest.mark.slow
@pytest.mark.early
@pytest.mark.parametrize("steps", [1000, pytest.param(10_000, marks=pytest.mark.long)])
@all_methods
def test_figure_eight(method, steps):
    """B5: Chenciner and Montgomery's orbit comes back after one period; 1.25 times the published two digits."""
    x1, v3 = np.array([0.97000436, -0.24308753]), np.array([-0.93240737, -0.86473146])
    x0, v0 = np.array([x1, -x1, 0 * x1]), np.array([-v3 / 2, -v3 / 2, v3])
    dt, pull = 6.32591398 / steps, NewtonianGravity().pull
    world = make_world(dt=dt, integrator=method)
    world.create_entities(3, Transform.many(x0), RigidBody.many(1.0, v0))
    world.add_system(NewtonianGravity())
    run(world, steps)
    np.testing.assert_allclose(world.momentum(), 0, atol=1e-12)
    x, published = world.bodies.position, FIGURE_EIGHT[method][steps > 1000]
    if steps == 1000:
        expected, _ = naive.trajectory(method, x0, v0, dt, steps, lambda x, v, t: pull(x))
        np.testing.assert_allclose(x, expected[-1], rtol=0, atol=1e-10)
    # without a published figure: fourth order against second
    assert np.abs(x - x0).max() < (1.25 * published if published else FIGURE_EIGHT["velocity_verlet"][0] / 10)

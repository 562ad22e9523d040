"""Limits of stability of the integrators, drag up to and beyond them, and time reversal."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_motion import (
    ORDERS,
    STIFFNESS,
    Oscillator,
    SpringAndDrag,
    all_methods,
    damped_oscillation,
    matrix_powers,
    oscillators,
    record,
)
from oracles import integrators_naive as naive
from worlds import EPS, make_world, run

from carom.components import RigidBody, Transform
from carom.framework import ForceSystem

ROWS = [(1.0, 0.0), (0.0, 1.0), (1.0, 0.1), (1.0, 1.0), (1.0, 2.0)]  # (stiffness, drag) of those columns, omega = 1


def at_share_of_limit(method, share):
    """(stiffness, drag) for steps of 1 s, at that fraction of each limit above zero."""
    limits = [naive.stability_limit(method, *row) for row in ROWS]
    return np.array(
        [(k * (share * h) ** 2, c * share * h) for (k, c), h in zip(ROWS, limits, strict=True) if h > 1e-3]
    )


def step_matrices(method, stiffness, drag):
    """The engine's own (x, v) -> (x, v) of one step of 1 s, for each oscillator: one step of both basis states."""
    columns = []
    for x0, v0 in ((1.0, 0.0), (0.0, 1.0)):
        positions, velocities = record(oscillators(method, 1.0, stiffness, drag, x0=x0, v0=v0), 1)
        columns.append(np.stack((positions[1, :, 0], velocities[1, :, 0]), axis=-1))
    return np.stack(columns, axis=-1)


@pytest.mark.slow
@all_methods
def test_stability_limits(method):
    """B6: at 0.999 of a limit no eigenvalue of the step leaves the unit circle; at 1.01 one grows millionfold."""
    for share, stable in ((0.999, True), (1.01, False)):
        stiffness, drag = at_share_of_limit(method, share).T
        matrices = step_matrices(method, stiffness, drag)
        textbook = [naive.oscillator_matrix(method, k, c, 1.0) for k, c in zip(stiffness, drag, strict=True)]
        np.testing.assert_allclose(matrices, textbook, rtol=0, atol=1e-13)
        radius = np.abs(np.linalg.eigvals(matrices)).max(axis=1)
        if stable:
            assert (radius <= 1 + 1e-13).all()
        else:
            assert (1e6 * np.log(radius) > math.log(1e6)).all()


def test_double_root_of_semi_implicit_euler():
    """C16: exactly at z = 2 the amplitude grows linearly, x_n = (-1)^n (1 + 2 n) from (1, 0)."""
    x = record(oscillators("semi_implicit_euler", 1.0, 4.0), 200)[0][:, 0, 0]
    n = np.arange(201)
    assert np.array_equal(x, (-1.0) ** n * (1 + 2 * n))


@pytest.mark.slow
def test_what_explodes_is_reported():
    """B6, B7: growth by 1.5 per step; once not finite, a fault names the body, and others are as without it."""
    world = oscillators("explicit_euler", 1.0, 0.0, [2.5, 0.5], v0=1.0)
    alone = oscillators("explicit_euler", 1.0, 0.0, 0.5, v0=1.0)
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(1800):  # 1.5^1750 > 1.8e308
            world.step()
            alone.step()
    entity = int(world.bodies.entity[0])
    assert any(f"entity {entity}:" in fault for fault in world.faults)
    assert not any(f"entity {entity + 1}:" in fault for fault in world.faults)
    assert np.array_equal(world.bodies.position[1], alone.bodies.position[0])

TAU, G = 0.8, 9.81
V_T = G * TAU  # terminal speed


@pytest.mark.slow
@all_methods
@pytest.mark.parametrize("dt", [1e-3, 1 / 60, 0.5 * TAU])
def test_terminal_speed_is_a_fixed_point(method, dt):
    """B7: terminal speed stays, 1e-14 or tau / dt half ulps, with drag as a force and as linear_damping."""
    world = oscillators(method, dt, 0.0, 1 / TAU, x0=0.0, v0=V_T, gravity=(G, 0.0))
    damped = world.create_entity(Transform((0, 0)), RigidBody(1.0, (V_T, 0.0), linear_damping=1 / TAU))
    _, velocities = record(world, 250)
    assert world.bodies.row_of(damped) == 1
    np.testing.assert_allclose(velocities[..., 0], V_T, rtol=max(1e-14, EPS * TAU / dt))


class Nothing(ForceSystem):
    """Its presence makes the integrators evaluate every stage."""

    def add_forces(self, bodies, time):
        pass


def damped_fall(method, dt, steps, staged=False):
    """Positions and velocities along x of a body from rest under g and linear_damping 1 / tau."""
    world = make_world(gravity=(G, 0.0), dt=dt, integrator=method)
    world.create_entity(Transform((0, 0)), RigidBody(3.0, linear_damping=1 / TAU))
    if staged:
        world.add_system(Nothing())
    positions, velocities = record(world, steps)
    return positions[:, 0, 0], velocities[:, 0, 0]


@pytest.mark.slow
@all_methods
@pytest.mark.parametrize("dt", [1e-9, 1 / 60, 2.5 * TAU, 100 * TAU])
@pytest.mark.parametrize("staged", [False, True])
def test_linear_damping_is_exact(method, dt, staged):
    """B7: v = v_t (1 - e^(-t/tau)) for every method and step, monotone; Yoshida magnifies rounding by 70.

    y = v_t (t - tau (1 - e^(-t/tau))): where no force depends on the state, and in every Verlet step.
    """
    steps = 200
    y, velocity = damped_fall(method, dt, steps, staged)
    t = dt * np.arange(steps + 1)
    magnified = 70 if method == "yoshida4" and staged else 1
    np.testing.assert_allclose(velocity, -V_T * np.expm1(-t / TAU), rtol=magnified * 10 * steps * EPS)
    assert (np.diff(velocity) >= -magnified * 4 * EPS * V_T).all()
    if ORDERS[method] > 1 and (method, staged) != ("rk4", True):
        np.testing.assert_allclose(y, V_T * (t + TAU * np.expm1(-t / TAU)), rtol=1e-11, atol=1e-15)


@pytest.mark.slow
@all_methods
def test_linear_damping_has_the_methods_order_with_a_spring(method):
    """Damping beside a force that depends on position keeps the method's order: exact solution of B3, zeta = 0.5."""
    w, errors = math.sqrt(STIFFNESS), []
    for steps in (200, 400):
        world = make_world(dt=1 / steps, integrator=method)
        world.create_entity(Transform((1, 0)), RigidBody(linear_damping=w), Oscillator(STIFFNESS))
        world.add_system(SpringAndDrag())
        positions, velocities = record(world, steps)
        x, v = damped_oscillation(0.5, 1.0)
        errors.append(math.hypot(positions[-1, 0, 0] - x, (velocities[-1, 0, 0] - v) / w))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(ORDERS[method], rel=0.05)


@all_methods
def test_heavily_damped_bodies_creep(method):
    """c = 600 / s at 60 Hz, k = 600 N/m: x = e^(-t) to the first order; an undamped body beside is not affected."""
    world = make_world(dt=1 / 60, integrator=method)
    world.create_entity(Transform((1, 0)), RigidBody(linear_damping=600.0), Oscillator(600.0))
    world.create_entity(Transform((1, 0)), RigidBody(), Oscillator(1.0))
    world.add_system(SpringAndDrag())
    positions, _ = record(world, 60)
    np.testing.assert_allclose(positions[:, 0, 0], np.exp(-np.arange(61) / 60), rtol=0.05)
    expected = matrix_powers(method, 1.0, 0.0, 1 / 60, 60)[:, 0]
    np.testing.assert_allclose(positions[:, 1, 0], expected, rtol=0, atol=1e-13)


class Network(ForceSystem):
    """Springs between bodies: F = -K x."""

    def __init__(self, stiffness):
        self.stiffness = stiffness

    def add_forces(self, bodies, time):
        bodies.force[:] -= self.stiffness @ bodies.position


def return_error(method, steps=600):
    """Forward, velocities reversed, back: distance from the start, relative to the largest coordinate."""
    rng = np.random.default_rng(8)
    n = 100
    springs = np.triu(rng.random((n, n)) < 0.05, 1) * rng.uniform(1.0, 5.0, (n, n))
    springs = springs + springs.T
    start = rng.uniform(-1, 1, (n, 2))
    world = make_world(dt=1 / 60, integrator=method)
    world.create_entities(n, Transform.many(start), RigidBody.many(rng.uniform(0.5, 2, n), rng.normal(size=(n, 2))))
    world.add_system(Network(np.diag(springs.sum(axis=1)) - springs))
    for _ in range(2):
        run(world, steps)
        world.bodies.linear_velocity[:] *= -1
    return np.abs(world.bodies.position - start).max()


@pytest.mark.slow
@all_methods
def test_time_reversal(method):
    """B8: 100 bodies, springs, no collisions. VV and YO4 are their own adjoints and return; the others do not."""
    error = return_error(method)
    if method in ("velocity_verlet", "yoshida4"):
        assert error < 1e-12
    else:
        assert error > 1e-9  # otherwise the test could not distinguish them

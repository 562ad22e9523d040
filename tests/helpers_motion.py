"""Bodies in free flight under forces with known answers, and their recorded motion."""

from __future__ import annotations

import math

import numpy as np
import pytest
from oracles import integrators_naive as naive
from worlds import METHODS, make_world

from carom.components import RigidBody, Transform
from carom.framework import Component, ForceSystem, column

ORDERS = dict(zip(METHODS, (1, 1, 2, 4, 4), strict=True))
STAGES = dict(zip(METHODS, (1, 1, 2, 4, 4), strict=True))
DRIFT = {"explicit_euler": 1, "semi_implicit_euler": -1}  # times g dt t / 2: the methods' error under constant force
FRAME_RATES = (15, 30, 60, 144)
NOISE = 1e-6  # relative, of frequencies that finite differences give

all_methods = pytest.mark.parametrize("method", METHODS)


class Oscillator(Component):
    """A spring to the origin and a drag."""

    stiffness = column(0.0)  # N/m
    drag = column(0.0)  # N s/m


class SpringAndDrag(ForceSystem):
    requires = (RigidBody, Oscillator)

    def add_forces(self, bodies, time):
        bodies.force[:] -= bodies.oscillator.stiffness[:, None] * bodies.position
        bodies.force[:] -= bodies.oscillator.drag[:, None] * bodies.linear_velocity

    def potential_energy(self, bodies):
        return 0.5 * (bodies.oscillator.stiffness * (bodies.position**2).sum(axis=1)).sum()


def oscillators(method, dt, stiffness, drag=0.0, *, x0=1.0, v0=0.0, mass=1.0, **world):
    """A world of independent oscillators along the first axis, one for each value given."""
    arrays = np.broadcast_arrays(*(np.atleast_1d(np.asarray(a, float)) for a in (stiffness, drag, x0, v0, mass)))
    stiffness, drag, x0, v0, mass = arrays
    result = make_world(dt=dt, integrator=method, **world)
    result.create_entities(
        len(mass),
        Transform.many(np.column_stack((x0, np.zeros_like(x0)))),
        RigidBody.many(mass, np.column_stack((v0, np.zeros_like(v0)))),
        Oscillator.many(stiffness, drag),
    )
    result.add_system(SpringAndDrag())
    return result


def record(world, steps):
    """Positions and velocities of all bodies at steps 0 ... steps, each (steps + 1, n, d)."""
    bodies = world.bodies
    position, velocity = bodies.position, bodies.linear_velocity
    positions = np.empty((steps + 1, *position.shape))
    velocities = np.empty_like(positions)
    for n in range(steps + 1):
        if n:
            world.step()
        positions[n], velocities[n] = position, velocity
    return positions, velocities


STIFFNESS = 4 * math.pi**2  # period 1 s


def matrix_powers(method, stiffness, drag, dt, steps, x0=1.0, v0=0.0):
    """The textbook method's (x, v) at steps 0 ... steps, by repeated multiplication with its step matrix."""
    matrix = naive.oscillator_matrix(method, stiffness, drag, dt)
    states = np.empty((steps + 1, 2))
    states[0] = x0, v0
    for n in range(steps):
        states[n + 1] = matrix @ states[n]
    return states


def damped_oscillation(zeta, t):
    """B3: exact (x, v) from (1, 0) of x'' = -w^2 x - 2 zeta w x', by the matrix exponential's eigenvalues."""
    w = math.sqrt(STIFFNESS)
    if zeta == 1.0:
        return (1 + w * t) * math.exp(-w * t), -w * w * t * math.exp(-w * t)
    root = np.sqrt(complex(zeta * zeta - 1))
    s1, s2 = w * (-zeta + root), w * (-zeta - root)
    e1, e2 = np.exp(s1 * t), np.exp(s2 * t)
    return ((s1 * e2 - s2 * e1) / (s1 - s2)).real, (s1 * s2 * (e2 - e1) / (s1 - s2)).real

"""The integrators as textbooks print them, one step at a time; x and v are numbers or arrays.

``acceleration(x, v, t)`` gives the acceleration; a step returns the new (x, v).
"""

from __future__ import annotations

import numpy as np


def explicit_euler(x, v, t, h, acceleration):
    return x + h * v, v + h * acceleration(x, v, t)


def semi_implicit_euler(x, v, t, h, acceleration):
    v = v + h * acceleration(x, v, t)
    return x + h * v, v


def velocity_verlet(x, v, t, h, acceleration):
    x, v, _ = verlet_part(x, v, acceleration(x, v, t), t, h, acceleration)
    return x, v


def verlet_part(x, v, a, t, h, acceleration):
    """a: the acceleration at the start; also returns the one at the end, with velocity predicted as v + a h."""
    x = x + h * v + h * h / 2 * a
    end = acceleration(x, v + h * a, t + h)
    return x, v + h / 2 * (a + end), end


def rk4(x, v, t, h, acceleration):
    v1, a1 = v, acceleration(x, v, t)
    v2 = v + h / 2 * a1
    a2 = acceleration(x + h / 2 * v1, v2, t + h / 2)
    v3 = v + h / 2 * a2
    a3 = acceleration(x + h / 2 * v2, v3, t + h / 2)
    v4 = v + h * a3
    a4 = acceleration(x + h * v3, v4, t + h)
    return x + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


def yoshida4(x, v, t, h, acceleration):
    """Verlet steps of lengths w1, w0, w1 (Yoshida 1990, eq. 4.4); the force between two of them is evaluated once."""
    w1 = 1 / (2 - 2 ** (1 / 3))
    a = acceleration(x, v, t)
    for w in (w1, 1 - 2 * w1, w1):
        x, v, a = verlet_part(x, v, a, t, w * h, acceleration)
        t += w * h
    return x, v


STEPS = {
    "explicit_euler": explicit_euler,
    "semi_implicit_euler": semi_implicit_euler,
    "velocity_verlet": velocity_verlet,
    "rk4": rk4,
    "yoshida4": yoshida4,
}


def trajectory(method, x, v, h, steps, acceleration):
    """Positions and velocities at steps 0 ... steps."""
    positions, velocities = [x], [v]
    for n in range(steps):
        x, v = STEPS[method](x, v, n * h, h, acceleration)
        positions.append(x)
        velocities.append(v)
    return np.array(positions), np.array(velocities)


def oscillator_matrix(method, stiffness, drag, h):
    """(x, v) -> (x, v) of one step of x'' = -stiffness x - drag v: (2, 2), and exact because the step is linear."""
    basis = np.eye(2)
    return np.array(STEPS[method](basis[0], basis[1], 0.0, h, lambda x, v, t: -stiffness * x - drag * v))


def stability_limit(method, stiffness, drag):
    """The largest h whose step matrix of (stiffness, drag) has no eigenvalue outside the unit circle; by bisection."""
    low, high = 0.0, 8.0
    while high - low > 1e-13:
        middle = (low + high) / 2
        matrix = oscillator_matrix(method, stiffness, drag, middle)
        stable = np.abs(np.linalg.eigvals(matrix)).max() <= 1 + 1e-12
        low, high = (middle, high) if stable else (low, middle)
    return low

"""Limits of stability: the longest step at which an integrator keeps a linear world from growing.

The system is x'' = -K x - C x' - G x': K stiffness and C drag by forces, G linear damping, which integrators treat
separately. One step of the integrator is applied to a basis of states, which gives the matrix of the step. The step is
stable while no eigenvalue lies outside the unit circle. So the limit of a plugin's integrator is found in the same way.

For one oscillator (k = w^2, c) the limits are known: w h = 2 for semi-implicit Euler and velocity Verlet, 2 sqrt 2 for
Runge-Kutta 4, none for explicit Euler; c h = 2, 2 and 2.785 for drag alone (Hairer & Wanner, Solving Ordinary
Differential Equations II, section IV.2).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...framework.jit.records.record import make_record
from ...framework.schedule.stages import Program
from ...systems import Integrator
from ...systems.integration.integrators import STANDARD_INTEGRATORS, Flight
from ...systems.integration.motion import Motion
from ...systems.integration.system import Integration
from ...systems.records import STATE

Floats = NDArray[np.float64]

ROUNDING = 1e-12  # growth per step that counts as none
SHORTEST, LONGEST = 1e-5, 30.0  # range of steps searched, in units of the oscillator's own time
RATIO = 1.02  # of consecutive steps
HALVINGS = 50
# A growth with a power of h from h = 0 exceeds rounding at a short step, and doubling the step multiplies it by at
# most STEEPEST.
SHORT, STEEPEST = 0.05, 2.0**8


def advanced(
    integrator: Integrator, position: Floats, velocity: Floats, damping: Floats, force: Callable[..., Floats]
) -> tuple[Floats, Floats]:
    """One step of 1 s of bodies of 1 kg: position and velocity (n, 2), damping (n,).

    force(position, velocity) returns (n, 2).
    """
    motion = _motion(position, velocity, force(position, velocity), damping)

    def evaluate(_: float) -> None:
        motion.force[:] = force(motion.position, motion.velocity)

    motion.evaluator = evaluate
    integrator.advance(motion, 1.0)
    return motion.position, motion.velocity


@cache
def _program() -> Program:
    """The stages of the built-in integrators, over a record that belongs to no world."""
    state = make_record(STATE, 2)
    state.force_changes = True
    program = Program(state, (*Integration.STAGES, *Integration.ON_DEMAND), {}, 0)
    program.alarm = state.word_of("unsound")
    return program


def _motion(position: Floats, velocity: Floats, force: Floats, damping: Floats) -> Motion:
    """A step that begins, for bodies of 1 kg."""
    program, count = _program(), len(position)
    bodies = program.state.bodies
    program.state.count = program.state.moving = program.state.dynamic = count
    columns = {
        "position": position.copy(), "linear_velocity": velocity.copy(), "force": force,
        "inverse_mass": np.ones(count), "linear_damping": damping.copy(),
        "previous_position": position.copy(), "start_velocity": velocity.copy(),
    }  # fmt: skip
    for name, column in columns.items():
        setattr(bodies, name, column)
    for integrator in (*STANDARD_INTEGRATORS.values(), Flight):
        bodies.reserve(count, *integrator.COLUMNS)
    return Motion(*columns.values(), None, program)  # pyright: ignore[reportCallIssue]


def growth(
    integrator: Integrator, stiffness: ArrayLike, drag: ArrayLike = 0.0, damping: ArrayLike = 0.0, h: ArrayLike = 1.0
) -> Floats:
    """The largest absolute eigenvalue of one step of each oscillator x'' = -stiffness x - (drag + damping) x'.

    stiffness 1/s^2, drag and damping 1/s, h s: arrays of one length or numbers. Stiffness and drag may be complex; then
    x stands for x + i y of a plane, as needed for forces that turn the velocity. Above 1 the oscillation grows.
    """
    k, c, g, step = (np.atleast_1d(np.asarray(a)) for a in (stiffness, drag, damping, h))
    k, c, g, step = np.broadcast_arrays(k, c, g, step)
    # In units of its own step every oscillator takes a step of 1 s.
    k, c, g = np.tile(k * step * step + 0j, 2), np.tile(c * step + 0j, 2), np.tile(np.real(g * step) + 0.0, 2)
    half = len(k) // 2
    start = np.zeros((2, 2 * half), complex)
    start[0, :half] = start[1, half:] = 1.0

    def force(position: Floats, velocity: Floats) -> Floats:
        x, v = position.view(complex)[:, 0], velocity.view(complex)[:, 0]
        return (-(k * x) - c * v)[:, None].view(float)

    position, velocity = advanced(integrator, start[0][:, None].view(float), start[1][:, None].view(float), g, force)
    x, v = position.view(complex)[:, 0], velocity.view(complex)[:, 0]
    a, b, d, e = x[:half], x[half:], v[:half], v[half:]
    a, e = a - 1, e - 1  # eigenvalues of the change: the matrix of a short step is nearly the unit matrix
    middle = 1 + (a + e) / 2
    root = np.sqrt((a + e) ** 2 / 4 - (a * e - b * d))
    return np.maximum(np.abs(middle + root), np.abs(middle - root))


def stability_limits(
    integrator: Integrator, stiffness: ArrayLike, drag: ArrayLike = 0.0, damping: ArrayLike = 0.0
) -> Floats:
    """Seconds, for each oscillator (see :func:`growth`): the shortest step at which it grows.

    0 if it grows at any step, inf if at none; inf too if the exact solution grows, whatever the step.
    """
    k, c, g = (np.atleast_1d(np.asarray(a)) for a in (stiffness, drag, damping))
    k, c, g = np.broadcast_arrays(k + 0j, c + 0j, np.real(g) + 0.0)
    limits = np.full(len(k), np.inf)
    scale = np.maximum(np.sqrt(np.abs(k)), np.abs(c))
    asked = np.flatnonzero((scale > 0) & ~grows_by_itself(k, c, g))
    if not len(asked):
        return limits
    k, c, g, scale = k[asked], c[asked], g[asked], scale[asked]
    low = np.zeros(len(asked))
    high = np.full(len(asked), np.inf)
    longest = LONGEST * (1.0 + g / scale) / scale
    h = SHORTEST / scale
    while (looking := np.isinf(high) & (h <= longest)).any():
        stable = growth(integrator, k, c, g, h) <= 1 + ROUNDING
        high[looking & ~stable] = h[looking & ~stable]
        low[looking & stable] = h[looking & stable]
        h = h * RATIO
    found = np.isfinite(high)
    for _ in range(HALVINGS if found.any() else 0):
        middle = np.where(found, (low + np.where(found, high, low)) / 2, low)
        stable = growth(integrator, k, c, g, middle) <= 1 + ROUNDING
        low, high = np.where(found & stable, middle, low), np.where(found & ~stable, middle, high)
    beyond = growth(integrator, k, c, g, 2 * low) - 1
    from_nothing = (low * scale <= SHORTEST) | ((low * scale < SHORT) & (beyond < STEEPEST * ROUNDING))
    limits[asked[found]] = np.where(from_nothing, 0.0, low)[found]
    return limits


def grows_by_itself(stiffness: Any, drag: Any, damping: Any) -> NDArray[np.bool_]:
    """True if the exact solution of x'' = -stiffness x - (drag + damping) x' grows: no step could prevent it."""
    c = drag + damping
    root = np.sqrt(c * c / 4 - stiffness + 0j)
    fastest = np.maximum((-c / 2 + root).real, (-c / 2 - root).real)
    return fastest > 1e-9 * np.maximum(np.sqrt(np.abs(stiffness)), np.abs(c))

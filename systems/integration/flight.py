"""The flight between impacts when all is driven by events: a parabola, exact for what does not change within the step.

All forces of the step's start bend the path: gravity, constant and applied forces exactly, those of force systems as
they are there. Forces at the end correct the velocity, as velocity Verlet does. Damping acts as a kick of half a step
before the flight and of another half after it (Strang splitting). Both are of second order, bounces on the way
included: a flight whose velocity is right only in the middle of the step would make that the first.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...framework.compilation import kernel
from .integrators import PARABOLA, Integrator

if TYPE_CHECKING:
    from .motion import Motion


@kernel
def take_off(position, velocity, force, inverse_mass, damping, path, second, h):
    """The first half kick, and the flight; path, second (n, d): its coefficients. Returns whether any is damped."""
    damped = False
    for i in range(len(position)):
        decay = 1.0
        if damping[i] != 0.0:
            decay, damped = math.exp(-0.5 * damping[i] * h), True
        for k in range(position.shape[1]):
            a, v = force[i, k] * inverse_mass[i], velocity[i, k] * decay
            path[i, k], second[i, k] = v, 0.5 * a
            position[i, k] += h * (v + 0.5 * h * a)
            velocity[i, k] = v + h * a
    return damped


@kernel
def land(velocity, force, inverse_mass, damping, second, h):
    """The mean of the forces at both ends in place of the first, and the second half kick."""
    for i in range(len(velocity)):
        decay = math.exp(-0.5 * damping[i] * h) if damping[i] != 0.0 else 1.0
        for k in range(velocity.shape[1]):
            velocity[i, k] = (velocity[i, k] + h * (0.5 * force[i, k] * inverse_mass[i] - second[i, k])) * decay


class Flight(Integrator):
    """What ``Settings(collision="event_driven")`` uses in place of the integrator."""

    order, evaluations, path = 2, 2, PARABOLA

    def __init__(self) -> None:
        self.velocity, self.second = np.empty((0, 0)), np.empty((0, 0))  # the paths' coefficients, (n, d)

    def advance(self, motion: Motion, dt: float) -> None:
        self.velocity, self.second = np.empty_like(motion.velocity), np.empty_like(motion.velocity)
        damped = take_off(*motion.arrays, self.velocity, self.second, dt)
        if motion.force_changes:
            motion.evaluate(dt)
        if motion.force_changes or damped:
            land(motion.velocity, motion.force, motion.inverse_mass, motion.damping, self.second, dt)

    def kernels(self, force_changes: bool) -> tuple[str, ...]:
        return ("take_off", "land") if force_changes else ("take_off",)

"""Integrators: how a body moves in free flight through one step.

Each takes the motion (columns at the start of the step, with the forces of that state summed) and leaves the
prediction in the columns. It also says what path the bodies take within the step, because an impact is found and
dated on that path: explicit Euler moves on a line with the old velocity, semi-implicit Euler on a line with the new
one, velocity Verlet on a parabola, the others on a cubic through both ends.

Damping is exact for a constant force in every method: it enters as the integrating factor e^(-c h), and what
multiplies accelerations are the phi functions of exponential integrators (Hochbruck & Ostermann, Acta Numerica 2010);
for c = 0 they are the ordinary coefficients.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ...framework.compilation import inlined, kernel

if TYPE_CHECKING:
    from .motion import Motion

LINE, PARABOLA, CUBIC = 1, 2, 3  # degree of the path within the step


class Integrator:
    """Derive from it and register it with ``plugin.integrator(name)``.

    order
        of the error of a whole run, in dt
    evaluations
        of the forces, per step
    path
        LINE, PARABOLA or CUBIC
    """

    order: ClassVar[int]
    evaluations: ClassVar[int]
    path: ClassVar[int] = CUBIC
    moves_with_old_velocity: ClassVar[bool] = False  # of a LINE: which end's velocity it follows

    def advance(self, motion: Motion, dt: float) -> None:
        """Move ``motion.position`` and ``motion.velocity`` of the dynamic bodies by ``dt`` seconds."""
        raise NotImplementedError

    def kernels(self, force_changes: bool) -> tuple[str, ...]:
        """Names of the kernels that :meth:`advance` calls, for ``world.plan()``; force_changes: see Motion."""
        return ()


class ExplicitEuler(Integrator):
    """Position with the old velocity. Drifts upwards by g dt t / 2; unstable for springs."""

    order, evaluations, path = 1, 1, LINE
    moves_with_old_velocity = True

    def advance(self, motion: Motion, dt: float) -> None:
        euler(*motion.arrays, dt, False, motion.like)

    def kernels(self, force_changes: bool) -> tuple[str, ...]:
        return ("euler",)


class SemiImplicitEuler(Integrator):
    """Velocity first, position with the new one. Symplectic: energy stays within bounds below z = 2."""

    order, evaluations, path = 1, 1, LINE

    def advance(self, motion: Motion, dt: float) -> None:
        euler(*motion.arrays, dt, True, motion.like)

    def kernels(self, force_changes: bool) -> tuple[str, ...]:
        return ("euler",)


class VelocityVerlet(Integrator):
    """Second order, symplectic; for velocity-dependent forces the velocity at the end is predicted by v + a dt."""

    order, evaluations, path = 2, 2, PARABOLA

    def advance(self, motion: Motion, dt: float) -> None:
        verlet(motion, dt, 0.0)

    def kernels(self, force_changes: bool) -> tuple[str, ...]:
        return verlet_kernels(force_changes)


class RungeKutta4(Integrator):
    """The classical fourth-order method; for damped bodies its exponential form (Cox & Matthews 2002)."""

    order, evaluations = 4, 4

    def advance(self, motion: Motion, dt: float) -> None:
        if not motion.force_changes:  # one Verlet step is exact already
            verlet(motion, dt, 0.0)
            return
        first, middle = np.empty_like(motion.velocity), np.empty_like(motion.velocity)
        speeds, kicks = np.empty_like(motion.velocity), np.empty_like(motion.velocity)
        for stage in range(4):
            if stage:
                motion.evaluate(dt if stage == 3 else dt / 2)
            runge_kutta_stage(
                stage, *motion.arrays, motion.start_position, motion.start_velocity, first, middle, speeds, kicks, dt
            )

    def kernels(self, force_changes: bool) -> tuple[str, ...]:
        return ("runge_kutta_stage",) if force_changes else verlet_kernels(False)


class Yoshida4(Integrator):
    """Fourth order, symplectic: three Verlet steps of lengths w1, w0, w1 (Yoshida 1990).

    For forces that depend on velocity it is of second order (linear_damping is no such force and keeps the fourth).
    The middle step goes back in time by 1.7 dt, where damping enlarges rounding by e^(1.7 c dt): bodies with damping
    above HEAVY_DAMPING / dt take one Verlet step instead.
    """

    HEAVY_DAMPING: ClassVar[float] = 5.0  # rounding stays at 1e-12

    order, evaluations = 4, 4

    def advance(self, motion: Motion, dt: float) -> None:
        if not motion.force_changes:  # one step is exact already, and none of it goes back in time
            verlet(motion, dt, 0.0)
            return
        outer = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))
        inner = 1.0 - 2.0 * outer
        heavy = self.HEAVY_DAMPING / dt
        verlet(motion, outer * dt, 0.0, heavy, 0.0)
        verlet(motion, inner * dt, outer * dt, heavy, dt)
        verlet(motion, outer * dt, (outer + inner) * dt, heavy, 0.0)

    def kernels(self, force_changes: bool) -> tuple[str, ...]:
        return verlet_kernels(force_changes)


def verlet_kernels(force_changes: bool) -> tuple[str, ...]:
    """What :func:`verlet` calls."""
    return ("verlet_drift", "verlet_kick") if force_changes else ("verlet_drift",)


def verlet(motion: Motion, h: float, start: float, heavy: float = math.inf, heavy_h: float = 0.0) -> None:
    """One Verlet step of length h, ``start`` seconds into the step; the forces at its start are summed already.

    Bodies with damping above ``heavy`` take a step of ``heavy_h`` instead.
    """
    if not motion.force_changes:  # the acceleration at the end would be the same
        verlet_drift(*motion.arrays, np.empty((0, motion.velocity.shape[1])), h, heavy, heavy_h)
        return
    acceleration = np.empty_like(motion.velocity)
    verlet_drift(*motion.arrays, acceleration, h, heavy, heavy_h)
    motion.evaluate(start + h)
    verlet_kick(*motion.arrays, acceleration, h, heavy, heavy_h)


@inlined
def phi1(z):
    """(e^z - 1) / z."""
    return 1.0 if z == 0.0 else math.expm1(z) / z


@inlined
def phi2(z):
    """(phi1(z) - 1) / z; a series near zero, where the difference cancels."""
    if abs(z) > 0.5:
        return (phi1(z) - 1.0) / z
    total, term = 0.0, 1.0
    for n in range(2, 18):
        term /= n
        total += term
        term *= z
    return total


@inlined
def phi3(z):
    """(phi2(z) - 1/2) / z."""
    if abs(z) > 0.5:
        return (phi2(z) - 0.5) / z
    total, term = 0.0, 0.5
    for n in range(3, 19):
        term /= n
        total += term
        term *= z
    return total


@kernel
def drift(position, velocity, damping, h):
    """x' = x + h v, if no body is damped; returns whether. Over flat columns, see :mod:`flat_columns`."""
    damped = False
    for i in range(len(damping)):
        damped |= damping[i] != 0.0
    size = position.size
    x, v = position.reshape(size), velocity.reshape(size)
    for j in range(0 if damped else size):
        x[j] += h * v[j]
    return not damped


@kernel
def euler(position, velocity, force, inverse_mass, damping, h, new_velocity, like):
    """v' = v e^(-c h) + a (1 - e^(-c h)) / c; x' = x + h (v' or v); over flat columns, see :mod:`flat_columns`."""
    size, d = position.size, len(like)
    x, v, f = position.reshape(size), velocity.reshape(size), force.reshape(size)
    damped = False
    for i in range(len(damping)):
        damped |= damping[i] != 0.0
    for i in range(0 if damped else len(damping)):  # no exponentials and no branches in this loop
        for k in range(d):
            j = i * d + k
            old = v[j]
            v[j] = new = old + f[j] * inverse_mass[i] * h
            x[j] += h * (new if new_velocity else old)
    for i in range(len(damping) if damped else 0):
        c = damping[i]
        decay, gain = 1.0, h
        if c != 0.0:
            decay, gain = math.exp(-c * h), h * phi1(-c * h)
        for k in range(d):
            j = i * d + k
            old = v[j]
            v[j] = new = old * decay + f[j] * inverse_mass[i] * gain
            x[j] += h * (new if new_velocity else old)


@kernel
def verlet_drift(position, velocity, force, inverse_mass, damping, acceleration, light_h, heavy, heavy_h):
    """x' = x + v h phi1 + a h^2 phi2; v' = v e^(-c h) + a h phi1; keeps a unless there is no room for it."""
    keep = len(acceleration) > 0
    for i in range(len(position)):
        c = damping[i]
        h = light_h if c <= heavy else heavy_h
        decay, first, second = 1.0, 1.0, 0.5
        if c != 0.0:
            decay, first, second = math.exp(-c * h), phi1(-c * h), phi2(-c * h)
        for k in range(position.shape[1]):
            a = force[i, k] * inverse_mass[i]
            position[i, k] += h * (first * velocity[i, k] + h * second * a)
            velocity[i, k] = velocity[i, k] * decay + h * first * a
            if keep:
                acceleration[i, k] = a


@kernel
def verlet_kick(position, velocity, force, inverse_mass, damping, acceleration, light_h, heavy, heavy_h):
    """The second half: the mean of both accelerations instead of the first.

    With damping, z = -c h, the first weighs phi2(z) / phi1(-z) and the second the rest of phi1(z): those alone are
    exact for a constant force and make the step its own adjoint, which keeps it reversible and lets Yoshida's
    composition reach the fourth order (derived; phi2(z) + phi2(-z) = phi1(z) phi1(-z)).
    """
    for i in range(len(position)):
        h = light_h if damping[i] <= heavy else heavy_h
        z = -damping[i] * h
        gain = 0.5 * h
        if z != 0.0:
            gain = h * (phi1(z) - phi2(z) / phi1(-z))
        for k in range(position.shape[1]):
            velocity[i, k] += gain * (force[i, k] * inverse_mass[i] - acceleration[i, k])


@kernel
def runge_kutta_stage(
    stage, position, velocity, force, inverse_mass, damping, x0, v0, first, middle, speeds, kicks, h
):  # fmt: skip
    """Take the acceleration of one stage in and go to the state of the next; after stage 3 that is the result.

    first: a1; middle: the velocity of stage 2; speeds, kicks: weighted sums of velocities and accelerations.
    """
    for i in range(len(position)):
        z = -damping[i] * h
        f1 = f2 = f3 = 1.0 / 6.0
        decay = half_decay = half_gain = 1.0
        if z != 0.0:
            p1, p2, p3 = phi1(z), phi2(z), phi3(z)
            f1, f2, f3 = p1 - 3.0 * p2 + 4.0 * p3, p2 - 2.0 * p3, 4.0 * p3 - p2
            decay, half_decay, half_gain = math.exp(z), math.exp(0.5 * z), phi1(0.5 * z)
        for k in range(position.shape[1]):
            a, v = force[i, k] * inverse_mass[i], velocity[i, k]
            if stage == 0:
                first[i, k] = a
                speeds[i, k], kicks[i, k] = v, f1 * a
                position[i, k] = x0[i, k] + 0.5 * h * v
                velocity[i, k] = middle[i, k] = v0[i, k] * half_decay + 0.5 * h * half_gain * a
            elif stage == 1:
                speeds[i, k] += 2.0 * v
                kicks[i, k] += 2.0 * f2 * a
                position[i, k] = x0[i, k] + 0.5 * h * v
                velocity[i, k] = v0[i, k] * half_decay + 0.5 * h * half_gain * a
            elif stage == 2:
                speeds[i, k] += 2.0 * v
                kicks[i, k] += 2.0 * f2 * a
                position[i, k] = x0[i, k] + h * v
                velocity[i, k] = middle[i, k] * half_decay + 0.5 * h * half_gain * (2.0 * a - first[i, k])
            else:
                position[i, k] = x0[i, k] + h / 6.0 * (speeds[i, k] + v)
                velocity[i, k] = v0[i, k] * decay + h * (kicks[i, k] + f3 * a)


STANDARD_INTEGRATORS: dict[str, type[Integrator]] = {
    "explicit_euler": ExplicitEuler,
    "semi_implicit_euler": SemiImplicitEuler,
    "velocity_verlet": VelocityVerlet,
    "rk4": RungeKutta4,
    "yoshida4": Yoshida4,
}

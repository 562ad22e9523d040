"""Integrators: how a body moves in free flight through one step.

Each takes the motion (columns at the start of the step, with the forces of that state summed) and leaves the
prediction in the columns. It also says what path the bodies take within the step, because an impact is found and
dated on that path: explicit Euler moves on a line with the old velocity, semi-implicit Euler on a line with the new
one, velocity Verlet on a parabola, the others on a cubic through both ends.

What the built-in ones compute stands in :mod:`stages`. Where no force changes within the step they are one stage of the
program; ``advance`` is for worlds with force systems.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...framework.jit.records.record import Record
from ...framework.schedule.stages import Program
from .stages import CUBE_ROOT_OF_2
from .stages import CUBIC as CUBIC
from .stages import LINE as LINE
from .stages import PARABOLA as PARABOLA
from .turns import ROTATION_STAGES


@dataclass
class Motion:
    """Views of the dynamic rows; position and velocity hold the state that forces are evaluated at.

    position, velocity, force, start_position, start_velocity (n, d); inverse_mass, damping (n,).
    """

    position: np.ndarray
    velocity: np.ndarray
    force: np.ndarray
    inverse_mass: np.ndarray
    damping: np.ndarray
    start_position: np.ndarray
    start_velocity: np.ndarray
    evaluator: Callable[[float], None] | None  # None: no force depends on the state
    program: Program | None = None  # with the stages of the built-in integrators
    turn: Callable[[int, float], None] | None = None  # beside such a stage; None: torques hold throughout the step

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        return self.position, self.velocity, self.force, self.inverse_mass, self.damping

    @property
    def force_changes(self) -> bool:
        """Whether some force depends on position, velocity or time; else the forces of the start hold throughout."""
        return self.evaluator is not None

    def evaluate(self, seconds: float) -> None:
        """Sum the forces again at the state in the columns, ``seconds`` into the step."""
        if self.evaluator is not None:
            self.evaluator(seconds)

    @property
    def state(self) -> Record:
        """The record that the stages work on."""
        assert self.program is not None
        return self.program.state

    def run(self, stage: str, h: float) -> None:
        """Run a stage of a built-in integrator over ``h`` seconds, and turn bodies beside it."""
        assert self.program is not None
        if self.turn is not None and stage in ROTATION_STAGES:
            self.turn(ROTATION_STAGES[stage], h)
        self.program.run_one(stage, h)


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
    STAGES: ClassVar[tuple[str, ...]] = ()  # of a built-in one, for forces that hold throughout the step,
    CHANGING: ClassVar[tuple[str, ...]] = ()  # and for those that change, where these are others
    COLUMNS: ClassVar[tuple[str, ...]] = ()  # of bodies that it needs

    def advance(self, motion: Motion, dt: float) -> None:
        """Move ``motion.position`` and ``motion.velocity`` of the dynamic bodies by ``dt`` seconds."""
        raise NotImplementedError

    def kernels(self, force_changes: bool) -> tuple[str, ...]:
        """Names of the kernels that :meth:`advance` calls, for ``world.plan()``; force_changes: see Motion."""
        return (self.CHANGING if force_changes else ()) or self.STAGES


class _Euler(Integrator):
    """One stage does it all."""

    order, evaluations, path = 1, 1, LINE

    def advance(self, motion: Motion, dt: float) -> None:
        motion.run(self.STAGES[0], dt)


class ExplicitEuler(_Euler):
    """Position with the old velocity. Drifts upwards by g dt t / 2; unstable for springs."""

    moves_with_old_velocity = True
    STAGES = ("explicit_euler",)


class SemiImplicitEuler(_Euler):
    """Velocity first, position with the new one. Symplectic: energy stays within bounds below z = 2."""

    STAGES = ("semi_implicit_euler",)


class VelocityVerlet(Integrator):
    """Second order, symplectic (Swope et al. 1982); forces that depend on velocity see v + a dt at the end."""

    order, evaluations, path = 2, 2, PARABOLA
    STAGES, CHANGING = ("verlet_drift",), ("verlet_drift", "verlet_kick")
    COLUMNS = ("acceleration",)

    def advance(self, motion: Motion, dt: float) -> None:
        verlet(motion, dt, 0.0)


class RungeKutta4(Integrator):
    """The classical fourth-order method; for damped bodies its exponential form (Cox & Matthews 2002).

    Where forces hold throughout the step one Verlet step is exact already.
    """

    order, evaluations = 4, 4
    STAGES, CHANGING = ("verlet_drift",), ("runge_kutta_stage",)
    COLUMNS = ("acceleration", "rk_middle", "rk_speeds", "rk_kicks")

    def advance(self, motion: Motion, dt: float) -> None:
        for stage in range(4):
            if stage:
                motion.evaluate(dt if stage == 3 else dt / 2)
            motion.state.rk_stage = stage
            motion.run("runge_kutta_stage", dt)


class Yoshida4(Integrator):
    """Fourth order, symplectic: three Verlet steps of lengths w1, w0, w1 (Yoshida 1990).

    For forces that depend on velocity it is of second order (linear_damping is no such force and keeps the fourth).
    The middle step goes back in time by 1.7 dt, where damping enlarges rounding by e^(1.7 c dt): bodies with damping
    above HEAVY_DAMPING / dt take one Verlet step instead.
    """

    HEAVY_DAMPING: ClassVar[float] = 5.0  # rounding stays at 1e-12

    order, evaluations = 4, 4
    STAGES, CHANGING = ("verlet_drift",), ("verlet_drift", "verlet_kick")
    COLUMNS = ("acceleration",)

    def advance(self, motion: Motion, dt: float) -> None:
        outer = 1.0 / (2.0 - CUBE_ROOT_OF_2)
        inner = 1.0 - 2.0 * outer
        heavy = self.HEAVY_DAMPING / dt
        verlet(motion, outer * dt, 0.0, heavy, 0.0)
        verlet(motion, inner * dt, outer * dt, heavy, dt)
        verlet(motion, outer * dt, (outer + inner) * dt, heavy, 0.0)


class Flight(Integrator):
    """What ``Settings(collision="event_driven")`` uses in place of the integrator: a parabola between impacts, exact
    for what does not change within the step.

    All forces of the step's start bend the path: gravity, constant and applied forces exactly, those of force systems
    as they are there. Forces at the end correct the velocity, as velocity Verlet does. Damping acts as a kick of half a
    step before the flight and of another half after it (Strang splitting). Both are of second order, bounces on the
    way included: a flight whose velocity is right only in the middle of the step would make that the first.
    """

    order, evaluations, path = 2, 2, PARABOLA
    STAGES = ("first_half_kick", "second_half_kick")
    COLUMNS = ("acceleration", "flight_velocity")

    def advance(self, motion: Motion, dt: float) -> None:
        motion.run("first_half_kick", dt)
        motion.evaluate(dt)
        motion.run("second_half_kick", dt)

    def kernels(self, force_changes: bool) -> tuple[str, ...]:
        return self.STAGES if force_changes else self.STAGES[:1]


def verlet(motion: Motion, h: float, start: float, heavy: float = math.inf, heavy_h: float = 0.0) -> None:
    """One Verlet step of length h, ``start`` seconds into the step; the forces at its start are summed already.

    Bodies with damping above ``heavy`` take a step of ``heavy_h`` instead.
    """
    motion.state.heavy_damping, motion.state.heavy_step = heavy, heavy_h
    motion.run("verlet_drift", h)
    motion.evaluate(start + h)
    motion.run("verlet_kick", h)


STANDARD_INTEGRATORS: dict[str, type[Integrator]] = {
    "explicit_euler": ExplicitEuler,
    "semi_implicit_euler": SemiImplicitEuler,
    "velocity_verlet": VelocityVerlet,
    "rk4": RungeKutta4,
    "yoshida4": Yoshida4,
}

"""INTEGRATION: the free flight of every body, as if there were no contacts."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from ...framework.schedule.phases import Phase, System
from ...framework.schedule.plan import PlannedKernel
from .flight import Flight
from .integrators import CUBIC, LINE, PARABOLA, STANDARD_INTEGRATORS, Integrator, drift
from .motion import Motion, limit_distance, limit_speeds

if TYPE_CHECKING:
    from ..state import PhysicsState


STANDARD = frozenset((*STANDARD_INTEGRATORS.values(), Flight))


class Integration(System):
    """Writes the free-flight prediction into position and linear_velocity and keeps the start state.

    Reads force, inverse_mass, linear_damping; writes position, linear_velocity, previous_position and the path that
    the bodies take within the step.
    """

    phase = Phase.INTEGRATION
    writes = ("position", "linear_velocity", "previous_position")

    def __init__(self, state: PhysicsState) -> None:
        self._state = state
        self._viewed = -1  # what state.structures was when the views below were taken
        self._motion: Motion
        self._starts: tuple[np.ndarray, ...]  # previous_position, position, start_velocity, linear_velocity
        self._path: np.ndarray

    def process(self, dt: float) -> None:
        state, table = self._state, self._state.table
        dynamic, moving = table.stops[0], table.stops[1]
        arrays = table.arrays
        if self._viewed != state.structures:
            self._take_views(dynamic, moving)
        before, position, start_velocity, velocity = self._starts
        table.keep("previous_position")
        np.copyto(before, position)
        table.keep("position", before)
        if state.limits_speed:
            limit_speeds(state)  # systems may have pushed since the forces were summed
        np.copyto(start_velocity, velocity)
        # Impacts change the start velocity of a body.
        table.keep("linear_velocity", None if state.collides else start_velocity)
        integrator = state.integrator()
        state.path_degree = integrator.path
        if dynamic:
            motion = self._motion
            if self._drifts(integrator) and drift(motion.position, motion.velocity, motion.damping, dt):
                state.path_degree = LINE
            else:
                motion.evaluator = self._evaluator(motion.force) if self.world.force_systems else None
                try:
                    integrator.advance(motion, dt)
                except Exception as error:
                    error.add_note(f"integrator {state.integrator_name!r}")
                    raise
            if state.limits_speed:
                limit_speeds(state)
                limit_distance(motion.position, motion.start_position, arrays["max_linear_speed"][:dynamic], dt)
        if moving > dynamic:
            arrays["position"][dynamic:moving] += dt * arrays["linear_velocity"][dynamic:moving]
        self._keep_path(integrator, dt, dynamic, moving)
        if state.pushed or table.everything_kept:
            table.keep("step_force")
            arrays["step_force"][:dynamic] = 0.0
        table.forces_summed = False
        state.moved = True
        state.queries.forget()

    def _take_views(self, dynamic: int, moving: int) -> None:
        """The arrays are the same until the structure changes."""
        state, arrays, count = self._state, self._state.table.arrays, self._state.table.count
        names = ("position", "linear_velocity", "force", "inverse_mass", "linear_damping", "previous_position")
        start_velocity, self._path = state.scratch["start_velocity"], state.scratch["path_velocity"][:moving]
        self._motion = Motion(*(arrays[name][:dynamic] for name in names), start_velocity[:dynamic], None)
        self._starts = (
            arrays["previous_position"][:count], arrays["position"][:count],
            start_velocity[:moving], arrays["linear_velocity"][:moving],
        )  # fmt: skip
        self._viewed = state.structures

    def _drifts(self, integrator: Integrator) -> bool:
        """Whether nothing acts on any body; all the standard integrators do the same then, unless one is damped."""
        state = self._state
        return state.unforced and not state.table.everything_kept and type(integrator) in STANDARD

    def _evaluator(self, force: np.ndarray) -> Callable[[float], None]:
        """Sums the forces at a later moment of the step."""
        forces, start = self._state.forces, self.world.time
        # What systems of the game added after the forces were summed acts throughout the step.
        extra = None if forces.summed is None else force - forces.summed

        def evaluator(seconds: float) -> None:
            forces.evaluate(start + seconds)
            if extra is not None and extra.any():
                np.add(force, extra, out=force)

        return evaluator

    def _keep_path(self, integrator: object, dt: float, dynamic: int, moving: int) -> None:
        """x(t) = x0 + p1 t + p2 t^2 + p3 t^3 for the dynamic bodies, x0 + v t for the kinematic ones."""
        state = self._state
        if not state.collides:
            return
        start, end, v0, v1 = self._starts
        degree = state.path_degree
        if degree == LINE:
            np.copyto(self._path, v0 if getattr(integrator, "moves_with_old_velocity", False) else v1)
            return
        np.copyto(self._path, v0)
        state.allocate_curves(degree)
        second, third = state.scratch["path_second"], state.scratch["path_third"]
        travel = end[:dynamic] - start[:dynamic]
        if isinstance(integrator, Flight) and dynamic:
            self._path[:dynamic], second[:dynamic] = integrator.velocity, integrator.second
            third[:dynamic] = 0.0
            if state.limits_speed:  # whom that may have held back goes straight
                limit = state.table.arrays["max_linear_speed"][:dynamic]
                speed, bend = (np.linalg.norm(array, axis=1) for array in (integrator.velocity, integrator.second))
                held = speed + 2 * dt * bend > limit
                self._path[:dynamic][held], second[:dynamic][held] = travel[held] / dt, 0.0
        elif degree == PARABOLA:
            second[:dynamic] = (travel - dt * v0[:dynamic]) / (dt * dt)
            third[:dynamic] = 0.0
        elif degree == CUBIC:  # Hermite: both ends and both velocities
            second[:dynamic] = (3 * travel - dt * (2 * v0[:dynamic] + v1[:dynamic])) / (dt * dt)
            third[:dynamic] = (dt * (v0[:dynamic] + v1[:dynamic]) - 2 * travel) / dt**3
        second[dynamic:moving] = 0.0
        third[dynamic:moving] = 0.0

    def kernels(self) -> Iterator[PlannedKernel]:
        state, integrator = self._state, self._state.integrator()
        if not state.table.stops[0]:
            return
        if state.limits_speed:
            yield PlannedKernel("limit_distance", "some body has a max_linear_speed")
        why = "free flight of the bodies that forces move"
        if state.forces.nothing_acts() and not state.table.everything_kept and type(integrator) in STANDARD:
            yield PlannedKernel("drift", "no force acts: position + dt velocity, unless a body is damped")
            if not state.table.column("linear_damping")[: state.table.stops[0]].any():
                return
            why = "some body is damped"
        called = getattr(integrator, "kernels", None)  # a plugin's need not say
        for name in called(bool(self.world.force_systems)) if called is not None else ():
            yield PlannedKernel(name, why)
        if self.world.force_systems and integrator.evaluations > 1:
            for kernel in state.forces.kernels_of_a_stage():
                yield dataclasses.replace(kernel, reason=f"{kernel.reason}, at each stage")

    def reason(self) -> str:
        integrator, name = self._state.integrator(), self._state.integrator_name
        if isinstance(integrator, Flight):
            return (
                "exact flight between impacts, whatever Settings.integrator; order 2 in force systems and damping"
            )
        return f"{name}, order {integrator.order}, {integrator.evaluations} force evaluations a step"

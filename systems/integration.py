"""INTEGRATION: the free flight of every body, as if there were no contacts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..framework.schedule import Phase, System
from .integrators import CUBIC, LINE, PARABOLA
from .motion import Motion, limit_distance, limit_speeds

if TYPE_CHECKING:
    from .state import PhysicsState


class Integration(System):
    """Writes the free-flight prediction into position and linear_velocity and keeps the start state.

    Reads force, inverse_mass, linear_damping; writes position, linear_velocity, previous_position and the path that
    the bodies take within the step.
    """

    phase = Phase.INTEGRATION
    writes = ("position", "linear_velocity", "previous_position")

    def __init__(self, state: PhysicsState) -> None:
        self._state = state

    def process(self, dt: float) -> None:
        state, table = self._state, self._state.table
        dynamic, moving = table.stops[0], table.stops[1]
        arrays, scratch = table.arrays, state.scratch
        np.copyto(arrays["previous_position"][: table.count], arrays["position"][: table.count])
        if state.limits_speed:
            limit_speeds(state)  # systems may have pushed since the forces were summed
        np.copyto(scratch["start_velocity"][:moving], arrays["linear_velocity"][:moving])
        integrator = state.integrator()
        if dynamic:
            motion = self._motion(dynamic)
            integrator.advance(motion, dt)
            if state.limits_speed:
                limit_speeds(state)
                limit_distance(motion.position, motion.start_position, arrays["max_linear_speed"][:dynamic], dt)
        if moving > dynamic:
            arrays["position"][dynamic:moving] += dt * arrays["linear_velocity"][dynamic:moving]
        state.path_degree = integrator.path
        self._keep_path(integrator, dt, dynamic, moving)
        arrays["step_force"][:dynamic] = 0.0
        table.forces_summed = False
        state.moved = True
        state.queries.forget()

    def _motion(self, dynamic: int) -> Motion:
        state = self._state
        names = ("position", "linear_velocity", "force", "inverse_mass", "linear_damping", "previous_position")
        position, velocity, force, inverse_mass, damping, x0 = (state.table.arrays[n][:dynamic] for n in names)
        v0 = state.scratch["start_velocity"][:dynamic]
        evaluator = None
        if self.world.force_systems:
            forces, start = state.forces, self.world.time
            # What systems of the game added after the forces were summed acts throughout the step.
            extra = None if forces.summed is None else force - forces.summed

            def evaluator(seconds: float) -> None:
                forces.evaluate(start + seconds)
                if extra is not None and extra.any():
                    np.add(force, extra, out=force)

        return Motion(position, velocity, force, inverse_mass, damping, x0, v0, evaluator)

    def _keep_path(self, integrator: object, dt: float, dynamic: int, moving: int) -> None:
        """x(t) = x0 + p1 t + p2 t^2 + p3 t^3 for the dynamic bodies, x0 + v t for the kinematic ones."""
        state = self._state
        if not state.collides:
            return
        arrays, scratch = state.table.arrays, state.scratch
        start, end = arrays["previous_position"], arrays["position"]
        v0, v1 = scratch["start_velocity"], arrays["linear_velocity"]
        path = scratch["path_velocity"]
        degree = state.path_degree
        if degree == LINE:
            old = getattr(integrator, "moves_with_old_velocity", False)
            np.copyto(path[:moving], (v0 if old else v1)[:moving])
            return
        np.copyto(path[:moving], v0[:moving])
        state.allocate_curves(degree)
        second, third = scratch["path_second"], scratch["path_third"]
        travel = end[:dynamic] - start[:dynamic]
        if degree == PARABOLA:
            second[:dynamic] = (travel - dt * v0[:dynamic]) / (dt * dt)
            third[:dynamic] = 0.0
        elif degree == CUBIC:  # Hermite: both ends and both velocities
            second[:dynamic] = (3 * travel - dt * (2 * v0[:dynamic] + v1[:dynamic])) / (dt * dt)
            third[:dynamic] = (dt * (v0[:dynamic] + v1[:dynamic]) - 2 * travel) / dt**3
        second[dynamic:moving] = 0.0
        third[dynamic:moving] = 0.0

    def reason(self) -> str:
        name = self.world.settings.integrator
        integrator = self._state.integrator()
        return f"{name}, order {integrator.order}, {integrator.evaluations} force evaluations a step"

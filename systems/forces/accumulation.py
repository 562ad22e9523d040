"""FORCES: everything that acts on a body, summed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ...framework.compilation import kernel
from ...framework.data.bodies import SelectedBodies
from ...framework.schedule.phases import ForceSystem, Phase, System
from ...framework.schedule.plan import PlannedKernel
from ..integration.motion import limit_speeds

if TYPE_CHECKING:
    from ..state import PhysicsState


@kernel
def sum_constant_forces(dynamic, force, mass, gravity, gravity_scale, constant, applied, for_step):
    """force = m g s + the constant force + what was applied, of the first rows; returns whether anything was applied.

    Over flat columns, see :mod:`integration.flat_columns`.
    """
    d, size = len(gravity), force.size
    force, constant = force.reshape(size), constant.reshape(size)
    applied, for_step = applied.reshape(size), for_step.reshape(size)
    for i in range(dynamic):
        weight = mass[i] * gravity_scale[i]
        for k in range(d):
            j = i * d + k
            force[j] = weight * gravity[k] + constant[j]
    pushed = False
    for j in range(dynamic * d):
        pushed |= (applied[j] != 0.0) | (for_step[j] != 0.0)
    for j in range(dynamic * d if pushed else 0):
        force[j] = force[j] + applied[j] + for_step[j]
    return pushed


@kernel
def any_force(dynamic, force, constant, applied, for_step):
    """Whether any of the first rows is given a force; and whether ``force`` still holds one. Over flat columns."""
    d, size = force.shape[1], force.size
    force, constant = force.reshape(size), constant.reshape(size)
    applied, for_step = applied.reshape(size), for_step.reshape(size)
    given, held = False, False
    for j in range(dynamic * d):
        given |= (constant[j] != 0.0) | (applied[j] != 0.0) | (for_step[j] != 0.0)
        held |= force[j] != 0.0
    return given, held


class ForceAccumulation(System):
    """Sums gravity, constant forces, applied forces and every force system into ``bodies.force``.

    Reads position, linear_velocity, mass, gravity_scale, the force columns and what force systems require; writes
    force. Integrators of several stages sum again at the state of each stage.
    """

    phase = Phase.FORCES
    writes = ("force",)

    def __init__(self, state: PhysicsState) -> None:
        self._state = state
        self.evaluations = 0
        self.summed: np.ndarray | None = None  # a copy, while integrators with more stages need to compare

    def process(self, dt: float) -> None:
        if self._state.limits_speed:
            limit_speeds(self._state)  # before a drag force sees them
        self.evaluate(self.world.time)
        self.summed = None
        if self.world.force_systems and self._state.integrator().evaluations > 1:
            self.summed = self._state.bodies.dynamic.force.copy()
        self._state.table.forces_summed = True

    def evaluate(self, time: float) -> None:
        """Sum all forces at the state in the columns; ``time`` in seconds."""
        state = self._state
        arrays, dynamic = state.table.arrays, state.table.stops[0]
        if not dynamic:
            return
        if not self.world.force_systems and not any(state.gravity_numbers) and self._find_nothing(dynamic):
            return
        self.evaluations += 1
        state.pushed = sum_constant_forces(
            dynamic, arrays["force"], arrays["mass"], state.gravity_numbers, arrays["gravity_scale"],
            arrays["constant_force"], arrays["applied_force"], arrays["step_force"],
        )  # fmt: skip
        for system in self.world.force_systems:
            self._add(system, state.bodies.dynamic, time)

    def _find_nothing(self, dynamic: int) -> bool:
        """Look for forces of single bodies; whether there is nothing to sum. The column is zero then."""
        state, arrays = self._state, self._state.table.arrays
        given, held = any_force(
            dynamic, arrays["force"], arrays["constant_force"], arrays["applied_force"], arrays["step_force"]
        )
        if given:
            return False
        if held:
            arrays["force"][:dynamic] = 0.0
        state.unforced, state.pushed = True, False
        return True

    def nothing_acts(self) -> bool:
        """Whether there is no gravity, no force system and, at the moment, no force given to a dynamic body."""
        arrays, dynamic = self._state.table.arrays, self._state.table.stops[0]
        if self.world.force_systems or any(self._state.gravity_numbers):
            return False
        return not any(arrays[key][:dynamic].any() for key in ("constant_force", "applied_force", "step_force"))

    def kernels(self) -> Iterator[PlannedKernel]:
        state = self._state
        if not state.table.stops[0]:
            return
        if state.limits_speed:
            yield PlannedKernel("limit_distance", "some body has a max_linear_speed")
        if not self.world.force_systems and not any(state.gravity_numbers):
            yield PlannedKernel("any_force", "no gravity: looks whether a force is given to any body")
        if not self.nothing_acts():
            yield from self.kernels_of_a_stage()

    def kernels_of_a_stage(self) -> Iterator[PlannedKernel]:
        """Those of :meth:`evaluate`, where something acts; force systems name theirs if they have ``kernels``."""
        yield PlannedKernel("sum_constant_forces", "m g, constant_force and what was applied")
        for system in self.world.force_systems:
            yield from getattr(system, "kernels", tuple)()

    def _add(self, system: ForceSystem, dynamic: Any, time: float) -> None:
        """A force system sees the bodies it requires: columns in place where that is all of them, else copies."""
        bodies = required_bodies(self._state, system)
        if bodies is None:
            return
        try:
            system.add_forces(bodies, time)
        except Exception as error:
            error.add_note(f"in force system {system.name}")
            raise
        if isinstance(bodies, SelectedBodies):
            bodies.scatter_force()

    def reason(self) -> str:
        names = ", ".join(system.name for system in self.world.force_systems)
        gravity = "gravity and " if self._state.gravity.any() else ""
        if self.nothing_acts():
            return "nothing acts: no gravity, no force"
        return f"{gravity}constant and applied forces" + (f"; force systems {names}" if names else "")


def required_bodies(state: PhysicsState, system: ForceSystem) -> Any:
    """The dynamic bodies that have what the force system requires; None if there are none."""
    dynamic = state.bodies.dynamic
    mask = np.ones(len(dynamic), bool)
    for component in system.requires:
        mask &= dynamic.has(component)
    if mask.all():
        return dynamic if len(dynamic) else None
    rows = np.flatnonzero(mask)
    return SelectedBodies(state.table, rows) if len(rows) else None

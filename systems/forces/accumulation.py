"""FORCES: everything that acts on a body, summed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ...components.spin import Spin
from ...framework.data.bodies import Bodies, SelectedBodies
from ...framework.data.table import Table
from ...framework.errors import CaromError
from ...framework.jit.records.record import Record
from ...framework.schedule.phases import ForceSystem, Phase
from ...framework.schedule.plan import PlannedKernel
from ...framework.schedule.stages import Program, PythonPart, Rows, Stage, asked
from ..parts.stages import begin_parts, carry_forces
from ..sleeping.stages import AWAKE
from ..stage_system import StagedSystem
from .stages import limit_velocities, sum_forces

DEPENDS = {"position", "linear_velocity", "rotation"}  # a force of a stage that reads these changes within the step
LARGEST_TORQUE = 1e150  # N m: squares of it are finite


class ForceAccumulation(StagedSystem):
    """Sums gravity, constant forces, applied forces and every force system into ``bodies.force``.

    Reads position, linear_velocity, mass, gravity_scale, the force columns and what force systems require; writes
    force. Integrators of several stages sum again at the state of each stage.
    """

    phase = Phase.FORCES
    writes = ("force",)
    STAGES = (
        Stage(
            limit_velocities, "shortens velocities above max_linear_speed, before a drag force reads them",
            ("linear_velocity", "max_linear_speed"), ("linear_velocity",), "dynamic bodies", "some body has a limit",
        ),
        Stage(
            sum_forces, "m g, constant_force and what was applied; nothing where nothing acts",
            ("mass", "gravity_scale", "constant_force", "applied_force", "step_force"), ("force",), "dynamic bodies",
            room=(Rows("bodies", ("force",), asked),),
        ),
    )  # fmt: skip

    def __init__(
        self, program: Program, state: Record, table: Table, bodies: Bodies, tell: Callable[[int, str, Any], None]
    ) -> None:
        super().__init__(program)
        self._state, self._table, self._bodies, self._tell = state, table, bodies, tell
        self.several_evaluations = False  # the integrator sums forces again within the step
        self.summed: np.ndarray | None = None  # a copy, while integrators with more stages need to compare

    @property
    def change(self) -> bool:
        """Whether some force depends on position, velocity or time: integrators of several evaluations sum again."""
        stages = (stage for stage in self._program.stages if stage.plugin and "force" in stage.writes)
        return bool(self.world.force_systems) or any(not DEPENDS.isdisjoint(stage.reads) for stage in stages)

    def _parts(self) -> list[Any]:
        if not self.world.force_systems and not (self.several_evaluations and self.change):
            return [self.segment()]
        return [self.segment(), PythonPart(self.name, self._add_of_first_evaluation)]

    def _add_of_first_evaluation(self, dt: float) -> None:
        self.add_systems(self.world.time)
        state = self._state
        self.summed = state.bodies.force[: state.dynamic].copy() if self.several_evaluations else None
        if state.asleep > 0 and self.kind()[1]:
            self._disturb_turned()

    def _disturb_turned(self) -> None:
        """Sleepers that a torque acts on count as pushed by another force than before; see ``look_at_sleepers``."""
        bodies, rows = self._state.bodies, slice(self._state.dynamic)
        torque = self._table.column("torque")[rows]
        turned = torque.any(axis=1) if torque.ndim > 1 else torque != 0.0
        bodies.rest_force[rows][turned & (bodies.sleep_state[rows] > AWAKE)] = np.nan

    def evaluate(self, time: float) -> None:
        """Sum all forces at the state in the columns; ``time`` in seconds."""
        if self._state.has_parts:
            self._program.run_one(begin_parts.__name__, self.world.settings.dt)
        self._program.run_span(sum_forces.__name__, self.world.settings.dt)
        self.add_systems(time)
        if self._state.has_parts:
            self._program.run_one(carry_forces.__name__, self.world.settings.dt)

    def kind(self) -> tuple[int, bool]:
        """How many force systems there are, and whether some give torques: bodies turn at each evaluation then."""
        systems = self.world.force_systems
        return len(systems), bool(systems) and any(Spin in system.requires for system in systems)

    def add_systems(self, time: float) -> None:
        """Let each force system add to ``force`` at that ``time``, s: in place where all bodies have what it requires,
        else to copies. CaromError if one adds to torques and does not require Spin."""
        torque = self._table.arrays.get("torque")
        if torque is not None:
            torque[...] = 0.0
        self._table.adding_forces = True
        try:
            for system in self.world.force_systems:
                self._add(system, time)
        finally:
            self._table.adding_forces = False

        torque = self._table.arrays.get("torque")
        if torque is None or not torque.any():
            return
        if not self.kind()[1]:
            names = ", ".join(system.name for system in self.world.force_systems)
            raise CaromError(f"force systems {names}: what adds to bodies.torque needs requires = (Spin,)")
        if self._table.in_step and not np.abs(torque).max() <= LARGEST_TORQUE:
            self._refuse(torque)

    def _add(self, system: ForceSystem, time: float) -> None:
        bodies = required_bodies(self._table, self._bodies, system)
        if bodies is None:
            return
        try:
            system.add_forces(bodies, time)
        except Exception as error:
            error.add_note(f"in force system {system.name}")
            raise
        if isinstance(bodies, SelectedBodies):
            bodies.scatter()

    def _refuse(self, torque: np.ndarray) -> None:
        """Bodies with a torque that cannot be are named, and their forces become nan: the flight takes these out."""
        rows = np.flatnonzero(~(np.abs(torque) <= LARGEST_TORQUE).reshape(len(torque), -1).all(axis=1))
        for row in rows.tolist():
            self._tell(row, "torque", torque[row].tolist())
        torque[rows], self._table.make("force")[rows] = 0.0, np.nan

    def nothing_acts(self) -> bool:
        """Whether there is no gravity, no force system and, at the moment, no force given to a dynamic body."""
        table, dynamic = self._table, self._table.stops[0]
        if self.world.force_systems or self._state.gravity.any():
            return False
        return not any(table.column(key)[:dynamic].any() for key in ("constant_force", "applied_force", "step_force"))

    def kernels(self) -> Iterator[PlannedKernel]:
        yield from super().kernels()
        if self._state.dynamic:
            yield from self.kernels_of_systems()

    def kernels_of_systems(self) -> Iterator[PlannedKernel]:
        """Those of the force systems, which name theirs if they have ``kernels``."""
        for system in self.world.force_systems:
            yield from getattr(system, "kernels", tuple)()

    def reason(self) -> str:
        names = ", ".join(system.name for system in self.world.force_systems)
        gravity = "gravity and " if self._state.gravity.any() else ""
        if self.nothing_acts():
            return "nothing acts: no gravity, no force"
        return f"{gravity}constant and applied forces" + (f"; force systems {names}" if names else "")


def required_bodies(table: Table, bodies: Bodies, system: ForceSystem) -> Any:
    """The dynamic bodies that have what the force system requires; None if there are none."""
    dynamic = bodies.dynamic
    mask = np.ones(len(dynamic), bool)
    for component in system.requires:
        mask &= dynamic.has(component)
    if mask.all():
        return dynamic if len(dynamic) else None
    rows = np.flatnonzero(mask)
    return SelectedBodies(table, rows) if len(rows) else None

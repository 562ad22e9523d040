"""INTEGRATION: the free flight of every body, as if there were no contacts."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ...framework.jit.records.record import Record
from ...framework.schedule.phases import Phase
from ...framework.schedule.plan import PlannedKernel, kernels_of
from ...framework.schedule.stages import Program, PythonPart, Rows, Stage
from ...framework.world.world import World
from ..forces.accumulation import ForceAccumulation
from ..forces.stages import sum_forces
from ..joints.bodies import begin_joints
from ..parts.stages import carry_forces, move_parts
from ..records import COLLISIONS, SPINS, all_rows
from ..scene import Scene
from ..sleeping.stages import look_at_sleepers, rest_sleepers
from ..stage_system import StagedSystem
from .integrators import STANDARD_INTEGRATORS, Flight, Integrator, Motion
from .stages import (
    ROOM_FOR_PATHS,
    ROOM_FOR_PUSHES,
    check_flight,
    drift,
    end_flight,
    explicit_euler,
    first_half_kick,
    keep_start,
    note_path,
    runge_kutta_stage,
    second_half_kick,
    semi_implicit_euler,
    verlet_drift,
    verlet_kick,
)
from .turns import ROTATION_COLUMNS, TURNS

STANDARD = frozenset((*STANDARD_INTEGRATORS.values(), Flight))
ON_WAY = "runge_kutta_stage"  # stages of plugins next to it turn bodies beside all that an integrator calls
TURNS_BESIDE = "turns bodies beside each stage of the integrator: forces give torques"
FLIES = "free flight of the bodies that forces move, unless nothing acts and none is damped"
MOTION = ("position", "linear_velocity")
FORCED = (*MOTION, "force", "inverse_mass", "total_damping")


class Integration(StagedSystem):
    """Writes the free-flight prediction into position and linear_velocity and keeps the start state.

    Reads force, inverse_mass, total_damping; writes position, linear_velocity, previous_position and the path that
    the bodies take within the step.
    """

    phase = Phase.INTEGRATION
    writes = ("position", "linear_velocity", "previous_position")
    STAGES = (
        Stage(carry_forces, "forces on parts act on their bodies", ("force",), ("force",), "parts"),
        Stage(
            look_at_sleepers, "what code of the game has done to sleepers in this step", ("force", "rest_force"),
            ("sleep_state",), "sleeping", "bodies sleep",
        ),
        Stage(
            keep_start, "keeps where the step starts, and the step before", (*MOTION, "previous_position", "rotation"),
            ("kept_previous", "previous_position", "start_velocity", "linear_velocity", "previous_rotation"),
        ),
        Stage(
            drift, "no force acts: position + dt velocity, unless a body is damped", MOTION, ("position",), "standard",
            "nothing acts",
        ),
        Stage(explicit_euler, FLIES, FORCED, MOTION, "explicit_euler"),
        Stage(semi_implicit_euler, FLIES, FORCED, MOTION, "semi_implicit_euler"),
        Stage(verlet_drift, FLIES, FORCED, MOTION, "verlet_drift"),
        Stage(first_half_kick, FLIES, FORCED, (*MOTION, "acceleration"), "first_half_kick"),
        Stage(second_half_kick, "damping of the second half step", FORCED, ("linear_velocity",), "second_half_kick"),
        Stage(
            end_flight, "limits of speed, kinematic bodies, forces for one step", MOTION,
            (*MOTION, "step_force"), room=ROOM_FOR_PUSHES,
        ),
        Stage(
            check_flight, "puts back and takes out bodies whose place or speed cannot be", MOTION,
            (*MOTION, "quarantined"),
        ),
        Stage(
            begin_joints, "which joints hold a body that may move; how far motors may turn these",
            ("inverse_mass", "sleep_state", "spin"), ("solver", "driven", "driven_turn"), "joints",
            room=(Rows("bodies", SPINS, all_rows), Rows("bodies", COLLISIONS, all_rows)),
        ),
        Stage(
            note_path, "the path within the step, on which impacts are found", MOTION, ("path_velocity",), "colliders",
            room=ROOM_FOR_PATHS,
        ),
        Stage(
            move_parts, "parts fly and turn with their bodies", (*MOTION, "rotation"),
            (*MOTION, "rotation", "axes", "path_velocity"), "parts",
            room=(Rows("bodies", COLLISIONS, all_rows), *ROOM_FOR_PATHS),
        ),
        Stage(
            rest_sleepers, "puts sleepers back that have flown with the others, as some were disturbed", MOTION,
            (*MOTION, "path_velocity", "sleep_state"), "sleeping", "bodies sleep",
        ),
    )  # fmt: skip
    ON_DEMAND = (
        Stage(verlet_kick, "the velocity with the forces at the end", FORCED, ("linear_velocity",), "on demand"),
        Stage(runge_kutta_stage, "one stage of the classical method", FORCED, MOTION, "on demand"),
    )

    def __init__(
        self, program: Program, scene: Scene, forces: ForceAccumulation, world: World
    ) -> None:
        super().__init__(program)
        self._state: Record = program.state
        self._scene, self._forces, self._world, self._registry = scene, forces, world, world.registry
        self._made: dict[Any, Integrator] = {}
        self._motion: Motion
        self.turns: Record  # what turns bodies beside stages of the integrator
        self._viewed: Any = None  # the scene's version and the first row when the views in the motion were taken

    # -- which integrator -------------------------------------------------------------------------

    @property
    def integrator_name(self) -> str:
        """As the settings say, unless another one goes with the kind of collision."""
        settings = self._world.settings
        return "flight" if settings.collision == "event_driven" else settings.integrator

    @property
    def integrator(self) -> Integrator:
        """The one of :attr:`integrator_name`."""
        make: Any = Flight
        if self._world.settings.collision != "event_driven":  # another one may be registered under the name at any time
            make = self._registry.integrators[self._world.settings.integrator]
        if make not in self._made:
            self._made[make] = make()
        return self._made[make]

    @property
    def stages_needed(self) -> tuple[str, ...]:
        """Names of the stages of the integrator that the program runs."""
        integrator = self.integrator
        if type(integrator) not in STANDARD:
            return ()
        return ("standard",) if self.in_python else ("standard", *integrator.STAGES)

    @property
    def stages_possible(self) -> tuple[str, ...]:
        """The same, and those that it calls from Python where forces change within the step."""
        integrator = self.integrator
        if type(integrator) not in STANDARD:
            return ()
        return tuple(dict.fromkeys(("standard", *integrator.STAGES, *integrator.kernels(True))))

    @property
    def in_python(self) -> bool:
        """Whether the integrator is called from Python: it is a plugin's, or forces change within the step."""
        integrator = self.integrator
        again = integrator.evaluations > 1 and self._forces.change
        return type(integrator) not in STANDARD or bool(self.world.force_systems) or again

    def prepare(self) -> None:
        """Before a step of other settings, systems or bodies: room and numbers for the integrator."""
        state, integrator = self._state, self.integrator
        state.moves_with_old_velocity = bool(getattr(integrator, "moves_with_old_velocity", False))
        state.flies = isinstance(integrator, Flight)
        state.pushed |= state.has_force_systems  # one may be gone: sleepers look at their forces
        state.force_changes = self._forces.change
        by_stages = any("force" in stage.writes for stage in self._program.stages if stage.plugin)
        state.has_force_systems = bool(self.world.force_systems) or by_stages
        state.heavy_damping, state.heavy_step = math.inf, 0.0
        state.path_degree = state.usual_path_degree = integrator.path
        self._forces.several_evaluations = integrator.evaluations > 1
        if type(integrator) in STANDARD and (state.flies or state.force_changes):
            self._scene.reserve(*integrator.COLUMNS)
        self.turns.within, self.turns.torque = False, np.empty(0)
        if self._stages_turn():
            self.turns.reserve(self._scene.table.capacity, "lifting")

    # -- a step -----------------------------------------------------------------------------------

    def _parts(self) -> list[Any]:
        if not self.in_python:
            return [self.segment()]
        return [
            self.segment(last="drift"),
            PythonPart(self.name, self._advance),
            self.segment("end_flight"),
        ]

    def _advance(self, dt: float) -> None:
        state, integrator = self._state, self.integrator
        if not state.dynamic or (state.drifted and type(integrator) in STANDARD):
            return
        if self._viewed != (self._scene.version, state.first):
            self._take_views()
        motion = self._motion
        motion.evaluator = self._evaluator(motion.force) if self._forces.change else None
        torque = self._take_torques(motion)
        at_start = None if torque is None or self.turns.within else torque.copy()
        try:
            integrator.advance(motion, dt)
        except Exception as error:
            error.add_note(f"integrator {self.integrator_name!r}")
            raise
        if at_start is not None:  # bodies turn after the flight, once
            torque[...] = at_start

    def _take_views(self) -> None:
        """The arrays are the same until the structure changes."""
        bodies, first, dynamic, table = self._state.bodies, self._state.first, self._state.dynamic, self._scene.table
        table.make("force")
        table.make("linear_damping")
        table.lend("linear_damping", False)
        names = ("position", "linear_velocity", "force", "inverse_mass", "total_damping")
        names += ("previous_position", "start_velocity")
        self._motion = Motion(*(getattr(bodies, name)[first:dynamic] for name in names), None, self._program)
        self._viewed = self._scene.version, first

    def _stages_turn(self) -> bool:
        """Whether stages of plugins give torques with their forces."""
        stages = self._registry.stages.values()
        return any(stage.anchor == sum_forces.__name__ and TURNS in stage.schemas for stage in stages)

    def _turning(self) -> list[str]:
        """Names of the stages that turn bodies beside those of the integrator: of a built-in one that evaluates torques
        several times, if force systems or stages of plugins give any."""
        integrator = self.integrator
        if type(integrator) not in STANDARD or integrator.evaluations == 1:
            return []
        if not (self._forces.kind()[1] or self._stages_turn()):
            return []
        return [stage.name for stage in self._program.stages if stage.plugin and stage.anchor == ON_WAY]

    def _take_torques(self, motion: Motion) -> np.ndarray | None:
        """The column of those of force systems, if any gives some."""
        motion.turn, table, turns, turning, torque = None, self._scene.table, self.turns, self._turning(), None
        if self._forces.kind()[1]:
            torque = table.make("torque")
            turns.torque = torque.reshape(-1)
        turns.within = bool(turning)
        if turning:
            turns.reserve(table.capacity, *ROTATION_COLUMNS)
            turns.begins = True
            motion.turn = functools.partial(self._turn, turning)
        return torque

    def _turn(self, turning: list[str], part: int, h: float) -> None:
        self.turns.part = part
        for name in turning:
            self._program.run_one(name, h)
        self.turns.begins = False

    def _evaluator(self, force: np.ndarray) -> Callable[[float], None]:
        """Sums the forces at a later moment of the step."""
        forces, start = self._forces, self.world.time
        # What systems of the game added after the forces were summed acts throughout the step.
        extra, summed = None, forces.summed
        if summed is not None:
            summed = summed[self._state.first :]
            extra = np.subtract(force, summed, out=np.zeros_like(force), where=force != summed)  # inf - inf is nan

        def evaluator(seconds: float) -> None:
            forces.evaluate(start + seconds)
            if extra is not None and extra.any():
                np.add(force, extra, out=force)

        return evaluator

    # -- for world.plan() -------------------------------------------------------------------------

    def kernels(self) -> Iterator[PlannedKernel]:
        if not self.in_python or not self._state.dynamic:
            yield from super().kernels()
            return
        yield from kernels_of(self.segment(last="drift"))
        called: Any = getattr(self.integrator, "kernels", None)  # a plugin's need not say
        for name in called(self._forces.change) if called is not None else ():
            yield PlannedKernel(name, FLIES)
        for name in self._turning():
            yield PlannedKernel(name, TURNS_BESIDE)
        if self.world.force_systems and self.integrator.evaluations > 1:
            for kernel in self._forces.kernels_of_systems():
                yield dataclasses.replace(kernel, reason=f"{kernel.reason}, at each stage")
        yield from kernels_of(self.segment("end_flight"))

    def reason(self) -> str:
        integrator, name = self.integrator, self.integrator_name
        if isinstance(integrator, Flight):
            return "exact flight between impacts, whatever Settings.integrator; order 2 in force systems and damping"
        return f"{name}, order {integrator.order}, {integrator.evaluations} force evaluations a step"

"""The machinery of a step: who runs when, how it opens and closes, and what happens if something raises inside."""

from __future__ import annotations

import hashlib
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import esper
import numpy as np

from . import esper_bridge
from .clock import Clock
from .errors import CaromError, NoPhysicsError, ScheduleError, StepError
from .schedule import FIRST_PRIORITY, LAST_PRIORITY, ForceSystem, Phase, System, in_order
from .statistics import Stats

if TYPE_CHECKING:
    from .world import World


@dataclass
class StepState:
    """A copy of what a step may change: columns, clock, contacts."""

    entities: np.ndarray
    columns: dict[str, np.ndarray]
    clock: tuple[float, ...]
    contacts: Any
    extra: Any = None


class _Opening(esper.Processor):
    """First of all processors."""

    def __init__(self, pipeline: Pipeline) -> None:
        self._pipeline = pipeline

    def process(self, *args: Any) -> None:
        self._pipeline.open_step(*args)


class _Closing(esper.Processor):
    """Last of all processors."""

    def __init__(self, pipeline: Pipeline) -> None:
        self._pipeline = pipeline

    def process(self, *args: Any) -> None:
        self._pipeline.close_step()


class Pipeline:
    """Owns a world's systems and clock; esper calls it back at the start and the end of every process()."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.clock = Clock(world.settings.dt)
        self.in_step = False
        self.faults: list[str] = []
        self._systems: list[System] = []
        self._frame_systems: list[Any] = []
        self._deferred: list[Any] = []
        self._in_window = False
        self._unfinished: StepState | None = None
        self._seconds: dict[str, float] = {}
        self._steps_measured = 0
        self._synchronizing = False

    def attach(self) -> None:
        esper.add_processor(_Opening(self), FIRST_PRIORITY)
        esper.add_processor(_Closing(self), LAST_PRIORITY)

    def detach(self) -> None:
        for processor in esper_bridge.processors():
            if isinstance(processor, (_Opening, _Closing, System)):
                esper_bridge.remove_processor_instance(processor)
                vars(processor).pop("process", None)

    # -- systems --------------------------------------------------------------------------------------------------------

    def ordered(self) -> list[System]:
        return list(self._systems)

    def must_be_between_steps(self, what: str) -> None:
        if self.in_step:
            raise CaromError(f"{what} can be changed between steps only, not inside one")

    def _later(self, action: Any) -> bool:
        """Put off what would disturb a running step; True if it has been."""
        if self.in_step:
            self._deferred.append(action)
        return self.in_step

    def add(self, system: Any, before: Any, after: Any, frame: bool) -> None:
        if isinstance(system, type):
            raise TypeError(f"add_system takes an instance: add_system({system.__name__}())")
        if frame:
            self._frame_systems.append(system)
            system.world = self.world
            return
        if isinstance(system, ForceSystem):
            if any(system is other for other in self.world.force_systems):
                raise ValueError(f"{system.name} is in this world already")
            if self.world.physics is None:
                raise NoPhysicsError("no physics in this world: World(Physics(...))")
            if not self._later(lambda: self._add_force_system(system)):
                self._add_force_system(system)
            return
        if not isinstance(system, System):
            if not isinstance(system, esper.Processor):
                raise TypeError(f"add_system takes a System, a ForceSystem or an esper.Processor, got {system!r}")
            self.add_plain(system, 0)
            return
        if any(system is other for other in self._systems):
            raise ValueError(f"{system.name} is in this world already")
        self._place(system, before, after)
        candidate = [*self._systems, system]
        in_order(candidate)  # a cycle shows here, at the call
        if not self._later(lambda: self._insert(system)):
            self._insert(system)

    def _place(self, system: System, before: Any, after: Any) -> None:
        """Note the order asked for; a system that names no phase of its own goes into its neighbour's."""
        for attribute, given in (("before", before), ("after", after)):
            given = tuple(given) if isinstance(given, (list, tuple)) else (given,)
            if given:
                setattr(system, attribute, (*_as_tuple(getattr(system, attribute)), *given))
        for attribute in ("before", "after"):
            for reference in _as_tuple(getattr(system, attribute)):
                neighbours = [s for s in self._systems if _means(reference, s)]
                if not neighbours:
                    name = reference.__name__ if isinstance(reference, type) else reference
                    raise ScheduleError(f"{system.name} asks to run {attribute} {name}, which is not in this world")
                phase = neighbours[0].phase
                if phase == system.phase:
                    continue
                if "phase" not in vars(type(system)):
                    system.phase = phase  # type: ignore[misc]
                elif (attribute == "before") != (system.phase < phase):
                    raise ScheduleError(
                        f"{system.name} runs in phase {system.phase.name} and cannot run {attribute} "
                        f"{neighbours[0].name} of phase {phase.name}"
                    )

    def _add_force_system(self, system: ForceSystem) -> None:
        system.world = self.world
        self.world.force_systems.append(system)

    def _insert(self, system: System) -> None:
        system.world = self.world
        system.process = self._measured(system)  # type: ignore[method-assign]
        self._systems = in_order([*self._systems, system])
        self._assign_priorities()

    def _assign_priorities(self) -> None:
        """Each phase has a band of esper priorities; its systems take places from the top."""
        with esper_bridge.context(self.world.name):
            present = esper_bridge.processors()
            for system in self._systems:
                if any(system is p for p in present):
                    esper_bridge.remove_processor_instance(system)
            place = dict.fromkeys(Phase, 0)
            for system in self._systems:
                esper.add_processor(system, system.phase.priority - place[system.phase])
                place[system.phase] += 1

    def remove(self, system: Any) -> None:
        for owned in (self.world.force_systems, self._frame_systems):
            if any(system is other for other in owned):
                action = lambda owned=owned: owned.remove(system)  # noqa: E731
                if not self._later(action):
                    action()
                return
        if isinstance(system, System) and any(system is other for other in self._systems):
            if not self._later(lambda: self._take_out(system)):
                self._take_out(system)
            return
        self.remove_processor(system)

    def _take_out(self, system: System) -> None:
        with esper_bridge.context(self.world.name):
            esper_bridge.remove_processor_instance(system)
        self._systems = [other for other in self._systems if other is not system]
        vars(system).pop("process", None)

    def add_plain(self, processor: Any, priority: int) -> None:
        def action() -> None:
            with esper_bridge.context(self.world.name):
                esper.add_processor(processor, priority)

        if not self._later(action):
            action()

    def remove_processor(self, processor: Any) -> None:
        """By instance, or the last one added of a type; KeyError if there is none."""
        with esper_bridge.context(self.world.name):
            hits = [p for p in esper_bridge.processors() if p is processor or type(p) is processor]
        if not hits:
            raise KeyError(f"no such processor in this world: {processor!r}")
        if isinstance(hits[-1], System):
            return self.remove(hits[-1])

        def action() -> None:
            with esper_bridge.context(self.world.name):
                esper_bridge.remove_processor_instance(hits[-1])

        if not self._later(action):
            action()
        return None

    def _measured(self, system: System) -> Any:
        """``system.process`` with its time taken and its errors named; esper calls this."""
        process = type(system).process
        name = system.name
        seconds = self._seconds

        def run(*args: Any) -> None:
            started = time.perf_counter()
            try:
                process(system, *args)
            except StepError:
                raise
            except Exception as error:
                raise self._step_error(name, error) from error
            seconds[name] = seconds.get(name, 0.0) + time.perf_counter() - started

        return run

    def _step_error(self, name: str, error: BaseException) -> StepError:
        return StepError(
            f"system {name} failed in step {self.clock.step_count} of world {self.world.name!r}: "
            f"{type(error).__name__}: {error} (carom's columns and clock are back at the start of the step)"
        )

    # -- stepping ---------------------------------------------------------------------------------------------------------

    def step(self) -> None:
        self._window(lambda: 1)

    def advance(self, seconds: float) -> int:
        steps = self.clock.gather(seconds, self.world.settings.max_steps_per_advance)
        self._window(lambda: steps)
        for system in tuple(self._frame_systems):
            with esper_bridge.context(self.world.name):
                system.process(seconds)
        return steps

    def _window(self, count: Any) -> None:
        """Some steps whose events are gathered together."""
        if self.in_step:
            raise CaromError("a step cannot be taken inside a step")
        self._open_window()
        self._in_window = True
        steps = count()
        try:
            with esper_bridge.context(self.world.name):
                for _ in range(steps):
                    self._process()
        finally:
            self._in_window = False
        if steps:
            self._close_window()

    def _process(self) -> None:
        try:
            esper.process(self.world.settings.dt)
        except BaseException as error:
            self._roll_back()
            if isinstance(error, (StepError, CaromError, ValueError)) or not isinstance(error, Exception):
                raise
            raise self._step_error(_processor_in(error), error) from error

    def open_step(self, *args: Any) -> None:
        dt = self.world.settings.dt
        if len(args) != 1 or args[0] != dt:
            given = ", ".join(map(repr, args))
            raise ValueError(
                f"esper.process({given}): this world's step is fixed, settings.dt = {dt!r}; "
                f"for frames of any length use world.advance(seconds)"
            )
        if self._unfinished is not None:  # a plain processor raised under plain esper
            self._roll_back()
        if not self._in_window:
            self._open_window()
        self.synchronize()
        if self.world.physics is not None:
            self._unfinished = self.capture(everything=self._foreign())
            self.world.physics.begin_step()
            self.world.physics.table.in_step = True
        self.in_step = True

    def close_step(self) -> None:
        physics = self.world.physics
        if physics is not None:
            physics.table.in_step = False
            physics.end_step()
        self.in_step = False
        self._unfinished = None
        self.clock.step_count += 1
        self._steps_measured += 1
        if not self._in_window:
            self._close_window()
        self._run_deferred()

    def _run_deferred(self) -> None:
        deferred, self._deferred = self._deferred, []
        for action in deferred:
            action()

    def _open_window(self) -> None:
        if self.world.physics is not None:
            self.world.physics.contacts.open_window()

    def _close_window(self) -> None:
        if self.world.physics is not None:
            self.world.physics.end_window()

    def _foreign(self) -> bool:
        """Whether code that is not carom's runs in the step and may write any column."""
        return any(not type(s).__module__.startswith("carom.systems") for s in self._systems) or (
            len(esper_bridge.processors()) > len(self._systems) + 2
        )

    def _roll_back(self) -> None:
        state, self._unfinished = self._unfinished, None
        physics = self.world.physics
        if state is not None and physics is not None:
            self.restore(state)
            physics.abandon_step()
            physics.table.in_step = False
        self.in_step = False
        self._run_deferred()

    def synchronize(self) -> None:
        """Bring the table in step with esper, unless a step is running: its rows stand still."""
        physics = self.world.physics
        if physics is None or self.in_step or self._synchronizing:
            return
        self._synchronizing = True
        try:
            with esper_bridge.context(self.world.name):
                physics.adoption.synchronize()
        finally:
            self._synchronizing = False

    def run(self, phase: Phase) -> None:
        if self.in_step:
            raise CaromError("a phase cannot be run inside a step")
        self.synchronize()
        physics = self.world.physics
        with esper_bridge.context(self.world.name):
            if physics is not None:
                physics.begin_step()
                physics.table.in_step = True
            self.in_step = True
            try:
                for system in [s for s in self._systems if s.phase == phase]:
                    system.process(self.world.settings.dt)
            finally:
                self.in_step = False
                if physics is not None:
                    physics.table.in_step = False
        self._run_deferred()

    # -- state ------------------------------------------------------------------------------------------------------------

    STATE = ("position", "previous_position", "linear_velocity", "applied_force", "step_force")

    def capture(self, everything: bool) -> StepState:
        physics = self.world.physics
        assert physics is not None
        columns = physics.table.copy_columns(None if everything else self.STATE)
        entities = columns.get("entity")
        if entities is None:
            entities = physics.table.column("entity")
        return StepState(entities, columns, self.clock.state(), physics.contacts.state(), physics.tracking_state())  # type: ignore[attr-defined]

    def restore(self, state: StepState) -> None:
        physics = self.world.physics
        assert physics is not None
        if not np.array_equal(state.entities, physics.table.column("entity")):
            raise ValueError("this snapshot holds other bodies than the world has now: some were created or deleted since")
        physics.table.restore_columns(state.columns)
        self.clock.restore(state.clock)
        physics.contacts.restore_state(state.contacts)
        physics.restore_tracking(state.extra)  # type: ignore[attr-defined]

    def state_hash(self) -> str:
        physics = self.world.physics
        assert physics is not None
        table = physics.table
        order = np.argsort(table.column("entity"), kind="stable")
        digest = hashlib.sha256()
        keys = {column.key for component in table.component_types for column in component.columns.values()}
        for key in ["entity", *sorted(keys)]:
            digest.update(key.encode())
            digest.update(np.ascontiguousarray(table.column(key)[order] + 0).tobytes())  # + 0: -0.0 is 0.0
        return digest.hexdigest()

    # -- statistics ---------------------------------------------------------------------------------------------------------

    def stats(self) -> Stats:
        steps = self._steps_measured
        milliseconds = {s.name: 1e3 * self._seconds.get(s.name, 0.0) / max(steps, 1) for s in self._systems}
        counters = dict(self.world.physics.counters()) if self.world.physics is not None else {}
        counters["dropped_steps"] = self.clock.dropped_steps
        return Stats(steps, milliseconds, counters)

    def reset_stats(self) -> None:
        self._seconds.clear()
        self._steps_measured = 0
        if self.world.physics is not None:
            self.world.physics.reset_counters()  # type: ignore[attr-defined]


def _as_tuple(value: Any) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, (list, tuple)) else (value,)


def _means(reference: Any, system: System) -> bool:
    if isinstance(reference, type):
        return isinstance(system, reference)
    return system is reference or system.name == reference


def _processor_in(error: BaseException) -> str:
    """The name of the innermost processor on the error's traceback."""
    name = "(unknown)"
    trace = error.__traceback__
    while trace is not None:
        owner = trace.tb_frame.f_locals.get("self")
        if isinstance(owner, esper.Processor):
            name = type(owner).__name__
        trace = trace.tb_next
    return name

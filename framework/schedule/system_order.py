"""The line-up of a world: its systems and processors, in which order they run, and who catches what they raise."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import esper

from ..compilation import log
from ..data import esper_bridge
from ..errors import NoPhysicsError, ScheduleError
from .phases import ForceSystem, Phase, System, in_order, means

if TYPE_CHECKING:
    from .step import Pipeline

PLACED = ("before", "after", "phase")  # attributes of a system that being added may set


class Guard:
    """A processor's ``process`` with its time taken and its errors named; set on the instance, where esper finds it."""

    def __init__(self, processor: esper.Processor) -> None:
        self.replaced = vars(processor).get("process")  # what somebody else had put there
        self._process = processor.process
        self.name = processor.name if isinstance(processor, System) else type(processor).__name__
        self.pipelines: dict[str, Pipeline] = {}  # by context: a plain processor may serve several worlds

    def __call__(self, *args: Any, **kwargs: Any) -> None:
        pipeline = self.pipelines.get(esper.current_world)
        if pipeline is None:
            self._process(*args, **kwargs)
            return
        measurements = pipeline.measurements
        outer, measurements.at = measurements.at, self.name
        waited, started = log.waited, time.perf_counter()
        try:
            self._process(*args, **kwargs)
            if pipeline.world.settings.debug and pipeline.world.physics is not None:
                pipeline.world.physics.report_faults(f"after {self.name}: ")
        except BaseException as error:
            pipeline.fail(self.name, error)
            raise
        finally:
            measurements.at = outer
        taken = time.perf_counter() - started
        if log.waited != waited:  # kernels were compiled or loaded
            measurements.wait(log.waited - waited)
            taken -= log.waited - waited
        seconds = measurements.seconds
        seconds[self.name] = seconds.get(self.name, 0.0) + taken


class Lineup:
    """Who runs in a step. What is added or removed while one runs joins or leaves at its end."""

    def __init__(self, pipeline: Pipeline) -> None:
        self.systems: list[System] = []
        self.force_systems: list[ForceSystem] = []
        self.frame_systems: list[Any] = []
        self._pipeline = pipeline
        self._wanted: list[System] = []  # in order of addition, as they will be after the step
        self._wanted_forces: list[ForceSystem] = []
        self._later: list[Callable[[], None]] = []  # what is to happen to plain processors after the step
        self._known: list[esper.Processor] = []  # esper's processors when they were looked at last
        self.changed = False  # whether something has been asked for that is not so yet
        self.foreign = True  # whether code that is not carom's runs in the step and may write any column
        self._given: dict[int, dict[str, Any]] = {}  # what PLACED attributes a system had before it was added

    @property
    def world(self) -> Any:
        return self._pipeline.world

    # -- adding -----------------------------------------------------------------------------------

    def add(self, system: Any, before: Any, after: Any, frame: bool) -> None:
        if isinstance(system, type):
            raise TypeError(f"add_system takes an instance: add_system({system.__name__}())")
        if not isinstance(system, (ForceSystem, esper.Processor)):
            raise TypeError(f"add_system takes a System, a ForceSystem or an esper.Processor, got {system!r}")
        if isinstance(system, System) and not isinstance(system.phase, Phase):
            known = ", ".join(f"Phase.{phase.name}" for phase in Phase)
            raise TypeError(f"{system.name}.phase must be one of {known}, got {system.phase!r}")
        if frame:
            self._add_frame_system(system)
        elif isinstance(system, ForceSystem):
            self._add_force_system(system)
        elif isinstance(system, System):
            self._add_system(system, before, after)
        elif before != () or after != ():
            name = type(system).__name__
            raise TypeError(
                f"{name} is a plain processor: add_processor gives it a priority instead of before and after"
            )
        else:
            self.add_plain(system, 0)

    def _add_frame_system(self, system: Any) -> None:
        if isinstance(system, ForceSystem):
            raise TypeError(f"{system.name} is a ForceSystem: the integrator calls it, it cannot run once per frame")
        self._refuse_twice(system, [*self.frame_systems, *self._wanted])
        self.frame_systems.append(system)
        system.world = self.world

    def _add_force_system(self, system: ForceSystem) -> None:
        if self.world.physics is None:
            raise NoPhysicsError("no physics in this world: World(Physics(...))")
        self._refuse_twice(system, self._wanted_forces)
        system.world = self.world
        self._wanted_forces.append(system)
        self._soon()

    def _add_system(self, system: System, before: Any, after: Any) -> None:
        self._refuse_twice(system, [*self._wanted, *self.frame_systems])
        given = {name: vars(system)[name] for name in PLACED if name in vars(system)}
        try:
            self._place(system, before, after)
            in_order([*self._wanted, system])  # a cycle shows here, at the call
        except Exception:
            _set_placed(system, given)
            raise
        self._given[id(system)] = given
        system.world = self.world
        self._wanted.append(system)
        self._soon()

    def _refuse_twice(self, system: Any, here: list[Any]) -> None:
        name = getattr(system, "name", type(system).__name__)
        if any(system is other for other in here):
            raise ValueError(f"{name} is in this world already")
        world = getattr(system, "world", None)
        if world is not None and world is not self.world and world.has_system(system):
            raise ValueError(f"{name} is in world {world.name!r} already: a system belongs to one world")

    def _place(self, system: System, before: Any, after: Any) -> None:
        """Note the order asked for; a system that names no phase of its own goes into its neighbour's."""
        for attribute, given in (("before", before), ("after", after)):
            if _as_tuple(given):
                setattr(system, attribute, (*_as_tuple(getattr(system, attribute)), *_as_tuple(given)))
        for attribute in ("before", "after"):
            for reference in _as_tuple(getattr(system, attribute)):
                neighbours = [s for s in self._wanted if means(reference, s)]
                if not neighbours:
                    name = reference.__name__ if isinstance(reference, type) else reference
                    raise ScheduleError(f"{system.name} asks to run {attribute} {name}, which is not in this world")
                phase = neighbours[0].phase
                if phase == system.phase:
                    continue
                if not _names_phase(system):
                    system.phase = phase  # type: ignore[misc]
                elif (attribute == "before") != (system.phase < phase):
                    raise ScheduleError(
                        f"{system.name} runs in phase {system.phase.name} and cannot run {attribute} "
                        f"{neighbours[0].name} of phase {phase.name}"
                    )

    def add_plain(self, processor: Any, priority: float) -> None:
        if isinstance(processor, type) or not isinstance(processor, esper.Processor):
            raise TypeError(f"add_processor takes an instance of an esper.Processor, got {processor!r}")

        def action() -> None:
            with esper_bridge.context(self.world.name):
                esper.add_processor(processor, priority)  # type: ignore[arg-type]

        self._soon(action)

    # -- removing ---------------------------------------------------------------------------------

    def has(self, system: Any) -> bool:
        """Whether that very system is here or about to come."""
        return any(system is other for other in (*self._wanted, *self._wanted_forces, *self.frame_systems))

    def remove(self, system: Any) -> None:
        """By instance; KeyError if it is not here."""
        if isinstance(system, type):
            raise TypeError(f"remove_system takes the instance that was added, got the class {system.__name__}")
        for owned in (self._wanted, self._wanted_forces):
            if any(system is other for other in owned):
                owned[:] = [other for other in owned if other is not system]  # type: ignore[misc]
                self._soon()
                return
        if any(system is other for other in self.frame_systems):
            self.frame_systems = [other for other in self.frame_systems if other is not system]
            return
        self.remove_processor(system)

    def remove_processor(self, processor: Any) -> None:
        """By instance, or the last one added of a type; KeyError if there is none."""
        with esper_bridge.context(self.world.name):
            self.reconcile()
            hits = [s for s in self._wanted if s is processor or type(s) is processor]
            if hits:
                self.remove(hits[-1])
                return
            plain = [p for p in esper_bridge.processors() if p is processor or type(p) is processor]
        if not plain or isinstance(plain[-1], (System, *self._pipeline.OWN)):
            raise KeyError(f"no such processor in this world: {processor!r}")

        def action() -> None:
            with esper_bridge.context(self.world.name):
                esper_bridge.remove_processor_instance(plain[-1])
            self._unguard(plain[-1])

        self._soon(action)

    # -- bringing it about ------------------------------------------------------------------------

    def _soon(self, action: Callable[[], None] | None = None) -> None:
        """Now, or at the end of the step that is running."""
        self.changed = True
        if action is not None:
            self._later.append(action)
        if not self._pipeline.in_step:
            self.apply()

    def apply_after_step(self) -> None:
        """The same while esper's loop over the processors is at its last."""
        with esper_bridge.context(self.world.name):
            esper_bridge.renew_processors()
        self.apply()

    def apply(self) -> None:
        """Make the line-up what was asked for."""
        later, self._later = self._later, []
        for action in later:
            action()
        self.force_systems = list(self._wanted_forces)
        if not _same(self._wanted, self.systems):
            self._line_up()
        self.changed = False
        self.foreign = self._has_foreign()

    def _line_up(self) -> None:
        """Each phase has a band of esper priorities; its systems take the places below the top."""
        with esper_bridge.context(self.world.name):
            for system in self.systems:
                esper_bridge.remove_processor_instance(system)
            for system in self.systems:
                if not any(system is other for other in self._wanted):
                    self._unguard(system)
                    _set_placed(system, self._given.pop(id(system), {}))
            self.systems = in_order(self._wanted)
            place = dict.fromkeys(Phase, 0)
            for system in self.systems:
                place[system.phase] += 1
                esper.add_processor(system, system.phase.priority - place[system.phase])
                self._guard(system)

    def reconcile(self) -> None:
        """Take in what plain esper calls have added and removed; called in the world's context, before a step."""
        if self._pipeline.in_step or esper_bridge.same_processors(self._known):
            return
        present = esper_bridge.processors()
        lost = [s for s in self.systems if not any(s is p for p in present)]
        self._wanted = [s for s in self._wanted if not any(s is other for other in lost)]
        for processor in present:
            if isinstance(processor, System) and not any(processor is s for s in self.systems):
                esper_bridge.remove_processor_instance(processor)  # it gets a place in its phase instead
                self._add_system(processor, (), ())
        self.apply()
        self._known = esper_bridge.processors()
        for processor in self._known:
            self._guard(processor)
        self.foreign = self._has_foreign()

    def detach(self) -> None:
        """Leave esper; called in the world's context when the world closes."""
        for processor in esper_bridge.processors():
            if isinstance(processor, System) or type(processor) in self._pipeline.OWN:
                esper_bridge.remove_processor_instance(processor)
            self._unguard(processor)

    def _has_foreign(self) -> bool:
        """Also true without the built-in INTEGRATION, which keeps the state that others overwrite after it."""
        if self.force_systems or len(self._known) > len(self.systems) + len(self._pipeline.OWN):
            return True
        if all(system.phase != Phase.INTEGRATION for system in self.systems):
            return True
        return any(not type(system).__module__.startswith("carom.systems") for system in self.systems)

    # -- guards -----------------------------------------------------------------------------------

    def _guard(self, processor: esper.Processor) -> None:
        if type(processor) in self._pipeline.OWN:
            return
        guard = vars(processor).get("process")
        if not isinstance(guard, Guard):
            guard = vars(processor)["process"] = Guard(processor)
        guard.pipelines[self.world.name] = self._pipeline

    def _unguard(self, processor: esper.Processor) -> None:
        guard = vars(processor).get("process")
        if isinstance(guard, Guard):
            guard.pipelines.pop(self.world.name, None)
            if not guard.pipelines:
                del vars(processor)["process"]
                if guard.replaced is not None:
                    vars(processor)["process"] = guard.replaced


def _names_phase(system: System) -> bool:
    """Whether the system's class, or one between it and System, or itself says in which phase it runs."""
    own = type(system).__mro__[: type(system).__mro__.index(System)]
    return "phase" in vars(system) or any("phase" in vars(cls) for cls in own)


def _set_placed(system: System, values: dict[str, Any]) -> None:
    for name in PLACED:
        vars(system).pop(name, None)
    vars(system).update(values)


def _same(first: list[Any], second: list[Any]) -> bool:
    """The same objects, in whatever order."""
    return set(map(id, first)) == set(map(id, second))


def _as_tuple(value: Any) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, (list, tuple)) else (value,)

"""The order of a world's systems and processors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import esper

from ..data import esper_bridge
from ..errors import NoPhysicsError, ScheduleError
from .phases import ForceSystem, OfOneWorld, Phase, System, in_order, means

PLACED = ("before", "after", "phase")  # attributes of a system that being added may set


class SystemOrder:
    """What runs in a step. A system added or removed while one runs joins or leaves at its end."""

    def __init__(self, world: Any, runner: Any) -> None:
        self.world = world
        self.systems: list[System] = []
        self.force_systems: list[ForceSystem] = []
        self.frame_systems: list[Any] = []
        self._runner = runner  # the processor that runs the step
        self.version = 0  # changes with every change of what runs
        self._wanted: list[System] = []  # in order of addition, as they will be after the step
        self._wanted_forces: list[ForceSystem] = []
        self._later: list[Callable[[], None]] = []  # what is to happen to plain processors after the step
        self.changed = False  # whether something has been asked for that is not so yet
        self.foreign = True  # whether code that is not carom's runs in the step and may write any column
        self._joined: list[OfOneWorld] = []  # those whose on_add has been called
        self._given: dict[int, dict[str, Any]] = {}  # what PLACED attributes a system had before it was added

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
        self._tell()

    def _add_force_system(self, system: ForceSystem) -> None:
        if self.world.physics is None:
            raise NoPhysicsError("no physics in this world: World(Physics(...))")
        wanted = system.requires
        if not (isinstance(wanted, (tuple, list)) and all(isinstance(component, type) for component in wanted)):
            raise TypeError(f"{system.name}.requires must be a tuple of component types, got {wanted!r}")
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
            self._tell()
            return
        self.remove_processor(system)

    def remove_processor(self, processor: Any) -> None:
        """By instance, or the last one added of a type; KeyError if there is none."""
        with esper_bridge.context(self.world.name):
            if self._runner.processors.changed:
                self.reconcile()
            hits = [s for s in self._wanted if s is processor or type(s) is processor]
            if hits:
                self.remove(hits[-1])
                return
            plain = [p for p in self.in_esper_order() if p is processor or type(p) is processor]
        if not plain or isinstance(plain[-1], System):
            raise KeyError(f"no such processor in this world: {processor!r}")

        def action() -> None:
            with esper_bridge.context(self.world.name):
                esper_bridge.remove_processor_instance(plain[-1])

        self._soon(action)

    # -- bringing it about ------------------------------------------------------------------------

    def _soon(self, action: Callable[[], None] | None = None) -> None:
        """Now, or at the end of the step that is running."""
        self.changed = True
        if action is not None:
            self._later.append(action)
        if not self._runner.in_step:
            self.apply()

    def in_esper_order(self) -> list[esper.Processor]:
        """All processors but the one that runs the step, by priority."""
        processors = self._runner.processors
        return [processors[k] for k in range(len(processors)) if processors[k] is not self._runner]

    def apply(self) -> None:
        """Make the order what was asked for."""
        later, self._later = self._later, []
        for action in later:
            action()
        self._settle()
        self.changed = False
        self._tell()

    def _tell(self) -> None:
        """Call on_add of what has joined, in order, and on_remove of what has left. What raises on joining is taken out
        again; the first error is raised when all others have been called."""
        errors: list[BaseException] = []
        while True:
            here = [*self.systems, *self.force_systems, *self.frame_systems]
            left = next((s for s in self._joined if not any(s is other for other in here)), None)
            come = (s for s in here if isinstance(s, OfOneWorld) and not any(s is other for other in self._joined))
            system = next(come, None) if left is None else left
            if system is None:
                break
            self._joined = [other for other in self._joined if other is not left]
            try:
                with esper_bridge.context(self.world.name):
                    if left is not None:
                        left.on_remove(self.world)
                    else:
                        self._joined.append(system)
                        system.on_add(self.world)
            except BaseException as error:
                error.add_note(f"in {type(system).__name__}.{'on_add' if left is None else 'on_remove'}")
                errors.append(error)
                if left is None:
                    self._take_out(system)
        if errors:
            raise errors[0]

    def _take_out(self, system: OfOneWorld) -> None:
        """As if it had never been added."""
        lists = self._wanted, self._wanted_forces, self.frame_systems, self._joined
        self._wanted, self._wanted_forces, self.frame_systems, self._joined = (  # type: ignore[assignment]
            [other for other in each if other is not system] for each in lists
        )
        self._settle()

    def _settle(self) -> None:
        """What is wanted is here from now on."""
        self.force_systems = list(self._wanted_forces)
        if not _same(self._wanted, self.systems):
            self._place_systems()
        self.version += 1
        self.foreign = self._has_foreign()

    def _place_systems(self) -> None:
        """Each phase has a band of esper priorities; its systems take the places below the top."""
        with esper_bridge.context(self.world.name):
            for system in self.systems:
                esper_bridge.remove_processor_instance(system)
            for system in self.systems:
                if not any(system is other for other in self._wanted):
                    _set_placed(system, self._given.pop(id(system), {}))
            self.systems = in_order(self._wanted)
            place = dict.fromkeys(Phase, 0)
            for system in self.systems:
                place[system.phase] += 1
                esper.add_processor(system, system.phase.priority - place[system.phase])

    def reconcile(self) -> None:
        """Take in what plain esper calls have added and removed, before a step."""
        if self._runner.in_step:
            return
        present = self.in_esper_order()
        lost = [s for s in self.systems if not any(s is p for p in present)]
        self._wanted = [s for s in self._wanted if not any(s is other for other in lost)]
        for processor in present:
            if isinstance(processor, System) and not any(processor is s for s in self.systems):
                with esper_bridge.context(self.world.name):
                    esper_bridge.remove_processor_instance(processor)  # it gets a place in its phase instead
                self._add_system(processor, (), ())
        self.apply()
        self._runner.processors.changed = False

    def detach(self) -> None:
        """Leave esper; called in the world's context when the world closes."""
        for processor in list(self._runner.processors):
            if isinstance(processor, System) or processor is self._runner:
                esper_bridge.remove_processor_instance(processor)
        esper_bridge.give_back_processors()

    def _has_foreign(self) -> bool:
        """Also true without a built-in system that integrates: it keeps the state that others overwrite after it."""
        if self.force_systems or len(self.in_esper_order()) > len(self.systems):
            return True
        if all(system.phase != Phase.INTEGRATION for system in self.systems):
            return True
        return any(system.parts() is None for system in self.systems)


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

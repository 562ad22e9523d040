"""Systems and their order: phases, before and after, one esper priority for each."""

from __future__ import annotations

import graphlib
from collections.abc import Sequence
from enum import IntEnum
from typing import Any, ClassVar

import esper

from ..data.component import Component
from ..errors import ScheduleError


class Phase(IntEnum):
    """The parts of a step, in order. Their esper priorities lie in bands of 1000: see :meth:`priority`."""

    START = 0
    FORCES = 1
    INTEGRATION = 2
    BROAD = 3
    NARROW = 4
    RESPONSE = 5
    END = 6

    @property
    def priority(self) -> int:
        """Top of the phase's band of esper priorities, START 7000 ... END 1000; its systems follow from one below it.

        A plain esper processor of this priority thus runs before the phase, one of priority 0 after them all.
        """
        return 1000 * (len(Phase) - self)


FIRST_PRIORITY = 1_000_000  # the processor that runs the step


class OfOneWorld:
    """What gets a ``world`` when it is added to one: a copy of it is in none."""

    world: Any  # declare ``world: World`` in a class of your own to have it typed

    def on_add(self, world: Any) -> None:
        """Called once when it has joined ``world``, before it runs: when it is added, or at the end of that step.

        If it raises, the call that added it does, or the step, and the system is not in the world.
        """

    def on_remove(self, world: Any) -> None:
        """Called once when it has been removed from ``world``; not when the world closes."""

    def __getstate__(self) -> object:
        state = super().__getstate__()
        if isinstance(state, dict):
            return {name: value for name, value in state.items() if name != "world"}
        return state


class System(OfOneWorld, esper.Processor):
    """A piece of a step. Derive from it, set ``phase`` and write ``process``; ``world.add_system`` puts it in order.

    phase
        runs in that phase, after the built-in system
    before, after
        types (or instances) of systems of the same phase to run before or after
    writes
        columns it sets (not: adds to). Two systems that write one column without an order between them are an error
    """

    phase: ClassVar[Phase] = Phase.END
    before: Sequence[Any] = ()
    after: Sequence[Any] = ()
    writes: Sequence[str] = ()

    @property
    def name(self) -> str:
        """Of the class: what ``world.plan()`` and ``world.stats()`` show."""
        return type(self).__name__

    def process(self, dt: float) -> None:  # type: ignore[override]
        """Called exactly once per fixed step of ``dt`` seconds."""
        raise NotImplementedError(f"{self.name} has no process(dt)")

    def parts(self) -> list[Any] | None:
        """What a step runs for a system that consists of stages; None: its ``process``."""
        return None


class ForceSystem(OfOneWorld):
    """Adds forces; pure, because it is called once per stage of the integrator, at that stage's state.

    requires
        component types a body must have (besides being dynamic) to be among ``bodies``
    """

    requires: ClassVar[Sequence[type[Component]]] = ()

    @property
    def name(self) -> str:
        """Of the class: what ``world.plan()`` and messages show."""
        return type(self).__name__

    def add_forces(self, bodies: Any, time: float) -> None:
        """Add to ``bodies.force`` (n, d), in newtons, from the other columns and the time in seconds; with a Spin in
        ``requires`` also to ``bodies.torque``, N m, (n,) in 2D, (n, 3) along the world's axes in 3D."""
        raise NotImplementedError(f"{self.name} has no add_forces(bodies, time)")

    # A force system that has a potential may define potential_energy(bodies) -> float, in joules,
    # so that world.potential_energy() includes it.


def in_order(systems: Sequence[System]) -> list[System]:
    """The systems sorted by phase, then by before/after, ties in the order given; ScheduleError on a cycle."""
    ordered: list[System] = []
    for phase in Phase:
        members = [system for system in systems if system.phase == phase]
        edges = {index: set() for index in range(len(members))}  # index -> those that run earlier
        for index, system in enumerate(members):
            for other in _named(system.after, members, system):
                edges[index].add(other)
            for other in _named(system.before, members, system):
                edges[other].add(index)
        _check_writers(members, edges)
        ordered += [members[index] for index in _topological(members, edges)] if any(edges.values()) else members
    return ordered


def means(reference: Any, system: System) -> bool:
    """Whether a type, an instance or a name stands for that system."""
    if isinstance(reference, type):
        return isinstance(system, reference)
    return system is reference or system.name == reference


def _named(references: Sequence[Any], members: list[System], system: System) -> list[int]:
    """Indices of the other members that the references mean."""
    references = references if isinstance(references, (list, tuple)) else (references,)
    others = [(index, member) for index, member in enumerate(members) if member is not system]
    return [index for reference in references for index, member in others if means(reference, member)]


def _topological(members: list[System], edges: dict[int, set[int]]) -> list[int]:
    """Each where it was added, pulling before it what must run earlier: a system that goes before a built-in one holds
    up nothing else, so those that follow it by addition still do."""
    try:
        graphlib.TopologicalSorter(edges).prepare()
    except graphlib.CycleError as error:
        names = " -> ".join(members[index].name for index in reversed(error.args[1]))
        raise ScheduleError(f"systems cannot be ordered, before/after form a cycle: {names}") from None
    ordered: list[int] = []

    def visit(index: int) -> None:
        if index not in ordered:
            for earlier in sorted(edges[index]):
                visit(earlier)
            ordered.append(index)

    for index in range(len(members)):
        visit(index)
    return ordered


def _consists_of_stages(system: System) -> bool:
    return system.parts() is not None


def _check_writers(members: list[System], edges: dict[int, set[int]]) -> None:
    """Two systems that declare the same column must have an order, direct or through others.

    Between a built-in system and one of the game there always is one: the game's runs after it unless it says before.
    """
    earlier: dict[int, set[int]] = {}

    def before(index: int, trail: frozenset[int] = frozenset()) -> set[int]:
        if index not in earlier and index not in trail:
            earlier[index] = set(edges[index]).union(*(before(i, trail | {index}) for i in edges[index]))
        return earlier.get(index, set())

    for j, second in enumerate(members):
        for i, first in enumerate(members[:j]):
            shared = sorted(set(first.writes) & set(second.writes))
            alike = _consists_of_stages(first) is _consists_of_stages(second)
            if alike and shared and i not in before(j) and j not in before(i):
                raise ScheduleError(
                    f"{first.name} and {second.name} both write {', '.join(shared)} in phase "
                    f"{first.phase.name} without an order: give one of them before= or after= the other"
                )

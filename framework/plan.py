"""``world.plan()``: what runs in a step, in order, and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .world import World


@dataclass(frozen=True)
class PlanEntry:
    """One system of a step: its phase, its esper priority, and what it has to do in this world."""

    phase: str
    system: str
    priority: int
    reason: str


@dataclass(frozen=True)
class Plan:
    """Printable; ``entries`` are in the order of a step."""

    entries: tuple[PlanEntry, ...]

    @classmethod
    def of(cls, world: World) -> Plan:
        return cls(
            tuple(
                PlanEntry(s.phase.name, s.name, s.priority, s.reason() if hasattr(s, "reason") else "added by the game")
                for s in world.systems
            )
        )

    def __str__(self) -> str:
        return "\n".join(f"{e.phase:<12}{e.priority:>5}  {e.system:<20} {e.reason}" for e in self.entries)

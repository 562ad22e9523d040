"""What all built-in systems are: a list of stages of the program, and what of the system is Python."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from ..framework.schedule.phases import System
from ..framework.schedule.plan import PlannedKernel, kernels_of
from ..framework.schedule.stages import Program, Segment, Stage


class StagedSystem(System):
    """A built-in system.

    Neighbouring systems run in one call. A class derived from one of them that has a ``process`` of its own runs as any
    other system does.
    """

    STAGES: ClassVar[tuple[Stage, ...]] = ()

    def __init__(self, program: Program) -> None:
        self._program = program

    def segment(self, first: str = "", last: str = "") -> Segment:
        """Its stages from the first to the last of these names, with those of plugins next to them; all of them, if
        none are given."""
        return self._program.segment(first or self.STAGES[0].name, last or self.STAGES[-1].name)

    def parts(self) -> list[Any] | None:
        if type(self).process is not StagedSystem.process or "process" in vars(self):
            return None
        return self._parts()

    def _parts(self) -> list[Any]:
        return [self.segment()]

    def process(self, dt: float) -> None:
        """Run this system alone."""
        for part in self._parts():
            part(dt)

    def kernels(self) -> Iterator[PlannedKernel]:
        """Its stages that are needed in this scene, for ``world.plan()``."""
        yield from kernels_of(self.segment())

    def reason(self) -> str:
        """What it does in this scene, for ``world.plan()``."""
        return ""

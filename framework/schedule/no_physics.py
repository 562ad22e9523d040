"""What a step asks of physics, in a world that has none."""

from __future__ import annotations

from typing import Any

from ..data.esper_bridge import Contents
from ..errors import NoPhysicsError
from ..jit.records.record import make_record
from .stages import PROGRAM, Program


class NoPhysics:
    """Does nothing, and has no stages; refuses bodies."""

    parts_version = 0

    def __init__(self, contents: Contents) -> None:
        self._contents = contents
        self.program = Program(make_record(PROGRAM, 2), (), {}, 0)

    def begin_step(self, others_write: bool) -> None:
        """NoPhysicsError if there is something that only physics can move."""
        for component, entities in self._contents.members.items() if self._contents.log.dirty else ():
            if entities and isinstance(component, type) and getattr(component, "makes_body", False):
                raise NoPhysicsError(
                    f"entity {next(iter(entities))} has {component.__name__}, and there is no physics in this world: "
                    f"World(Physics(dimensions=2))"
                )

    def settled(self) -> bool:
        return True

    def system_of_stage(self, stage: int) -> str:
        return ""

    def counters(self) -> dict[str, int]:
        return {}

    def _none(self) -> tuple[()]:
        return ()

    opening_stages = closing_stages = planned_kernels = planned_columns = _none

    def _nothing(self, *_: Any) -> None:
        return None

    check_settings = take_settings = open_window = end_window = take_deferred = look_ahead = _nothing
    end_step = end_phase = abandon_step = report_faults = reset_counters = _nothing

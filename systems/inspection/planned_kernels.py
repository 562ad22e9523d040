"""What runs at the start and the end of a step, for ``world.plan()``."""

from __future__ import annotations

from collections.abc import Iterator

from ...framework.data.column_copies import copy_blocks
from ...framework.jit.records.record import Record
from ...framework.schedule.plan import PlannedKernel
from ..stage_list import CLOSING, OPENING


def planned_kernels(state: Record) -> Iterator[PlannedKernel]:
    """The kernels that belong to no system."""
    for stage in (*OPENING, *CLOSING):
        if stage.needed and not (state.sleeping and state.collides):
            continue
        yield PlannedKernel(stage.name, stage.why, stage.when)
    if state.others_write:
        yield PlannedKernel(copy_blocks.__name__, "copies of all columns: code of the game may write any of them")

"""What runs at the start and the end of a step, for ``world.plan()``."""

from __future__ import annotations

from collections.abc import Iterator

from ...framework.data.column_copies import copy_blocks
from ...framework.schedule.plan import PlannedKernel, kernels_of
from ...framework.schedule.stages import Program
from ..stage_list import CLOSING, OPENING


def planned_kernels(program: Program) -> Iterator[PlannedKernel]:
    """The kernels that belong to no system."""
    for stages in (OPENING, CLOSING):
        yield from kernels_of(program.segment(stages[0].name, stages[-1].name))
    if program.state.others_write:
        yield PlannedKernel(copy_blocks.__name__, "copies of all columns: code of the game may write any of them")

"""The stages of plugins in one world: which there are, and the columns that they need."""

from __future__ import annotations

import numpy as np

from ...framework.data.column_copies import ColumnCopies
from ...framework.data.table import Table
from ...framework.jit.records.record import Record
from ...framework.plugins.registry import PluginStage, Registry
from ...framework.schedule.stages import Program
from .. import records
from ..scene import Scene
from ..stage_list import MADE_AGAIN
from .placement import OF_TABLE, check_stages, placed

NEEDED = "stages of plugins"  # the condition of what all of them need
# Columns of the records alone, which have a row for each of the table where something asks for them.
RESERVED = {
    name
    for section in (
        records.START, records.QUARANTINE, records.COLLISIONS, records.PREDICTED, records.HELD, records.CURVES,
        records.SWEEPS, records.EVALUATIONS, records.SLEEPING,
    )
    for name in section
}  # fmt: skip


class Extensions:
    """Follows the registry and the table.

    written
        copies of what the stages write, see :mod:`.kept`
    """

    def __init__(self, state: Record, table: Table, scene: Scene, registry: Registry) -> None:
        self._state, self._table, self._scene, self._registry = state, table, scene, registry
        self.stages: tuple[PluginStage, ...] = ()
        self.written = ColumnCopies(table, ())
        check_stages(registry.stages.values())
        registry.check_stages = check_stages

    def follow(self, program: Program) -> bool:
        """Between two steps: what plugins and bodies there are now. True if the program has got other stages."""
        stages = tuple(self._registry.stages.values())
        changed = stages != self.stages
        if changed:
            program.take(tuple(placed(stages)))
            self.stages = stages
            written = dict.fromkeys(name for stage in stages for name in stage.writes)
            self.written = ColumnCopies(self._table, tuple(OF_TABLE.intersection(written).difference(MADE_AGAIN)))
        if stages:
            self._bind(program)
        return changed

    def _bind(self, program: Program) -> None:
        """Rows for all columns that the stages name, and the addresses of what they have of their own."""
        for name in sorted({name for stage in self.stages for name in (*stage.reads, *stage.writes)}):
            if name in OF_TABLE:
                self._table.make(name)
            elif name in RESERVED:
                self._scene.reserve(name)
        self.written.bind()
        addresses = np.zeros(len(program.stages), np.int64)
        addresses[program.index["keep_written"]] = self.written.address
        self._state.extensions = addresses

    def conditions(self, met: dict[str, bool]) -> dict[str, bool]:
        """Which of the stages are needed, by name, where these conditions are met."""
        needed = {stage.name: met[stage.needed] for stage in self.stages}
        return {NEEDED: any(needed.values()), **needed}

"""The stages of plugins in one world: which there are, and the columns that they need."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import Any

import numpy as np

from ...framework.data.adoption import Adoption
from ...framework.data.column_copies import ColumnCopies
from ...framework.data.component import Component
from ...framework.data.interpolation import restart
from ...framework.jit.records.record import Record, make_record
from ...framework.jit.records.schema import Schema
from ...framework.plugins.registry import PluginStage, Registry
from ...framework.schedule.stages import Program, Stage
from ..joints.records import JOINTS
from ..parts.rows import PARTS
from ..records import BODY_COLUMNS, DAMPING_COLUMNS
from ..scene import Scene
from ..stage_list import MADE_AGAIN
from .compiled import PRESENT, own_schema, visible_columns
from .placement import OF_TABLE, check_plugin_stages, placed

NEEDED = "stages of plugins"  # the condition of what all of them need,
QUERYING = "stages query"  # and of what those need that find bodies


class PluginStages:
    """Follows the registry and the table.

    written
        copies of what the stages write, see :func:`keep_written`
    """

    def __init__(self, state: Record, scene: Scene, adoption: Adoption, registry: Registry) -> None:
        self._state, self._scene, self._table = state, scene, scene.table
        self._adoption, self._registry = adoption, registry
        self.stages: tuple[PluginStage, ...] = ()
        self._about: list[tuple[type[Component], ...]] = []  # the components of each
        self.written = ColumnCopies(self._table, ())
        self._bound: Any = None  # the stages, and what columns there were, when these were bound
        self._own: dict[PluginStage, Record] = {}  # what each of them gets
        # Of plugins' own; these are shared.
        self._records: dict[Schema, Record] = {JOINTS: state.solver.joints, PARTS: state.parts}
        self.followers: list[Callable[[Any], None]] = []  # what plugins do with the world before each step,
        self.adopters: list[Callable[[Any], None]] = []  # whenever the table is brought up to date,
        self.finishers: list[Callable[[Any], None]] = []  # after it,
        self.waiting: list[Callable[[], bool]] = []  # and whether they have something to do
        check_plugin_stages(registry.stages.values())
        registry.check_stages = check_plugin_stages

    def unsettled(self) -> bool:
        """Whether a plugin has something to do before or after this step."""
        for waits in self.waiting:  # noqa: SIM110  called in every step
            if waits():
                return True
        return False

    def follow(self, program: Program) -> bool:
        """Between two steps: what plugins and bodies there are now. True if the program has got other stages."""
        stages = tuple(self._registry.stages.values())
        changed = stages != self.stages
        if changed:
            self._take(stages, program)
        if stages:
            if self._bound != (stages, self._table.columns_version):
                self._bind(program)
                self._bound = stages, self._table.columns_version  # of those that it has made, too
            self.written.bind()
        return changed

    def _take(self, stages: tuple[PluginStage, ...], program: Program) -> None:
        dimensions = self._state.dimensions
        self._adoption.register(dict.fromkeys(component for stage in stages for component in stage.components))
        program.take(tuple(placed(stages, dimensions)))
        self.stages, self._about = stages, [stage.about for stage in stages]
        if any("rotation" in stage.writes for stage in stages) and "previous_rotation" not in self._table.arrays:
            self._table.make("previous_rotation")
            restart(self._table, slice(0, self._table.count), ("rotation",))
        self._own = {stage: make_record(own_schema(stage, dimensions), dimensions) for stage in stages}
        reads, writes = ({name for stage in stages for name in getattr(stage, what)} for what in ("reads", "writes"))
        kept = {name for name in writes if name in OF_TABLE or self._table.has_column(name)}.difference(MADE_AGAIN)
        owners = {column.key: each for stage in stages for each in stage.components for column in each.columns.values()}
        self.written = ColumnCopies(self._table, tuple(sorted(kept)), owners)
        own = {name for name in writes if "." in name}  # no stage writes what sleeps, see docs/write-a-stage.md
        self._scene.read_by_plugins, self._scene.moments_asked = (reads - writes) | own, "shapes" in reads
        self._scene.sweeps_asked = "tree" in reads

    def _bind(self, program: Program) -> None:
        """Rows for all columns that the stages name, and the addresses of what they have of their own."""
        table, addresses = self._table, np.zeros(len(program.stages), np.int64)
        for name in sorted({name for stage in self.stages for name in (*stage.reads, *stage.writes)}):
            if name in OF_TABLE:
                table.make(name)
            elif name in BODY_COLUMNS:
                self._scene.reserve(name)
            elif name in DAMPING_COLUMNS:
                self._scene.make(name)
        for stage, own in self._own.items():
            addresses[program.index[stage.name]] = own.address
            for source, name in zip(stage.records, own.schema.fields, strict=True):
                if isinstance(source, Schema):
                    setattr(own, name, self.record(source))
                else:
                    self._show(source, getattr(own, name))
        addresses[program.index["keep_written"]] = self.written.address
        self._state.plugin_stages = addresses

    def _show(self, component: type[Component], record: Record) -> None:
        """Let the record of a component show the table's columns."""
        record.show(PRESENT, self._table.has_mask(component))
        for column in visible_columns(component):
            array = self._table.make(column.key)
            record.show(column.name, array.reshape(len(array), -1) if column.item == "angular" else array)

    def record(self, schema: Schema) -> Record:
        """The one of this world of a plugin's schema."""
        if schema not in self._records:
            self._records[schema] = make_record(schema, self._state.dimensions)
        return self._records[schema]

    def saved(self) -> dict[str, Any]:
        """Copies of the records that plugins have declared, by name."""
        return {name: _values(self.record(schema)) for name, schema in self._registry.records.items()}

    def take_back(self, saved: dict[str, Any]) -> None:
        for name, values in saved.items():
            if name in self._registry.records:
                _put(self.record(self._registry.records[name]), values)

    def own(self, stage: Stage) -> Record | None:
        """What a stage of a plugin gets beside the state; None for others."""
        return next((own for each, own in self._own.items() if each.name == stage.name), None)

    def present(self) -> tuple[bool, ...]:
        """Of each stage, whether some body has all components that it is about."""
        table, found = self._table, {}
        for components in dict.fromkeys(self._about):
            masks = [table.has_mask(each)[: table.count] for each in components]
            found[components] = not masks or bool(reduce(np.logical_and, masks).any())
        return tuple(found[components] for components in self._about)

    def conditions(self, met: dict[str, bool]) -> dict[str, bool]:
        """Which of the stages are needed, by name, where these conditions are met."""
        needed = {
            stage.name: met.get(stage.needed, False) and present  # "on demand": none of every step
            for stage, present in zip(self.stages, self.present(), strict=True)
        }
        spins = any(needed[stage.name] for stage in self.stages if "spin" in stage.writes)
        return {
            NEEDED: any(needed.values()), **needed,
            QUERYING: any(needed[stage.name] for stage in self.stages if "tree" in stage.reads),
            "bodies spin or joints": spins or met["joints"],
            "no body spins, no joints": met["contacts may rest"] and not spins and not met["joints"],
        }  # fmt: skip


def _values(record: Record) -> dict[str, Any]:
    """A copy of all that is in a record."""
    fields = {name: getattr(record, name) for name in record.schema.fields}
    return {
        name: _values(value) if isinstance(value, Record) else value.copy() if isinstance(value, np.ndarray) else value
        for name, value in fields.items()
    }


def _put(record: Record, values: dict[str, Any]) -> None:
    for name, value in values.items():
        if isinstance(value, dict):
            _put(getattr(record, name), value)
        else:
            setattr(record, name, value.copy() if isinstance(value, np.ndarray) else value)

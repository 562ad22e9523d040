"""The arrays that a world's physics holds, and why: for ``world.plan()``. What has no rows is not listed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...framework.data.columns import REQUIRED
from ...framework.data.table import HAS_OBJECTS, Table
from ...framework.jit.records.record import Record
from ...framework.jit.records.schema import Schema, Section
from ...framework.schedule.plan import PlannedColumn
from ..records import BODIES, HIDDEN_COLUMNS
from ..scene import Scene

FIELDS = "what the game has set"
DEFAULTS = "at their defaults, there because handles and world.bodies write in place"
OBJECTS = "whose entities have Python objects"
MASKS = "which components it has"
ROTATED = "some body is rotated: shapes as they are in the world"
NOT_ENCLOSING = "some body has several colliders: whether the cheaper one still encloses the other"
NOT_ENABLED = "some collider is not enabled: which shapes a body has, with those"
UNDO_NOTE = "copies for going back to the start of a step that fails"


def planned_columns(
    state: Record, table: Table, scene: Scene, copies: dict[str, np.ndarray]
) -> Iterator[PlannedColumn]:
    """All arrays of bodies, then of pairs, contacts and impacts; ``copies``: the room for those of columns."""
    bodies, capacity = state.bodies, table.capacity
    of_table = [section for section in BODIES.sections if section.group == "the table"]
    yield from _fields(table)
    yield from _sections(bodies, of_table)
    yield from _column(HAS_OBJECTS, "body", "the table", table.arrays[HAS_OBJECTS], capacity, OBJECTS)
    for component in table.component_types:
        yield from _column(table.mask_name(component), "body", "the table", table.has_mask(component), capacity, MASKS)
    yield from _sections(bodies, [section for section in BODIES.sections if section not in of_table])
    if scene.own_levels is not scene.levels:
        yield from _column("own_levels", "body", "shapes", scene.own_levels, capacity, NOT_ENABLED)
    yield from _column("stretches", "body", "shapes", scene.stretches, capacity, NOT_ENCLOSING)
    yield from _column("level_not_enclosing", "body", "shapes", bodies.level_not_enclosing, capacity, NOT_ENCLOSING)
    for key, array in sorted(scene.rotated_columns.items()):
        yield from _column(f"{key}, rotated", "body", "rotation", array, capacity, ROTATED)
    for key, copy in copies.items():
        yield from _column(f"copy of {key}", "body", "going back", copy, len(copy), UNDO_NOTE)
    for name, schema in state.schema.fields.items():
        if isinstance(schema, Schema) and schema is not BODIES:
            yield from _sections(getattr(state, name), schema.sections, least=3)  # fewer: numbers of the whole record


def _sections(record: Record, sections: Sequence[Section], least: int = 1) -> Iterator[PlannedColumn]:
    """The columns of a record that have rows."""
    for section in sections:
        for name in section if section.why else ():
            array, rows = getattr(record, name), record.rows_of(name)
            if name == "axes":
                rows //= record.dimensions**2
            elif name == "axes_rotation" and record.dimensions == 3:
                rows //= 4
            if rows >= least:
                shown = f"_{name}" if name in HIDDEN_COLUMNS else name
                unit = section.fields[name].unit
                yield from _column(shown, section.of, section.group, array, rows, section.why, unit)


def _column(
    name: str, of: str, group: str, array: np.ndarray, rows: int, reason: str, unit: str = ""
) -> Iterator[PlannedColumn]:
    if array.nbytes and rows:
        yield PlannedColumn(name, of, group, array.nbytes // rows, reason, unit)


def _fields(table: Table) -> Iterator[PlannedColumn]:
    """Of each component type, first those that hold something."""
    for component in table.component_types:
        used, unused = [], []
        for column in component.columns.values():
            same = table.column(column.key) == column.empty_value(table.dimensions)
            default = same | (table.column(column.key) != table.column(column.key))  # nan is None
            has = table.has_mask(component)[: table.count]
            if column.key not in table.arrays:  # a column on demand that nothing has asked for
                continue
            (used if column.default is REQUIRED or not default[has].all() else unused).append(column)
        for columns, reason in ((used, FIELDS), (unused, DEFAULTS)):
            for column in columns:
                array = table.arrays[column.key]
                yield from _column(
                    column.key, "body", component.__name__, array, table.capacity, reason, column.unit
                )

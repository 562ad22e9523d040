"""The arrays that a world's physics holds, and why: for ``world.plan()``. What has no rows is not listed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...framework.data.column_copies import ColumnCopies
from ...framework.data.columns import REQUIRED
from ...framework.data.table import Table
from ...framework.jit.records.record import Record
from ...framework.schedule.plan import PlannedColumn
from ..room import SOLVER_BODIES
from ..scene import COLLISIONS, CURVES, HALF_KICKS, SEVERAL_EVALUATIONS, SLEEP_COLUMNS, SLEEPING, SWEEPS, Scene

FIELDS = "what the game has set"
DEFAULTS = "at their defaults, there because handles and world.bodies write in place"
TABLE = {
    "entity": "the entity of each row",
    "previous_position": "the start of the step: for drawing between steps, and for going back",
    "force": "the sum of forces",
    "inverse_mass": "0 for what cannot be moved",
    **dict.fromkeys(SLEEP_COLUMNS.values(), "bodies may sleep: who does, since when, and what they were like then"),
}
STANDING = "where it stood when its box was made"
MASKS = "which components it has"
GROUPS = (
    ("the step", ("start_velocity",), "velocity at the start of the step, for the path"),
    ("the step", ("quarantined",), "a body had a value that cannot be: it takes no part"),
    ("collisions", COLLISIONS, "some body has a collider: boxes, extents, the path in the step, the response"),
    ("collisions", ("supported", "support_change", "most_support", "held", "place"), "contacts have rested"),
    ("curved paths", CURVES, "the integrator's paths are curved"),
    ("swept bodies", SWEEPS, "bodies are swept along their paths: how far impacts may send them"),
    (
        "integrator", tuple(dict.fromkeys((*HALF_KICKS, *SEVERAL_EVALUATIONS))),
        "the integrator evaluates forces more than once, or flies exactly",
    ),
    ("going back", ("kept_previous", "kept_velocity", "kept_step_force"), "the start of the step, for one that fails"),
    ("sleeping", SLEEPING, "bodies may sleep: islands, and whether anything has changed them"),
    ("rotation", ("axes",), "some body is rotated, or a shape reads its axes"),
    ("shapes", ("levels", "level_offsets"), "which shapes a body has, and where they are"),
)  # fmt: skip
ROTATED = "some body is rotated: shapes as they are in the world"
NOT_ENCLOSING = "some body has several colliders: whether the cheaper one still encloses the other"
UNDO = "copies for going back to the start of a step that fails"
NEAR = "bodies have come near each other"
# Other records: what one of their rows is, and why they have any.
RECORDS = (
    ("candidates", "pair", "pairs", NEAR), ("pairs", "pair", "pairs", NEAR), ("merged", "pair", "pairs", NEAR),
    ("solver", "contact", "contacts at rest", "contacts have rested"),
    ("warm_start", "contact", "contacts at rest", "contacts have rested"),
    ("contacts", "contact", "contacts", "bodies have touched"), ("impacts", "impact", "impacts", "bodies have bounced"),
    ("grid", "body", "broad phase, grid", "more bodies than are tested pair by pair"),
    ("static_grid", "body", "broad phase, static grid", "more static bodies than are tested pair by pair"),
    ("views", "body", "broad phase, static grid", "what a moving body has seen in the grid"),
)  # fmt: skip

# Columns of these records whose rows are something else.
NO_ROWS = {
    "candidates": ("bucket_starts",), "solver": ("starts",),
    **dict.fromkeys(("grid", "static_grid"), ("frame", "directory", "notes", "longest", "outside")),
}  # fmt: skip


def planned_columns(state: Record, table: Table, scene: Scene, copies: ColumnCopies) -> Iterator[PlannedColumn]:
    """All arrays of bodies, then of pairs, contacts and impacts; ``copies``: the room for those of all columns."""
    yield from _fields(table)
    yield from _table(table)
    yield from _bodies(state.bodies, table.capacity, scene)
    for key, copy in copies.sizes():
        yield from _column(f"copy of {key}", "body", "going back", copy, len(copy), UNDO)
    for name, of, group, reason in RECORDS:
        record = getattr(state, name)
        for key, array in record.columns().items():
            rows = array.shape[1] if record.schema.fields[key].stacked else len(array)
            if rows > 2 and key not in NO_ROWS.get(name, ()):  # fewer: numbers of the whole record
                kind = "body at rest" if name == "solver" and key in SOLVER_BODIES else of
                yield from _column(key, kind, group, array, rows, reason)


def _column(name: str, of: str, group: str, array: np.ndarray, rows: int, reason: str) -> Iterator[PlannedColumn]:
    if array.nbytes and rows:
        yield PlannedColumn(name, of, group, array.nbytes // rows, reason)


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
                yield from _column(column.key, "body", component.__name__, array, table.capacity, reason)


def _table(table: Table) -> Iterator[PlannedColumn]:
    for key, reason in TABLE.items():
        if key not in table.arrays:
            continue
        yield from _column(key, "body", "the table", table.arrays[key], table.capacity, reason)
    for component in table.component_types:
        yield from _column(
            table.mask_name(component), "body", "the table", table.has_mask(component), table.capacity, MASKS
        )


def _bodies(bodies: Record, capacity: int, scene: Scene) -> Iterator[PlannedColumn]:
    for group, names, reason in GROUPS:
        for name in names:
            yield from _column(name, "body", group, getattr(bodies, name), capacity, reason)
    standing = bodies.static_position
    yield from _column("static_position", "static body", "collisions", standing, len(standing), STANDING)
    yield from _column("stretches", "body", "shapes", scene.stretches, capacity, NOT_ENCLOSING)
    yield from _column("level_not_enclosing", "body", "shapes", bodies.level_not_enclosing, capacity, NOT_ENCLOSING)
    for key, array in sorted(scene.rotated_columns.items()):
        yield from _column(f"{key}, rotated", "body", "rotation", array, capacity, ROTATED)

"""The arrays that a world's physics holds, and why: for ``world.plan()``. What is not allocated is not listed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ..framework.data.columns import REQUIRED
from ..framework.schedule.plan import PlannedColumn

if TYPE_CHECKING:
    from .state import PhysicsState

FIELDS = "what the game has set"
DEFAULTS = "at their defaults, there because handles and world.bodies write in place"
TABLE = {
    "entity": "who is in which row",
    "previous_position": "the start of the step: for drawing between steps, and for going back",
    "force": "the sum of forces",
    "inverse_mass": "0 for what cannot be moved",
}
MASKS = "which components it has"
FLIGHT = "velocity at the start of the step, for the path and for going back"
COLLISIONS = "some body has a collider: boxes, sizes, the path in the step"
CURVES = "the integrator's paths are curved"
SWEPT = "bodies are swept along their paths: how far blows may send them"
TURNED = "some body is turned, or a shape asks for its axes: these, and shapes as they are in the world"
LEVELS = "which shapes a body has, which it is asked for whether it has one or not"
SHAPED = "some body has a collider: its offset in the world, and the order of ids"
OUTGROWN = "some body has several colliders: whether the cheaper one still encloses the other"
UNDO = "copies for going back to the start of a step that fails"

FEW_BOXES = "few bodies, each tested with each"
BOXES = "more bodies than are tested pair by pair"
NOTHING = np.empty(0)

BOX_ARRAYS = ("_keys", "_order", "_cells", "_codes", "_directory", "_boxes")
PAIR_ARRAYS = (
    "pair_a", "pair_b", "_half_a", "_half_b", "responds", "involved", "hits", "hit_a", "hit_b", "pair_impulse",
    "pair_depth", "pair_parts", "pair_normal", "pair_point",
)  # fmt: skip
IMPACT_ARRAYS = ("events", "times", "keys", "values", "heap", "log_pair", "log_value")
CONTACT_ARRAYS = (
    "_first", "_second", "_slot", "_colours", "_light", "_before", "_normal", "_tangent", "_gap", "_mass", "_friction",
    "_extent", "_impulse", "_total", "_opening", "_pushing", "_in_block", "_worked", "_parting", "_active", "_soft",
    "_blocks",
)  # fmt: skip
BODY_ARRAYS = (
    "supported", "_held", "change", "_place", "_used", "_body_rows", "_last", "_velocity", "_moved", "_acceleration",
    "_inverse_mass",
)  # fmt: skip


def planned_columns(state: PhysicsState) -> Iterator[PlannedColumn]:
    """All arrays of bodies, then of pairs, contacts and impacts."""
    yield from _fields(state)
    yield from _table(state)
    yield from _scratch(state)
    for name, array in state.broad_phase.few().items():
        yield from _column(name, "body", "broad phase, pairwise", array, len(array), FEW_BOXES)
    for name in ("_grid", "_moving_tree", "_static_tree"):
        made = vars(state.broad_phase).get(name)
        if made is not None:
            group, rows = f"broad phase,{name.replace('_', ' ')}", len(made._keys)
            for array in BOX_ARRAYS:
                yield from _column(array[1:], "body", group, getattr(made, array, NOTHING), rows, BOXES)
    solver = state.contact_solver
    yield from _of("body", "contacts at rest", "bodies have come near each other", solver, BODY_ARRAYS)
    yield from _of("pair", "pairs", "bodies have come near each other", state, PAIR_ARRAYS)
    yield from _of("contact", "contacts at rest", "contacts have rested", solver, CONTACT_ARRAYS)
    yield from _of("impact", "impacts", "bodies have bounced", state.event_queue, IMPACT_ARRAYS)


def _column(name: str, of: str, group: str, array: np.ndarray, rows: int, reason: str) -> Iterator[PlannedColumn]:
    if array.nbytes and rows:
        yield PlannedColumn(name, of, group, array.nbytes // rows, reason)


def _fields(state: PhysicsState) -> Iterator[PlannedColumn]:
    """Of each component type, first those that hold something."""
    table = state.table
    for component in table.component_types:
        used, unused = [], []
        for column in component.columns.values():
            same = table.column(column.key) == column.empty_value(state.dimensions)
            default = same | (table.column(column.key) != table.column(column.key))  # nan is None
            has = table.has_mask(component)[: table.count]
            (used if column.default is REQUIRED or not default[has].all() else unused).append(column)
        for columns, reason in ((used, FIELDS), (unused, DEFAULTS)):
            for column in columns:
                array = table.arrays[column.key]
                yield from _column(column.key, "body", component.__name__, array, table.capacity, reason)


def _table(state: PhysicsState) -> Iterator[PlannedColumn]:
    table = state.table
    for key, reason in TABLE.items():
        yield from _column(key, "body", "the table", table.arrays[key], table.capacity, reason)
    for component in table.component_types:
        yield from _column(
            table.mask_name(component), "body", "the table", table.has_mask(component), table.capacity, MASKS
        )


def _scratch(state: PhysicsState) -> Iterator[PlannedColumn]:
    capacity, scratch = state.table.capacity, state.scratch
    groups = (("the step", state.FLIGHT, FLIGHT), ("collisions", state.COLLISIONS, COLLISIONS))
    late = (("curved paths", state.CURVES, CURVES), ("swept bodies", state.SWEEPS, SWEPT))
    for group, specs, reason in (*groups, *late):
        for key, _, _ in specs:
            yield from _column(key, "body", group, scratch[key], capacity, reason)
    known = {key for key, _, _ in (*state.FLIGHT, *state.COLLISIONS, *state.CURVES, *state.SWEEPS)}
    known |= {"shape", "offset"}
    for key in sorted(scratch.keys() - known):
        yield from _column(f"{key}, turned", "body", "rotation", scratch[key], capacity, TURNED)
    yield from _column("axes", "body", "rotation", state.axes, capacity, TURNED)
    yield from _column("levels", "body", "shapes", state.levels, capacity, LEVELS)
    yield from _column("level_offsets", "body", "shapes", state.level_offsets, capacity, SHAPED)
    yield from _column("rank", "body", "shapes", state.rank, len(state.rank), SHAPED)
    for key, array in (("outgrown", state.outgrown), ("stretches", state.stretches)):
        yield from _column(key, "body", "shapes", array, max(len(array), 1), OUTGROWN)
    for key, copy in state.table.undo_buffers():
        yield from _column(f"copy of {key}", "body", "going back", copy, len(copy), UNDO)


def _of(of: str, group: str, reason: str, holder: Any, names: Iterable[str]) -> Iterator[PlannedColumn]:
    for name in names:
        array = getattr(holder, name, NOTHING)
        yield from _column(name.lstrip("_"), of, group, array, len(array), reason)

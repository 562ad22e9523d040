"""Copies of a world's state, and a hash to compare by."""

from __future__ import annotations

import copy
import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..schedule.clock import Clock
from .services import PhysicsServices


@dataclass
class StepState:
    """A copy of what a step may change: columns, clock, contacts, which pairs touch; entities: ids by row."""

    entities: np.ndarray
    columns: dict[str, np.ndarray]
    clock: tuple[float, ...]
    contacts: Any
    tracking: Any
    arrays: Any  # keeps those that columns have numbers of


def snapshot(physics: PhysicsServices, clock: Clock) -> StepState:
    """A copy that shares nothing with the world."""
    columns = physics.table.copy_columns()
    contacts, tracking = copy.deepcopy((physics.contacts.state(), physics.tracking_state()))
    arrays = physics.table.held_arrays()
    return StepState(columns.pop("entity"), columns, clock.state(), contacts, tracking, arrays)


def restore(state: StepState, physics: PhysicsServices, clock: Clock) -> None:
    """Make the world what it was; ValueError if bodies or their components have come or gone since.

    The settings stay as they are now, dt too.
    """
    table = physics.table
    rows = table.rows_of(state.entities)
    if len(state.entities) != table.count or (rows < 0).any():
        raise ValueError("this snapshot holds other bodies than the world has now: some were created or deleted since")
    for component in table.component_types:
        mask = table.has_mask(component)[rows]
        was = state.columns.get(table.mask_name(component), np.zeros(len(rows), bool))
        if not np.array_equal(mask, was):
            entity = int(state.entities[np.flatnonzero(mask != was)[0]])
            raise ValueError(f"entity {entity}: {component.__name__} was added or removed since this snapshot")
    for key, column in state.columns.items():
        table.make(key)[rows] = column
    table.reset(table.on_demand.keys() - state.columns.keys())
    table.set_kinds(rows, state.columns["kind"])
    table.static_version += 1
    table.frames_applied = True
    dt = clock.dt
    clock.restore(state.clock)
    clock.set_dt(dt)
    physics.restore_tracking(copy.deepcopy(state.tracking))
    physics.contacts.restore_state(copy.deepcopy(state.contacts))
    physics.queries.forget()


def state_hash(physics: PhysicsServices) -> str:
    """Of all values of all bodies' components, in order of the entity ids; 0.0 and -0.0 are the same."""
    table = physics.table
    order = np.argsort(table.column("entity"), kind="stable")
    digest = hashlib.sha256(table.column("entity")[order].tobytes())
    present = [c for c in table.component_types if table.has_mask(c)[: table.count].any()]
    for component in sorted(present, key=table.mask_name):
        mask = table.mask_name(component)
        columns = {column.key: column.hashable(table.column(column.key)) for column in component.columns.values()}
        for key, values in {mask: table.column(mask), **columns}.items():
            digest.update(key.encode())
            digest.update(np.ascontiguousarray(values[order] + 0).tobytes())
    return digest.hexdigest()

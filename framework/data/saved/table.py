"""The rows of a table as snapshots hold them, and going back to them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ..arrays.column import ArrayColumn
from ..arrays.pool import Held
from ..columns import Column
from ..component import Component
from ..table import HAS_OBJECTS, Table


@dataclass
class SavedTable:
    """Copies of the columns of all bodies.

    types
        the component types that have columns
    columns
        by key: those that have an array; "entity" has the ids
    blocks, frame
        as the table has them
    held
        keeps the arrays that columns have numbers of
    """

    types: list[type[Component]]
    columns: dict[str, np.ndarray]
    blocks: tuple[int, ...]
    frame: int
    held: list[Held]

    @classmethod
    def of(cls, table: Table) -> SavedTable:
        keep_freed_memory()
        count = table.count
        columns = {key: array[:count].copy() for key, array in table.arrays.items()}
        return cls(list(table.component_types), columns, table.blocks, table.frame, [table.held_arrays()])

    def types_of(self, entity: int) -> list[type[Component]]:
        """The types of the components of that body; none if it is no body."""
        rows = np.flatnonzero(self.columns["entity"] == entity)
        masks = {c: self.columns.get(Table.mask_name(c)) for c in self.types} if len(rows) else {}
        return [component for component, mask in masks.items() if mask is not None and mask[rows[0]]]

    def put_back(self, table: Table) -> bool:
        """Make the table what it was; True if bodies have other rows, or other components, than it had.

        The table must know all these component types and have arrays for these columns.
        """
        columns, count = self.columns, len(self.columns["entity"])
        same_rows = table.blocks == self.blocks and np.array_equal(table.column("entity"), columns["entity"])
        same_members = same_rows and all(
            np.array_equal(table.column(name), columns.get(name, np.zeros(count, bool)))
            for name in map(table.mask_name, table.component_types)
        )
        same_statics = same_members and all(
            np.array_equal(table.arrays[key][table.stops[1] : count], column[table.stops[1] :])
            for key, column in columns.items()
            if key != HAS_OBJECTS
        )
        same_arrays = same_members and all(
            np.array_equal(table.column(key), columns[key]) for key in array_columns(self.types) if key in columns
        )
        if not same_rows:
            table.resize(self.blocks)
        for key, column in columns.items():
            table.arrays[key][:count] = column
        for key in table.column_keys() - columns.keys():
            if key in table.arrays:
                table.arrays[key][:count] = table.default_of(key)
        table.kind_changed = False
        table.members_version += not same_arrays  # their pool may have moved
        table.static_version += not same_statics
        table.frame, table.frames_applied = self.frame, True
        return not same_members

    # -- for another process ----------------------------------------------------------------------

    def __getstate__(self) -> dict[str, Any]:
        """Numbers of arrays mean nothing in another process: the arrays themselves instead."""
        return {**vars(self), "columns": with_arrays(self.columns, self.types), "held": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.columns, self.held = with_numbers(self.columns, self.types)


@cache
def keep_freed_memory() -> None:
    """Have malloc keep memory that is freed, up to some tens of MB, for the next snapshot.

    glibc gives it back to the system at once, and fetching it again takes ten times as long as filling it: unless a
    block has been freed that was larger. This one is never written to, so it takes no memory.
    """
    np.empty(16 * 2**20, np.uint8)


def array_columns(types: list[type[Component]]) -> dict[str, ArrayColumn]:
    """Those fields of these components whose value is an array, by key."""
    columns: list[Column] = [column for component in types for column in component.columns.values()]
    return {column.key: column for column in columns if isinstance(column, ArrayColumn)}


def numbers_of(columns: dict[str, np.ndarray], types: list[type[Component]]) -> Held:
    """Keeps the arrays that these columns have numbers of."""
    return Held({column.pool: columns[key] for key, column in array_columns(types).items() if key in columns})


def with_arrays(columns: dict[str, np.ndarray], types: list[type[Component]]) -> dict[str, Any]:
    """Columns as they mean the same in every process; a column of arrays becomes the different ones of them, and which
    of these each row has.
    """
    portable: dict[str, Any] = dict(columns)
    for key, column in array_columns(types).items():
        if key in columns:
            numbers, which = np.unique(columns[key], return_inverse=True)
            portable[key] = [column.pool.array(number) for number in numbers.tolist()], which
    return portable


def with_numbers(columns: dict[str, Any], types: list[type[Component]]) -> tuple[dict[str, np.ndarray], list[Held]]:
    """Such columns as a table has them, and what keeps their arrays."""
    own, held = dict(columns), []
    for key, column in array_columns(types).items():
        if key in own:
            arrays, which = own[key]
            with column.pool.kept():
                numbers = np.array([column.pool.number_of(array) for array in arrays], np.int64)
                held.append(Held({column.pool: numbers}))
            own[key] = numbers[which]
    return own, held

"""What code of the game may write in place, and that wakes what sleeps: columns that were lent, and what they held."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...components import RigidBody, Transform
from ...framework.data.table import Table
from ..scene import Scene

OF_BODIES = (
    *(RigidBody.columns[name].key for name in ("linear_velocity", "mass", "kind", "gravity_scale", "constant_force")),
    *(Transform.columns[name].key for name in ("position", "rotation")),
)
MOVABLE, STATIC = range(2)


class ExposedColumns:
    """Copies of the rows that are still; of columns that were never lent there are none: they change in no such way."""

    def __init__(self, table: Table, scene: Scene) -> None:
        self._table, self._scene = table, scene
        self._rows = [np.empty(0, np.int64)] * 2  # of what may move, and of static bodies
        self._ids = list(self._rows)
        self._places: list[Any] = list(self._rows)  # the same, as slices where rows are next to each other
        self._version = -1  # of the rows
        self._copies: dict[tuple[str, int], np.ndarray] = {}

    def take(self, rows: np.ndarray) -> None:
        """Ascending rows: all that is still."""
        table = self._table
        self._rows = np.split(rows, [int(rows.searchsorted(table.stops[1]))])
        self._ids = [table.column("entity")[each] for each in self._rows]
        self._version, self._copies = -1, {}
        for key in table.exposed if len(rows) else ():
            self.add(key)

    def add(self, key: str) -> None:
        """A column is lent, perhaps its static rows too."""
        for group in (MOVABLE, STATIC) if self._table.exposed[key] else (MOVABLE,):
            if len(self._ids[group]) and (key, group) not in self._copies and key in self._watched():
                self._copies[key, group] = self._table.values(key, self._rows_now()[group])

    def replace(self, key: str, row: int) -> None:
        """A row that is known to have changed."""
        for group, rows in enumerate(self._rows_now()):
            if (key, group) in self._copies:
                self._copies[key, group][rows == row] = self._table.column(key)[row]

    def changed(self) -> np.ndarray:
        """Rows that hold other bits in some column."""
        found = [self._ids[MOVABLE][:0]]
        if not self._copies:
            return found[0]
        for (key, group), copy in self._copies.items():
            rows, bits = self._rows_now()[group], f"i{copy.itemsize}"
            if (rows < 0).all():  # all of them are gone
                continue
            now = self._table.column(key)[self._places[group]].view(bits)
            if not np.array_equal(now, copy.view(bits)):
                other = (now != copy.view(bits)).reshape(len(rows), -1).any(axis=1)
                found.append(rows[other & (rows >= 0)])
        return np.concatenate(found)

    def _rows_now(self) -> list[np.ndarray]:
        if self._version != self._table.version:
            self._rows, self._version = [self._table.rows_of(ids) for ids in self._ids], self._table.version
            self._places = [_slice_of(rows) for rows in self._rows]
        return self._rows

    def _watched(self) -> set[str]:
        linked = self._scene.linked
        shapes = linked.shapes if linked is not None else ()
        read = self._scene.read_by_plugins
        return {*OF_BODIES, *read, *(column.key for shape in shapes for column in shape.component.columns.values())}


def _slice_of(rows: np.ndarray) -> Any:
    """These rows, as a slice if they are next to each other."""
    if len(rows) and rows[0] >= 0 and (np.diff(rows) == 1).all():
        return slice(int(rows[0]), int(rows[-1]) + 1)
    return rows

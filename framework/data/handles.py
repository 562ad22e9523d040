"""Values of handles on their way into a table and out of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from .columns import Column
from .component import Component, RowStore
from .table import Table


class Sources:
    """Where the values of some handles of one type are: with the handle itself, or in rows of stores."""

    def __init__(self, component: type[Component], handles: list[Component]) -> None:
        self._component, self._count = component, len(handles)
        self._loose: list[int] = []  # indices of handles that hold their values themselves
        self._values: list[dict[str, Any]] = []
        store = handles[0]._store
        if store is not None and all(handle._store is store for handle in handles):  # made in bulk, all of them
            self._groups = [(store, np.arange(self._count), np.array([handle._row for handle in handles]))]
            return
        groups: dict[int, tuple[RowStore, list[int], list[int]]] = {}
        for index, handle in enumerate(handles):
            store = handle._store
            if store is None:
                self._loose.append(index)
                self._values.append(handle._values)
                continue
            group = groups.get(id(store))
            if group is None:
                group = groups[id(store)] = (store, [], [])
            group[1].append(index)
            group[2].append(handle._row)
        self._groups = [(store, np.array(indices), np.array(rows)) for store, indices, rows in groups.values()]

    def values(self, column: Column, dimensions: int) -> np.ndarray:
        """(n, ...) of that column, one per handle."""
        result = np.empty((self._count, *column.item_shape(dimensions)), column.dtype)
        if self._loose:
            values = [values[column.name] for values in self._values]
            result[self._loose] = values if result.ndim == 1 else _vectors(values, column, dimensions)
        for store, indices, rows in self._groups:
            result[indices] = store.values(column.key, rows)
        return result

    def write(self, table: Table, rows: np.ndarray) -> None:
        """Write all values into these rows of a table, one row per handle."""
        columns = self._component.columns.values()
        for index, values in zip(self._loose, self._values, strict=True):
            row = int(rows[index])
            for column in columns:
                table.write_one(column.key, row, values[column.name])
        for store, indices, source in self._groups:
            for column in columns:
                table.write(column.key, rows[indices], store.values(column.key, source))


def _vectors(values: list[Any], column: Column, dimensions: int) -> np.ndarray:
    """Rows from values of which some may be a single number that stands for all (0: no rotation)."""
    width = column.item_shape(dimensions)[0]
    whole = column.empty_value(dimensions) if column.item == "rotation" else None

    def row(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return value
        return whole if whole is not None else (value,) * width

    rows = [row(value) for value in values]
    return np.array(rows, column.dtype).reshape(len(rows), width)

"""Values of handles on their way into a table and out of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from .columns import Column
from .component import Component, RowStore
from .table import Table


class Sources:
    """Where the values of some handles of one type are: with the handle itself, or in rows of stores."""

    def __init__(self, handles: list[Component]) -> None:
        self._count = len(handles)
        self._loose: list[int] = []  # indices of handles that hold their values themselves
        self._values: list[dict[str, Any]] = []
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


def write_handles(
    table: Table, component: type[Component], handles: list[Component], rows: list[int], fresh: bool
) -> None:
    """Write the values of handles into these rows of a table; fresh: the rows hold the defaults."""
    defaults, arrays, fields = table.defaults, table.arrays, component.fields
    groups: dict[int, tuple[RowStore, list[int], list[int]]] = {}
    for handle, row in zip(handles, rows, strict=True):
        store = handle._store
        if store is not None:
            group = groups.setdefault(id(store), (store, [], []))
            group[1].append(row)
            group[2].append(handle._row)
            continue
        values = handle._values
        for name, key in fields:
            value = values[name]
            if value is defaults[key] and fresh:
                continue
            kind = type(value)
            if key in arrays and (kind is np.ndarray or type(defaults[key]) is kind):
                arrays[key][row] = value
            else:
                table.write_one(key, row, value)
    for store, targets, sources in groups.values():
        for _, key in fields:
            table.write(key, np.array(targets), store.values(key, np.array(sources)))


def bind_handles(table: Table, entities: list[int], handles: list[Component]) -> None:
    """Let each handle read and write the row that the table has for its entity."""
    for entity, handle in zip(entities, handles, strict=True):  # as ``_bind``, without a call for each
        handle._store = table
        handle._entity = entity
        handle._version = -1
        handle._values = None


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

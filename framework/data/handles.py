"""Values of handles on their way into a table and out of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .columns import Column
from .component import Component
from .table import Table


def stored(handle: Component) -> Mapping[str, Any]:
    """A handle's values by field, as they are stored; a single number may stand for a vector."""
    store = handle._store
    if store is None:
        return handle._values  # type: ignore[return-value]
    row = handle._row if handle._version == store.version else handle._locate()
    return {name: store.values(column.key, row) for name, column in handle.columns.items()}


def as_column(values: list[Any], column: Column, dimensions: int) -> np.ndarray:
    """(n, ...) such values of one field."""
    shape = column.item_shape(dimensions)
    if shape and not all(type(value) is np.ndarray for value in values):
        values = [v if isinstance(v, np.ndarray) and v.shape else column.whole(float(v), dimensions) for v in values]
    return np.array(values, column.dtype).reshape(len(values), *shape)


def write_handles(
    table: Table, component: type[Component], handles: list[Component], rows: list[int], fresh: bool
) -> None:
    """Write the values of handles into these rows of a table; fresh: the rows hold the defaults."""
    defaults = table.defaults
    sources = [stored(handle) for handle in handles]
    if len(sources) == 1:
        row, values = rows[0], sources[0]
        for name, key in component.fields:
            value = values[name]
            if value is not defaults[key] or not fresh:
                table.write_one(key, row, value)
        return
    at = np.array(rows)
    for name, key in component.fields:
        given = [values[name] for values in sources]
        if not fresh or set(map(id, given)) != {id(defaults[key])}:
            table.write(key, at, as_column(given, component.columns[name], table.dimensions))


def bind_handles(table: Table, entities: list[int], handles: list[Component]) -> None:
    """Let each handle read and write the row that the table has for its entity."""
    for entity, handle in zip(entities, handles, strict=True):  # as ``_bind``, without a call for each
        handle._store = table
        handle._entity = entity
        handle._version = -1
        handle._values = None

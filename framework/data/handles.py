"""Values of handles on their way into a table and out of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .columns import Column
from .component import Component
from .table import Table

Contained = Mapping[type[Any], Any]  # the components of an entity


def stored(handle: Component, default: bool = True) -> Mapping[str, Any]:
    """A handle's values by field, as they are stored; a single number may stand for a vector.

    default: also those that a handle without a row has not been given.
    """
    store = handle._store
    if store is None:
        return {**handle._defaults, **handle._values} if default else handle._values  # type: ignore[dict-item]
    row = handle._row if handle._version == store.version else handle._locate()
    return {name: store.values(column.key, row) for name, column in handle.columns.items()}


def as_column(values: Sequence[Any], column: Column, dimensions: int) -> np.ndarray:
    """(n, ...) such values of one field."""
    shape = column.item_shape(dimensions)
    if not shape:
        return np.array(values, column.dtype)
    if set(map(type, values)) != {np.ndarray}:
        values = [v if isinstance(v, np.ndarray) and v.shape else column.whole(float(v), dimensions) for v in values]
    return np.concatenate(values).reshape(len(values), *shape)


def write_handles(
    table: Table, component: type[Component], contents: list[Contained], rows: list[int], fresh: bool
) -> None:
    """Write the values of handles into these rows of a table; fresh: the rows hold the defaults.

    contents: for each row the components of its entity, by type.
    """
    columns = component.columns
    if len(rows) == 1:
        for name, value in stored(contents[0][component], not fresh).items():
            table.write_one(columns[name].key, rows[0], value)
        return
    sources = [stored(now[component], not fresh) for now in contents]
    at, names = np.array(rows), set().union(*sources)
    for name, column in columns.items():
        if name in names:
            given = [values.get(name, column.stored_default) for values in sources]
            table.write(column.key, at, as_column(given, column, table.dimensions))


def bind_handles(table: Table, entities: list[int], handles: list[Component]) -> None:
    """Let each handle read and write the row that the table has for its entity."""
    for entity, handle in zip(entities, handles, strict=True):  # as ``_bind``, without a call for each
        handle._store = table
        handle._entity = entity
        handle._version = -1
        handle._values = handle._saved = None

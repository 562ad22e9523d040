"""Parameter records: one per shape, with the columns that its functions see as ``shape.radius`` and the like.

Their fields are ``column_<name>`` for each column; an array column also has ``data_<name>`` and ``starts_<name>``, the
pool. Shapes that rotate have ``axes``; ``matrices`` are the same numbers, d rows per body. ``support``, ``rounding``
and ``edge`` come first in every record: what takes any convex shape reads them without knowing which.
"""

from __future__ import annotations

import collections
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from ....framework.compilation import pasted
from ....framework.data.arrays.column import ArrayColumn
from ....framework.jit.linking import CACHE_SIZE
from ....framework.jit.records.record import Record, make_record
from ....framework.jit.records.record_type import rows_of
from ....framework.jit.records.schema import Column, Schema, axes, floats, integer, table, vectors
from ....framework.plugins.registry import Shape

# What every parameter record begins with: addresses; 0 until some function calls by them, and of what a shape has not.
HEADER_FIELDS = {"support": integer(), "rounding": integer(), "edge": integer()}
HEADER = Schema("ShapeHeader", **HEADER_FIELDS)


@pasted
def array_of(numbers, data, starts, i):
    """The array of row i of an array column."""
    number = numbers[i]
    return rows_of(data, starts[number], starts[number + 1])


@lru_cache(maxsize=CACHE_SIZE)
def parameter_schema(shape: Shape) -> Schema:
    """The schema of the shape's parameter record."""
    fields: dict[str, Any] = dict(HEADER_FIELDS)
    for name in shape.columns:
        column = shape.component.columns[name]
        fields[f"column_{name}"] = _field(column)
        if isinstance(column, ArrayColumn):
            fields[f"data_{name}"] = table("float64", column.width)
            fields[f"starts_{name}"] = Column("int64")
    if shape.rotates:
        fields["axes"] = axes()
    if shape.turned is not None:
        fields["matrices"] = table("float64", 1, per_dimension=True)
    return Schema(f"{shape.component.__name__}Parameters", **fields)


def _field(column: Any) -> Column:
    if column.item == "vector":
        return vectors()
    if column.item == "rotation":
        raise TypeError(f"{column.owner}.{column.name}: rotation is a field of Transform; shapes get axes")
    return floats() if np.dtype(column.dtype) == np.float64 else Column(np.dtype(column.dtype).name)


@lru_cache(maxsize=CACHE_SIZE)
def parameter_tuple(shape: Shape) -> Any:
    """The named tuple that the shape's functions get."""
    return collections.namedtuple(shape.component.__name__, shape.parameters)


def parameters_source(shape: Shape, record: str, row: str, kind: str, axes: str = "") -> str:
    """Source of that tuple, of class ``kind``, for a row of the shape's record, turned like its body or along these
    ``axes``; uses ``array_of``."""
    parts = []
    for name in shape.columns:
        if isinstance(shape.component.columns[name], ArrayColumn):
            columns = ", ".join(f"{record}.{part}_{name}" for part in ("column", "data", "starts"))
            parts.append(f"array_of({columns}, {row})")
        else:
            parts.append(f"{record}.column_{name}[{row}]")
    if shape.rotates:
        parts.append(axes or f"{record}.axes[{row}]")
    return f"{kind}({', '.join(parts)})"


def make_parameter_record(shape: Shape, dimensions: int) -> Record:
    """An empty record of the shape's parameters; :func:`bind` gives it columns."""
    return make_record(parameter_schema(shape), dimensions)


def bind(record: Record, shape: Shape, columns: Mapping[str, np.ndarray], axes: np.ndarray | None = None) -> None:
    """Let the record show these columns, by name; ``axes`` (n, d, d): rotation matrices of the bodies."""
    for name in shape.columns:
        record.show(f"column_{name}", columns[name])
        column = shape.component.columns[name]
        if isinstance(column, ArrayColumn):
            show_pool(record, name, column)
    if axes is not None and shape.rotates:
        record.axes = axes
    if axes is not None and shape.turned is not None:
        record.matrices = axes.reshape(-1, axes.shape[-1])


def show_pool(record: Record, name: str, column: ArrayColumn) -> None:
    """Let the record show where the arrays of that column stand, again whenever one of the two is another array."""
    record.show(f"data_{name}", column.pool.data)
    record.show(f"starts_{name}", column.pool.all_starts)

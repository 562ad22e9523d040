"""The Python side of a record: it owns the arrays and the memory in which compiled code finds them."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ..lazy import JIT
from .plain_view import remember
from .schema import WORD, Column, Schema


class Record:
    """One record; its fields are attributes.

    Columns are numpy arrays: another one of the same kind may be assigned, which compiled code sees from its next call
    on. Scalars are read and written in place. ``address`` is what kernels get. Made by :func:`make_record`.
    """

    __slots__ = ("__weakref__", "_arrays", "_floats", "_records", "_words", "address")

    schema: Schema
    dimensions: int

    if TYPE_CHECKING:  # fields are properties of the classes made below

        def __setattr__(self, name: str, value: Any) -> None: ...

    def __init__(self) -> None:
        self._words = np.zeros(max(self.schema.size // WORD, 1), np.int64)
        self._floats = self._words.view(np.float64)
        self.address: int = self._words.ctypes.data
        if not JIT:
            remember(self.address, self)
        self._arrays: dict[str, np.ndarray] = {}
        self._records: dict[str, Record] = {}
        for name, field in self.schema.fields.items():
            if isinstance(field, Column):
                shape = (0, 0) if field.stacked else (0,)
                setattr(self, name, np.empty((*shape, *field.item_shape(self.dimensions)), field.dtype))
            elif isinstance(field, Schema):
                setattr(self, name, make_record(field, self.dimensions))

    def __getattr__(self, name: str) -> Any:  # for type checkers: fields are properties of the classes made below
        raise AttributeError(f"record {self.schema.name} has no field {name!r}")

    def reserve(self, rows: int, *names: str, keep: int = 0) -> None:
        """Give these columns room for at least ``rows`` rows; the first ``keep`` rows stay."""
        for name in names:
            before = self._arrays[name]
            if len(before) < rows:
                after = self.schema.fields[name].empty(rows, self.dimensions)  # type: ignore[union-attr]
                after[:keep] = before[:keep]
                setattr(self, name, after)

    def show(self, name: str, array: np.ndarray) -> None:
        """Assign a column, unless it is that very array already."""
        if self._arrays[name] is not array:
            setattr(self, name, array)

    def columns(self) -> dict[str, np.ndarray]:
        """The arrays by name."""
        return dict(self._arrays)

    def word_of(self, name: str) -> int:
        """The place of a scalar in :attr:`words`."""
        return self.schema.layout[name] // WORD

    @property
    def words(self) -> memoryview:
        """The memory as integers, for reading scalars in a hurry: faster than an array."""
        return memoryview(self._words)  # type: ignore[arg-type]


@cache
def _record_class(schema: Schema, dimensions: int) -> type[Record]:
    body: dict[str, Any] = {"__slots__": (), "schema": schema, "dimensions": dimensions}
    for name, field in schema.fields.items():
        at = schema.layout[name] // WORD
        if isinstance(field, Schema):
            body[name] = _inner(name, at)
        elif isinstance(field, Column):
            body[name] = _column(schema.name, name, field, at, dimensions)
        else:
            body[name] = _scalar(field.dtype, at)
    return type(schema.name, (Record,), body)


def make_record(schema: Schema, dimensions: int) -> Record:
    """A record with empty columns, its scalars 0; records inside it are made too."""
    return _record_class(schema, dimensions)()


def _scalar(dtype: str, at: int) -> property:
    if dtype == "float64":
        return property(lambda self: self._floats.item(at), lambda self, value: self._floats.__setitem__(at, value))
    if dtype == "bool":
        return property(lambda self: self._words[at] != 0, lambda self, value: self._words.__setitem__(at, bool(value)))
    return property(lambda self: self._words.item(at), lambda self, value: self._words.__setitem__(at, value))


def _inner(name: str, at: int) -> property:
    def put(self: Record, record: Record) -> None:
        self._records[name] = record
        self._words[at] = record.address

    return property(lambda self: self._records[name], put)


def _column(record: str, name: str, field: Column, at: int, dimensions: int) -> property:
    dtype, item = np.dtype(field.dtype), field.item_shape(dimensions)
    leading = 2 if field.stacked else 1

    def put(self: Record, array: np.ndarray) -> None:
        if array.dtype != dtype or array.shape[leading:] != item or array.ndim != leading + len(item):
            raise ValueError(f"{record}.{name} takes arrays of {dtype} (..., {item}), got {array.dtype} {array.shape}")
        if not array.flags.c_contiguous:
            raise ValueError(f"{record}.{name} takes contiguous arrays")
        self._arrays[name] = array
        self._words[at] = array.ctypes.data
        self._words[at + 1] = array.shape[leading - 1]

    return property(lambda self: self._arrays[name], put)

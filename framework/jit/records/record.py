"""The Python side of a record: it owns the arrays and the memory in which compiled code finds them."""

from __future__ import annotations

from functools import cache
from operator import attrgetter
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

    __slots__ = ("__weakref__", "_floats", "_words", "address")

    schema: Schema
    dimensions: int
    columns_at_first: list[tuple[str, tuple[int, ...], np.dtype]]  # where each is held, its shape and kind
    inner: list[tuple[str, Schema]]

    if TYPE_CHECKING:  # fields are properties of the classes made below

        def __setattr__(self, name: str, value: Any) -> None: ...

    def __init__(self) -> None:
        self._words = np.zeros(max(self.schema.size // WORD, 1), np.int64)
        self._floats = self._words.view(np.float64)
        self.address: int = self._words.ctypes.data
        if not JIT:
            remember(self.address, self)
        for slot, shape, dtype in self.columns_at_first:  # of no rows: nobody asks where they are
            setattr(self, slot, np.empty(shape, dtype))
        for name, inner in self.inner:
            setattr(self, name, make_record(inner, self.dimensions))

    def __getattr__(self, name: str) -> Any:  # for type checkers: fields are properties of the classes made below
        raise AttributeError(f"record {self.schema.name} has no field {name!r}")

    def rows_of(self, name: str) -> int:
        """How many rows a column has; each of them, if it is stacked."""
        return getattr(self, name).shape[self.schema.fields[name].rows_axis]

    def reserve(self, rows: int, *names: str) -> None:
        """Give these columns room for at least ``rows`` rows; what they hold stays."""
        for name in names:
            before, field, length = getattr(self, name), self.schema.fields[name], self.rows_of(name)
            if length < rows:
                stacks = before.shape[: field.rows_axis]
                after = field.fresh((*stacks, rows), self.dimensions)
                after[(*map(slice, stacks), slice(length))] = before
                setattr(self, name, after)

    def show(self, name: str, array: np.ndarray) -> None:
        """Assign a column, unless it is that very array already."""
        if getattr(self, name) is not array:
            setattr(self, name, array)

    def columns(self) -> dict[str, np.ndarray]:
        """The arrays by name."""
        return {name: getattr(self, name) for name, field in self.schema.fields.items() if isinstance(field, Column)}

    def word_of(self, name: str) -> int:
        """The place of a scalar in :attr:`words`."""
        return self.schema.layout[name] // WORD

    @property
    def words(self) -> memoryview:
        """The memory as integers, for reading scalars in a hurry: faster than an array."""
        return memoryview(self._words)  # type: ignore[arg-type]


@cache
def _record_class(schema: Schema, dimensions: int) -> type[Record]:
    held = tuple(_slot(name) for name, field in schema.fields.items() if isinstance(field, (Column, Schema)))
    body: dict[str, Any] = {"__slots__": held, "schema": schema, "dimensions": dimensions}
    body["inner"] = [(name, field) for name, field in schema.fields.items() if isinstance(field, Schema)]
    body["columns_at_first"] = [
        (
            _slot(name), (*(field.numbers(dimensions) if field.apart else 0, 0)[-1 - field.rows_axis :],
            *field.item_shape(dimensions)), np.dtype(field.dtype),
        )
        for name, field in schema.fields.items() if isinstance(field, Column)
    ]  # fmt: skip
    for name, field in schema.fields.items():
        at = schema.layout[name] // WORD
        if isinstance(field, Schema):
            body[name] = _inner(name, at)
        elif isinstance(field, Column):
            body[name] = _column(schema, name, field, at, dimensions)
        else:
            body[name] = _scalar(field.dtype, at)
    return type(schema.name, (Record,), body)


def make_record(schema: Schema, dimensions: int) -> Record:
    """A record with empty columns, its scalars 0; records inside it are made too."""
    return _record_class(schema, dimensions)()


def _scalar(dtype: str, at: int) -> property:
    def put(self: Record, value: Any) -> None:
        self._words[at] = value

    def put_float(self: Record, value: float) -> None:
        self._floats[at] = value

    def put_bool(self: Record, value: Any) -> None:
        self._words[at] = bool(value)

    if dtype == "float64":
        return property(lambda self: self._floats.item(at), put_float)
    if dtype == "bool":
        return property(lambda self: self._words.item(at) != 0, put_bool)
    return property(lambda self: self._words.item(at), put)


def _slot(name: str) -> str:
    """The attribute that holds a column or a record inside: read without a call of Python."""
    return f"held_{name}"


def _inner(name: str, at: int) -> property:
    slot = _slot(name)

    def put(self: Record, record: Record) -> None:
        setattr(self, slot, record)
        self._words[at] = record.address

    return property(attrgetter(slot), put)


def _column(schema: Schema, name: str, field: Column, at: int, dimensions: int) -> property:
    record, dtype, item = schema.name, np.dtype(field.dtype), field.item_shape(dimensions)
    leading, slot = 1 + field.rows_axis, _slot(name)

    def put(self: Record, array: np.ndarray) -> None:
        if array.dtype != dtype or array.shape[leading:] != item or array.ndim != leading + len(item):
            raise ValueError(f"{record}.{name} takes arrays of {dtype} (..., {item}), got {array.dtype} {array.shape}")
        if not array.flags.c_contiguous:
            raise ValueError(f"{record}.{name} takes contiguous arrays")
        if schema.unshared and array.base is not None:
            raise ValueError(f"{record}.{name} takes arrays that own their memory")
        setattr(self, slot, array)
        self._words[at] = array.ctypes.data
        self._words[at + 1] = array.shape[leading - 1]

    return property(attrgetter(slot), put)

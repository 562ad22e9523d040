"""Records as kernels see them with the JIT off (``NUMBA_DISABLE_JIT=1``): the same source runs as plain Python."""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np

_records: weakref.WeakValueDictionary[int, Any] = weakref.WeakValueDictionary()  # by address


def remember(address: int, record: Any) -> None:
    """Let kernels find a record by its address."""
    _records[address] = record


def plain_view_at(address: int) -> PlainView:
    """The record at that address."""
    return PlainView(_records[int(address)])


class PlainView:
    """A record whose vectors are tuples."""

    __slots__ = ("_record",)

    def __init__(self, record: Any) -> None:
        object.__setattr__(self, "_record", record)

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._record, name)
        if isinstance(value, np.ndarray):
            return PlainColumn(value, self._record.schema.fields[name])
        return PlainView(value) if hasattr(value, "schema") else value

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._record, name, value)

    @property
    def dimensions(self) -> int:
        return self._record.dimensions


class PlainColumn:
    """A column whose items are numbers and tuples; an index outside of it raises IndexError, also a negative one."""

    __slots__ = ("_field", "array")

    def __init__(self, array: np.ndarray, field: Any) -> None:
        self.array, self._field = array, field

    def __len__(self) -> int:
        return self.array.shape[self._field.rows_axis]

    def _checked(self, index: Any) -> Any:
        parts = index if isinstance(index, tuple) else (index,)
        if any(part < 0 for part in parts):
            raise IndexError(f"index {index} outside of a column of {len(self)} rows")
        return index

    def _place(self, index: Any) -> Any:
        """Where an item is in the array."""
        return (slice(None), self._checked(index)) if self._field.apart else self._checked(index)

    def __getitem__(self, index: Any) -> Any:
        if not len(self) and self._field.default is not None:
            return self._default()
        item = self.array[self._place(index)]
        if not isinstance(item, np.ndarray):
            return item
        if self._field.item == "axes":
            return tuple(tuple(item[:, j]) for j in range(len(item)))
        return (*item, *(0.0,) * (self._field.item == "vector" and 2 - len(item)))

    def _default(self) -> Any:
        """What every row of a column on demand reads as while it has none."""
        number = self.array.dtype.type(self._field.default)
        return (number,) * self.array.shape[-1] if self._field.item == "vector" else number

    def __setitem__(self, index: Any, value: Any) -> None:
        if self._field.flat < 2 and self.array.ndim > self._field.stacked:
            value = value[: self.array.shape[0 if self._field.apart else -1]]
        self.array[self._place(index)] = value

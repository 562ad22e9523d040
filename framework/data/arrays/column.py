"""Columns whose value is an array of any length: the corners of a polygon, the cells of a map.

A table holds a number per row, the arrays themselves stand in a pool that all worlds share: equal arrays once, never
changed. A snapshot stays a copy of the numbers, and a prefab of a thousand polygons costs one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..columns import Column
from .pool import Pool

ANY = 2**31  # rows: as many as one likes

@dataclass(frozen=True, eq=False)
class ArrayColumn(Column):
    """See :func:`array_column`."""

    width: int = 1
    rows: tuple[int, int] = (1, ANY)
    check: Callable[[np.ndarray], str | None] | None = None
    convert: Callable[[np.ndarray], np.ndarray] | None = None
    pool: Pool = field(default_factory=lambda: Pool(1))

    def checked(self, value: Any, entity: int | None = None) -> Any:
        array = Column(item="vector", name=self.name, owner=self.owner)._as_numbers(value, entity)
        if array.ndim == 1 and self.width == 1:
            array = array[:, None]
        if array.ndim != 2 or array.shape[1] != self.width:
            raise self._error(value, f"must be an array of shape (n, {self.width})", entity)
        least, most = self.rows
        if not least <= len(array) <= most:
            number = f"{least} to {most}" if most < ANY else f"{least} or more"
            raise self._error(value, f"must have {number} rows", entity)
        self.check_numbers(array, array.tolist(), entity)
        wrong = None if self.check is None else self.check(array)
        if wrong is not None:
            raise self._error(array, wrong, entity)
        return self.pool.number_of(array if self.convert is None else self.convert(array))

    def checked_many(self, values: Any, count: int, dimensions: int) -> np.ndarray:
        """One array for all, or a list with one per row."""
        if isinstance(values, list) and len(values) == count and all(np.ndim(v) == 2 for v in values):
            with self.pool.kept():
                return np.array([self.checked(value) for value in values], np.int64)
        return np.full(count, self.checked(values), np.int64)

    def __set__(self, handle: Any, value: Any) -> None:
        store = handle._store
        if getattr(store, "in_step", False):
            self.pool.replaced(store, int(store.values(self.key, store.find(handle._entity))))
        super().__set__(handle, value)

    def change(self, handle: Any, write: Callable[[np.ndarray], Iterable[int]], inside: np.ndarray) -> None:
        """Give the handle's entity another array, like its own, changed by ``write``, see :meth:`Pool.changed`.

        inside
            (k, 2d) m, boxes, lower and upper corners relative to the Transform, that hold all that it changes of the
            shape; the box around the shape stays as it is
        """
        store = handle._store
        if store is None:
            handle._values[self.name] = self.pool.changed(handle._values[self.name], write)
            handle._saved = None
            return
        row = handle._row if handle._version == store.version else handle._locate()
        before = int(store.values(self.key, row))
        if getattr(store, "in_step", False):
            self.pool.replaced(store, before)
        number = self.pool.changed(before, write)
        if number != before:
            store.make(self.key)[row] = number
            store.changed_inside(self, row, before, inside)

    def view(self, handle: Any) -> np.ndarray:
        """The array of a handle without a copy, for reading at once."""
        store = handle._store
        if store is None:
            return self.pool.view(handle._values[self.name])
        row = handle._row if handle._version == store.version else handle._locate()
        return self.pool.view(int(store.values(self.key, row)))

    def empty_value(self, dimensions: int) -> Any:
        return 0

    def unshared(self, value: Any) -> Any:
        return self.pool.number_of(value)

    def shown(self, value: Any) -> np.ndarray:
        return self.pool.array(int(value))

    def hashable(self, values: np.ndarray) -> np.ndarray:
        return self.pool.digests[values]


def hold_arrays(holder: Any, columns: Iterable[Column]) -> None:
    """The holder may have numbers of these columns, as its ``numbers_in`` says."""
    for column in columns:
        if isinstance(column, ArrayColumn):
            column.pool.holders.add(holder)


def array_column(
    width: int, *, rows: tuple[int, int] = (1, ANY), check: Callable[[np.ndarray], str | None] | None = None,
    convert: Callable[[np.ndarray], np.ndarray] | None = None, leading: Callable[[np.ndarray], int] = len,
    kw_only: bool = False,
) -> Any:  # fmt: skip
    """A field of a component that is an array (n, width) of floats, with its own n on every entity.

    rows
        the fewest and the most rows it may have
    check
        gets the array; returns what is wrong with it ("must be convex"), or None
    convert
        gets an array in which nothing is wrong, and returns the one to store
    leading
        gets the array; returns how many of its first rows the others follow from
    kw_only
        whether the constructor takes it by name only

    Pair functions see the array itself, and cannot write to it. To change it, assign another.
    """
    return ArrayColumn(
        item="array", dtype=np.int64, width=width, rows=rows, check=check, convert=convert, kw_only=kw_only,
        pool=Pool(width, leading), on_write=_array_changed,
    )


def _array_changed(table: Any, row: int) -> None:
    """The pool may have moved."""
    table.members_version += 1
    table.on_arrays_changed()

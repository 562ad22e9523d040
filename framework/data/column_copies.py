"""Copies of all columns of a table, made in one call: for a step in which code of the game may write any of them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from ..compilation import kernel, part
from ..jit.records.record import make_record
from ..jit.records.record_type import record_at
from ..jit.records.schema import Schema, ints
from .component import Component
from .row_moves import move_bytes
from .table import Table

BLOCKS = Schema("Blocks", sources=ints(), targets=ints(), sizes=ints())  # addresses, bytes

NO_OWNERS: Mapping[str, type[Component]] = MappingProxyType({})

_blocks_at = record_at(BLOCKS, 2)


@part
def copy_all(address):
    """Copy every block of the record at that address from its source to its target."""
    blocks = _blocks_at(address)
    for k in range(len(blocks.sizes)):
        move_bytes(blocks.targets[k], blocks.sources[k], blocks.sizes[k])


@kernel
def copy_blocks(address: int) -> int:
    """The same, called from Python."""
    copy_all(address)
    return 0


class ColumnCopies:
    """The copies of one table: of some columns, or of all but what no step changes: which bodies there are, and their
    components.

    owners
        the component of columns that are copied as far as bodies have it: static ones have the last rows
    """

    def __init__(
        self, table: Table, keys: tuple[str, ...] | None = None, owners: Mapping[str, type[Component]] = NO_OWNERS
    ) -> None:
        self._table, self._keys, self._owners = table, keys, owners
        self._blocks = make_record(BLOCKS, 2)
        self._copied: tuple[str, ...] = ()  # keys,
        self._pairs: list[tuple[np.ndarray, np.ndarray]] = []  # and copy and column of each
        self._buffers: dict[str, np.ndarray] = {}
        self._columns_version = -1  # of the table, when these were made
        self._row_bytes, self._rows = np.empty(0, np.int64), np.empty(0, np.int64)  # of the columns: those copied
        self._bound: tuple[int, int] | None = None
        self._unmade: list[str] = []  # columns on demand that had no memory
        self.kept = False

    @property
    def address(self) -> int:
        """For :func:`copy_all`, after :meth:`bind`."""
        return self._blocks.address

    def bind(self) -> None:
        """Follow which rows and columns there are."""
        table = self._table
        bound = table.count, table.members_version if self._owners else 0
        if table.columns_version != self._columns_version:
            self._columns_version = table.columns_version
            self._bind_columns()
        elif bound == self._bound:
            return
        self._bound, self._rows = bound, np.fromiter(map(self._rows_of, self._copied), np.int64)
        self._blocks.sizes = self._row_bytes * self._rows

    def _rows_of(self, key: str) -> int:
        """How many rows of a column may hold anything."""
        count = self._table.count
        if key not in self._owners:
            return count
        present = self._table.has_mask(self._owners[key])[:count].nonzero()[0]
        return int(present[-1]) + 1 if len(present) else 0

    def _bind_columns(self) -> None:
        arrays = self._table.arrays
        keys = self._keys
        if keys is None:
            keys = tuple(key for key in arrays if key != "entity" and not key.startswith("has:"))
            self._unmade = self._table.unmade()
        self._copied = keys
        self._pairs = [(self._buffer(key), arrays[key]) for key in keys]
        self._blocks.sources = np.array([column.ctypes.data for _, column in self._pairs], np.int64)
        self._blocks.targets = np.array([copy.ctypes.data for copy, _ in self._pairs], np.int64)
        self._row_bytes = np.array([column[:1].nbytes for _, column in self._pairs], np.int64)

    def keep(self) -> None:
        """Copy the columns."""
        self.bind()
        copy_blocks(self._blocks.address)
        self.kept = True

    def put_back(self) -> None:
        """Write the copies into the columns."""
        for (copy, column), rows in zip(self._pairs, self._rows.tolist(), strict=True):
            column[:rows] = copy[:rows]
        self._table.reset(self._unmade)

    def sizes(self) -> list[tuple[str, np.ndarray]]:
        """The room for copies that there is, by column."""
        return list(self._buffers.items())

    def _buffer(self, key: str) -> np.ndarray:
        array, buffer = self._table.arrays[key], self._buffers.get(key)
        if buffer is None or buffer.shape != array.shape:
            buffer = self._buffers[key] = np.empty_like(array)
        return buffer

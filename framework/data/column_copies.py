"""Copies of all columns of a table, made in one call: for a step in which code of the game may write any of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..compilation import kernel
from ..jit.lazy import JIT
from ..jit.linking import Called
from ..jit.records.record import make_record
from ..jit.records.record_type import record_at
from ..jit.records.schema import Schema, ints
from .row_moves import move_bytes
from .table import Table

BLOCKS = Schema("Blocks", sources=ints(), targets=ints(), sizes=ints())  # addresses, bytes

_blocks_at = record_at(BLOCKS, 2)


@kernel
def copy_blocks(address):
    """Copy every block of the record at that address from its source to its target."""
    blocks = _blocks_at(address)
    for k in range(len(blocks.sizes)):
        move_bytes(blocks.targets[k], blocks.sources[k], blocks.sizes[k])


COPY_BLOCKS = Called(copy_blocks, int)


class ColumnCopies:
    """The copies of one table; all but what no step changes: which bodies there are, and their components."""

    def __init__(self, table: Table) -> None:
        self._table = table
        self._blocks = make_record(BLOCKS, 2)
        self._pairs: list[tuple[np.ndarray, np.ndarray]] = []  # copy and column
        self._buffers: dict[str, np.ndarray] = {}
        self._made_of: Any = None
        self._unmade: list[str] = []  # columns on demand that had no memory
        self.kept = False

    def keep(self) -> None:
        """Copy all columns."""
        table = self._table
        made_of = (table.version, table.members_version, len(table.arrays))
        if made_of != self._made_of:
            self._made_of = made_of
            keys = [key for key in table.arrays if key != "entity" and not key.startswith("has:")]
            self._pairs = [(self._buffer(key), table.column(key)) for key in keys]
            self._unmade = table.unmade()
            self._blocks.sources = np.array([column.ctypes.data for _, column in self._pairs], np.int64)
            self._blocks.targets = np.array([copy.ctypes.data for copy, _ in self._pairs], np.int64)
            self._blocks.sizes = np.array([column.nbytes for _, column in self._pairs], np.int64)
        if JIT:
            copy_blocks(self._blocks.address)
        else:
            for copy, column in self._pairs:
                copy[...] = column
        self.kept = True

    def put_back(self) -> None:
        """Write the copies into the columns."""
        for copy, column in self._pairs:
            column[...] = copy
        self._table.reset(self._unmade)

    def sizes(self) -> list[tuple[str, np.ndarray]]:
        """The room for copies that there is, by column."""
        return list(self._buffers.items())

    def _buffer(self, key: str) -> np.ndarray:
        array, buffer = self._table.arrays[key], self._buffers.get(key)
        if buffer is None or buffer.shape != array.shape:
            buffer = self._buffers[key] = np.empty_like(array)
        return buffer[: self._table.count]

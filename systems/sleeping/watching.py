"""Which columns are watched: what code of the game may write in place, and that changes how a body rests."""

from __future__ import annotations

import zlib
from collections.abc import Iterator

import numpy as np

from ...components import RigidBody, Transform
from ...framework.data.arrays.column import ArrayColumn
from ...framework.data.columns import Column
from ...framework.data.table import Table
from ...framework.jit.records.record import Record, make_record
from ..records import WATCHED
from ..scene import Scene
from .stages import rotated_bits

# All else that acts on them shows in their flight: and these too, but for the step in which they fall asleep.
OF_BODIES = ("mass", "kind", "gravity_scale", "constant_force", "applied_force")


def turn_of(key: str) -> int:
    """By how many places the bits of a column are rotated in the checksums."""
    return zlib.crc32(key.encode()) % 62


class Watching:
    """Binds the records of the columns for the stages; again when columns are other arrays."""

    def __init__(self, state: Record, table: Table, scene: Scene) -> None:
        self._state, self._table, self._scene = state, table, scene
        self._bound: object = None
        self._records: list[Record] = []
        self._arrays: dict[str, tuple[np.ndarray, np.ndarray]] = {}  # by column: numbers of arrays, and their digests

    def bind(self) -> None:
        """Call it before a step in which any of them may be another."""
        table = self._table
        bound = table.columns_version, self._scene.linked, table.version, table.members_version
        same_arrays = all(np.array_equal(table.column(key), numbers) for key, (numbers, _) in self._arrays.items())
        if bound == self._bound and same_arrays:
            return
        self._arrays = {}
        self._records = list(self._find())
        self._state.watching = np.array([record.address for record in self._records], np.int64)
        self._bound = bound

    def follow_change(self, column: ArrayColumn, row: int, before: int) -> int:
        """A row has another array than that of number ``before``; returns by which bits its checksum is another."""
        number = int(self._table.column(column.key)[row])
        old, new = column.hashable(np.array((before, number))).tolist()
        if column.key in self._arrays:
            numbers, digests = self._arrays[column.key]
            numbers[row], digests[row] = number, new
        return rotated_bits(np.int64(old ^ new), 1 + turn_of(column.key))

    def _find(self) -> Iterator[Record]:
        table, linked = self._table, self._scene.linked
        columns: list[Column] = [RigidBody.columns[name] for name in OF_BODIES]
        columns.append(Transform.columns["rotation"])
        for shape in linked.shapes if linked is not None else ():
            columns += shape.component.columns.values()
            yield self._record(table.mask_name(shape.component), table.has_mask(shape.component), False)
        for column in columns:
            array, default = table.arrays.get(column.key), table.default_of(column.key)
            if array is not None:
                if isinstance(column, ArrayColumn):  # what the arrays hold; their numbers mean nothing elsewhere
                    numbers = array[: table.count].copy()
                    array = column.hashable(numbers)
                    self._arrays[column.key] = numbers, array
                yield self._record(column.key, array, default)

    def _record(self, key: str, array: np.ndarray, default: object) -> Record:
        record, flat = make_record(WATCHED, 2), array.reshape(-1)
        record.width, record.turn = array[:1].size, turn_of(key)
        fill = np.empty(array.shape[1:], array.dtype)
        fill[...] = default
        if array.itemsize == 8:
            record.words, bits = flat.view(np.int64), fill.reshape(-1).view(np.int64)
        else:
            record.small, bits = flat.view(np.int8), fill.reshape(-1).view(np.int8)
        record.defaults = bits.astype(np.int64)
        return record

"""Rows that make room and close up: what happens to columns when rows leave and others come, in one call for all."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..compilation import kernel, part
from ..jit.late import JIT, cgutils, intrinsic, ir, types
from ..jit.linking import Called
from ..jit.records.record import make_record
from ..jit.records.record_type import record_at
from ..jit.records.schema import Schema, integer, ints

ROW_MOVES = Schema(
    "RowMoves",
    count=integer(),  # rows before
    leaving=integer(),  # how many leave,
    removed=ints(),  # and which, ascending
    coming=integer(),  # how many come,
    places=ints(),  # the row that stands behind each of them, ascending,
    fresh=ints(),  # and their rows, afterwards
    # runs of rows that stay together and move
    runs=integer(),
    source=ints(),
    target=ints(),
    length=ints(),
    # of each column
    addresses=ints(),
    row_bytes=ints(),
    defaults=ints(),  # address of a row that new rows are copies of; 0: they stay as they are
)

MOST_KEPT = 65536  # rows; the lists of more do not stay in memory

_moves_at = record_at(ROW_MOVES, 2)


@intrinsic
def _move_bytes(typing_context: Any, target: Any, source: Any, size: Any) -> Any:
    def emit(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        byte = ir.IntType(8).as_pointer()
        places = [builder.inttoptr(value, byte) for value in values[:2]]
        cgutils.raw_memmove(builder, places[0], places[1], values[2], 1)
        return context.get_dummy_value()

    return types.none(types.int64, types.int64, types.int64), emit


@part
def find_runs(moves):
    """List the runs between the rows that leave and the places of those that come, and the rows of the latter."""
    gone, come, start, count, moves.runs = 0, 0, 0, moves.count, 0
    while start <= count:
        leaves = moves.removed[gone] if gone < moves.leaving else count
        place = moves.places[come] if come < moves.coming else count
        stop = min(leaves, place)
        if stop > start and come != gone:
            moves.source[moves.runs], moves.target[moves.runs] = start, start - gone + come
            moves.length[moves.runs] = stop - start
            moves.runs += 1
        start = stop
        if come < moves.coming and place == stop:
            moves.fresh[come] = stop - gone + come
            come += 1
        else:  # a row leaves, or this was the last run
            gone += 1
            start += 1


@part
def move_rows_of(moves, column):
    """Move the runs of one column: first those that go down, from the lowest on, then those that go up, from the
    highest on, so that none is written over before it has moved. Then the new rows get the default."""
    address, size, default = moves.addresses[column], moves.row_bytes[column], moves.defaults[column]
    source, target, length = moves.source, moves.target, moves.length
    for k in range(moves.runs):
        if target[k] < source[k]:
            _move_bytes(address + target[k] * size, address + source[k] * size, length[k] * size)
    for k in range(moves.runs - 1, -1, -1):
        if target[k] > source[k]:
            _move_bytes(address + target[k] * size, address + source[k] * size, length[k] * size)
    for k in range(moves.coming if default != 0 else 0):
        _move_bytes(address + moves.fresh[k] * size, default, size)


@kernel
def move_rows(address):
    """Carry out the record at that address."""
    moves = _moves_at(address)
    find_runs(moves)
    for column in range(len(moves.addresses)):
        move_rows_of(moves, column)


MOVE_ROWS = Called(move_rows, int)


class RowMoves:
    """Moves the rows of some columns at once."""

    def __init__(self) -> None:
        self._moves = make_record(ROW_MOVES, 2)
        self._columns: list[np.ndarray] = []
        self._defaults: list[np.ndarray | None] = []

    def bind(self, columns: list[np.ndarray], defaults: list[np.ndarray | None]) -> None:
        """Contiguous columns whose rows move together, and for each what new rows hold (None: whatever is there)."""
        self._columns, self._defaults = columns, defaults
        moves = self._moves
        moves.addresses = np.array([column.ctypes.data for column in columns], np.int64)
        moves.row_bytes = np.array([column[:1].nbytes for column in columns], np.int64)
        moves.defaults = np.array([0 if row is None else row.ctypes.data for row in defaults], np.int64)

    def run(self, count: int, removed: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Of the first ``count`` rows take some out, make room in front of others; returns the new rows.

        removed: ascending rows. places: ascending; a row once for each that comes in front of it, ``count``: at the
        end. Columns must have room for all.
        """
        if not count:  # nothing moves; most worlds need no kernel
            self._fill(slice(0, len(places)))
            return np.arange(len(places))
        moves, leaving, coming = self._moves, len(removed), len(places)
        moves.reserve(leaving, "removed")
        moves.reserve(coming, "places", "fresh")
        moves.reserve(leaving + coming + 1, "source", "target", "length")
        moves.removed[:leaving], moves.places[:coming] = removed, places
        moves.count, moves.leaving, moves.coming = count, leaving, coming
        if JIT:
            move_rows(moves.address)
        else:
            self._run_plain()
        fresh = moves.fresh[:coming].copy()
        if leaving + coming > MOST_KEPT:
            for name in ("removed", "places", "fresh", "source", "target", "length"):
                setattr(moves, name, np.empty(0, np.int64))
        return fresh

    def _fill(self, rows: Any) -> None:
        for column, default in zip(self._columns, self._defaults, strict=True):
            if default is not None:
                column[rows] = default

    def _run_plain(self) -> None:
        moves = self._moves
        find_runs(moves)
        listed = (column[: moves.runs].tolist() for column in (moves.source, moves.target, moves.length))
        runs = list(zip(*listed, strict=True))
        down, up = [run for run in runs if run[1] < run[0]], [run for run in reversed(runs) if run[1] > run[0]]
        for column in self._columns:
            for source, target, length in (*down, *up):
                column[target : target + length] = column[source : source + length].copy()
        self._fill(moves.fresh[: moves.coming])

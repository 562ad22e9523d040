"""Rows that make room and close up: what happens to columns when bodies leave and others come, in one call for all."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from ..compilation import kernel, part
from ..jit.lazy import JIT, cgutils, intrinsic, ir, types
from ..jit.records.record import make_record
from ..jit.records.record_type import record_at
from ..jit.records.schema import Schema, integer, ints

ROW_PLAN = Schema(
    "RowPlan",
    ids=ints(),  # of the bodies, ascending within each block,
    stops=ints(),  # and the first row after each block: before, and when the rows have moved
    leaving=integer(),  # how many leave,
    removed=ints(),  # and which rows, ascending
    coming=integer(),  # how many come,
    added=ints(),  # their ids,
    blocks=ints(),  # by ascending block and id,
    kind_column=ints("int8"),  # where the table has the kinds; empty: nowhere
    places=ints(),  # the row that stands behind each of them,
    fresh=ints(),  # and their rows, afterwards
    # runs of rows that stay together and move
    runs=integer(),
    source=ints(),
    target=ints(),
    length=ints(),
)
MOVED_COLUMNS = Schema(
    "MovedColumns",
    addresses=ints(),
    row_bytes=ints(),
    defaults=ints(),  # address of a row that new rows are copies of; 0: they stay as they are
)
BLOCKS = 4  # of rows: sleepers, dynamic, kinematic and static bodies
MOST_KEPT = 4096  # rows; the lists of more do not stay in memory
LISTS = ("removed", "added", "blocks", "places", "fresh", "source", "target", "length")  # of a plan, for its rows

Rows = np.ndarray | list[int]

NO_ROWS = np.empty(0, np.int64)

_plan_at = record_at(ROW_PLAN, 2)
_columns_at = record_at(MOVED_COLUMNS, 2)


def _move_bytes(typing_context: Any, target: Any, source: Any, size: Any) -> Any:

    def emit(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        byte = ir.IntType(8).as_pointer()
        places = [builder.inttoptr(value, byte) for value in values[:2]]
        cgutils.raw_memmove(builder, places[0], places[1], values[2], 1)
        return context.get_dummy_value()

    return types.none(types.int64, types.int64, types.int64), emit


def _plain_move_bytes(target: int, source: int, size: int) -> None:
    ctypes.memmove(int(target), int(source), int(size))


# move_bytes(target, source, size): copy so many bytes from one address to another; the two may overlap.
move_bytes: Any = intrinsic(_move_bytes, _plain_move_bytes)


@part
def place_of(ids, start, stop, entity):
    """The first of these rows whose id is not smaller; most come behind all there are."""
    if start == stop or ids[stop - 1] < entity:
        return stop
    while start < stop:
        middle = (start + stop) // 2
        if ids[middle] < entity:
            start = middle + 1
        else:
            stop = middle
    return start


@part
def find_places(plan):
    """The places of those that come, and the stops afterwards."""
    gone, come, start = 0, 0, 0
    for block in range(BLOCKS):
        stop = plan.stops[block]
        while come < plan.coming and plan.blocks[come] == block:
            plan.places[come] = place_of(plan.ids, start, stop, plan.added[come])
            come += 1
        while gone < plan.leaving and plan.removed[gone] < stop:
            gone += 1
        plan.stops[block] = stop - gone + come
        start = stop


@part
def find_runs(plan, count):
    """List the runs between the rows that leave and the places of those that come, and the rows of the latter."""
    gone, come, start, plan.runs = 0, 0, 0, 0
    while start <= count:
        leaves = plan.removed[gone] if gone < plan.leaving else count
        place = plan.places[come] if come < plan.coming else count
        stop = min(leaves, place)
        if stop > start and come != gone:
            plan.source[plan.runs], plan.target[plan.runs] = start, start - gone + come
            plan.length[plan.runs] = stop - start
            plan.runs += 1
        start = stop
        if come < plan.coming and place == stop:
            plan.fresh[come] = stop - gone + come
            come += 1
        else:  # a row leaves, or this was the last run
            gone += 1
            start += 1


@part
def move_rows_of(plan, columns, column):
    """Move the runs of one column: first those that go down, from the lowest on, then those that go up, from the
    highest on, so that none is written over before it has moved. Then the new rows get the default."""
    address, size, default = columns.addresses[column], columns.row_bytes[column], columns.defaults[column]
    source, target, length = plan.source, plan.target, plan.length
    for k in range(plan.runs):
        if target[k] < source[k]:
            move_bytes(address + target[k] * size, address + source[k] * size, length[k] * size)
    for k in range(plan.runs - 1, -1, -1):
        if target[k] > source[k]:
            move_bytes(address + target[k] * size, address + source[k] * size, length[k] * size)
    for k in range(plan.coming if default != 0 else 0):
        move_bytes(address + plan.fresh[k] * size, default, size)


@kernel
def move_rows(plan_address: int, columns_address: int, new_plan: int) -> int:
    """Move the rows of some columns as planned; new_plan, 0 or 1: find out first what has to move, and write ids and
    kinds of those that come."""
    plan, columns = _plan_at(plan_address), _columns_at(columns_address)
    if new_plan != 0:
        count = plan.stops[BLOCKS - 1]
        find_places(plan)
        find_runs(plan, count)
    for column in range(len(columns.addresses)):
        move_rows_of(plan, columns, column)
    for k in range(plan.coming if new_plan != 0 else 0):
        plan.ids[plan.fresh[k]] = plan.added[k]
        if len(plan.kind_column):
            plan.kind_column[plan.fresh[k]] = max(plan.blocks[k] - 1, 0)
    return 0


class RowPlan:
    """Which rows leave, which come, and so which have to move."""

    def __init__(self) -> None:
        self.record = make_record(ROW_PLAN, 2)
        self.record.stops = np.zeros(BLOCKS, np.int64)
        self.new = False  # the runs have not been found yet
        self.count = 0  # rows before
        self.fresh = NO_ROWS  # the rows of those that have come, in order

    def follow(self, ids: np.ndarray, kinds: np.ndarray | None) -> None:
        """The columns where the table has ids and kinds of the bodies."""
        self.record.ids = ids
        if kinds is not None:
            self.record.kind_column = kinds

    def begin(self, removed: Rows, added: Rows, blocks: Rows) -> None:
        """removed: ascending rows; added: ids by ascending block and id; the stops are those of the bodies before."""
        plan, leaving, coming = self.record, len(removed), len(added)
        if leaving + coming >= len(plan.source):
            plan.reserve(leaving + coming + 1, *LISTS)
        for column, values in ((plan.removed, removed), (plan.added, added), (plan.blocks, blocks)):
            if len(values) == 1:
                column[0] = values[0]  # much faster than a slice
            elif len(values):
                column[: len(values)] = values
        plan.leaving, plan.coming = leaving, coming
        self.count, self.new = plan.stops.item(BLOCKS - 1), True

    def end(self) -> None:
        """Long lists do not stay in memory."""
        self.fresh = NO_ROWS
        if len(self.record.source) > MOST_KEPT:
            for name in LISTS:
                setattr(self.record, name, np.empty(0, np.int64))


class MovedColumns:
    """Columns whose rows move together."""

    def __init__(self) -> None:
        self._record = make_record(MOVED_COLUMNS, 2)
        self._columns: list[np.ndarray] = []
        self._defaults: list[np.ndarray | None] = []

    def bind(self, columns: list[np.ndarray], defaults: list[np.ndarray | None]) -> None:
        """Contiguous columns, and for each what new rows hold (None: whatever is there)."""
        self._columns, self._defaults = columns, defaults
        record = self._record
        record.addresses = np.array([column.ctypes.data for column in columns], np.int64)
        record.row_bytes = np.array([column[:1].nbytes for column in columns], np.int64)
        record.defaults = np.array([0 if row is None else row.ctypes.data for row in defaults], np.int64)

    def move(self, plan: RowPlan) -> None:
        """Move the rows as planned; the columns must have room for all."""
        if JIT and plan.count:
            move_rows(plan.record.address, self._record.address, int(plan.new))
        else:  # nothing moves where there are no rows yet, and most worlds need no kernel
            self._move_plain(plan)
        if plan.new:
            plan.fresh, plan.new = plan.record.fresh[: plan.record.coming].copy(), False

    def _move_plain(self, plan: RowPlan) -> None:
        record = plan.record
        if plan.new:
            if plan.count:
                find_places(record)
                find_runs(record, plan.count)
            else:
                coming = record.coming
                record.runs, record.fresh[:coming] = 0, np.arange(coming)
                record.stops[:] = record.blocks[:coming].searchsorted(np.arange(1, BLOCKS + 1))
        listed = (column[: record.runs].tolist() for column in (record.source, record.target, record.length))
        runs = list(zip(*listed, strict=True))
        down, up = [run for run in runs if run[1] < run[0]], [run for run in reversed(runs) if run[1] > run[0]]
        rows: Any = record.fresh[: record.coming] if plan.count else slice(0, record.coming)
        for column, default in zip(self._columns, self._defaults, strict=True):
            for source, target, length in (*down, *up):
                column[target : target + length] = column[source : source + length].copy()
            if default is not None:
                column[rows] = default
        if plan.new:
            record.ids[rows] = record.added[: record.coming]
            if len(record.kind_column):
                record.kind_column[rows] = np.maximum(record.blocks[: record.coming] - 1, 0)

"""Room for what stages write."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter

import numpy as np

from ..framework.jit.records.record import Record
from ..framework.schedule.stages import Stage
from .contacts.solving.records import KINDS_OF_FAULT, WARM_START_ROWS
from .records import CONTACT_ROWS

SPARE_ROWS = 1 << 16  # rows at most that are reserved beyond what is asked for


def reserve_fixed(state: Record) -> None:
    """The columns of records whose number of rows does not depend on the bodies."""
    for record, rows in ((state.warm_start, WARM_START_ROWS), (state.contacts, CONTACT_ROWS)):
        record.counts = np.zeros(2, np.int64)
        for name, column in rows.fields.items():
            if column.stacked:
                setattr(record, name, column.fresh((2, 0), state.dimensions))
    state.warm_start.rows_version = np.full(2, -1, np.int64)
    state.warm_start.step, state.warm_start.period = np.ones(2), np.zeros(2)
    state.contacts.stays, state.contacts.steps = np.zeros(2, np.int64), np.zeros(2, np.int64)
    state.solver.faults, state.solver.faulty = np.zeros(KINDS_OF_FAULT, np.int64), np.zeros(KINDS_OF_FAULT, np.int64)
    state.frame = np.zeros(7)


def make_room(stage: Stage, state: Record, own: Record | None, make: Callable[..., None]) -> None:
    """What the ``room`` of a stage says; ``own`` is the record of a plugin's stage, ``make`` gives columns of bodies a
    row for each of the table."""
    short = []
    for rows in stage.room:
        record = attrgetter(rows.record)(own or state)
        if rows.count(state) > min(map(record.rows_of, rows.telling)):
            short.append((record, rows, rows.count(state)))
    state.needed = 0
    if not short:
        raise ValueError(f"stage {stage.name} asks for more rows than it needs")
    for record, rows, needed in short:
        try:
            if record is state.bodies:
                make(*rows.columns)
            else:
                record.reserve(with_spare(needed), *rows.columns)
        except MemoryError as error:
            raise MemoryError(f"no memory for {needed} rows of {rows.record} in stage {stage.name}") from error


def with_spare(rows: int) -> int:
    """So many rows and half as many again, up to a limit: numbers of pairs change from step to step."""
    return rows + min(rows // 2, SPARE_ROWS) + 16

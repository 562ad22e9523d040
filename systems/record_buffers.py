"""Room for what stages write, and the other things that Python does between two stages."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Any

import numpy as np

from ..framework.jit.records.record import Record
from ..framework.schedule.stages import Stage
from . import codes
from .broad_phase.search import CandidateSearch
from .contacts.solving.islands import COLOURS
from .contacts.solving.records import WARM_START_ROWS
from .records import CONTACT_ROWS
from .scene import Scene

SPARE_ROWS = 1 << 16  # rows at most that are reserved beyond what is asked for


class RecordBuffers:
    """Gives the records of one world the rows that stages need; MemoryError names what needs how many."""

    def __init__(self, state: Record, scene: Scene, search: CandidateSearch) -> None:
        self._state, self._scene, self._search = state, scene, search
        for record, rows in ((state.warm_start, WARM_START_ROWS), (state.contacts, CONTACT_ROWS)):
            record.counts = np.zeros(2, np.int64)
            for name, column in rows.fields.items():
                if column.stacked:
                    setattr(record, name, column.fresh((2, 0), state.dimensions))
        state.warm_start.rows_version = np.full(2, -1, np.int64)
        state.warm_start.step = np.ones(2)
        state.contacts.stays, state.contacts.steps = np.zeros(2, np.int64), np.zeros(2, np.int64)
        state.solver.starts = np.zeros(2 * COLOURS + 2, np.int64)
        state.frame = np.zeros(7)

    def handlers(self, simulation: Any) -> dict[int, Callable[[float], None]]:
        """What to do for each code; ``simulation`` has the systems that run when a phase before them has not."""
        return {
            codes.NEED_ROOM: lambda dt: self._make_room(simulation),
            codes.NEED_SWEEPS: lambda dt: simulation.link(),
            codes.NEED_IMPACTS: lambda dt: simulation.links.link_impacts(),
            codes.FIND_IN_PYTHON: lambda dt: self._find_candidates(simulation, dt),
            codes.ROTATE: lambda dt: self._scene.refresh_rotation(),
            codes.RUN_BROAD: lambda dt: simulation.broad_phase.process(dt),
            codes.RUN_NARROW: lambda dt: simulation.narrow_phase.process(dt),
            codes.REFRESH_PAIRS: lambda dt: self._refresh_pairs(simulation, dt),
        }

    def _make_room(self, simulation: Any) -> None:
        stage = simulation.program.stages[self._state.stage]
        make_room(stage, self._state, simulation.plugin_stages.own(stage), self._scene.make)

    def _find_candidates(self, simulation: Any, dt: float) -> None:
        """Trees, which from now on hold whole motions, or the broad phase of a plugin."""
        self._search.find_in_python(dt)
        simulation.queries.forget()

    def _refresh_pairs(self, simulation: Any, dt: float) -> None:
        """An impact has sent a body out of its search bounds: pairs for what is left of the step."""
        state, program = self._state, simulation.program
        program.run_one("box_rest_of_step", dt)
        found = simulation.broad_phase.segment("place_statics")
        found(dt)
        while simulation.sleepers.wake_candidates(dt):
            found(dt)
        program.run_one("order_candidates", dt)
        simulation.narrow_phase.filter_candidates()
        program.run_one("merge_pairs", dt)
        state.pairs, state.merged = state.merged, state.pairs
        state.impacts.until = state.neighbours_known_until


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

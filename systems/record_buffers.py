"""Room for what stages ask for, and the other things that Python does between two stages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..framework.jit.records.record import Record
from ..framework.jit.records.schema import Column
from . import codes, records
from .broad_phase.search import CandidateSearch
from .broad_phase.static_grid import reserve_static_grid
from .broad_phase.uniform_grid import reserve_grid
from .contacts.solving.islands import COLOURS
from .impacts import records as impact_records
from .scene import Scene

SPARE = 1 << 16  # rows at most that are reserved beyond what is asked for
# What these stages need of the bodies before they do anything.
COLUMNS_OF = {
    "sum_forces": ("force",), "end_flight": records.UNDO_FORCE, "predict_rest": records.PREDICTED,
    "gather": records.HELD, "begin_joints": (*records.SPINS, *records.COLLISIONS),
    "begin_parts": records.COMPOUNDS,
}  # fmt: skip


class Room:
    """Gives the records of one world the rows that stages ask for; MemoryError names what asked for how much."""

    def __init__(self, state: Record, scene: Scene, search: CandidateSearch) -> None:
        self._state, self._scene, self._search = state, scene, search
        for record in (state.warm_start, state.contacts):
            record.counts = np.zeros(2, np.int64)
        state.warm_start.rows_version = np.full(2, -1, np.int64)
        state.warm_start.step = np.ones(2)
        state.contacts.stays, state.contacts.steps = np.zeros(2, np.int64), np.zeros(2, np.int64)
        state.solver.starts = np.zeros(2 * COLOURS + 2, np.int64)
        state.frame = np.zeros(7)
        _grow_stacked(state.warm_start, 0)
        _grow_stacked(state.contacts, 0)

    def handlers(self, simulation: Any) -> dict[int, Callable[[float], None]]:
        """What to do for each code; ``simulation`` has the systems that run when a phase before them has not."""
        state = self._state
        growing: dict[int, Callable[[], Any]] = {
            codes.NEED_ORDER: self._grow_order,
            codes.NEED_EVENTS: self._grow_events,
            codes.NEED_SOLVER: self._grow_solver,
            codes.NEED_PAIRS: lambda: self._reserve_pairs(state.pairs),
            codes.NEED_MERGED: lambda: self._reserve_pairs(state.merged),
            codes.NEED_CONTACTS: lambda: self.reserve_contacts(state.needed),
            codes.NEED_WARM_START: lambda: self.reserve_warm_start(state.needed),
            codes.NEED_CANDIDATES: self._search.grow_candidates,
            codes.NEED_CELLS: lambda: reserve_grid(state.grid, state.needed),
            codes.NEED_STATIC_CELLS: lambda: reserve_static_grid(state.static_grid, state.needed),
        }  # fmt: skip
        return {
            **{code: self._named(grow) for code, grow in growing.items()},
            codes.NEED_COLUMNS: lambda dt: self._scene.make(*COLUMNS_OF[simulation.program.stages[state.stage].name]),
            codes.NEED_SWEEPS: lambda dt: simulation.link(),
            codes.NEED_IMPACTS: lambda dt: simulation.links.link_impacts(),
            codes.FIND_IN_PYTHON: lambda dt: self._find_candidates(simulation, dt),
            codes.ROTATE: lambda dt: self._scene.refresh_rotation(),
            codes.RUN_BROAD: lambda dt: simulation.broad_phase.process(dt),
            codes.RUN_NARROW: lambda dt: simulation.narrow_phase.process(dt),
            codes.REFRESH_PAIRS: lambda dt: self._refresh_pairs(simulation, dt),
        }

    def _named(self, grow: Callable[[], Any]) -> Callable[[float], None]:
        def handler(dt: float) -> None:
            state = self._state
            try:
                grow()
            except MemoryError as error:
                raise MemoryError(f"no memory for {state.needed} rows, which stage {state.stage} asks for") from error

        return handler

    def _grow_order(self) -> None:
        candidates, state = self._state.candidates, self._state
        if state.needed > len(candidates.sorted_a):
            candidates.reserve(with_spare(state.needed), *records.HALVES, *records.SORTED)
        candidates.reserve(self._scene.table.capacity + 1, "starts")
        kinds = state.shapes.count**2 + 2
        candidates.reserve(kinds, "bucket_starts")

    def _reserve_pairs(self, pairs: Record) -> None:
        pairs.reserve(with_spare(self._state.needed), *records.PAIR_COLUMNS, keep=len(pairs.a))

    def _grow_events(self) -> None:
        """Whichever is too small: room for the search among all pairs, the queue, the log."""
        impacts, state = self._state.impacts, self._state
        if len(impacts.heads) < state.count:
            impacts.reserve(self._scene.table.capacity, "heads")
        old = len(impacts.heap)
        if state.needed > old:
            size = with_spare(state.needed)
            impacts.reserve(size, *impact_records.EVENTS, keep=old)
            impacts.heap[old:size] = np.arange(old, size)
        if impacts.logged + impacts.together >= len(impacts.log_pair):
            impacts.reserve(with_spare(impacts.logged + impacts.together), *impact_records.LOG, keep=impacts.logged)
        if impacts.together > len(impacts.member):
            rows = with_spare(impacts.together)
            impacts.reserve(rows, "member", *impact_records.MEMBERS)
            impacts.reserve(2 * rows, "next_member")
        if impacts.together > 0 and len(impacts.first_member) < state.count:
            impacts.reserve(self._scene.table.capacity, *impact_records.BODIES_OF_MEMBERS)
        impacts.together = 0
        impacts.linked = False

    def _grow_solver(self) -> None:
        solver, state = self._state.solver, self._state
        if state.needed > len(solver.first):
            solver.reserve(with_spare(state.needed), *records.SOLVER_CONTACTS)
        bodies = min(2 * state.needed, state.count) + 1  # the world is one that joints hold on to
        if bodies > len(solver.body_row):
            solver.reserve(min(with_spare(bodies), self._scene.table.capacity + 1), *records.SOLVER_BODIES)
        if state.spinning:
            solver.reserve(len(solver.first), *records.SOLVER_ARMS)
            solver.reserve(len(solver.body_row), *records.SOLVER_SPINS)

    def reserve_warm_start(self, rows: int) -> None:
        """Room for the impulses of so many contacts, if there is less."""
        memory = self._state.warm_start
        if rows > len(memory.off):
            _grow_stacked(memory, max(with_spare(rows), memory.entity_a.shape[1]))
            memory.reserve(memory.entity_a.shape[1], "off")

    def reserve_contacts(self, rows: int) -> None:
        """Room for so many contacts, if there is less."""
        contacts = self._state.contacts
        if rows > len(contacts.began):
            _grow_stacked(contacts, max(with_spare(rows), contacts.entity_a.shape[1]))
            contacts.reserve(contacts.entity_a.shape[1], "began", "ended")

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


def with_spare(rows: int) -> int:
    """So many rows and half as many again, up to a limit: numbers of pairs change from step to step."""
    return rows + min(rows // 2, SPARE) + 16


def _grow_stacked(record: Record, rows: int) -> None:
    """More rows in the columns of which there are two, keeping both."""
    for name, field in record.schema.fields.items():
        if isinstance(field, Column) and field.stacked:
            before = getattr(record, name)
            after = np.zeros((2, rows, *field.item_shape(record.dimensions)), field.dtype)
            if before.shape[0] == 2:
                after[:, : before.shape[1]] = before
            setattr(record, name, after)

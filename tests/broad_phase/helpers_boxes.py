"""The broad phase without a world: boxes in a state's record, the stages run over them, and pairs by brute force."""

from __future__ import annotations

import warnings
from types import SimpleNamespace

import numpy as np

from carom.framework.jit.records.record import make_record
from carom.framework.schedule.stages import Program, Rows, Stage
from carom.framework.settings import Settings
from carom.systems import codes
from carom.systems.broad_phase import stages
from carom.systems.broad_phase.records import FRAME_SIZE, GRID_BOXES, GRID_STATICS, HIGHEST, LARGEST_EXTENT, LOWEST
from carom.systems.broad_phase.search import CandidateSearch
from carom.systems.record_buffers import make_room
from carom.systems.records import STATE

SEARCH = (
    stages.place_statics, stages.place_moving, stages.choose_search, stages.search_uniform_grid, stages.test_few,
    stages.search_static_grid,
)  # fmt: skip


def begin_uniform_grid(state, dt):
    """A uniform grid of what moves, however few that is."""
    state.candidates.count = 0
    stages.build_moving_grid(state)
    state.pair_search = stages.UNIFORM_GRID if state.grid.suits else stages.NO_SEARCH
    return codes.OK


def begin_static_grid(state, dt):
    """Bodies that do not move are put into a grid, however few they are."""
    state.candidates.count = 0
    stages.build_statics(state)
    state.pair_search = stages.BRUTE_FORCE if state.static_grid.suits else stages.NO_SEARCH
    return codes.OK


def search_static_grid(state, dt):
    return stages.look_into_statics(state) if state.pair_search == stages.BRUTE_FORCE else codes.OK


# However few bodies there are, both grids have room.
ROOM = (
    Rows("grid", GRID_BOXES, lambda s: s.count + stages.LANES),
    Rows("static_grid", (*GRID_BOXES, *GRID_STATICS), lambda s: s.count + stages.LANES),
    Rows("grid", ("directory",), lambda s: stages.most_cells(s.count)),
    Rows("static_grid", ("directory",), lambda s: stages.most_cells(s.count)),
    *stages.ROOM_FOR_CANDIDATES,
)  # fmt: skip
UNIFORM_GRID_ALONE = (begin_uniform_grid, stages.search_uniform_grid)
STATIC_GRID_ALONE = (begin_static_grid, search_static_grid)


class Boxes:
    """Boxes of bodies of which the first move; ``asked`` are the codes that stages have returned."""

    def __init__(self, dimensions, registry=None, settings=None, functions=SEARCH):
        self.state = make_record(STATE, dimensions)
        self.state.collides = True
        self.state.frame = np.zeros(FRAME_SIZE)
        self.search = CandidateSearch(
            self.state, SimpleNamespace(registry=registry, settings=settings or Settings()), lambda: None, None
        )
        self.asked = []
        work = {
            codes.NEED_ROOM: lambda: make_room(self._program.stages[self.state.stage], self.state, None, None),
            codes.FIND_IN_PYTHON: lambda: self.search.find_in_python(0.0),
        }
        handlers = {code: self._handler(code, each) for code, each in work.items()}
        self._program = Program(self.state, [Stage(f, "", room=ROOM) for f in functions], handlers, codes.AFTERWARDS)
        self._program.link(lambda stage: True)

    def _handler(self, code, work):
        def handle(dt):
            self.asked.append(code)
            work()

        return handle

    def set(self, lower, upper, moving, statics_changed=True, first=0, kinematic=0):
        """Take these corners (n, d), of which those before ``first`` sleep and the last of what moves are kinematic."""
        state, d = self.state, lower.shape[1]
        state.bodies.lower, state.bodies.upper = np.ascontiguousarray(lower), np.ascontiguousarray(upper)
        state.bodies.position = state.bodies.previous_position = np.zeros_like(lower)
        state.count, state.first, state.moving = len(lower), first, moving
        state.dynamic = stop = moving - kinematic
        state.statics_version += statics_changed
        state.frame[LOWEST : LOWEST + 3], state.frame[HIGHEST : HIGHEST + 3] = np.inf, -np.inf
        state.frame[LARGEST_EXTENT] = 0.0
        with warnings.catch_warnings(), np.errstate(invalid="ignore"):
            warnings.simplefilter("ignore")  # all of a column may be nan
            state.frame[LOWEST : LOWEST + d] = np.fmin.reduce(lower[first:stop], axis=0, initial=np.inf)
            state.frame[HIGHEST : HIGHEST + d] = np.fmax.reduce(upper[first:stop], axis=0, initial=-np.inf)
            state.frame[LARGEST_EXTENT] = np.fmax.reduce(upper[first:stop] - lower[first:stop], axis=None, initial=0.0)

    def find(self):
        """Rows (first, second) of the candidates."""
        self._program.run(0, len(self._program.stages), 0.0)
        candidates = self.state.candidates
        return candidates.first[: candidates.count], candidates.second[: candidates.count]


def pair_set(first, second):
    """The pairs as a set of (smaller, larger), after checking that none is there twice."""
    pairs = {(min(p), max(p)) for p in zip(first.tolist(), second.tolist(), strict=True)}
    assert len(pairs) == len(first)
    return pairs


def overlapping(lower, upper, moving):
    """By brute force: pairs (i, j), i < j, of boxes that share a point; the first is among the first ``moving``.

    A box with nan, or empty (lower above upper), shares none.
    """
    real, found = (lower <= upper).all(axis=1), set()
    for i in np.flatnonzero(real[:moving]).tolist():
        meet = real[i + 1 :] & ((lower[i + 1 :] <= upper[i]) & (lower[i] <= upper[i + 1 :])).all(axis=1)
        found |= {(i, i + 1 + j) for j in np.flatnonzero(meet).tolist()}
    return found

"""The Python side of the broad phase, for one world: memory of the grids, trees, broad phases of plugins."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...framework.jit.records.record import Record
from ...framework.settings import AUTOMATIC
from ...framework.world.world import World
from ..records import FOUND
from .boxes import fixed_count
from .plan import reason_of
from .plugin_broad_phase import PluginBroadPhase
from .records import FRAME_SIZE
from .stages import BRUTE_FORCE, NO_SEARCH, PLUGIN, UNIFORM_GRID, UNIFORM_GRID_MIN
from .static_grid import NEVER_BUILT
from .tree.tree import SpatialTree
from .uniform_grid import LONGEST, NOTE_CHUNK, OUTSIDE_MAX

MOST_KINDS = 8  # of layers, for each of which there is a tree: as many as games have


class CandidateSearch:
    """What the stages that find candidates need of Python.

    state
        the record of the world; its columns ``bodies.lower``, ``bodies.upper`` hold the boxes
    box_now, run_stage
        for queries: makes the boxes of all bodies where they are at this moment; runs the stage of that name
    """

    def __init__(
        self, state: Record, world: World, box_now: Callable[[], None],
        run_stage: Callable[[str, float], None],
    ) -> None:  # fmt: skip
        self._state, self._world, self._box_now, self._run_stage = state, world, box_now, run_stage
        self._plugin = PluginBroadPhase(world.registry)
        first, self._asleep, self._static, self._empty = (SpatialTree(state.dimensions) for _ in range(4))
        self._trees = [first]  # of what moves: one of all, or one for each kind of layers
        self._static_version, self._static_first = NEVER_BUILT, 0
        for grid in (state.grid, state.static_grid):
            grid.reserve(FRAME_SIZE, "frame")
            grid.reserve(1, "scale")
            grid.reserve(NOTE_CHUNK + LONGEST, "notes")
            grid.reserve(OUTSIDE_MAX + 1, "longest", "outside")
        state.static_grid.version = NEVER_BUILT
        state.pair_search, state.moving_meet = NO_SEARCH, True
        self.read_settings()

    def read_settings(self) -> None:
        """Call it when settings have changed."""
        self._state.uses_plugin_broad_phase = self._world.settings.broad_phase != AUTOMATIC

    def needs_grids(self) -> bool:
        """Whether the stages of grids may have to do anything with so many bodies as there are."""
        return self._state.count >= UNIFORM_GRID_MIN

    # -- what stages ask for ----------------------------------------------------------------------

    def find_in_python(self, dt: float) -> None:
        """Candidates from the broad phase of a plugin, or from trees: no grid suits the boxes of this step."""
        state = self._state
        if state.pair_search == PLUGIN:
            lower, upper = state.bodies.lower[: state.count], state.bodies.upper[: state.count]
            self._store(*self._plugin.pairs(self._world.settings.broad_phase, lower, upper, state.moving))
            return
        kinds, kind = self._kinds_of_layers()
        self._trees += (SpatialTree(state.dimensions) for _ in range(len(self._trees), len(kinds)))
        trees = self._trees[: len(kinds)]
        for k, tree in enumerate(trees):
            lower = state.bodies.lower
            if len(trees) > 1:
                lower = lower[: state.moving].copy()
                lower[state.first :][kind != k] = np.nan
            tree.build(lower, state.bodies.upper, state.first, state.moving)
        self._build_static()
        for k, tree in enumerate(trees):
            for other in range(k, len(trees)):
                (layer, mask), (other_layer, other_mask) = kinds[k], kinds[other]
                if layer & other_mask and other_layer & mask:
                    self._store(*(tree.pairs_within() if other == k else tree.pairs_between(trees[other])))
            self._store(*tree.pairs_between(self._static))
            if state.first:
                self._store(*tree.pairs_between(self._asleep))

    def _kinds_of_layers(self) -> tuple[list[list[int]], np.ndarray]:
        """The different (layer, mask) of what moves, and which of them each row has, so that crowds of what does not
        meet each other need not be tested; only one if there are many, and of bodies without a shape none."""
        state, colliders = self._state, self._state.colliders
        rows = np.arange(state.first, state.moving)
        if len(colliders.mask) > 0:
            at = state.bodies.collider_slot[rows], rows
            layer = colliders.layer[at] if len(colliders.layer) > 0 else np.ones(len(rows), np.int64)
            both = np.stack((layer, colliders.mask[at]), axis=1)
            both[state.bodies.shape[rows] < 0] = 0
            kinds, kind = np.unique(both, axis=0, return_inverse=True)
            if len(kinds) <= MOST_KINDS:
                return kinds.tolist(), kind.ravel()
        return [[-1, -1]], np.zeros(len(rows), np.int64)

    def _store(self, first: np.ndarray, second: np.ndarray) -> None:
        candidates, after = self._state.candidates, self._state.candidates.count
        stop = after + len(first)
        if stop > len(candidates.first):
            candidates.reserve(max(stop, 2 * len(candidates.first)), *FOUND)
        candidates.first[after:stop], candidates.second[after:stop] = first, second
        candidates.count = stop

    # -- indexes for queries ----------------------------------------------------------------------

    def index_now(self) -> tuple[SpatialTree, SpatialTree]:
        """Bring the grids that suit to where the bodies are at this moment, and let them ``serve`` queries. Returns
        trees of the other bodies: of what moves and sleeps, and of what is static.

        The grid of the last step goes on, if all bodies but a few are near their cells there.
        """
        state, grid, static_grid = self._state, self._state.grid, self._state.static_grid
        known_until, state.all_still = state.neighbours_known_until, False
        grid.suits &= (grid.version, grid.first) == (state.version, state.first) and not state.several_levels
        if grid.suits:
            self._run_stage("box_statics", 0.0)
            self._run_stage("box_standing", 0.0)
        if not grid.suits:
            self._box_now()
            self._run_stage("place_moving", 0.0)
        self._run_stage("place_statics", 0.0)
        state.neighbours_known_until = known_until  # a system within the step may query
        grid.serves = grid.suits
        made_for = static_grid.version, static_grid.first
        static_grid.serves = static_grid.suits and made_for == (state.statics_version, state.moving)
        start, stop = state.first if static_grid.serves else 0, state.first if grid.serves else state.moving
        if start < stop:
            self._build(self._trees[0], start, stop)
        if not static_grid.serves:
            self._build_static()
        return self._trees[0] if start < stop else self._empty, self._empty if static_grid.serves else self._static

    def index_for_stages(self, scene: Any) -> None:
        """The same within a step, and the trees where compiled code finds them."""
        if self._state.rotation_stale:
            scene.refresh_rotation()
        self._state.tree, self._state.static_tree = (tree.record for tree in self.index_now())

    def _build(self, index: SpatialTree, start: int, stop: int) -> None:
        index.build(self._state.bodies.lower, self._state.bodies.upper, start, stop)

    def _build_static(self) -> None:
        """The index of what does not move, if that has changed; other rows are no reason to build it again."""
        first = self._state.moving
        if self._static_version != self._state.statics_version:
            self._build(self._static, first, self._state.count)
            self._build(self._asleep, 0, self._state.first)
            self._static_version = self._state.statics_version
        elif first != self._static_first:
            self._static.shift_rows(first - self._static_first)
        self._static_first = first

    # -- plan -------------------------------------------------------------------------------------

    @property
    def last(self) -> int:
        """What found the candidates of the last step, as ``state.pair_search``; before the first step what will."""
        state = self._state
        if state.pair_search in (NO_SEARCH, PLUGIN) or state.uses_plugin_broad_phase:
            return UNIFORM_GRID if state.moving - state.first >= UNIFORM_GRID_MIN else BRUTE_FORCE
        return state.pair_search

    def describe(self) -> str:
        """How candidates are found, for ``world.plan()``."""
        state, name = self._state, self._world.settings.broad_phase
        if not state.collides:
            return "no colliders: nothing to do"
        if name != AUTOMATIC:
            return f"{name}, as the settings say"
        moving = state.moving - state.first
        return reason_of(self.last, moving, fixed_count(state), state.dimensions, state.moving_meet)

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
from .brute_force import BRUTE_FORCE_MAX
from .plugin_broad_phase import PluginBroadPhase
from .records import FRAME_SIZE
from .stages import BRUTE_FORCE, NO_SEARCH, PLUGIN, SPATIAL_TREE, UNIFORM_GRID, UNIFORM_GRID_MIN, has_many_static
from .static_grid import NEVER_BUILT
from .tree.tree import CandidateLimitError, SpatialTree
from .uniform_grid import LONGEST, NOTE_CHUNK, OUTSIDE_MAX

MANY_CANDIDATES = 100  # candidates of a body, on average, from which layers are looked at before boxes are tested
MOST_KINDS = 8  # of layers, for each of which there is a tree then: as many as games have


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
        self._moving, self._asleep, self._static, self._empty = (SpatialTree(state.dimensions) for _ in range(4))
        self._of_kinds: list[SpatialTree] = []  # of what moves, one for each kind of layers: where it crowds
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
        self._build(self._moving, state.first, state.moving)
        self._build_static()
        try:
            self._store(*self._moving.pairs_within(MANY_CANDIDATES * self._moving.count))
        except CandidateLimitError:
            self._search_by_layers()
        self._store(*self._moving.pairs_between(self._static))
        if state.first:
            self._store(*self._moving.pairs_between(self._asleep))

    def _search_by_layers(self) -> None:
        """A crowd: what layers and masks keep apart in it is not tested."""
        state, colliders = self._state, self._state.colliders
        rows = np.arange(state.first, state.moving)
        both = np.full((len(rows), 2), -1)
        if len(colliders.mask) > 0:
            at = state.bodies.collider_slot[rows], rows
            both[:, 0], both[:, 1] = colliders.layer[at] if len(colliders.layer) > 0 else 1, colliders.mask[at]
        found, kind = np.unique(both, axis=0, return_inverse=True)
        if not 1 < len(found) <= MOST_KINDS:
            self._store(*self._moving.pairs_within())
            return
        kinds, trees = found.tolist(), self._of_kinds
        trees += (SpatialTree(state.dimensions) for _ in range(len(trees), len(kinds)))
        for k, (tree, (layer, mask)) in enumerate(zip(trees, kinds, strict=False)):
            lower = state.bodies.lower[: state.moving].copy()
            lower[state.first :][kind.ravel() != k] = np.nan
            tree.build(lower, state.bodies.upper, state.first, state.moving)
            for other, (other_layer, other_mask) in enumerate(kinds[: k + 1]):
                if layer & other_mask and other_layer & mask:
                    self._store(*(tree.pairs_within() if other == k else tree.pairs_between(trees[other])))

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
            self._build(self._moving, start, stop)
        if not static_grid.serves:
            self._build_static()
        return self._moving if start < stop else self._empty, self._empty if static_grid.serves else self._static

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
        search, meet, moving, static = self.last, state.moving_meet, state.moving - state.first, fixed_count(state)
        tree = "quadtree" if state.dimensions == 2 else "octree"
        if search == SPATIAL_TREE:
            beside = f" and against that of {static} static ones" if static else ""
            return f"{tree} of {moving} moving bodies against itself{beside}"
        if not meet:
            among = "a uniform grid of" if has_many_static(moving, static, meet) else "all"
            return f"layers let no two of {moving} moving bodies meet; they look into {among} {static} static ones"
        if has_many_static(moving, static, meet):
            among = "uniform grid" if search == UNIFORM_GRID else "every pair"
            return f"{among} of {moving} moving bodies, which look into a uniform grid of {static} static ones"
        if search == UNIFORM_GRID:
            return f"uniform grid of {moving} moving bodies, and {static} static ones that look into it"
        more = f"above {BRUTE_FORCE_MAX} a uniform grid, or a {tree} where this does not suit"
        return f"every pair of {moving} moving and {static} static bodies; {more}"

"""BROAD: which bodies may meet in this step, from the boxes around their motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from ...framework.compilation import kernel
from ...framework.schedule.phases import Phase, System
from ...framework.schedule.plan import PlannedKernel
from ...framework.settings import AUTOMATIC
from ...framework.vectors import add, item, replace, row, store
from ..ccd.search_bounds import find_rooms, places_at, widen
from .brute_force import FEW, FewBoxes, pairs_between
from .plan import EVEN, STILL, planned_pairs
from .plugin_broad_phase import ForeignBroadPhase
from .static_grid import StillGrid
from .tree.tree import SpatialTree
from .uniform_grid import FRAME_SIZE, HIGHEST, LARGEST, LOWEST, EvenGrid

if TYPE_CHECKING:
    from ..shapes.dispatch import ShapeCode
    from ..state import PhysicsState

# Of the body's smallest half extent, on each side: bodies deflected within the step still meet their neighbours.
MARGIN = 0.1

Pairs: TypeAlias = tuple[np.ndarray, np.ndarray]


def make_box_kernel(shape_bounds: Any, write_world: Any, several: bool = False) -> Callable[..., None]:
    """The kernel that boxes bodies, over the shapes of a scene; ``several``: some body has several levels."""

    @kernel
    def box_motion(
        start, stop, before, after, levels, slots, shapes, world, turns, turned, axes, offsets, level_offsets, size,
        lower, upper, frame, like,
    ):  # fmt: skip
        """Offsets as they are in the world, sizes, and the boxes around the motion of rows start..stop-1.

        turns: whether any shape changes when turned; turned: whether any body is. A row without shape gets NaN. A box
        holds every level of its body, so that what the first one meets is looked at; the size is that of the last.
        frame: the lowest and the highest coordinate of all these boxes, and their longest edge; see ``uniform_grid``.
        """
        lowest, highest, largest = like, like, 0.0
        for k in range(len(like)):
            lowest, highest = replace(lowest, k, np.inf), replace(highest, k, -np.inf)
        for i in range(start, stop):
            for level in range(len(levels) if several else 1):
                shape = levels[level, i]
                if shape < 0:
                    for k in range(len(like)):
                        lower[i, k] = upper[i, k] = np.nan
                    break
                at = row(offsets[slots[shape]], i, like)
                if turned:
                    local = at
                    for k in range(len(like)):
                        total = 0.0
                        for j in range(len(like)):
                            total += axes[i, k, j] * item(local, j)
                        at = replace(at, k, total)
                if turns:
                    write_world(shape, i, shapes, world, turned, axes, like)
                store(level_offsets[level], i, at)
                half = shape_bounds(shape, i, world, like)
                smallest = half[0]
                for k in range(1, len(like)):
                    smallest = min(smallest, item(half, k))
                size[i] = 2.0 * smallest if smallest < np.inf else 0.0  # what has no end is to others as a point
                margin = MARGIN * smallest
                first, last = add(row(before, i, like), at), add(row(after, i, like), at)
                for k in range(len(like)):
                    low = min(item(first, k), item(last, k)) - item(half, k) - margin
                    high = max(item(first, k), item(last, k)) + item(half, k) + margin
                    if level == 0 or low < lower[i, k]:
                        lower[i, k] = low
                    if level == 0 or high > upper[i, k]:
                        upper[i, k] = high
            for k in range(len(like)):  # comparisons with NaN are false
                low, high = lower[i, k], upper[i, k]
                lowest = replace(lowest, k, low if low < item(lowest, k) else item(lowest, k))
                highest = replace(highest, k, high if high > item(highest, k) else item(highest, k))
                largest = high - low if high - low > largest else largest
        for k in range(len(like)):
            frame[LOWEST + k], frame[HIGHEST + k] = item(lowest, k), item(highest, k)
        frame[LARGEST] = largest

    return box_motion


@lru_cache(maxsize=64)
def box_kernel_with_levels(code: ShapeCode) -> Callable[..., None]:
    return make_box_kernel(code.shape_bounds, code.write_world, several=True)


class BroadPhase(System):
    """Finds candidate pairs with uniform grids of what moves and of what does not, where these suit, see
    :mod:`uniform_grid` and :mod:`static_grid`; else with a quadtree (octree) of each.

    Reads previous_position, position, rotation and the colliders; writes the candidate pairs. Pairs of static bodies
    are never made. What is built for them is kept until they change.
    """

    phase = Phase.BROAD

    def __init__(self, state: PhysicsState) -> None:
        self._state = state
        self._moving: SpatialTree | FewBoxes = FewBoxes(state.dimensions)
        self._static: SpatialTree | FewBoxes | None = None  # built when first asked for
        self._still: StillGrid | None = None  # likewise
        self._outside = FewBoxes(state.dimensions)  # what does not move and is not in its grid
        self._frame = np.zeros(FRAME_SIZE)
        self._grids: str | None = None  # which of the grids the last step used, if there was one
        self._foreign = ForeignBroadPhase(state)
        self._static_seen: Any = None
        self._static_positions = b""
        self._static_rows = np.empty(0, np.int32)

    @cached_property
    def _moving_tree(self) -> SpatialTree:
        return SpatialTree(self._state.dimensions)

    @cached_property
    def _static_tree(self) -> SpatialTree:
        return SpatialTree(self._state.dimensions)

    @cached_property
    def _grid(self) -> EvenGrid:
        return EvenGrid(self._state.dimensions)

    def process(self, dt: float) -> None:
        state, table = self._state, self._state.table
        first, second = state.no_pairs, state.no_pairs
        if state.collides:
            state.queries.forget()  # these boxes hold whole motions
            self.box_all()
            if state.sweeping and state.moved:
                self._box_ways(0.0, dt, state.motion(table.arrays["previous_position"]))
            first, second = self._pairs(table.stops[1], table.count)
        state.set_candidates(first, second)

    def pairs_on_the_way(self, now: float, dt: float) -> Pairs:
        """Candidates for what is left of the step on the paths as they are now; ``now``: seconds since its start."""
        state, table = self._state, self._state.table
        self._box_ways(now, dt, state.motion(state.scratch["origin"]))
        return self._pairs(table.stops[1], table.count)

    def _box_ways(self, now: float, dt: float, motion: tuple[Any, ...]) -> None:
        """Boxes around the ways of what moves, with room for what blows make of these; or, where that would be too many
        candidates, around the next part of the ways. ``state.known_until`` tells until when all neighbours are known.
        """
        state, table, scratch = self._state, self._state.table, self._state.scratch
        moving, inverse_mass = table.stops[1], table.arrays["inverse_mass"]
        before, after = motion[0][:moving], table.arrays["position"][:moving]
        if now > 0.0:
            before = np.empty((moving, state.dimensions))
            places_at(now, now, moving, scratch["size"], motion, before, state.like)
        crossing = find_rooms(
            now, dt - now, moving, scratch["shape"], scratch["size"], inverse_mass, before, motion, state.sweep_of,
            scratch["room"], state.like,
        )  # fmt: skip
        state.known_until = now + crossing if now + crossing < dt else math.inf
        if now > 0.0 or state.known_until < dt:
            after = np.empty((moving, state.dimensions))
            places_at(min(state.known_until, dt), dt, moving, scratch["size"], motion, after, state.like)
            self._box(0, moving, before, after)
        widen(
            moving, before, after, scratch["room"], scratch["size"], scratch["lower"], scratch["upper"],
            scratch["roam_lower"], scratch["roam_upper"], self._frame, state.like,
        )  # fmt: skip

    def _pairs(self, moving: int, count: int) -> Pairs:
        """Rows of overlapping boxes, at least one of each pair below ``moving``."""
        self._grids = ""
        name = self._state.world.settings.broad_phase
        if name != AUTOMATIC:
            return self._foreign.pairs(name, moving, count)
        pairs = None
        if count - moving > max(moving, FEW):
            still = self._still_grid()
            if still.suits:
                pairs = self._pairs_beside(still, moving)
        elif moving > FEW:
            pairs = self._even_pairs(moving, self._static_rows)
            self._grids = EVEN
        if pairs is not None:
            return pairs
        self._grids = ""
        self._moving = self._partition("_moving_tree", 0, moving)
        pairs = self._moving.pairs_within()
        static = self._static_partition()
        return _joined(pairs, pairs_between(static, self._moving)) if static.count else pairs

    def _pairs_beside(self, still: StillGrid, moving: int) -> Pairs | None:
        """The same with a grid of what does not move; None if one of what moves does not suit."""
        if moving > FEW:
            pairs = self._even_pairs(moving, still.outside)
        else:
            self._moving = self._partition("_moving_tree", 0, moving)
            pairs = _joined(self._moving.pairs_within(), pairs_between(self._outside, self._moving))
        between = None if pairs is None else still.pairs(np.arange(moving, dtype=np.int32))
        self._grids = STILL
        return None if pairs is None or between is None else _joined(pairs, between)

    def _even_pairs(self, moving: int, others: np.ndarray) -> Pairs | None:
        lower, upper = self._state.scratch["lower"], self._state.scratch["upper"]
        return self._grid.pairs(lower, upper, self._frame, moving, others)

    def box_all(self) -> None:
        """Boxes around the motion of what moves; of what does not only if it has changed."""
        state, table = self._state, self._state.table
        moving, count = table.stops[1], table.count
        position, before = table.arrays["position"], table.arrays["previous_position"]
        fixed = position[moving:count].tobytes()  # compared in one go
        seen = (table.static_version, state.structures, state.turned)
        if seen != self._static_seen or fixed != self._static_positions:
            before[moving:count] = position[moving:count]
            self._box(moving, count, position, position)
            self._static = self._still = None
            self._static_seen, self._static_positions = seen, fixed
            self._static_rows = np.arange(moving, count, dtype=np.int32)
        self._box(0, moving, before if state.moved else position, position)

    def _box(self, start: int, stop: int, before: np.ndarray, after: np.ndarray) -> None:
        state, scratch = self._state, self._state.scratch
        box_motion = state.kernels.box_motion if len(state.levels) == 1 else box_kernel_with_levels(state.code)
        with state.blame:
            box_motion(
                start, stop, before, after, state.levels, state.slots, state.shapes, state.world_shapes,
                state.turned and state.code.turns, state.turned, state.axes, state.table.stacks["collider.offset"],
                state.level_offsets, scratch["size"], scratch["lower"], scratch["upper"], self._frame, state.like,
            )  # fmt: skip

    @property
    def partitions(self) -> tuple[SpatialTree | FewBoxes, SpatialTree | FewBoxes]:
        """Of what moves and of what does not."""
        return self._moving, self._static_partition()

    def few(self) -> dict[str, np.ndarray]:
        """What is kept of what moves, if that is few; for ``world.plan()``."""
        few = self._moving
        return {"boxes": few.boxes, "rows": few.rows} if isinstance(few, FewBoxes) else {}

    def trees_now(self) -> None:
        """Build the trees from where the bodies are at this moment."""
        moved, self._state.moved = self._state.moved, False
        try:
            self.box_all()
        finally:
            self._state.moved = moved
        self._moving = self._partition("_moving_tree", 0, self._state.table.stops[1])

    def _partition(self, tree: str, start: int, stop: int) -> SpatialTree | FewBoxes:
        """The boxes of rows start..stop-1, as the tree of that name unless they are few."""
        boxes = FewBoxes(self._state.dimensions) if stop - start <= FEW else getattr(self, tree)
        boxes.build(self._state.scratch["lower"], self._state.scratch["upper"], start, stop)
        return boxes

    def _static_partition(self) -> SpatialTree | FewBoxes:
        if self._static is None:
            moving, count = self._state.table.stops[1], self._state.table.count
            self._static = self._partition("_static_tree", moving, count if self._state.code else moving)
        return self._static

    def _still_grid(self) -> StillGrid:
        if self._still is None:
            scratch, table = self._state.scratch, self._state.table
            self._still = StillGrid(scratch["lower"], scratch["upper"], table.stops[1], table.count)
            self._outside.take(scratch["lower"], scratch["upper"], self._still.outside)
        return self._still

    def _grids_now(self) -> str:
        """Which of the grids the last step used; before the first one, which the next one will try."""
        if self._grids is not None:
            return self._grids
        moving, still = self._state.table.stops[1], self._state.table.count - self._state.table.stops[1]
        return STILL if still > max(moving, FEW) else EVEN if moving > FEW else ""

    def kernels(self) -> Iterator[PlannedKernel]:
        state, table = self._state, self._state.table
        if not state.collides:
            return
        yield PlannedKernel("box_motion", "boxes around the motion of what moves; of the rest when it changes")
        if state.sweeping:
            yield PlannedKernel("find_rooms", "how far blows may send a body that is swept")
            yield PlannedKernel("widen", "boxes around that")
        if state.world.settings.broad_phase == AUTOMATIC:
            yield from planned_pairs(table.stops[1], table.count - table.stops[1], self._grids_now())

    def reason(self) -> str:
        if not self._state.collides:
            return "no colliders: nothing to do"
        name = self._state.world.settings.broad_phase
        if name != AUTOMATIC:
            return f"{name}, as the settings say"
        moving, count = self._state.table.stops[1], self._state.table.count
        grids = self._grids_now()
        if grids == EVEN:
            return f"uniform grid of {moving} moving bodies, and {count - moving} static ones that look into it"
        if grids == STILL:
            among = "uniform grid" if moving > FEW else "every pair"
            return f"{among} of {moving} moving bodies, which look into a uniform grid of {count - moving} static ones"
        tree = "quadtree" if self._state.dimensions == 2 else "octree"
        if max(moving, count - moving) <= FEW:
            return f"every pair of {moving} moving and {count - moving} static bodies; a {tree} above {FEW}"
        return f"{tree} of {moving} moving bodies against itself" + (
            f" and against that of {count - moving} static ones" if count > moving else ""
        )


def _joined(one: Pairs, other: Pairs) -> Pairs:
    """Pairs of moving bodies, and pairs with these as the second."""
    if not len(other[0]):
        return one
    return np.concatenate((one[0], other[1])), np.concatenate((one[1], other[0]))

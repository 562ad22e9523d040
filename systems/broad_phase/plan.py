"""Which kernels find candidate pairs, by how many bodies move and stand still: for ``world.plan()``."""

from __future__ import annotations

from collections.abc import Iterator

from ...framework.schedule.plan import PlannedKernel
from .brute_force import FEW, TESTS_AT_MOST

EVEN, STILL = "even", "still"  # grids: one of what moves, or that and one of what does not

SIZES = "boxes differ much in size"
CHANGES = "static bodies change"


def planned_pairs(moving: int, still: int, grids: str) -> Iterator[PlannedKernel]:
    """The kernels for so many boxes; grids: EVEN, STILL or, where no grid suits or there are few, nothing."""
    tried = still > max(moving, FEW)
    if tried:
        yield PlannedKernel("lay_out", "grid of what stands still", CHANGES)
    if grids == STILL:
        yield PlannedKernel("pairs_inside", "what moves looks into the grid of what stands still")
    if moving > FEW and (grids or not tried):
        unsuited = "" if grids else ": does not suit them, the tree goes on"
        yield PlannedKernel("even_pairs", f"grid of what moves{unsuited}")
    if grids == EVEN:
        return
    if grids == STILL:
        if moving <= FEW:
            yield PlannedKernel("test_all", f"every pair of at most {FEW} that move, and of what is in no grid")
        return
    yield from _without_grids(moving, still)


def _without_grids(moving: int, still: int) -> Iterator[PlannedKernel]:
    """Every pair of few boxes; trees of many."""
    trees_meet = (still > 0 and moving * still > TESTS_AT_MOST) or (moving > FEW and still > FEW)
    few_meet = still > 0 and not trees_meet
    if (1 < moving <= FEW) or few_meet:
        yield PlannedKernel("test_all", f"every pair of at most {FEW} boxes")
    if moving > FEW or still > FEW or trees_meet:
        when = "" if moving > FEW else CHANGES
        yield PlannedKernel("choose_frame", f"a tree of more than {FEW} boxes", when)
        yield PlannedKernel("assign_cells", "its cells", when)
        yield PlannedKernel("place", "its boxes in their order", when)
    if moving > FEW:
        yield PlannedKernel("ranges_within_levels", "neighbours of one size")
    if moving > FEW or trees_meet:
        yield PlannedKernel("ranges_between", "neighbours of two sizes, or in two trees", "" if trees_meet else SIZES)
        yield PlannedKernel("overlapping", "tests them")

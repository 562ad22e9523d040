"""What ``world.plan()`` says of the broad phase: how candidates are found, and the kernels of trees."""

from __future__ import annotations

from collections.abc import Iterator

from ...framework.schedule.plan import PlannedKernel
from .brute_force import BRUTE_FORCE_MAX
from .stages import SPATIAL_TREE, UNIFORM_GRID, has_many_static


def reason_of(search: int, moving: int, static: int, dimensions: int, meet: bool) -> str:
    """How the candidates of so many bodies are found; search: a value of ``state.pair_search``; meet: whether layers
    let any two that move meet."""
    tree = "quadtree" if dimensions == 2 else "octree"
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


def planned_passes(static: int) -> Iterator[PlannedKernel]:
    """What runs the passes that build trees and find their pairs."""
    beside = ", and of what does not move" if static else ""
    yield PlannedKernel("run_tree_pass", f"builds the tree of what moves{beside}; neighbours in it; tests their boxes")

"""BROAD: which bodies may meet in this step, from the boxes around their motion."""

from __future__ import annotations

from collections.abc import Iterator

from ...framework.schedule.phases import Phase
from ...framework.schedule.plan import PlannedKernel
from ...framework.schedule.stages import Program, Stage
from ..joints.bodies import leave_out_joined
from ..parts.stages import leave_out_parts
from ..sleeping.stages import leave_out_still
from ..stage_system import StagedSystem
from .boxes import box_motions, box_statics, fixed_count
from .brute_force import BRUTE_FORCE_MAX
from .search import CandidateSearch
from .stages import (
    ROOM_FOR_CANDIDATES,
    ROOM_FOR_MOVING,
    ROOM_FOR_STATICS,
    SPATIAL_TREE,
    UNIFORM_GRID_MIN,
    choose_search,
    place_moving,
    place_statics,
    search_static_grid,
    search_uniform_grid,
    test_few,
)

BOXES = ("lower", "upper")
MANY = "many bodies"  # needed by the stages of grids: CandidateSearch.needs_grids


class BroadPhase(StagedSystem):
    """Finds candidate pairs: every pair of few bodies; many with uniform grids of what moves and of what does not,
    where these suit; else with a quadtree (octree) of each. See :mod:`.stages`.

    Reads previous_position, position, rotation and the colliders; writes the candidate pairs. Pairs of static bodies
    are never made. What is built for them is kept until they change.
    """

    phase = Phase.BROAD
    STAGES = (
        Stage(
            box_statics, "boxes of what does not move", ("position", "rotation"), BOXES, "colliders",
            "static bodies change",
        ),
        Stage(
            box_motions, "boxes around the motion of what moves, with room for what impacts make of it",
            ("previous_position", "position", "rotation"), BOXES, "colliders",
        ),
        Stage(
            place_statics, "uniform grid of what does not move", BOXES, ("static_grid",), MANY,
            "more bodies are static than move, and these change", ROOM_FOR_STATICS,
        ),
        Stage(
            place_moving, "uniform grid of what moves", BOXES, ("grid",), MANY,
            f"at least {UNIFORM_GRID_MIN} bodies move", ROOM_FOR_MOVING,
        ),
        Stage(choose_search, "how to find which boxes overlap", (), ("candidates",), "colliders"),
        Stage(
            search_uniform_grid, "what is in that grid with each other, and with what is in none", (*BOXES, "grid"),
            ("candidates",), MANY, f"at least {UNIFORM_GRID_MIN} bodies move", ROOM_FOR_CANDIDATES,
        ),
        Stage(
            test_few, f"every pair of at most {BRUTE_FORCE_MAX} that move, and with what is in no grid", BOXES,
            ("candidates",), "colliders", f"less than {UNIFORM_GRID_MIN} bodies move", ROOM_FOR_CANDIDATES,
        ),
        Stage(
            search_static_grid, "what moves looks into the grid of what does not", (*BOXES, "static_grid"),
            ("candidates",), MANY, "more bodies are static than move", ROOM_FOR_CANDIDATES,
        ),
        Stage(
            leave_out_still, "pairs of two bodies that sleep or stay", ("candidates", "sleep_state"), ("candidates",),
            "sleeping",
            "bodies sleep",
        ),
        Stage(
            leave_out_joined, "pairs that a joint keeps from touching",
            ("candidates", "layer", "mask", "group"), ("candidates",), "joints",
        ),
        Stage(leave_out_parts, "pairs of parts of one body", ("candidates",), ("candidates",), "parts"),
    )  # fmt: skip

    def __init__(self, program: Program, search: CandidateSearch) -> None:
        super().__init__(program)
        self._search, self._state = search, program.state

    def kernels(self) -> Iterator[PlannedKernel]:
        """The stages, and the passes of trees where the last step needed them."""
        yield from super().kernels()
        if self._state.collides and self._search.last == SPATIAL_TREE:
            beside = ", and of what does not move" if fixed_count(self._state) else ""
            does = f"builds the tree of what moves{beside}; neighbours in it; tests their boxes"
            yield PlannedKernel("run_tree_pass", does)

    def reason(self) -> str:
        return self._search.describe()

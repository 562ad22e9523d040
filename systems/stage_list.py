"""The stages of a step in their order, the only description of one: what plan(), stats(), profile() and
docs/architecture.md read; and the parts of stages that are called by address."""

from __future__ import annotations

from functools import reduce

from ..framework.schedule.stages import Rows, Stage
from .broad_phase.boxes import bound_searches, box_rest_of_step, box_standing
from .broad_phase.system import BroadPhase
from .ccd.refresh_pairs import ROOM_TO_MERGE, merge_pairs
from .ccd.time_of_impact import first_touch
from .ccd.turning_touch import closing_point, first_touch_of_turn, touch_of_turning
from .contacts.bodies import gather_joined
from .contacts.events import ContactEvents
from .contacts.points import lay_arms
from .contacts.response import Response
from .contacts.solving.fours import solve_fours
from .contacts.solving.islands import measure_joined_islands
from .contacts.solving.turning import tumble, turn_back
from .forces.accumulation import ForceAccumulation
from .impacts.jointed import bend_struck, respond_joined, strike_joined
from .impacts.together import resolve_simultaneous
from .impacts.turning import respond_at_arms, turn_by_impact
from .integration.system import Integration
from .joints.groups import mark_joined
from .joints.solving import solve_joined_range
from .linking.parts import (
    ARMS_AT_REST,
    BOUND_SEARCHES,
    CLOSING_POINT,
    FIRST_TOUCH,
    FOURS,
    FREE_TURN,
    JOINED_BODIES,
    JOINED_IMPACT,
    JOINED_ISLANDS,
    JOINED_RANGE,
    JOINED_RESPONSE,
    JOINED_START,
    JOINED_SUPPORT,
    TAKE_TOGETHER,
    TOUCH_OF_TURN,
    TUMBLE,
    TURN_BACK,
    TURN_BY_IMPACT,
    TURNING_RESPONSE,
    TURNING_TOUCH,
)  # fmt: skip
from .narrow_phase.manifolds import finish_found
from .narrow_phase.system import NarrowPhase
from .parts.rows import PART_COLUMNS
from .parts.stages import begin_parts
from .quarantine.columns import check_columns
from .records import BODIES, COLLIDERS, STATE, TABLE_COLUMNS, all_rows
from .shapes.poses import turn_with_unequal_moments
from .sleeping.stages import update_sleep
from .step_stages import (
    KEEPS_FORCE,
    KEEPS_HOLD,
    KEEPS_START,
    KEEPS_VELOCITY,
    close_step,
    index_bodies,
    keep_state,
    keep_written,
    read_bodies,
)

OPENING = (
    Stage(keep_state, "keeps what a failed step puts back", ("linear_velocity",), ("kept", "kept_velocity")),
    Stage(keep_written, "the same of columns that stages of plugins write", (), ("kept",), "stages of plugins"),
    Stage(
        check_columns, "takes out bodies with values that cannot be",
        ("mass", "gravity_scale", "constant_force", "rotation", "restitution", "friction"), ("quarantined",),
    ),
    Stage(
        begin_parts, "which rows are parts of one body; where the game has moved it they follow", (),
        ("position", "linear_velocity", "rotation"), "parts", room=(Rows("bodies", PART_COLUMNS, all_rows),),
    ),
    Stage(
        read_bodies, "1 / mass of what moves freely; whether any speed is limited, any body swept or rotated",
        ("mass", "rotation", "ccd", "max_linear_speed"), ("inverse_mass",),
    ),
)  # fmt: skip
CLOSING = (
    Stage(
        index_bodies, "where the bodies are now, for stages of plugins that query", ("position", "rotation"),
        ("lower", "upper", "grid", "static_grid", "tree", "static_tree"), "stages query",
    ),
    Stage(
        update_sleep, "how long bodies have been at rest; islands fall asleep",
        ("pairs", "position", "linear_velocity"), ("sleep_state", "rest_steps", "linear_velocity"), "sleeping",
    ),
    Stage(close_step, "the step is over: nothing is put back any more", writes=("kept",)),
)  # fmt: skip
ON_DEMAND = (
    Stage(
        box_standing, "for queries: boxes where the bodies are, and which have left those of the grid",
        ("position", "rotation"), ("lower", "upper", "grid"), "queries of many bodies",
    ),
    Stage(
        box_rest_of_step, "boxes around the rest of the paths", ("path_velocity",), ("lower", "upper"), "swept bodies",
    ),
    Stage(
        merge_pairs, "the pairs of the rest of the step, and the queue that is left", ("pairs", "candidates"),
        ("merged", "impacts"), "swept bodies", room=ROOM_TO_MERGE,
    ),
    Stage(
        finish_found, "contacts where free flight leads, for code that reads them", ("pairs",), ("pairs",),
        "contacts are read early",
    ),
    *Integration.ON_DEMAND,
)  # fmt: skip
# What may be true of a scene, for ``Stage.needed``; besides, stages of integrators are needed by their own names.
WITH_COLLIDERS = frozenset((
    "colliders", "colliders or joints", "contacts", "contacts may rest", "contacts may rest or joints", "impacts",
    "no body spins, no joints", "one level", "several levels", "many bodies", "swept bodies", "queries of many bodies",
    "contacts are read early",
))  # fmt: skip
CONDITIONS = (
    "", "dynamic bodies", *sorted(WITH_COLLIDERS), "bodies spin or joints", "joints", "parts",
    "one-way colliders", "standard", "sleeping", "stages of plugins", "stages query", "on demand",
)  # fmt: skip
# What a failed step puts back, in this order: the bit of state.kept that says that the copy is made; the column, its
# copy, and their rows.
KEPT = (
    (KEEPS_FORCE, "step_force", "kept_step_force", "dynamic"),
    (KEEPS_START, "position", "previous_position", "kept_rows"),
    (KEEPS_START, "previous_position", "kept_previous", "kept_rows"),
    (KEEPS_START, "linear_velocity", "start_velocity", "moving"),
    (KEEPS_HOLD, "hold", "kept_hold", "moving"),
    (KEEPS_HOLD, "held_velocity", "kept_held_velocity", "moving"),
    (KEEPS_VELOCITY, "linear_velocity", "kept_velocity", "moving"),  # from before start_velocity
)
MADE_AGAIN = ("force", "inverse_mass")  # by every step


def check_stages(stages: tuple[Stage, ...]) -> tuple[Stage, ...]:
    """The stages; ValueError for a name that nothing has, or a column that a failed step would leave changed."""
    fields = {*STATE.fields, *BODIES.fields, *COLLIDERS.fields}
    for stage in stages:
        for name in (*stage.reads, *stage.writes):
            if name not in fields:
                raise ValueError(f"stage {stage.name}: no record in systems/records.py has {name!r}")
        for name in stage.writes:
            if name in TABLE_COLUMNS and name not in (*(kept[1] for kept in KEPT), *MADE_AGAIN):
                raise ValueError(f"stage {stage.name} writes {name}, which a failed step does not put back")
        for rows in stage.room:
            record = reduce(lambda schema, name: schema.fields[name], rows.record.split("."), STATE)
            if not {*rows.columns} <= {*record.fields}:
                raise ValueError(f"stage {stage.name}: not all of its room is in record {rows.record}")
        if stage.needed not in (*CONDITIONS, stage.name):
            raise ValueError(f"stage {stage.name}: needed must be one of {', '.join(CONDITIONS)}, got {stage.needed!r}")
    return stages


SYSTEMS = (ForceAccumulation, Integration, BroadPhase, NarrowPhase, Response, ContactEvents)
STAGES = check_stages((*OPENING, *(stage for system in SYSTEMS for stage in system.STAGES), *CLOSING, *ON_DEMAND))

# Parts of stages by their place in ``state.links``.
LINKED_PARTS = {
    BOUND_SEARCHES: bound_searches, FIRST_TOUCH: first_touch, TAKE_TOGETHER: resolve_simultaneous,
    FREE_TURN: turn_with_unequal_moments, TURNING_TOUCH: touch_of_turning, TOUCH_OF_TURN: first_touch_of_turn,
    CLOSING_POINT: closing_point, ARMS_AT_REST: lay_arms, TURNING_RESPONSE: respond_at_arms,
    TURN_BY_IMPACT: turn_by_impact, JOINED_ISLANDS: measure_joined_islands, JOINED_BODIES: gather_joined,
    JOINED_RESPONSE: respond_joined, JOINED_IMPACT: strike_joined, JOINED_START: bend_struck,
    JOINED_RANGE: solve_joined_range, JOINED_SUPPORT: mark_joined, TURN_BACK: turn_back, TUMBLE: tumble,
    FOURS: solve_fours,
}  # fmt: skip

# The system of each stage; "" for those that open and close a step.
SYSTEM_OF_STAGE = {
    **{stage.name: "" for stage in (*OPENING, *CLOSING)},
    **{stage.name: system.__name__ for system in SYSTEMS for stage in system.STAGES},
    **dict.fromkeys(("box_standing", "box_rest_of_step"), BroadPhase.__name__),
    **dict.fromkeys(("merge_pairs", "finish_found"), NarrowPhase.__name__),
    **{stage.name: Integration.__name__ for stage in Integration.ON_DEMAND},
}

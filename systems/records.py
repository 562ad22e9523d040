"""The records of one world: all arrays and numbers that the compiled stages of a step read and write.

``State`` is what a stage gets; it holds the numbers of the step and the addresses of the other records. Units are SI; n
rows of bodies are ordered asleep, dynamic, kinematic, static. A column that a scene does not need has no rows. Those
with a default are on demand: kernels read the default while there are no rows. What a stage writes has rows before it
runs, as its ``room`` says.
"""

from __future__ import annotations

from typing import Any

from ..components import Collider, RigidBody
from ..framework.jit.records.schema import Schema, Section, flag, flags, floats, integer, ints, number, vectors
from ..framework.schedule.stages import PROGRAM_FIELDS
from .broad_phase.records import GRID, TREE
from .contacts.solving.records import ARM_COLUMNS, RESTED, SOLVER, TURN_COLUMNS, WARM_START
from .impacts.records import IMPACTS
from .parts.rows import PART_COLUMNS, PARTS


def default_of(field: Any) -> Any:
    """What rows of the table hold that have no value of their own, of a component's field; each number of a vector."""
    return field.empty_value(2)


TABLE_SECTIONS = (
    Section("body", "the table", "the entity of each row", entity=ints()),
    Section(
        "body", "the table", "the start of the step: for drawing between steps, and for going back",
        previous_position=vectors(unit="m"),
    ),
    Section("body", "the table", "the sum of forces", force=vectors(default=0.0, unit="N")),
    Section("body", "the table", "0 for what cannot be moved", inverse_mass=floats(unit="1/kg")),
    Section(  # fields of components, of which the plan shows what the game has set
        position=vectors(unit="m"),
        linear_velocity=vectors(unit="m/s"),
        mass=floats(unit="kg"),
        gravity_scale=floats(default=default_of(RigidBody.gravity_scale), unit="1"),
        linear_damping=floats(default=default_of(RigidBody.linear_damping), unit="1/s"),
        max_linear_speed=floats(default=default_of(RigidBody.max_linear_speed), unit="m/s"),  # nan: no limit
        constant_force=vectors(default=default_of(RigidBody.constant_force), unit="N"),
        applied_force=vectors(default=default_of(RigidBody.applied_force), unit="N"),
        step_force=vectors(default=default_of(RigidBody.step_force), unit="N"),
        ccd=flags(default=default_of(RigidBody.ccd)),
    ),
)  # fmt: skip
TABLE_COLUMNS = tuple(name for section in TABLE_SECTIONS for name in section)
# Columns of the table too, which has them under names that begin with _ and are not shown.
SLEEP_COLUMNS = Section(
    "body", "the table", "bodies may sleep: which do, since when, and their state then",
    sleep_state=ints("int8", default=0),  # AWAKE and the like, see sleeping.stages
    rest_steps=ints("int32"),  # for how many steps it has been at rest
    island=ints(),  # entity id of the first body of those that sleep together; 0: none
    rest_position=vectors(unit="m"),
    rest_force=vectors(unit="N"),
    flown_position=vectors(unit="m"),  # where free flight leads it from there
    flown_velocity=vectors(unit="m/s"),
)  # fmt: skip
HELD_COLUMNS = Section(
    "body", "the table", "contacts or joints have held it: the next step foresees that they do",
    hold=vectors(default=0.0, unit="m/s^2"),  # what they gave it in the last step in which they did,
    held_velocity=vectors(default=0.0, unit="m/s"),  # and with what velocity it ended that
)  # fmt: skip
DAMPING_COLUMNS = Section(
    "body", "the table", "linear_damping and what a plugin adds to it; the same array if none does",
    total_damping=floats(default=0.0, unit="1/s"),
)  # fmt: skip
HIDDEN_COLUMNS = (*SLEEP_COLUMNS, *HELD_COLUMNS, *DAMPING_COLUMNS)

# Columns of the bodies that are made within a step or when rows have moved.
START_COLUMNS = Section(
    "body", "the step", "velocity at the start of the step, for the path",
    start_velocity=vectors(unit="m/s"),
)  # fmt: skip
QUARANTINE = Section(
    "body", "the step", "a body had a value that cannot be: it takes no part",
    quarantined=flags(default=False),
)  # fmt: skip
# Flight: x(t) = origin + path_velocity t + path_second t^2 + path_third t^3 within the step.
COLLISIONS = Section(
    "body", "collisions", "some body has a collider: boxes, extents, the path in the step, the response",
    origin=vectors(unit="m"),
    path_velocity=vectors(unit="m/s"),
    half_extents=vectors(unit="m"),  # of the box around the shape; nan without one
    min_extent=floats(unit="m"),  # smallest full extent of the shape; 0 for what has no end
    force_speed_change=floats(unit="m/s"),  # by which forces change the speed in this step
    lower=vectors(unit="m"),  # boxes around the motion
    upper=vectors(unit="m"),
    rank=ints("int32"),  # place in the order of entity ids
    collider_slot=ints("int8"),  # slot of the collider that gives layer, mask and material
    impact_count=ints("int32"),
    counted_impacts=ints("int32"),  # those that the cap counts
)  # fmt: skip
PREDICTED = Section(
    "body", "collisions", RESTED,
    warm_started=flags(default=False),  # the resting prediction has changed its velocity
    warm_start_velocity=vectors(unit="m/s"),
    swings=flags(default=False),  # that was by joints alone which hold, of those that have any
)  # fmt: skip
REST_COLUMNS = Section(
    "body", "collisions", RESTED,
    held=flags(default=False),  # a contact at rest has pushed it
    place=ints("int32", default=-1),  # among the bodies of the solver; -1 between steps
    contact_travel=floats(unit="m"),  # by which these have turned its points, where bodies spin
)  # fmt: skip
CURVES = Section(
    "body", "curved paths", "the integrator's paths are curved",
    path_second=vectors(unit="m/s^2"),
    path_third=vectors(unit="m/s^3"),
)  # fmt: skip
SWEEP_COLUMNS = Section(
    "body", "swept bodies", "bodies are swept along their paths: how far impacts may send them",
    search_margin=floats(unit="m"),
    search_lower=vectors(unit="m"),  # where the centre may be while all neighbours are known
    search_upper=vectors(unit="m"),
    trapped_impacts=ints("int32"),  # impacts one after the other with what cannot be moved
    last_impact=floats(unit="s"),  # since the start of the step
)  # fmt: skip
EVALUATIONS = Section(
    "body", "integrator", "the integrator evaluates forces more than once, or flies exactly",
    acceleration=vectors(unit="m/s^2"),
    flight_velocity=vectors(unit="m/s"),  # of an event-driven world, after the first half kick
    rk_middle=vectors(unit="m"),
    rk_speeds=vectors(unit="m/s"),
    rk_kicks=vectors(unit="m/s"),
)  # fmt: skip
SPINS = Section(
    "body", "rotation", "bodies spin: a plugin's stages say how fast, and contacts change that",
    spin=vectors(unit="rad/s"),  # in 2D the first component
    inverse_inertia=vectors(unit="1/(kg m^2)"),  # in 2D the first component; in 3D xx, yy, zz along the world's axes,
    inverse_products=vectors(unit="1/(kg m^2)"),  # and xy, xz, yz; 0: contacts do not turn it
    rolling_radius=floats(default=0.0, unit="m"),  # of a round body; 0: its surface moves as its centre
    rolling_friction=floats(unit="m"),
    turn=vectors(unit="rad"),  # in the step
    # m: how far turning moves points of the last level that has been measured, per rad, at most; only of what turns
    reach=floats(unit="m"),
    driven=floats(default=0.0, unit="m"),  # by which motors may move it, about where joints hold it, farther than that
    driven_turn=floats(default=0.0, unit="rad"),  # by which they may turn it
    joined=ints("int32", default=-1),  # by which joints, see joints.bodies; -1: by none that is active
)  # fmt: skip
FAILS = "the start of the step, for one that fails"
UNDO_COLUMNS = Section("body", "going back", FAILS, kept_previous=vectors(unit="m"), kept_velocity=vectors(unit="m/s"))
UNDO_FORCE = Section("body", "going back", FAILS, kept_step_force=vectors(unit="N"))
UNDO_HOLD = Section(
    "body", "going back", FAILS, kept_hold=vectors(unit="m/s^2"), kept_held_velocity=vectors(unit="m/s")
)  # fmt: skip
SLEEPING = Section(
    "body", "sleeping", "bodies may sleep: islands, and whether anything has changed them",
    rest_root=ints("int32"),
    keeps_awake=flags(),
)  # fmt: skip

# Columns of the records alone: no rows, or one for each of the table from when something asks for them.
BODY_SECTIONS = (
    START_COLUMNS, QUARANTINE, COLLISIONS, PREDICTED, REST_COLUMNS, CURVES, SWEEP_COLUMNS, EVALUATIONS, SPINS,
    PART_COLUMNS, UNDO_COLUMNS, UNDO_FORCE, UNDO_HOLD,
    SLEEPING,
)  # fmt: skip


def all_rows(state):
    """For ``Rows`` of the bodies."""
    return state.count


BODY_COLUMNS = tuple(name for section in BODY_SECTIONS for name in section)

BODIES = Schema(
    "Bodies", *TABLE_SECTIONS, SLEEP_COLUMNS, HELD_COLUMNS, DAMPING_COLUMNS, *BODY_SECTIONS,
    Section(
        "body", "rotation", "some body is rotated, or a shape reads its axes",
        axes=floats(unit="1"),  # rotation matrices (n, d, d), flat,
        axes_rotation=floats(unit="rad or 1"),  # and the rotations that they are of
    ),
    Section(
        "body", "shapes", "which shapes a body has",
        levels=ints("int8", stacked=True),  # cheapest first, the last one repeated
    ),
    # With those that are not enabled, which have inertia. The same array as ``levels`` while all are.
    Section(own_levels=ints("int8", stacked=True)),
    Section("body", "shapes", "where its shapes are", level_offsets=vectors(stacked=True, unit="m")),
    Section(
        "static body", "collisions", "where it stood when its box was made",
        static_position=vectors(unit="m"),  # from row 0
    ),
    rotation=floats(unit="rad or 1"),  # one angle, in 3D four numbers per body; without rows no body is rotated
    previous_rotation=floats(unit="rad or 1"),  # at the start of the step, in worlds where bodies turn: for drawing
    shape=ints("int8"),  # of the last level; -1: none
    offset=vectors(unit="m"),  # of the last level, in the world
    level_not_enclosing=flags(),  # a rotated level may reach out of the one around it
)  # fmt: skip

DYNAMIC_ROWS, STATIC_ROWS, ALL_ROWS = range(3)

# A column that code of the game may write in place, and what the field allows.
CHECKED = Schema(
    "Checked",
    values=floats(),
    owned=flags(),  # bodies that have the component
    width=integer(),  # numbers per body
    rows=integer(),  # which bodies: DYNAMIC_ROWS and the like
    low=number(),
    high=number(),
    least=number(),  # sum of a row's magnitudes
    statics=flag(),  # rows of static bodies may have been written, too
    optional=flag(),  # nan stands for None
)

# Fields that every collider has, by the slot of its type and the row.
COLLIDERS = Schema(
    "Colliders",
    offset=vectors(stacked=True, default=default_of(Collider.offset), unit="m"),
    restitution=floats(stacked=True, default=default_of(Collider.restitution), unit="1"),
    friction=floats(stacked=True, default=default_of(Collider.friction), unit="1"),
    sensor=flags(stacked=True, default=default_of(Collider.sensor)),
    layer=ints(stacked=True, default=default_of(Collider.layer)),
    mask=ints(stacked=True, default=default_of(Collider.mask)),
    group=ints(stacked=True, default=default_of(Collider.group)),
    one_way=vectors(stacked=True, default=default_of(Collider.one_way), unit="1"),
    surface_velocity=vectors(stacked=True, default=default_of(Collider.surface_velocity), unit="m/s"),
)

# Linked functions and parameters of the scene's shapes, cheapest first; a pair is at first * count + second, where
# first <= second.
SHAPES = Schema(
    "Shapes",
    count=integer(),
    slots=ints(),  # in the stacks of the colliders
    parameters=ints(),  # addresses of the shapes' parameter records, as they are in the world
    own_parameters=ints(),  # the same as the components have them, before rotation
    bounds=ints(),
    half_thickness=ints(),
    rotated=ints(),  # 0 for shapes that rotation does not change, both
    moments=ints(),  # 0 for shapes that do not tell; empty unless a stage of a plugin asks
    material=ints(),  # 0 for shapes that are the same everywhere
    concave=flags(),
    sharp=flags(),  # of faces that meet in corners
    flipped=flags(),  # pairs that are registered as (second, first); the functions below take them so
    evaluate=ints(),
    batch=ints(),
    sweep=ints(),  # 0: no closed form
    corner=ints(),  # 0: none of the pair's own
    mixing=ints(),  # rules of plugins
)

CAME_NEAR = "bodies have come near each other"
FOUND = Section("pair", "pairs", CAME_NEAR, first=ints("int32"), second=ints("int32"))
HALVES = Section("pair", "pairs", CAME_NEAR, half_a=ints("int32"), half_b=ints("int32"))
SORTED = Section(
    "pair", "pairs", CAME_NEAR,
    sorted_a=ints("int32"),
    sorted_b=ints("int32"),
    kind=ints("int32"),  # pair of shapes
    bucket=ints("int32"),  # candidates by pair of shapes
)  # fmt: skip
CANDIDATES = Schema(
    "Candidates", FOUND, HALVES, Section("pair", "pairs", CAME_NEAR, starts=ints("int32")), SORTED,
    count=integer(),
    bucket_starts=ints("int32"),
)  # fmt: skip

# Pairs whose layers meet, a's entity id the smaller, in canonical order.
PAIR_COLUMNS = Section(
    "pair", "pairs", CAME_NEAR,
    a=ints("int32"),
    b=ints("int32"),
    is_solid=flags(),  # they push each other
    hit=flags(),
    near_contact=flags(),  # the response may concern them
    crossed=flags(),  # they have met on their way, and have not pushed
    impulse=floats(unit="N s"),
    struck=floats(unit="s"),  # time of its last impact in this step, where there is an impulse
    parting=flags(),  # it rests, and flies apart or is sent back: no overlap to be pushed out
    # the manifold, made once in a step: what the pair's function says of
    at=vectors(unit="m"),  # this way from the centre of a's shape to that of b's; nan: of none
    depth=floats(unit="m"),
    normal=vectors(unit="1"),
    point=vectors(unit="m"),  # relative to the centre of a's shape; if they have crossed: in the world
    early=flags(),  # it was made where the step starts, as the two rested in the step before
    found=integer(),  # contacts of the narrow phase: hits
    hits=ints("int32"),
    disabled_count=integer(),
    disabled=flags(),  # the contact counts as none
    rests=flags(),
    resting_count=integer(),
    resting=ints("int32"),
    touching_count=integer(),
    touching=ints("int32"),
    place=ints("int32"),  # while two lists are merged
)  # fmt: skip
PAIRS = Schema("Pairs", PAIR_COLUMNS, count=integer())

# Contacts at the end of the step and of the one before: [now, i] and [1 - now, i].
CONTACT_ROWS = Section(
    "contact", "contacts", "bodies have touched",
    entity_a=ints(stacked=True),
    entity_b=ints(stacked=True),
    point=vectors(stacked=True, unit="m"),
    normal=vectors(stacked=True, unit="1"),
    depth=floats(stacked=True, unit="m"),
    impulse=floats(stacked=True, unit="N s"),
    enabled=flags(stacked=True),
    rested=flags(stacked=True),
    ended=ints("int32"),
    began=ints("int32"),
    stayed=ints("int32", stacked=True),
)  # fmt: skip
CONTACTS = Schema(
    "Contacts", CONTACT_ROWS,
    now=integer(),
    counts=ints(),
    ends=integer(),
    begins=integer(),
    before=integer(),  # ``now`` at the start of the step
    stays=ints(),  # one for each of the two
    stored=integer(),  # those among what sleeps, which are kept elsewhere
    steps=ints(),  # numbers of the steps that the contacts are of
)  # fmt: skip

# The solver's columns: those of contacts, but for faults, from ``bodies`` on those of bodies, islands,
# ranges, and those of either that are there where bodies spin.
_APART = "addresses", "faults", "faulty", "joints", "direct"
_fields = {name: field for name, field in SOLVER.fields.items() if name not in _APART}
SOLVER_ARMS = Section("contact", "rotation", "bodies spin", **{name: _fields.pop(name) for name in ARM_COLUMNS})
SOLVER_SPINS = Section("body at rest", "rotation", "bodies spin", **{name: _fields.pop(name) for name in TURN_COLUMNS})
SOLVER_SURFACES = Section("contact", "contacts at rest", "surfaces run", surface_slip=_fields.pop("surface_slip"))
_split = list(_fields).index("bodies")
SOLVER_CONTACTS = Section("contact", "contacts at rest", RESTED, **dict(list(_fields.items())[:_split]))
SOLVER_BODIES = Section("body at rest", "contacts at rest", RESTED, **dict(list(_fields.items())[_split:]))
SOLVER.sections = SOLVER_CONTACTS, SOLVER_ARMS, SOLVER_SURFACES, SOLVER_BODIES, SOLVER_SPINS

STATE = Schema(
    "State",
    **PROGRAM_FIELDS,
    links=ints(),  # addresses of parts of stages, see linking.parts
    plugin_stages=ints(),  # by stage: the address of what it has of its own, see systems/plugin_stages
    needed=integer(),  # rows that a stage asks for
    checked=ints(),  # addresses of records of CHECKED
    sleeping=flag(),  # the settings say so
    all_still=flag(),  # in this step nothing moves that could meet another
    moving_meet=flag(),  # layers and masks let some bodies meet that move
    asleep=integer(),  # bodies that sleep, or are about to
    due=integer(),  # bodies that do from the next step on
    sleep_stages=integer(),  # those of sleeping that have run in this step, as bits
    fresh_statics=integer(),  # bodies that cannot move and are new, or have been changed
    quarantining=flag(),  # some body is, or was told of and may be sound again
    # the scene
    count=integer(),
    sleepers=integer(),  # rows before it sleep; ids ascend before it, and from it on,
    first=integer(),  # rows before it take no part in this step: all that sleep, or none if some are disturbed
    force_first=integer(),  # forces are summed from this row on: where they may be others than before, of all
    pushes=flag(),  # code of the game may have pushed sleepers
    dynamic=integer(),  # rows before it are dynamic
    moving=integer(),  # rows before it move
    version=integer(),  # of the table's rows
    ranks_version=integer(),  # of the rows that ``bodies.rank`` is of
    support_version=integer(),  # of the rows of which no static one is marked as ``bodies.warm_started``
    gravity=vectors(unit="m/s^2"),  # one row
    collides=flag(),
    several_levels=flag(),
    level_count=integer(),
    slot_count=integer(),  # types of colliders in the stacks
    has_force_systems=flag(),
    rotated=flag(),  # some body is, or may be before the step ends
    has_parts=flag(),  # bodies have parts: ``bodies.owner`` and what goes with it have rows
    spinning=flag(),  # some body spins: ``bodies.spin`` and what goes with it have rows
    limits_speed=flag(),
    others_write=flag(),  # code that is not carom's runs in the step
    # settings
    dt_cubed=number(unit="s^3"),
    substeps=integer(),
    mode=integer(),
    slop=number(unit="m"),  # below 0: from the sizes
    restitution_threshold=number(unit="m/s"),  # below 0: from the forces
    max_impacts=integer(),
    restitution_rule=integer(),
    friction_rule=integer(),
    moves_with_old_velocity=flag(),  # the integrator's straight path
    flies=flag(),  # event-driven: exact flight between impacts
    force_changes=flag(),  # with position, velocity or time
    uses_plugin_broad_phase=flag(),
    pairs_filtered=flag(),  # by plugins
    # the step
    unforced=flag(),
    pushed=flag(),
    moved=flag(),
    sweeping=flag(),
    path_degree=integer(),
    usual_path_degree=integer(),  # of the integrator
    force_travels=number(unit="m"),
    step_number=integer(),
    neighbours_known_until=number(unit="s"),
    any_warm_started=flag(),
    heavy_damping=number(unit="1/s"),
    heavy_step=number(unit="s"),
    rk_stage=integer(),
    drifted=flag(),
    damped=flag(),
    rotation_stale=flag(),  # axes have to be made, whether some body is rotated or not
    positions_exposed=flag(),  # those of static bodies may be written at any time
    inverse_masses_exposed=flag(),
    statics_version=integer(),  # another whenever a static body may have changed; and the one that these are of:
    read_version=integer(),  # inverse masses, checked columns,
    boxed_version=integer(),  # boxes,
    shared_version=integer(),  # with the version: spins,
    frame=floats(unit="m"),  # extent of the moving bodies' boxes
    pair_search=integer(),  # what finds candidates in this step, see broad_phase.stages
    response_idle=flag(),  # nothing is near anything, and nothing rested
    ids_changed=flag(),  # ids mean other entities than in the last step
    contacts_version=integer(),
    motion_version=integer(),  # changes whenever bodies may have moved
    stay_wanted=flag(),  # contact_stay has a handler
    thinnest_static=number(unit="m"),  # the smallest extent of a static body, but for those without any
    thinnest_moving=number(unit="m"),
    too_fast_for_discrete=flag(),  # a body is so fast that discrete collisions may miss what it passes:
    too_fast_row=integer(),
    turns_too_far=integer(),  # 1 + the row of a body that may turn past others within the step; 0: none
    event_count=integer(),  # events of contacts in the last step that no history has yet
    # what an error names
    blamed=integer(),  # 1 + the row of a body for which a plugin's stage raises an error; 0: none
    row_a=integer(),
    row_b=integer(),
    unsound=integer(),
    unsound_a=integer(),
    unsound_b=integer(),
    # counters
    bodies_counted=integer(),
    force_evaluations=integer(),
    candidates_counted=integer(),
    pairs_counted=integer(),
    evaluations_counted=integer(),  # calls of pairs' functions
    contacts_counted=integer(),
    resting_counted=integer(),
    islands_counted=integer(),
    refined_counted=integer(),  # islands with more substeps than usual
    solved_counted=integer(),  # rows in all passes
    restrained_counted=integer(),  # islands that the guard has taken energy from,
    restrained_energy=number(unit="J"),  # and how much, J
    impacts_counted=integer(),
    capped_counted=integer(),
    refreshes_counted=integer(),
    looks_counted=integer(),  # pairs searched for their next impact
    first_level_tests=integer(),
    first_level_hits=integer(),
    false_positives=integer(),
    forces_summed=flag(),  # ``force`` holds the sum of this step
    sweeps_ready=flag(),  # what swept bodies need is linked,
    rest_ready=flag(),  # and what contacts at rest need
    kept=integer(),  # what a failed step puts back, see stage_list.KEPT,
    kept_first=integer(),  # from this row on
    kept_rows=integer(),  # those of previous_position that the step may change
    flight_usual=flag(),  # after the flight no number was far out
    flight_seen=integer(),  # rows of which the integrator has noted that already
    impacts_recorded=flag(),  # in the history of world.contacts
    found_current=flag(),  # the contacts are those of the narrow phase,
    found_at_end=flag(),  # where free flight leads, of all pairs
    candidates_ready=flag(),
    contacts_ready=flag(),
    # records
    bodies=BODIES,
    colliders=COLLIDERS,
    shapes=SHAPES,
    candidates=CANDIDATES,
    pairs=PAIRS,
    merged=PAIRS,  # room for the pairs of the rest of the step
    solver=SOLVER,
    warm_start=WARM_START,
    contacts=CONTACTS,
    impacts=IMPACTS,
    parts=PARTS,
    grid=GRID,  # of what moves
    static_grid=GRID,
    tree=TREE,  # for queries: of what moves or sleeps and is in no grid,
    static_tree=TREE,  # and of what does not
)

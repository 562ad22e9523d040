"""Records of the solver: rows and their bodies in a step, and what is known of the contacts of the last one."""

from __future__ import annotations

from ....framework.compilation import inlined
from ....framework.jit.records.schema import Schema, Section, flag, flags, floats, integer, ints, table, vectors
from ...joints.records import DIRECT, JOINTS

# What has gone wrong in a step, of which faults will tell: how many bodies or joints of each kind, and the first.
SQUEEZED, OVERLOADED, RESTRAINED, TORN_OPEN = range(4)
# there is no room where they are pushed; they count as lighter than they are; first bodies of islands to which contacts
# would have given much energy; joints that are wide open
KINDS_OF_FAULT = 4

ROW_CHUNK = 64  # pairs at most: their columns stay in the processor's first cache

SOLVER = Schema(
    "Solver",
    unshared=True,
    # rows: contacts at rest, in the order of their ranges and colours
    addresses=ints(),  # of parts that it calls: the links of the state
    contacts=integer(),
    slot=ints("int32"),  # the row of contact r,
    pair=ints("int32"),  # its pair,
    point=ints("int8"),  # and which of the points of that
    colour=ints("int8"),  # of contact r: twice that of its pair, one more if that has several points
    listed=ints("int32"),  # some rows; or after each that is listed the next one
    first=ints("uint32"),  # places of the two bodies
    second=ints("uint32"),
    normal=vectors(unit="1"),
    gap=floats(unit="m"),  # along the normal, where the step starts; below 0: overlap
    apart=flags(),  # there is a gap where the step starts
    parting=flags(),  # it bounces: no overlap to be pushed out
    mass=floats(unit="kg"),  # see effective_mass
    friction=floats(unit="1"),
    extent=floats(unit="m"),
    impulse=floats(unit="N s"),  # in a substep, along the normal,
    tangent=vectors(unit="N s"),  # and along the surface
    total=floats(unit="N s"),  # in the step
    previous=floats(unit="N s"),  # impulse before a pass or a substep
    target_speed=floats(unit="m/s"),  # at which it may close,
    pushing=floats(unit="m/s"),  # the same in the pass that pushes: where it is closed what its gap asks,
    push_rate=floats(unit="1/s"),  # which is the gap, below 0 of overlap, times this,
    most_push=floats(unit="m/s"),  # but not below this
    soft=floats(unit="1"),  # share of its impulse that it gives back in that pass; below 0 where it is open: none
    peak=floats(unit="N s"),  # largest impulse in this step, that it starts with counts
    hard=flags(),  # before that: its normal does not stand for several faces
    has_friction=flag(),
    any_tips=flag(),  # some pair has several points
    has_rolling=flag(),
    lopsided=flag(),  # some body has such a middle
    # where bodies spin:
    place=vectors(unit="m"),  # of the point, from the centre of the first shape
    arm_a=vectors(apart=True, unit="m"),  # from the centres of mass to the surfaces there,
    arm_b=vectors(apart=True, unit="m"),
    core_a=vectors(apart=True, unit="m"),  # and to what of the shapes turns: a rounding stays along the normal
    core_b=vectors(apart=True, unit="m"),
    tangent_mass=floats(unit="kg"),  # that an impulse along the surface moves
    rolling=floats(unit="m"),  # of rolling friction
    rolled=vectors(unit="N m s"),  # in a substep, by that
    # where surfaces run:
    surfaces_run=flag(),
    surface_slip=vectors(unit="m/s"),  # of the second body's surface, as the first one's sees it
    # of the bodies of each pair, where the row of its first point is:
    mass_a=floats(unit="1/kg"),  # inverse masses,
    mass_b=floats(unit="1/kg"),
    inertia_a=vectors(apart=True, flat=1, unit="1/(kg m^2)"),  # inverse moments,
    inertia_b=vectors(apart=True, flat=1, unit="1/(kg m^2)"),
    products_a=vectors(apart=True, flat=0, unit="1/(kg m^2)"),
    products_b=vectors(apart=True, flat=0, unit="1/(kg m^2)"),
    ends=ints("int32"),  # where each chunk ends,
    points=ints("int8"),  # and how many rows each of its pairs has
    chunks=integer(),
    first_chunk=integer(),  # of a range
    visits=integer(),  # rows solved in this step
    # bodies, in the order of their ranges
    bodies=integer(),
    body_row=ints("int32"),
    used=ints(),  # colours of its rows; later a row
    island=ints("int32"),  # -1: cannot be moved
    group=ints("int32"),  # of what joints join
    velocity=vectors(unit="m/s"),
    velocity_before=vectors(unit="m/s"),  # of a substep, without contacts
    shift=vectors(unit="m"),  # since the step began
    acceleration=vectors(unit="m/s^2"),
    inverse_mass=floats(unit="1/kg"),
    solver_mass=floats(unit="kg"),  # 0 for what cannot be moved
    mass_ratio=floats(unit="1"),  # solver mass / real mass
    spin=vectors(flat=1, unit="rad/s"),  # where bodies spin, as in the records of the bodies
    spin_before=vectors(flat=1, unit="rad/s"),  # of a substep
    turn=vectors(flat=1, unit="rad"),
    middle=vectors(unit="m"),  # of the ball that touches, from its mass centre; 0: that is the same, or no ball does
    sine=floats(unit="1"),  # shares of that, see shares_of_turn
    versine=floats(unit="1"),
    inverse_inertia=vectors(flat=1, unit="1/(kg m^2)"),
    inverse_products=vectors(flat=0, unit="1/(kg m^2)"),
    frame=table("float64", 4, unit="1"),  # principal axes, a quaternion, with joints in space: see turning
    inverse_moments=vectors(unit="1/(kg m^2)"),  # about these
    reach=floats(unit="m"),  # of its shape from its centre of mass
    number=ints("int32"),
    mover=ints("int32"),  # bodies that move by themselves
    movers=integer(),
    held=floats(unit="N s"),  # by its strongest hard contact; above 0 before that: something presses on it
    # islands
    islands=integer(),
    size_of=ints("int32"),  # rows
    mass_of=floats(unit="kg"),
    force_of=floats(unit="N s"),  # that forces give in the step
    lightest=floats(unit="1/kg"),  # inverse mass of the heaviest body
    most_change=floats(unit="m/s"),  # that forces make in the step
    stiff=floats(unit="1/(kg m)"),  # largest inverse mass of a row over its extent
    own=floats(unit="1/m"),  # the same times the mass of the lighter body
    approach_extents=floats(unit="1"),  # extents per step that some row closes
    substeps_of=ints("int32"),  # before they are chosen: as many as a blow on its joints needs
    load_share=floats(unit="1"),  # share of its heaviest body that it can bear
    range_of=ints("int32"),
    slope=floats(unit="J"),  # see guard.measure_energy
    curvature=floats(unit="J"),
    energy=floats(unit="J"),
    allowed=floats(unit="J"),
    share=floats(unit="1"),  # before that how many times better the rows of a struck island are solved than others
    taken=floats(unit="J"),  # that the guard has taken in this step
    tips=flags(),  # some pair has several points
    struck=flags(),  # some row is far from solved
    listed_of=ints("int32"),  # rows of it that further passes go over
    credit=floats(unit="J"),  # that joints have taken in this step, and may give back; inf: motors or springs give any
    at_once=flags(),  # some of its joints are solved at once
    sway=floats(unit="1/m"),  # how fast light bodies of joints swing that bear heavy ones, see direct
    links=ints("int32"),  # rows of joints
    # ranges: the ordinary islands, then each special one, whose bodies are all of it
    ranges=integer(),
    usual=integer(),  # substeps,
    row_ends=ints("int32"),
    body_ends=ints("int32"),
    joint_ends=ints("int32"),
    # of each kind of faults:
    faults=ints(),  # how many there are,
    faulty=ints(),  # and the row of the first body
    joints=JOINTS,
    direct=DIRECT,
)

ARM_COLUMNS = (
    "place", "arm_a", "arm_b", "core_a", "core_b", "tangent_mass", "rolling", "rolled", "mass_a", "mass_b", "inertia_a",
    "inertia_b", "products_a", "products_b", "ends", "points",
)  # fmt: skip
TURN_COLUMNS = (
    "spin", "spin_before", "turn", "middle", "sine", "versine", "inverse_inertia", "inverse_products", "frame",
    "inverse_moments", "reach",
)  # fmt: skip

# Impulses of the contacts at rest, for the next step: [now, i] is the memory, [1 - now, i] is written.
RESTED = "contacts rested in the step before"
WARM_START_ROWS = Section(
    "contact", "contacts at rest", RESTED,
    entity_a=ints(stacked=True),
    entity_b=ints(stacked=True),
    place=vectors(stacked=True, unit="m"),  # of the point; nan where no body spun
    impulse=floats(stacked=True, unit="N s"),  # of the last substep, as if the step were one,
    tangent=vectors(stacked=True, unit="N s"),  # and along the surface
    total=floats(stacked=True, unit="N s"),  # what it gave in the step
    first=ints("int32", stacked=True),  # rows of the pairs, for ``rows_version``
    second=ints("int32", stacked=True),
    off=flags(),  # of no use in this step
)  # fmt: skip
WARM_START = Schema(
    "WarmStart", WARM_START_ROWS,
    now=integer(),
    before=integer(),  # ``now`` at the start of the step
    counts=ints(),
    rows_version=ints(),
    step=floats(unit="s"),  # that the impulses are for
    period=floats(unit="s"),  # of a step with springs as soft as those of the last one
)  # fmt: skip


@inlined
def note_fault(solver, kind, first):
    """One more. first: the row of a body, the entity of a joint, if it is the first."""
    if solver.faults[kind] == 0:
        solver.faulty[kind] = first
    solver.faults[kind] += 1

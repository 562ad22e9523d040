"""Rows of joints, which a plugin writes where joints or their fields change; see measuring."""

from __future__ import annotations

from ...framework.jit.records.schema import Column, Schema, flag, floats, integer, ints, number, table, vectors

POINT, ROD, SLIDE, TURN, ALIGN, CONE, TWIST, CUSTOM = range(8)
HOLD, LIMIT, DRIVE, SPRING, SERVO, FREE = range(6)
BY_PASSES, HELD_AT_ONCE, LIMITED_AT_ONCE = range(3)
NOT_JOINED = -1  # of a body that no active joint holds
MOST_NEIGHBOURS = 64  # neighbours of a body where joints are solved at once

JOINTS = Schema(
    "Joints",
    count=integer(),
    joint=ints(),  # the entity of a row's joint
    kind=ints("int8"),  # POINT, ROD, SLIDE, TURN, ALIGN, CONE, TWIST, CUSTOM
    rule=ints("int8"),  # HOLD, LIMIT, DRIVE, SPRING, SERVO, FREE
    entity_a=ints(),  # 0: the world
    entity_b=ints(),
    anchor_a=vectors(unit="m"),  # from the body's position, along its own axes; of the world a place; of angles in
    anchor_b=vectors(unit="m"),  # space unit vectors
    axis=vectors(unit="1"),  # along the axes of a, of what slides or turns; of what turns in a plane (1, 0)
    low=floats(unit="m or rad"),  # the least, or the only one,
    high=floats(unit="m or rad"),  # and the most
    target=floats(unit="m/s or rad/s"),
    most=floats(unit="N or N m"),
    frequency=floats(unit="Hz"),  # of springs
    damping_ratio=floats(unit="1"),
    breaking_force=floats(unit="N"),  # of all rows of the joint; inf: none
    breaking_torque=floats(unit="N m"),  # likewise
    function=ints(),  # of a CUSTOM: address of the function of a plugin,
    part=ints("int8"),  # which of its rows,
    numbers_at=ints("int32"),  # and where the fields of the joint begin
    numbers=floats(),
    # what is kept from step to step
    load=floats(unit="N or N m"),  # in the last substep,
    pull=vectors(unit="N"),  # and that of a POINT
    total=floats(unit="N s or N m s"),  # in the step
    thrust=vectors(unit="N s"),
    normal=vectors(unit="1"),  # along which it acts, or about which
    along_a=vectors(unit="1"),  # of a CUSTOM: the same for the first body
    value=floats(unit="m or rad"),  # of a CUSTOM, after the last substep; of the first row of a joint in space with a
    # TURN or TWIST the angle of that, with whole turns: it stays with the joint while that holds the same bodies
    old_load=floats(unit="N or N m"),  # the same before the step
    old_pull=vectors(unit="N"),
    old_normal=vectors(unit="1"),
    old_along_a=vectors(unit="1"),
    old_value=floats(unit="m or rad"),
    # pairs of bodies that joints keep from touching, the smaller id first, in order
    apart=integer(),
    apart_a=ints(),
    apart_b=ints(),
    # in a step
    kept_in=integer(),  # 1 + the number of the step that these were kept in
    rows_version=integer(),  # of the rows of bodies
    row_a=ints("int32"),  # -1: the world, or a body that is gone
    row_b=ints("int32"),
    active=integer(),  # rows that take part, in the order of their ranges:
    order=ints("int32"),
    stream=ints("int32"),  # of each place: what holds points of an island, or all else of it
    at_once=ints("int8"),  # BY_PASSES, or with all such of its island: HELD_AT_ONCE, LIMITED_AT_ONCE; see direct
    group=ints("int32"),  # of its bodies, as that was numbered first
    open_row=ints("int32"),  # some of these
    first=ints("int32"),  # places of the two bodies
    second=ints("int32"),
    base_a=vectors(unit="m"),  # anchors where the step has turned the bodies
    base_b=vectors(unit="m"),
    rail=vectors(unit="1"),  # axis, likewise
    between=vectors(unit="m"),  # from a to b where the step starts
    angle=floats(unit="rad"),  # likewise as the step has turned the bodies
    axes_a=vectors(unit="1"),  # of the bodies of a CUSTOM, likewise: as many rows as there are dimensions
    soft_further=vectors(unit="1 or 1/m or m"),
    axes_b=vectors(unit="1"),
    period=number(unit="s"),  # of a usual substep whose springs are as soft as those of this step
    # in a range
    begin=integer(),  # places in ``order``
    end=integer(),
    step=number(unit="s"),  # of a substep
    stiffness=number(unit="1"),  # of what holds
    rate=number(unit="1/s"),  # at which what holds pushes its error out
    asked=integer(),  # the joint whose function runs now; 0: none
    push_rate=floats(unit="1/s"),  # at which error is pushed out,
    mass_scale=floats(unit="1"),  # and what makes it soft
    impulse_scale=floats(unit="1"),
    # in a substep
    arm_a=vectors(unit="m"),
    arm_b=vectors(unit="m"),
    gap=vectors(unit="m"),  # of a POINT, and what else holds a length
    turn_a=vectors(unit="1 or m"),  # of a CUSTOM: about which it turns them
    turn_b=vectors(unit="1 or m"),
    mass=floats(unit="kg or kg m^2"),
    inverse=vectors(unit="1/kg"),  # of the masses of a POINT: diagonal,
    inverse_products=vectors(unit="1/kg"),  # and beside it
    pushing=floats(unit="m/s or rad/s"),  # that the passes ask for,
    target_speed=floats(unit="m/s or rad/s"),  # and those that do not push
    least=floats(unit="N s or N m s"),
    greatest=floats(unit="N s or N m s"),
    impulse=floats(unit="N s or N m s"),
    push=vectors(unit="N s"),  # of a POINT
    answer=vectors(unit="1 or 1/m or m"),  # of each row before it in its joint that holds, for each N or N m of it,
    soft_answer=vectors(unit="1 or 1/m or m"),  # the same of those that give way, in the pass that pushes
    further=vectors(unit="1 or 1/m or m"),  # and of those beyond as many as there are dimensions
)

# Islands whose joints are solved at once, by the places of their bodies; blocks of two bodies have rows of their own.
DIRECT = Schema(
    "Direct",
    bodies=integer(),
    body=ints("int32"),  # places in the order in which they go,
    place=ints("int32"),  # and where each is in that
    body_ends=ints("int32"),  # of each range
    degree=ints("int32"),  # neighbours when it goes; -1: it has no such joint,
    near=table("int32", MOST_NEIGHBOURS),  # these,
    block=table("int32", MOST_NEIGHBOURS),  # and where their blocks are
    blocks=integer(),
    root=table("float64", 6),  # of its inverse inertia
    diagonal=table("float64", 36),  # of the matrix, then its root
    solution=table("float64", 6),
    push=vectors(unit="N s"),
    twist=vectors(unit="N m s"),
    values=table("float64", 36),  # of a block
    # of groups of bodies, by their first ones
    light=floats(unit="1/kg"),  # inverse mass of the lightest body,
    heavy=floats(unit="1/kg"),  # of the heaviest that a joint holds,
    swing=floats(unit="1/(kg m)"),  # and the largest one of a joint over its length
    welds=ints("int32"),
    freedom=ints("int32"),  # twice of what joints leave free, less one for each body
    # in a range
    begin=integer(),
    end=integer(),
    stiffer=number(unit="1"),  # times as stiff as where the pass pushes
    mixed=flag(),  # some of its rows are solved by passes
)
DIRECT_BODIES = [name for name, field in DIRECT.fields.items() if isinstance(field, Column) and name != "values"]

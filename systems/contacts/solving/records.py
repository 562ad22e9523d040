"""Records of the solver: contacts at rest and their bodies in a step, and what is known of those of the last one."""

from __future__ import annotations

from ....framework.jit.records.schema import Schema, flag, flags, floats, integer, ints, table, vectors

# Contacts at rest and their bodies, while they are solved.
SOLVER = Schema(
    "Solver",
    contacts=integer(),
    first=ints("uint32"),
    second=ints("uint32"),
    slot=ints("int32"),  # place of contact r in these columns, which are sorted by colour
    pair=ints("int32"),  # and whose place that is
    colour=ints("int8"),
    normal=vectors(),
    tangent=vectors(),
    gap=floats(),
    apart=flags(),  # where the step starts
    varies=flags(),  # its normal stands for several faces
    mass=floats(),
    friction=floats(),
    extent=floats(),
    impulse=floats(),
    total=floats(),
    opening=floats(),
    pushing=floats(),
    in_block=flags(),
    blow=floats(),  # impulse of a shock in this substep,
    blow_tangent=vectors(),
    shock=floats(),  # and of all in this step
    asked=ints(),  # a bit for each contact
    batch=ints("int32"),  # contacts that are asked at the same time, how much their impulses change,
    change=floats(),
    speed=floats(),  # and the speed of the shock that they come from
    contact_of=table("int32", 8),  # the contacts of each body that can be moved, body by body,
    worked=flags(),
    parting=flags(),
    active=flags(),
    soft=flags(),
    firm=flags(),  # of a body that touches only what cannot be moved
    rigid=flags(),
    any_rigid=flag(),
    any_uneven=flag(),  # contacts of a light body and a heavy one that can be moved
    deep=flags(),
    direction=floats(),
    tolerance=floats(),
    previous=floats(),
    error=floats(),
    converging=flags(),  # in an island with rigid contacts
    velocity_before=vectors(),
    velocity_way=vectors(),
    island=ints("int32"),
    size=ints("int32"),  # contacts of an island
    open=flags(),
    going=flags(),
    across=floats(),
    along=floats(),
    far=floats(),
    worst=floats(),
    stopper=ints("int32"),
    islands_known=flag(),
    squeezed=integer(),  # bodies for which there is no room where they are pushed,
    squeezed_row=integer(),  # and the first of them
    light_of=ints("int32"),
    before=ints("int32"),
    heaviest=ints("int32"),
    fastest=floats(),
    blocks=integer(),
    block=table("int32", 2),
    has_friction=flag(),
    bodies=integer(),
    body_row=ints("int32"),
    used=ints(),
    last=ints("int32"),
    velocity=vectors(),
    shift=vectors(),
    acceleration=vectors(),
    inverse_mass=floats(),
    contacts_until=ints("int32"),  # and where those of each body end
    linked=flag(),
    reach=floats(),
    visits=integer(),  # times that a contact was solved in this step,
    shock_visits=integer(),  # and in shocks
    waits=flags(),  # a firm one that is open where the step starts
    unsettled=flags(),
    any_unsettled=flag(),
    starts=ints(),
)

# Impulses of the contacts at rest, for the next step: [now, i] is the memory, [1 - now, i] is written.
WARM_START = Schema(
    "WarmStart",
    now=integer(),
    before=integer(),  # ``now`` at the start of the step
    counts=ints(),
    entity_a=ints(stacked=True),
    entity_b=ints(stacked=True),
    normal=vectors(stacked=True),
    impulse=floats(stacked=True),
    total=floats(stacked=True),
    tangent=vectors(stacked=True),
    first=ints("int32", stacked=True),  # rows of the pairs, for ``rows_version``
    second=ints("int32", stacked=True),
    rows_version=ints(),
    step=floats(),
    substep=floats(),
    work=floats(),
)

"""The record of the impacts of a step: their queue, those at the same time, and the log of what has happened."""

from __future__ import annotations

from ...framework.jit.records.schema import Schema, Section, flag, flags, floats, integer, ints, number, vectors

BOUNCED = "bodies have bounced"
EVENTS = Section(
    "impact", "impacts", BOUNCED,
    event_pair=ints("int32"),
    event_count_a=ints(),  # impact_count of both bodies when the event was made
    event_count_b=ints(),
    event_kind=ints("int8"),
    event_time=floats(unit="s"),
    event_key=ints(),
    event_change=floats(unit="m/s"),  # of the speed along the normal
    event_normal=vectors(unit="1"),
    event_point=vectors(unit="m"),
    event_pull=vectors(unit="m/s"),  # change of velocity along the surface
    heap=ints("int32", numbered=True),  # a permutation
    worklist=ints("int32"),  # pairs to search for their next impact,
    listed_since=floats(unit="s"),  # each from this time on
    links=ints("int32"),  # to a body's next pair
)  # fmt: skip
BEARINGS = Section(
    "impact", "impacts", BOUNCED,
    heads=ints("int32"),  # the first pair of each body
    borne=flags(),  # a contact at rest bears it
)  # fmt: skip
# Impacts at the same time: the events, by member; lists of the members of each body.
MEMBER_LISTS = Section("impact", "impacts", BOUNCED, next_member=ints("int32"))
MEMBERS = Section(
    "impact", "impacts", BOUNCED,
    member=ints("int32"),
    group=ints("int32"),
    is_left=flags(),
    share=floats(unit="N s"),  # impulses along the normals, N s
    before=floats(unit="N s"),
    ahead=floats(unit="N s"),
    weight=floats(unit="kg"),
    terms=floats(unit="N s or J"),
    friction_impulse=vectors(unit="N s"),  # impulses along the surfaces
)  # fmt: skip
BODIES_OF_MEMBERS = Section(
    "impact", "impacts", BOUNCED,
    first_member=ints("int32"),
    gained=vectors(unit="m/s"),  # change of velocity
    gained_spin=vectors(unit="rad/s"),  # of what joints hold
    settled=vectors(unit="m/s"),  # of that, by what joints have done in the flight to an impact
    settled_spin=vectors(unit="rad/s"),
)  # fmt: skip
LOG = Section(
    "impact", "impacts", BOUNCED,
    log_pair=ints("int32"),
    log_time=floats(unit="s"),
    log_impulse=floats(unit="N s"),
    log_normal=vectors(unit="1"),
    log_point=vectors(unit="m"),
)  # fmt: skip
IMPACTS = Schema(
    "Impacts", EVENTS, BEARINGS, MEMBER_LISTS, MEMBERS, BODIES_OF_MEMBERS, LOG,
    active=flag(),  # something may bounce in this step
    sweeps=flag(),  # bodies are swept
    waiting=integer(),
    # the loop
    listed=integer(),  # pairs in the worklist
    linked=flag(),  # ``heads`` and ``links`` are those of the pairs
    swept_version=integer(),  # of the rows, when the impacts of static bodies were set to none
    may_sink=flag(),  # through something thin, at the speed of contacts at rest
    pending=integer(),  # the event that waits for room or code, off the queue; -1: none
    touchdown_pair=integer(),  # the last one of whose bodies landings were searched
    touchdown_time=number(unit="s"),  # the time of its impact while they are searched, else 0
    now=number(unit="s"),
    since=number(unit="s"),  # of the flight of what joints hold, to an impact
    end=number(unit="s"),  # of the step
    until=number(unit="s"),
    # impacts at the same time
    together=integer(),  # for how many there must be room
    group_visits=integer(),  # impacts in all passes over groups of this step
    # what has happened in this step
    logged=integer(),
    capped=integer(),  # impacts beyond the cap,
    capped_row=integer(),  # and the body of the first of them
    looked=integer(),  # pairs searched for their next impact in this step
    rounds=integer(),  # of pairs for what is left of the step
    halted=integer(),  # bodies that were stopped because these were too many,
    halted_row=integer(),  # and the first of them
)  # fmt: skip

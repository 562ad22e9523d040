"""What the kernels of characters share: constants, the memory of a step, and the walker."""

from __future__ import annotations

import collections

from ...framework.jit.records.schema import Schema, flag, floats, integer, ints, vectors

STATES = ("air", "floor", "steep", "climb")
AIR, FLOOR, STEEP, CLIMB = range(4)
LEAVES = ("all", "up", "none")
LEAVE_ALL, LEAVE_UP, LEAVE_NOTHING = range(3)
NEVER = 1e9  # s since something that has not been
EXACT = 1e-9  # m, and of cosines: less is rounding
MOST_HITS = 16  # of one character in a step
SLIDES = 5  # pieces of its way
ROWS = 64  # of the columns below, at least

CRUSHED, LANDED, HIT = range(3)

# Columns by row of the table, by number of a push, an event, a hit or a plane: all have as many rows.
WORK = Schema(
    "CharacterWork",
    place=vectors(unit="m"),  # where row i will be,
    velocity=vectors(unit="m/s"),  # and its own velocity: all look at those of the start
    push=vectors(unit="m/s"),  # what characters have changed the velocity of row i by
    most_push=floats(unit="m/s"),  # as fast as those who push it want to be
    pushes=integer(),
    pushed=ints(),  # rows
    events=integer(),
    event=ints(),  # CRUSHED and the like
    entity=ints(),
    other=ints(),
    normal=vectors(unit="1"),
    speed=floats(unit="m/s"),
    blocked=integer(),  # row that the character at work has walked against; -1: none
    inside=flag(),  # it is in something that rests
    hits=integer(),  # what it has met
    hit_row=ints(),
    hit_out=vectors(unit="1"),
    planes=integer(),
    plane_out=vectors(unit="1"),
    plane_depth=floats(unit="m"),
    plane_push=floats(unit="m"),
)

# A character at work: the records, its row, and what stays the same in a step. start: centre of its shape at first;
# half_extents: of its box, half: the least; limit: cosine of the steepest slope it walks on; dropping: whether it falls
# through what holds from above only; wish: m/s across up; found: how many rows there are in ``near.row``.
Walker = collections.namedtuple(
    "Walker", "state near character work row start half_extents half up skin limit dropping gravity wish found"
)

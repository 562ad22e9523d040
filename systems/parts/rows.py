"""The rows of a body of several parts, and the record of parts, which a plugin writes where they come, go or change. In
a world without any, each body has one row."""

from __future__ import annotations

from ...framework.compilation import inlined
from ...framework.jit.records.schema import Schema, Section, floats, integer, ints, table

PARTS = Schema(
    "Parts",
    count=integer(),
    entity=ints(),  # ascending
    body=ints(),  # the entity of the body that it belongs to, and moves with
    mass=floats(unit="kg"),
    turn=table("float64", 4, unit="rad or 1"),  # against the body: an angle, in space a quaternion w, x, y, z
    kept=table("float64", 6, unit="m^2"),  # of the collider that it had last, as Spin.gyration; nan: of none
    rows_version=integer(),  # of the rows of bodies
    row=ints("int32"),
    body_row=ints("int32"),
)
PART_COLUMNS = Section(
    "body", "compound bodies", "bodies have parts",
    owner=ints("int32"),  # the row of the body that a row belongs to; itself, where it is none's part
    next_part=ints("int32"),  # the rows of a body are a chain that begins with its own; -1: the last one
    part=ints("int32"),  # place among the parts; -1: none
)  # fmt: skip


@inlined
def owner_of(state, i):
    """The row of the body that row i belongs to."""
    return state.bodies.owner[i] if state.has_parts else i


@inlined
def next_row(state, k):
    """The row of the same body that follows; -1 behind the last one. The first one is that of the body."""
    return state.bodies.next_part[k] if state.has_parts else -1


@inlined
def has_parts(state, i):
    """Whether row i is a body of several parts."""
    return state.has_parts and state.bodies.owner[i] == i and state.bodies.next_part[i] >= 0


@inlined
def place_of(state, i):
    """Where the solver has the body of row i."""
    return state.bodies.place[owner_of(state, i)]

"""The record of the parts of bodies, which a plugin writes where parts come, go or change."""

from __future__ import annotations

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

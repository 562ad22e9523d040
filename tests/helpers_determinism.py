"""Worlds whose states are compared bit by bit, and all of their bits."""

from __future__ import annotations

from worlds import make_world

from carom.framework import Component, column


class Charge(Component):
    value = column(default=0.0)


def state(world):
    """Every column, contacts included, as bytes."""
    bodies, contacts = world.bodies, world.contacts
    columns = {name: getattr(bodies, name).tobytes() for name in bodies.column_names()}
    events = {"begin": contacts.begin, "end": contacts.end, "impacts": contacts.impacts}
    for label, rows in {"now": contacts, **events}.items():
        for name in ("entity_a", "entity_b", "point", "normal", "depth", "normal_impulse", "step"):
            columns[f"{label}.{name}"] = getattr(rows, name).tobytes()
    return columns


def settled(**settings):
    return make_world(gravity=9.81, **settings)

"""Reports of contacts: events in order, ids of rows."""

from __future__ import annotations

EVENTS = ("contact_begin", "contact_stay", "contact_end", "impact")


def listen(world, told, *names):
    for name in names or EVENTS:
        world.on(name, lambda contact, name=name: told.append((name, contact.step, contact.entity_a, contact.entity_b)))


def ids(rows):
    return list(zip(rows.entity_a.tolist(), rows.entity_b.tolist(), strict=True))

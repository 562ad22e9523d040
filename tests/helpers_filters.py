"""Which pairs meet, and which have a response, in every path: without one, the motion of a body alone, to the bit."""

from __future__ import annotations

import numpy as np
from worlds import position, velocity

DT = 1 / 60
EVENTS = ("contact_begin", "contact_stay", "contact_end", "impact")


def up(d, height):
    """A place above the origin."""
    return (0.0, height, 0.0)[:d]


def listen(world):
    """Events as (name without ``contact_``, a, b), in order."""
    told = []
    for name in EVENTS:
        world.on(name, lambda contact, name=name: told.append((name[8:] or name, contact.entity_a, contact.entity_b)))
    return told


def pairs(rows):
    return list(zip(rows.entity_a.tolist(), rows.entity_b.tolist(), strict=True))


def assert_same_motion(world, other, entities):
    """Equal bits for entities that have the same ids in both worlds."""
    for entity in entities:
        np.testing.assert_array_equal(position(world, entity), position(other, entity))
        np.testing.assert_array_equal(velocity(world, entity), velocity(other, entity))

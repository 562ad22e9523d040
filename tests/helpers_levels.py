"""Bodies with geometry levels: a box with a sphere around it, and their counters."""

from __future__ import annotations

import numpy as np

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform

COUNTERS = ("first_level_tests", "first_level_hits", "false_positives")


def levelled(world, place, velocity=0.0, *, half=0.5, radius=None, rotation=0.0, sphere=None, kind="dynamic", **last):
    """A box with a sphere around it; the sphere touches the corners unless a radius is given."""
    half = np.broadcast_to(half, world.dimensions)
    radius = float(np.linalg.norm(half)) if radius is None else radius
    place = place if np.ndim(place) else (place, *(0.0,) * (world.dimensions - 1))
    speed = velocity if np.ndim(velocity) else (velocity, *(0.0,) * (world.dimensions - 1))
    return world.create_entity(
        Transform(place, rotation), RigidBody(linear_velocity=speed, kind=kind),
        SphereCollider(radius, **(sphere or {})), AABBCollider(half, **last),
    )  # fmt: skip


def pairs(world):
    contacts = world.contacts
    return list(zip(contacts.entity_a.tolist(), contacts.entity_b.tolist(), strict=True))

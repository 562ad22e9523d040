"""Movers among many static bodies."""

from __future__ import annotations

import numpy as np

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics


def level(d, movers, speed=1.0):
    """A lattice of 900 static boxes with walls around it, and ``movers`` spheres among them."""
    world = World(Physics(dimensions=d, gravity=(0.0,) * d), settings=Settings.balanced())
    rng = np.random.default_rng(5)
    side = 30 if d == 2 else 10
    for axis in range(d):
        half = np.full(d, 2.0 * side)
        half[axis] = 0.5
        at = np.full(d, 1.5 * side)
        for place in (-2.0, 3.0 * side + 2.0):
            at[axis] = place
            world.create_entity(Transform(at.copy()), AABBCollider(half))
    places = np.stack(np.unravel_index(np.arange(900), (side,) * d), axis=1) * 3.0
    world.create_entities(900, Transform.many(places), AABBCollider.many(half_extents=(0.5,) * d))
    world.create_entities(
        movers,
        Transform.many(rng.random((movers, d)) * 3.0 * side),
        RigidBody.many(linear_velocity=rng.standard_normal((movers, d)) * speed),
        SphereCollider.many(radius=0.4),
    )
    return world

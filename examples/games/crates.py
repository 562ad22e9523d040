"""A pile of twelve crates that comes to rest: carom trade examples/games/crates.py"""

from __future__ import annotations

import numpy as np

from carom import AABBCollider, Physics, RigidBody, Transform, World

seconds = 4.0


def build(settings, seed=0):
    world = World(Physics(dimensions=2, gravity=(0, -9.81)), settings=settings)
    world.create_entity(Transform((0, -0.5)), AABBCollider((10, 0.5), friction=0.6))
    random = np.random.default_rng(seed)
    for k in range(12):
        row, place = divmod(k, 4)
        where = (1.1 * (place - 1.5) + 0.5 * (row % 2) + random.uniform(-0.05, 0.05), 0.6 + 1.15 * row)
        world.create_entity(Transform(where), RigidBody(mass=20), AABBCollider((0.5, 0.5), friction=0.6))
    return world

"""Balls fall through a field of pegs into bins: carom run examples/pegs.py --record out/pegs.webp"""

from __future__ import annotations

import numpy as np

from carom import AABBCollider, Physics, RigidBody, SphereCollider, Transform, World

seconds = 4.8
view = (-0.5, -0.5), (16.5, 11)


def build(settings, seed=0):
    world = World(Physics(dimensions=2, gravity=(0, -9.81)), settings=settings)
    for x, y, width, height in ((8, -0.25, 17, 0.5), (-0.25, 6, 0.5, 13), (16.25, 6, 0.5, 13)):
        world.create_entity(Transform((x, y)), AABBCollider((width / 2, height / 2)))
    for bin_wall in range(2, 16, 2):
        world.create_entity(Transform((bin_wall, 1.25)), AABBCollider((0.08, 1.25), friction=0))
    for row in range(5):
        for x in np.arange(1.0 + row % 2, 16, 2):
            world.create_entity(Transform((x, 3.5 + row)), SphereCollider(0.25, restitution=0.6))
    random = np.random.default_rng(seed)
    n = 160
    places = np.column_stack([2 + 0.6 * (np.arange(n) % 20), 9 + (np.arange(n) // 20)])
    world.create_entities(
        n, Transform.many(places + random.uniform(-0.05, 0.05, (n, 2))), RigidBody.many(mass=1.0),
        SphereCollider.many(radius=random.uniform(0.1, 0.2, n), restitution=0.4, friction=0.2),
    )  # fmt: skip
    return world

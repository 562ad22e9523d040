"""A bridge of planks, each hinged to the next, bears crates and balls."""

import numpy as np

from carom import Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.plugins.joints import Hinge, Joints
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.scenes.sizes import whole

PLANKS, CRATES = 30, 8
HALF_LENGTH, HALF_THICKNESS = 0.5, 0.1
MASS, CRATE_MASS = 1.0, 2.0
CRATE = 0.5
FRICTION = 0.6
SECONDS = 10.0
VIEW = ((-4.0, -8.0), (2 * HALF_LENGTH * PLANKS + 4.0, 8.0))


def build(settings: Settings | None = None, seed: int = 0, *, n: int = PLANKS, crates: int = CRATES) -> World:
    """``n`` planks from one bank to the other, and every other time a crate or a ball above them."""
    n, crates = whole(n, "n", 2), whole(crates, "crates", 0)
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), Rotation(), Joints(), settings=settings)
    length = 2.0 * HALF_LENGTH * n
    for x in (-2.0, length + 2.0):
        world.create_entity(Transform((x, -2.0)), BoxCollider((2.0, 2.0), friction=FRICTION))
    before = None
    for k in range(n):
        plank = world.create_entity(
            Transform(((2 * k + 1) * HALF_LENGTH, -HALF_THICKNESS)),
            RigidBody(mass=MASS),
            BoxCollider((HALF_LENGTH, HALF_THICKNESS), friction=FRICTION),
            Spin(),
        )
        world.create_entity(Hinge(before, plank, anchor=(2 * k * HALF_LENGTH, -HALF_THICKNESS)))
        before = plank
    world.create_entity(Hinge(before, None, anchor=(length, -HALF_THICKNESS)))
    random = np.random.default_rng(seed)
    for k in range(crates):
        place = length * (0.2 + 0.6 * (k + 0.5) / crates) + random.uniform(-0.3, 0.3), 2.0 + 0.5 * k
        collider = SphereCollider(CRATE, friction=FRICTION) if k % 2 else BoxCollider((CRATE, CRATE), friction=FRICTION)
        world.create_entity(Transform(place), RigidBody(mass=CRATE_MASS), collider, Spin())
    return world

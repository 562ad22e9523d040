"""Twenty balls at rest on a floor, or in the air above it: the step of a small game."""

import numpy as np

from carom import Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.scenes.random_numbers import uniform
from carom.scenes.sizes import real, whole
from carom.scenes.walls import block

BODIES = 20
PITCH = 1.5
SECONDS = 10.0
VIEW = ((-16.0, -2.0), (16.0, 8.0))


def build(
    settings: Settings | None = None,
    seed: int = 0,
    *,
    n: int = BODIES,
    height: float = 0.0,
    restitution: float = 0.0,
) -> World:
    """``n`` balls of mass 1 and diameter 1 side by side, each at ``height`` times a number in [0.5, 1.5) above the
    floor; ``seed`` chooses these."""
    n, height, restitution = whole(n, "n"), real(height, "height"), real(restitution, "restitution")
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), settings=settings)
    half = 0.5 * PITCH * (n + 1)
    block(world, (-half, -1.0), (half, 0.0), restitution=restitution)
    x = PITCH * (np.arange(n) - 0.5 * (n - 1))
    centres = np.stack([x, 0.5 + height * (0.5 + uniform(n, seed))], axis=1)
    balls = SphereCollider.many(radius=0.5, restitution=restitution)
    world.create_entities(n, Transform.many(centres), RigidBody.many(mass=1.0), balls)
    return world

"""Fifty dominoes in a row: the first one gets a push, and each one throws the next.

The wave runs at a speed that depends on height and spacing, not on the number of dominoes.
"""

import numpy as np

from carom import BoxCollider, Physics, RigidBody, Rotation, Settings, Spin, Transform, World
from carom.scenes.sizes import real, whole
from carom.scenes.walls import block

DOMINOES = 50
HALF_EXTENTS = (0.15, 1.0)
MASS = 0.6
SPACING = 0.8  # from centre to centre
PUSH = 1.0  # rad/s, about its foot
FRICTION = 0.6
SECONDS = 13.0
VIEW = ((-3.0, -1.0), (DOMINOES * SPACING + 3.0, 4.0))


def build(
    settings: Settings | None = None, seed: int = 0, *, n: int = DOMINOES, spacing: float = SPACING,
    friction: float = FRICTION,
) -> World:  # fmt: skip
    """``n`` dominoes on end, the first one at 0 falls to the right; ``seed`` changes nothing."""
    n, spacing, friction = whole(n, "n"), real(spacing, "spacing", above=True), real(friction, "friction")
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), Rotation(), settings=settings)
    block(world, (-5.0, -1.0), (n * spacing + 5.0, 0.0), friction=friction)
    places = np.stack([spacing * np.arange(n), np.full(n, HALF_EXTENTS[1])], axis=1)
    push = np.where(np.arange(n) == 0, PUSH, 0.0)
    world.create_entities(
        n,
        Transform.many(places),
        RigidBody.many(mass=MASS, linear_velocity=np.stack([HALF_EXTENTS[1] * push, 0.0 * push], axis=1)),
        Spin.many(-push),
        BoxCollider.many(half_extents=HALF_EXTENTS, friction=friction),
    )
    return world

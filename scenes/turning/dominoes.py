"""A row of dominoes: the first one gets a push, and each one throws the next.

The wave runs at a speed that depends on height and spacing, not on the number of dominoes.
"""

from __future__ import annotations

import numpy as np

from ...components import RigidBody, Transform
from ...components.spin import Spin
from ...framework import Settings, World
from ...plugins import Physics
from ...plugins.rotation import BoxCollider, Rotation
from ..protocol import Scene
from ..sizes import real, whole
from ..walls import block

DOMINOES = 50
HALF_EXTENTS = (0.15, 1.0)
MASS = 0.6
SPACING = 0.8  # from centre to centre
PUSH = 1.0  # rad/s, about its foot
FRICTION = 0.6
GRAVITY = 9.81


def build(
    settings: Settings | None = None, seed: int = 0, *, n: int = DOMINOES, spacing: float = SPACING,
    friction: float = FRICTION,
) -> World:  # fmt: skip
    """``n`` dominoes on end, the first one at 0 falls to the right; ``seed`` changes nothing."""
    n, spacing, friction = whole(n, "n"), real(spacing, "spacing", above=True), real(friction, "friction")
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), Rotation(), settings=settings or Settings.balanced())
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


SCENE = Scene(
    name="dominoes",
    description="fifty dominoes in a row, the first one pushed",
    build=build,
    seconds=13.0,
    view=((-3.0, -1.0), (DOMINOES * SPACING + 3.0, 4.0)),
)

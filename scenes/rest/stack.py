"""A tower of ten boxes that must stay as it is.

Boxes of side 1, or balls of diameter 1, one exactly above the other: no sinking, no shaking, no drift. ``top_mass``
makes the topmost body heavier than the others, which is difficult for an iterative solver.
"""

import numpy as np

from carom import AABBCollider, Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.scenes.sizes import real, whole
from carom.scenes.walls import block

BODIES = 10
FRICTION = 0.6
GRAVITY = 9.81
SECONDS = 10.0
VIEW = ((-6.0, -1.0), (6.0, 11.0))


def build(
    settings: Settings | None = None,
    seed: int = 0,
    *,
    n: int = BODIES,
    top_mass: float = 1.0,
    friction: float = FRICTION,
    balls: bool = False,
) -> World:
    """``n`` bodies from the ground up, mass 1, the last one ``top_mass`` kg; ``seed`` changes nothing."""
    n, top_mass, friction = whole(n, "n"), real(top_mass, "top_mass", above=True), real(friction, "friction")
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), settings=settings)
    block(world, (-10.0, -1.0), (10.0, 0.0), friction=friction)
    mass = np.ones(n)
    mass[-1] = top_mass
    ball, box = SphereCollider.many(radius=0.5, friction=friction), AABBCollider.many((0.5, 0.5), friction=friction)
    centres = np.stack([np.zeros(n), 0.5 + np.arange(n)], axis=1)
    world.create_entities(n, Transform.many(centres), RigidBody.many(mass=mass), ball if balls else box)
    return world

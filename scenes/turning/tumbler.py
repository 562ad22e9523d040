"""Three hundred small boxes in a square drum that turns.

The drum is four kinematic bodies at the same place, each with a wall beside it, which turn together.
"""

import math

from carom import BoxCollider, Physics, RigidBody, Rotation, Settings, Spin, Transform, World
from carom.scenes.bodies import lattice
from carom.scenes.sizes import ceil_root, whole

BOXES = 300
HALF, THICKNESS = 12.0, 1.0  # of the drum
TURN = math.pi / 6  # rad/s
SIDE, DENSITY = 0.5, 1.0  # of a box
PITCH = 0.65  # of the lattice on which they start
FRICTION = 0.6
SECONDS = 12.0
VIEW = ((-18.0, -18.0), (18.0, 18.0))


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BOXES) -> World:
    """``n`` boxes in rows, at rest in the middle of a drum that turns; ``seed`` changes nothing."""
    n = whole(n, "n")
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), Rotation(), settings=settings)
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        half = (THICKNESS / 2, HALF) if x else (HALF, THICKNESS / 2)
        wall = BoxCollider(half, offset=(HALF * x, HALF * y), friction=FRICTION)
        world.create_entity(Transform((0.0, 0.0)), RigidBody(kind="kinematic"), Spin(TURN), wall)
    side = ceil_root(n, 2)
    places = (lattice(n, side) - 0.5 * (side - 1)) * PITCH
    world.create_entities(
        n,
        Transform.many(places),
        RigidBody.many(mass=DENSITY * SIDE**2),
        Spin.many(0.0),
        BoxCollider.many(half_extents=(SIDE / 2, SIDE / 2), friction=FRICTION),
    )
    return world

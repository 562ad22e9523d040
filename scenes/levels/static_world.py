"""1,000 discs bounce between 10,000 static boxes.

Static shapes should cost almost nothing. The boxes, 1 by 1, leave lanes 3 wide; each disc starts near the
middle of a crossing of two lanes. Restitution 1, no gravity: kinetic energy is conserved.
"""

import math

import numpy as np
from numpy.typing import NDArray

from carom import AABBCollider, Physics, Settings, Transform, World
from carom.scenes import gas
from carom.scenes.bodies import add_spheres, lattice
from carom.scenes.random_numbers import uniform
from carom.scenes.sizes import ceil_root, whole
from carom.scenes.walls import enclose

DISCS = 1000
BOXES_A_SIDE = 100  # for 1,000 discs; ten boxes per disc for any number
PITCH = 4.0  # from box to box
EVERY = 3  # a disc starts at every third crossing, along x and along y
JITTER = 0.5
SECONDS = 20.0
VIEW = ((-1.0, -1.0), (401.0, 401.0))


def boxes_a_side(n: int) -> int:
    """Rows and columns of boxes for ``n`` discs."""
    return max(math.ceil(BOXES_A_SIDE * math.sqrt(n / DISCS)), EVERY * ceil_root(n, 2))


def initial_state(n: int, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions and velocities of the discs, (n, 2) each, drawn body by body, position first."""
    per_row = boxes_a_side(n) // EVERY
    crossing = EVERY * lattice(n, per_row) + 1
    draws = uniform(4 * n, seed).reshape(n, 2, 2)
    return PITCH * crossing + JITTER * (2 * draws[:, 0] - 1), -5 + 10 * draws[:, 1]


def build(settings: Settings | None = None, seed: int = 0, *, n: int = DISCS) -> World:
    """``n`` discs; for 1,000 a square of side 400. The walls come first, then the boxes, then the discs."""
    boxes = boxes_a_side(whole(n, "n"))
    world = World(Physics(dimensions=2), settings=settings)
    enclose(world, (0.0, 0.0), (PITCH * boxes, PITCH * boxes), restitution=1.0)
    world.create_entities(
        boxes**2,
        Transform.many(PITCH * lattice(boxes**2, boxes) + PITCH / 2),
        AABBCollider.many(half_extents=(0.5, 0.5), restitution=1.0),
    )
    add_spheres(world, *initial_state(n, seed), radius=gas.RADIUS, mass=gas.BODY_VOLUME[2])
    return world

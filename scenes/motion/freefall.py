"""10,000 bodies without colliders fly their parabolas.

The lower limit of the cost of a step. Each starts on a lattice of pitch 2 with velocity components between -5 and 5.
"""

import numpy as np
from numpy.typing import NDArray

from carom import Physics, RigidBody, Settings, Transform, World
from carom.scenes.bodies import lattice
from carom.scenes.gas import BODY_VOLUME
from carom.scenes.random_numbers import uniform
from carom.scenes.sizes import whole

BODIES = 10_000
PER_ROW = 317  # for any number of bodies
PITCH = 2.0
SECONDS = 2.0
VIEW = ((-10.0, -30.0), (PITCH * PER_ROW + 10.0, PITCH * (BODIES // PER_ROW) + 10.0))


def initial_state(n: int, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions and velocities, (n, 2) each."""
    return PITCH * lattice(n, PER_ROW), -5 + 10 * uniform(2 * n, seed).reshape(n, 2)


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES) -> World:
    """``n`` bodies in rows of 317; ``seed`` chooses their velocities."""
    n = whole(n, "n")
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), settings=settings)
    positions, velocities = initial_state(n, seed)
    world.create_entities(n, Transform.many(positions), RigidBody.many(mass=BODY_VOLUME[2], linear_velocity=velocities))
    return world

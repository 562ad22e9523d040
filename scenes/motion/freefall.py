"""Bodies without colliders that fall: only forces and integration, the lower limit of the cost of a step.

Each starts on a lattice of pitch 2 with velocity components between -5 and 5 and flies on a parabola.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...components import RigidBody, Transform
from ...framework import Settings, World
from ...plugins import Physics
from ..gas import BODY_VOLUME
from ..protocol import Scene
from ..random_numbers import uniform
from ..sizes import whole

BODIES = 10_000
PER_ROW = 317  # for any number of bodies
PITCH = 2.0
GRAVITY = 9.81
SECONDS = 2.0


def initial_state(n: int, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions and velocities, (n, 2) each."""
    index = np.arange(n)
    positions = PITCH * np.stack([index % PER_ROW, index // PER_ROW], axis=1).astype(np.float64)
    return positions, -5 + 10 * uniform(2 * n, seed).reshape(n, 2)


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES) -> World:
    """``n`` bodies in rows of 317; ``seed`` chooses their velocities."""
    n = whole(n, "n")
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), settings=settings or Settings.balanced())
    positions, velocities = initial_state(n, seed)
    world.create_entities(n, Transform.many(positions), RigidBody.many(mass=BODY_VOLUME[2], linear_velocity=velocities))
    return world


SCENE = Scene(
    name="freefall",
    description="10,000 bodies without colliders fly their parabolas",
    build=build,
    seconds=SECONDS,
    view=((-10.0, -30.0), (PITCH * PER_ROW + 10.0, PITCH * (BODIES // PER_ROW) + 10.0)),
)

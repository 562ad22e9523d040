"""10,000 discs at rest, to ask what is where.

The start of :mod:`carom.scenes.gases.gas2d`, at rest, so all time is spent in the queries. ``places`` gives 1,000
points spread over the box.
"""

import numpy as np
from numpy.typing import NDArray

from carom import Settings, World
from carom.scenes import gas
from carom.scenes.bodies import add_spheres
from carom.scenes.random_numbers import uniform

BODIES = 10_000
QUERIES = 1000
SECONDS = 1.0
VIEW = gas.view(BODIES, 2)


def places(n: int = BODIES, count: int = QUERIES, seed: int = 0) -> NDArray[np.float64]:
    """(count, 2) points in the box of ``n`` discs: the generator's draws after those of the gas, x then y."""
    return gas.side(n, 2) * uniform(4 * n + 2 * count, seed)[4 * n :].reshape(count, 2)


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES) -> World:
    """``n`` discs at rest, at the start positions of the gas."""
    world = gas.empty_box(settings, n, 2)
    positions, velocities = gas.initial_state(n, 2, seed)
    add_spheres(world, positions, np.zeros_like(velocities), radius=gas.RADIUS, mass=gas.BODY_VOLUME[2])
    return world

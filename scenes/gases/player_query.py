"""Queries: the gas of :mod:`carom.scenes.gases.gas2d` at rest, and places for queries.

Nothing moves, so all time is spent in the queries. ``places`` gives 1,000 points spread
over the box.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...framework import Settings, World
from .. import gas
from ..protocol import Scene
from ..random_numbers import uniform

BODIES = 10_000
QUERIES = 1000


def places(n: int = BODIES, count: int = QUERIES, seed: int = 0) -> NDArray[np.float64]:
    """(count, 2) points in the box of ``n`` discs: the generator's draws after those of the gas, x then y."""
    return gas.side(n, 2) * uniform(4 * n + 2 * count, seed)[4 * n :].reshape(count, 2)


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES) -> World:
    """``n`` discs at rest, at the start positions of the gas."""
    world = gas.empty_box(settings, n, 2)
    positions, velocities = gas.initial_state(n, 2, seed)
    gas.add_spheres(world, positions, np.zeros_like(velocities))
    return world


SCENE = Scene("player_query", "10,000 discs at rest, to ask what is where", build, 1.0, gas.view(BODIES, 2))

"""An elastic gas in a box, 2D and 3D: equal discs or spheres that only bounce, from one to hundreds of
thousands.

The benchmark scene: no gravity, restitution 1, so kinetic energy is conserved. Radius 0.5, density 1.
Discs fill a quarter of the area, spheres a tenth of the volume. Each body starts in its own cell of a
lattice, displaced at random without touching its neighbours, with velocity components between -5 and 5.
Other scenes use this start and change one thing: mixed2d, fastgas and player_query.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..framework import Settings, World
from ..plugins import Physics
from .bodies import add_spheres, lattice
from .random_numbers import uniform
from .sizes import ceil_root, root, whole
from .walls import enclose

RADIUS = 0.5
FILLING = {2: 0.25, 3: 0.1}  # fraction of the area or volume that the bodies fill
BODY_VOLUME = {2: math.pi / 4, 3: math.pi / 6}  # of a body of diameter 1; also its mass
BODIES = {2: 1000, 3: 10_000}


def gas2d(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES[2]) -> World:
    """``n`` discs in a square of side sqrt(n pi)."""
    return _gas(settings, seed, n, 2)


def gas3d(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES[3]) -> World:
    """``n`` spheres in a cube of side (n (pi / 6) / 0.1)^(1/3)."""
    return _gas(settings, seed, n, 3)


def side(n: int, dimensions: int) -> float:
    """The side of the box, metres."""
    return root(n * BODY_VOLUME[dimensions] / FILLING[dimensions], dimensions)


def initial_state(n: int, dimensions: int, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions and velocities, (n, d) each: body k in cell (k mod m, k div m, ...) of m cells a side."""
    cells = ceil_root(n, dimensions)
    spacing = side(n, dimensions) / cells
    draws = uniform(n * 2 * dimensions, seed).reshape(n, 2, dimensions)  # per body: displacement, velocity
    jitter = 0.45 * (spacing - 2 * RADIUS)
    positions = (lattice(n, cells, dimensions) + 0.5) * spacing + jitter * (2 * draws[:, 0] - 1)
    velocities = -5 + 10 * draws[:, 1]
    return positions, velocities


def empty_box(settings: Settings | None, n: int, dimensions: int, thickness: float = 1.0) -> World:
    """An empty world for ``n`` bodies, without gravity, with its elastic walls."""
    length = side(whole(n, "n"), dimensions)
    world = World(Physics(dimensions=dimensions), settings=settings)
    enclose(world, (0.0,) * dimensions, (length,) * dimensions, thickness=thickness, restitution=1.0)
    return world


def view(n: int, dimensions: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The region to draw: the box and its walls."""
    return (-1.0,) * dimensions, (side(n, dimensions) + 1.0,) * dimensions


def _gas(settings: Settings | None, seed: int, n: int, dimensions: int) -> World:
    world = empty_box(settings, n, dimensions)
    add_spheres(world, *initial_state(n, dimensions, seed), radius=RADIUS, mass=BODY_VOLUME[dimensions])
    return world

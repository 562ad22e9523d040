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

from ..components import RigidBody, SphereCollider, Transform
from ..framework import Settings, World
from ..plugins import Physics
from .protocol import Scene
from .random_numbers import uniform
from .sizes import ceil_root, whole
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
    return (n * BODY_VOLUME[dimensions] / FILLING[dimensions]) ** (1 / dimensions)


def initial_state(n: int, dimensions: int, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions and velocities, (n, d) each: body k in cell (k mod m, k div m, ...) of m cells a side."""
    cells = ceil_root(n, dimensions)
    spacing = side(n, dimensions) / cells
    index = np.arange(n)
    cell = np.stack([index // cells**axis % cells for axis in range(dimensions)], axis=1)
    draws = uniform(n * 2 * dimensions, seed).reshape(n, 2, dimensions)  # per body: displacement, velocity
    jitter = 0.45 * (spacing - 2 * RADIUS)
    positions = (cell + 0.5) * spacing + jitter * (2 * draws[:, 0] - 1)
    velocities = -5 + 10 * draws[:, 1]
    return positions, velocities


def empty_box(settings: Settings | None, n: int, dimensions: int, thickness: float = 1.0) -> World:
    """An empty world for ``n`` bodies, without gravity, with its elastic walls."""
    length = side(whole(n, "n"), dimensions)
    settings = settings or Settings.balanced()
    world = World(Physics(dimensions=dimensions, gravity=(0.0,) * dimensions), settings=settings)
    enclose(world, (0.0,) * dimensions, (length,) * dimensions, thickness=thickness, restitution=1.0)
    return world


def add_spheres(world: World, positions: NDArray[np.float64], velocities: NDArray[np.float64]) -> None:
    """Elastic discs or spheres, in the order of their positions (n, d)."""
    world.create_entities(
        len(positions),
        Transform.many(positions),
        RigidBody.many(mass=BODY_VOLUME[positions.shape[1]], linear_velocity=velocities),
        SphereCollider.many(radius=RADIUS, restitution=1.0),
    )


def _gas(settings: Settings | None, seed: int, n: int, dimensions: int) -> World:
    world = empty_box(settings, n, dimensions)
    add_spheres(world, *initial_state(n, dimensions, seed))
    return world


def view(n: int, dimensions: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The region to draw: the box and its walls."""
    return (-1.0,) * dimensions, (side(n, dimensions) + 1.0,) * dimensions


SCENE_2D = Scene("gas2d", "1,000 elastic discs in a square box", gas2d, 10.0, view(BODIES[2], 2))
SCENE_3D = Scene("gas3d", "10,000 elastic spheres in a cube", gas3d, 5.0, view(BODIES[3], 3))

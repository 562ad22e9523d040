"""A pile, 2D and 3D: discs or spheres fall into a bin and come to rest.

The benchmark of contacts at rest: restitution 0, no friction, gravity 9.81 along y. Radius 0.5, density 1. The
bodies start at rest on a lattice with gaps of 0.2, each displaced by up to 0.09 along every axis. The bin has a
floor and sides, but no lid.
"""

import numpy as np
from numpy.typing import NDArray

from carom import Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.scenes.bodies import lattice
from carom.scenes.gas import BODY_VOLUME, RADIUS
from carom.scenes.random_numbers import uniform
from carom.scenes.sizes import floor_root, root, whole
from carom.scenes.walls import enclose

PITCH = 1.2  # of the lattice
JITTER = 0.09
BODIES = {2: 1000, 3: 1000}
UP = 1  # the axis


def pile2d(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES[2]) -> World:
    """``n`` discs in a bin 1.2 sqrt(n) wide."""
    return _pile(settings, seed, n, 2)


def pile3d(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES[3]) -> World:
    """``n`` spheres in a bin 1.2 n^(1/3) wide and deep."""
    return _pile(settings, seed, n, 3)


def width(n: int, dimensions: int) -> float:
    """Width of the bin, metres."""
    return PITCH * root(n, dimensions)


def layers(n: int, dimensions: int) -> int:
    """Number of layers at the start."""
    return -(-n // floor_root(n, dimensions) ** (dimensions - 1))


def initial_positions(n: int, dimensions: int, seed: int = 0) -> NDArray[np.float64]:
    """(n, d): m = floor(n^(1/d)) bodies to a row along x, in 3D m rows along z to a layer, layers upwards."""
    per_row = floor_root(n, dimensions)
    place = lattice(n, per_row, dimensions)  # x, (z,) y
    centres = width(n, dimensions) / 2 + (place - (per_row - 1) / 2) * PITCH
    centres[:, -1] = 0.6 + PITCH * place[:, -1]
    if dimensions == 3:
        centres = centres[:, [0, 2, 1]]
    return centres + JITTER * (2 * uniform(n * dimensions, seed).reshape(n, dimensions) - 1)


def _pile(settings: Settings | None, seed: int, n: int, dimensions: int) -> World:
    n = whole(n, "n")
    gravity = [0.0] * dimensions
    gravity[UP] = -9.81
    world = World(Physics(dimensions=dimensions, gravity=gravity), settings=settings)
    upper = np.full(dimensions, width(n, dimensions))
    upper[UP] = PITCH * layers(n, dimensions)
    enclose(world, (0.0,) * dimensions, upper.tolist(), open_top=True)
    world.create_entities(
        n,
        Transform.many(initial_positions(n, dimensions, seed)),
        RigidBody.many(mass=BODY_VOLUME[dimensions]),
        SphereCollider.many(radius=RADIUS),
    )
    return world


def view(dimensions: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The region to draw: the bin and its walls."""
    n = BODIES[dimensions]
    upper = [width(n, dimensions) + 1.0] * dimensions
    upper[UP] = PITCH * layers(n, dimensions) + 1.0
    return (-1.0,) * dimensions, tuple(upper)

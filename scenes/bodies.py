"""Bodies that several scenes create in the same way, and where they start."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..components import AABBCollider, RigidBody, SphereCollider, Transform
from ..components.spin import Spin
from ..framework import World
from ..framework.elementary import sines_and_cosines
from ..plugins.capsule import CapsuleCollider
from ..plugins.convex_polygon import ConvexPolygonCollider
from ..plugins.rotation import BoxCollider


def lattice(n: int, per_row: int, dimensions: int = 2) -> NDArray[np.float64]:
    """(n, d) whole numbers, the first ``n`` cells of a lattice: ``per_row`` along each axis but the last, x fastest."""
    cells = np.arange(n)[:, None] // per_row ** np.arange(dimensions)
    cells[:, :-1] %= per_row
    return cells.astype(np.float64)


def random_velocities(random: np.random.Generator, n: int, speeds: tuple[float, float]) -> NDArray[np.float64]:
    """(n, 2) m/s: in all directions, with speeds from .. to."""
    heading, speed = random.uniform(0, 2 * math.pi, n), random.uniform(*speeds, n)
    sines, cosines = sines_and_cosines(heading)
    return speed[:, None] * np.stack([cosines, sines], axis=1)


def add_spheres(
    world: World, positions: ArrayLike, velocities: ArrayLike, *, radius: ArrayLike, mass: ArrayLike
) -> None:
    """Elastic discs or spheres, in the order of their positions (n, d); radius, m, and mass, kg: one or (n,)."""
    world.create_entities(
        len(np.asarray(positions)),
        Transform.many(positions),
        RigidBody.many(mass=mass, linear_velocity=velocities),
        SphereCollider.many(radius=radius, restitution=1.0),
    )


def add_discs_and_boxes(
    world: World,
    positions: np.ndarray,
    velocities: np.ndarray,
    extents: np.ndarray,
    *,
    restitution: float = 1.0,
    damping: float = 0.0,
) -> None:
    """Discs of every other position (n, 2), then squares of those between: extents (n,) m, radii or half sides;
    density 1; damping, 1/s."""
    discs, boxes = slice(0, None, 2), slice(1, None, 2)
    sides = np.repeat(extents[boxes, None], 2, axis=1)
    for chosen, area, collider in (
        (discs, math.pi, SphereCollider.many(radius=extents[discs], restitution=restitution)),
        (boxes, 4, AABBCollider.many(half_extents=sides, restitution=restitution)),
    ):
        mass = area * extents[chosen] ** 2
        body = RigidBody.many(mass=mass, linear_velocity=velocities[chosen], linear_damping=damping)
        world.create_entities(len(mass), Transform.many(positions[chosen]), body, collider)


def add_shapes(
    world: World,
    random: np.random.Generator,
    cells: NDArray[np.float64],
    sizes: tuple[float, float],
    *,
    jitter: float,
    pitch: float = 1.0,
    friction: float,
) -> None:
    """Discs, boxes, capsules and polygons of 3 to 7 corners by turns, mass 1, at any angle; needs their plugins.

    cells: (n, 2), in units of ``pitch``, m, each moved at random by up to ``jitter`` of it; sizes: half of a body's
    width or so, m, from .. to
    """
    for k, size in enumerate(random.uniform(*sizes, len(cells))):
        shape = (
            SphereCollider(size, friction=friction),
            BoxCollider((size, 0.7 * size), friction=friction),
            CapsuleCollider(0.5 * size, 0.6 * size, friction=friction),
            ConvexPolygonCollider.regular(3 + k % 5, size, friction=friction),
        )[k % 4]
        place = (cells[k] + random.uniform(-jitter, jitter, 2)) * pitch
        world.create_entity(Transform(place, random.uniform(0.0, 2 * np.pi)), RigidBody(mass=1.0), Spin(), shape)

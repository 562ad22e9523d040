"""1,000 bullets at 1000 m/s between walls a centimetre thick, none of which may escape.

Spheres of radius 0.05 move in a box of 50 metres, among 200 pillars, and hit each other. In a step of 1/60 s each moves
17 metres: through a wall a hundredth of a metre thick, through several pillars and past dozens of other bullets. All
shapes are elastic, without gravity, so kinetic energy is conserved. Discrete collisions would miss nearly all impacts.
"""

import numpy as np
from numpy.typing import NDArray

from carom import AABBCollider, Physics, Settings, SphereCollider, Transform, World
from carom.framework.elementary import sines_and_cosines
from carom.scenes.bodies import add_spheres, lattice
from carom.scenes.random_numbers import uniform
from carom.scenes.sizes import ceil_root, whole
from carom.scenes.walls import enclose

BULLETS = 1000
RADIUS = 0.05
SPEED = 1000.0
SIDE = 50.0
WALL = 0.01  # thickness
PILLARS = 200
PILLAR_RADIUS = 0.5
FREE = 1.0  # from a pillar's axis: bullets nearer than this start there instead, on the same side of it
MARGIN = 5.0  # shown around the box
SETTINGS = Settings(collision="continuous")
SECONDS = 0.5
VIEW = ((-MARGIN, -MARGIN), (SIDE + MARGIN, SIDE + MARGIN))


def centres(n: int, dimensions: int) -> NDArray[np.float64]:
    """Of the first ``n`` cells of a lattice that fills the box, (n, dimensions)."""
    a_side = ceil_root(n, dimensions)
    return (lattice(n, a_side, dimensions) + 0.5) * (SIDE / a_side)


def directions(n: int, dimensions: int, seed: int) -> NDArray[np.float64]:
    """``n`` unit vectors, evenly spread (Archimedes: the height of a point on the sphere is evenly spread too)."""
    draws = uniform(2 * n, seed).reshape(n, 2)
    angle = 2 * np.pi * draws[:, 0]
    sines, cosines = sines_and_cosines(angle)
    flat = np.stack([cosines, sines], axis=1)
    if dimensions == 2:
        return flat
    height = 2 * draws[:, 1:] - 1
    return np.concatenate([np.sqrt(1 - height**2) * flat, height], axis=1)


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BULLETS, dimensions: int = 2) -> World:
    """``n`` bullets in a square or a cube. The walls come first, then the pillars, then the bullets."""
    world = World(Physics(dimensions=dimensions), settings=settings or SETTINGS)
    enclose(world, [0.0] * dimensions, [SIDE] * dimensions, thickness=WALL, restitution=1.0)
    feet = centres(PILLARS, 2)
    if dimensions == 2:
        places, pillar = feet, SphereCollider.many(radius=PILLAR_RADIUS, restitution=1.0)
    else:  # from the floor to the ceiling
        places = np.concatenate([feet, np.full((PILLARS, 1), SIDE / 2)], axis=1)
        pillar = AABBCollider.many(half_extents=(PILLAR_RADIUS, PILLAR_RADIUS, SIDE / 2), restitution=1.0)
    world.create_entities(PILLARS, Transform.many(places), pillar)
    starts = centres(whole(n, "n"), dimensions)
    from_foot = starts[:, None, :2] - feet
    nearest = (from_foot[..., 0] ** 2 + from_foot[..., 1] ** 2).argmin(axis=1)
    away = from_foot[np.arange(n), nearest]
    distance = np.sqrt((away * away).sum(axis=1))[:, None]
    starts[:, :2] += away * np.maximum(0.0, FREE / distance - 1.0)
    add_spheres(world, starts, SPEED * directions(n, dimensions, seed), radius=RADIUS, mass=1.0)
    return world

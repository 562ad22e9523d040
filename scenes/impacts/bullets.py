"""Small spheres at 1000 metres/s in a closed box, none of which may escape.

A thousand spheres of radius 0.05 move in a box of 50 metres, among 200 pillars, and hit each other. In a step of
1/60 s each moves 17 metres: through a wall a hundredth of a metre thick, through several pillars and past dozens of
other bullets. All shapes are elastic, without gravity, so kinetic energy is conserved, and all bodies must stay
inside.

The settings are the caller's, but discrete collisions would miss nearly all impacts; without settings the scene is
continuous.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...components import AABBCollider, RigidBody, SphereCollider, Transform
from ...framework import Settings, World
from ...plugins import Physics
from ..protocol import Scene
from ..random_numbers import uniform
from ..sizes import ceil_root, whole
from ..walls import enclose

BULLETS = 1000
RADIUS = 0.05
SPEED = 1000.0
SIDE = 50.0
WALL = 0.01  # thickness
PILLARS = 200
PILLAR_RADIUS = 0.5
FREE = 1.0  # from a pillar's axis: bullets nearer than this start there instead, on the same side of it
MARGIN = 5.0  # shown around the box

SETTINGS = Settings.balanced().replace(collision="continuous")


def lattice(n: int, dimensions: int) -> NDArray[np.float64]:
    """The centres of the first ``n`` cells of a lattice that fills the box, (n, dimensions)."""
    a_side = ceil_root(n, dimensions)
    index = np.arange(n)[:, None] // a_side ** np.arange(dimensions)
    return np.asarray((index % a_side + 0.5) * (SIDE / a_side), np.float64)


def directions(n: int, dimensions: int, seed: int) -> NDArray[np.float64]:
    """``n`` unit vectors, evenly spread (Archimedes: the height of a point on the sphere is evenly spread too)."""
    draws = uniform(2 * n, seed).reshape(n, 2)
    angle = 2 * np.pi * draws[:, 0]
    flat = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if dimensions == 2:
        return flat
    height = 2 * draws[:, 1:] - 1
    return np.concatenate([np.sqrt(1 - height**2) * flat, height], axis=1)


def build(
    settings: Settings | None = None, seed: int = 0, *, n: int = BULLETS, dimensions: int = 2
) -> World:
    """``n`` bullets in a square or a cube. The walls come first, then the pillars, then the bullets."""
    settings = settings or SETTINGS
    world = World(Physics(dimensions=dimensions, gravity=np.zeros(dimensions)), settings=settings)
    enclose(world, [0.0] * dimensions, [SIDE] * dimensions, thickness=WALL, restitution=1.0)
    feet = lattice(PILLARS, 2)
    if dimensions == 2:
        world.create_entities(
            PILLARS, Transform.many(feet), SphereCollider.many(radius=PILLAR_RADIUS, restitution=1.0)
        )
    else:  # from the floor to the ceiling
        centres = np.concatenate([feet, np.full((PILLARS, 1), SIDE / 2)], axis=1)
        half = (PILLAR_RADIUS, PILLAR_RADIUS, SIDE / 2)
        world.create_entities(PILLARS, Transform.many(centres), AABBCollider.many(half_extents=half, restitution=1.0))
    starts = lattice(whole(n, "n"), dimensions)
    from_foot = starts[:, None, :2] - feet
    nearest = np.hypot(*from_foot.T).T.argmin(axis=1)
    away = from_foot[np.arange(n), nearest]
    distance = np.hypot(*away.T)[:, None]
    starts[:, :2] += away * np.maximum(0.0, FREE / distance - 1.0)
    world.create_entities(
        n,
        Transform.many(starts),
        RigidBody.many(mass=1.0, linear_velocity=SPEED * directions(n, dimensions, seed)),
        SphereCollider.many(radius=RADIUS, restitution=1.0),
    )
    return world


SCENE = Scene(
    name="bullets",
    description="1,000 bullets at 1000 m/s between walls a centimetre thick",
    build=build,
    seconds=0.5,
    view=((-MARGIN, -MARGIN), (SIDE + MARGIN, SIDE + MARGIN)),
    settings=SETTINGS,
)

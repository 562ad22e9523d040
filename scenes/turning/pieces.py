"""Pieces: bodies of several boxes, in the shapes of L, T and U, tumble into a bin, hook into each other and rest."""

from __future__ import annotations

import numpy as np

from ...components import RigidBody, Transform
from ...components.part_of import PartOf
from ...components.spin import Spin
from ...framework import Settings, World
from ...plugins import Physics
from ...plugins.parts import Parts
from ...plugins.rotation import BoxCollider, Rotation
from ..protocol import Scene
from ..sizes import ceil_root, whole
from ..walls import enclose

BODIES = 60
PITCH = 1.5  # m, of the lattice on which they start
FRICTION = 0.6
GRAVITY = 9.81
DENSITY = 4.0  # kg/m^2
# The boxes of each piece, (centre, half extents) in m: the first one is the body's own.
PIECES = (
    (((0.0, 0.0), (0.15, 0.5)), ((0.3, -0.35), (0.15, 0.15))),
    (((0.0, 0.0), (0.5, 0.15)), ((0.0, -0.4), (0.15, 0.25))),
    (((0.0, 0.0), (0.5, 0.15)), ((-0.35, 0.35), (0.15, 0.2)), ((0.35, 0.35), (0.15, 0.2))),
)


def _width(n: int) -> float:
    return PITCH * ceil_root(n, 2)


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES, friction: float = FRICTION) -> World:
    """``n`` bodies, one of each shape after the other; ``seed`` chooses their angles, velocities and spins."""
    n, parts = whole(n, "n"), Parts()
    physics = Physics(dimensions=2, gravity=(0.0, -GRAVITY))
    world = World(physics, Rotation(), parts, settings=settings or Settings.balanced())
    side, width = ceil_root(n, 2), _width(n)
    enclose(world, (0.0, 0.0), (width, 1.5 * width), friction=friction, open_top=True)
    random = np.random.default_rng(seed)
    for k in range(n):
        own, *others = PIECES[k % len(PIECES)]
        body = world.create_entity(
            Transform((np.array((k % side, k // side)) + 0.5) * PITCH, random.uniform(0.0, 2.0 * np.pi)),
            RigidBody(mass=_mass(own), linear_velocity=random.uniform(-1.0, 1.0, 2)),
            Spin(random.uniform(-2.0, 2.0)),
            BoxCollider(own[1], friction=friction),
        )
        for box in others:
            world.create_entity(PartOf(body, box[0], mass=_mass(box)), BoxCollider(box[1], friction=friction))
        parts.balance(body)
    return world


def _mass(box: tuple[tuple[float, float], tuple[float, float]]) -> float:
    return DENSITY * 4.0 * box[1][0] * box[1][1]


SCENE = Scene(
    name="pieces",
    description="L, T and U pieces of several boxes tumble into a bin and hook into each other",
    build=build,
    seconds=10.0,
    view=((-1.0, -1.0), (_width(BODIES) + 1.0, _width(BODIES) + 2.0)),
)

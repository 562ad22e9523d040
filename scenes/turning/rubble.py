"""Rubble: discs, boxes, capsules and polygons fall into a bin, turn, and come to rest."""

from __future__ import annotations

import numpy as np

from ...components import RigidBody, SphereCollider, Transform
from ...components.spin import Spin
from ...framework import Settings, World
from ...plugins import Physics, capsule, convex_polygon
from ...plugins.capsule import CapsuleCollider
from ...plugins.convex_polygon import ConvexPolygonCollider
from ...plugins.rotation import BoxCollider, Rotation
from ..protocol import Scene
from ..sizes import ceil_root, whole
from ..walls import enclose

BODIES = 200
SIZES = (0.3, 0.5)  # m, half of a body's width or so
PITCH = 1.1  # of the lattice on which they start
FRICTION = 0.6
GRAVITY = 9.81


def _width(n: int) -> float:
    return PITCH * ceil_root(n, 2)


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES, friction: float = FRICTION) -> World:
    """``n`` bodies of mass 1, one of each kind after the other; ``seed`` chooses their sizes, places and angles."""
    n = whole(n, "n")
    plugins = Rotation(), capsule.plugin, convex_polygon.plugin
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), *plugins, settings=settings or Settings.balanced())
    side, width = ceil_root(n, 2), _width(n)
    enclose(world, (0.0, 0.0), (width, 1.2 * width), friction=friction, open_top=True)
    random = np.random.default_rng(seed)
    for k, size in enumerate(random.uniform(*SIZES, n)):
        shape = (
            SphereCollider(size, friction=friction),
            BoxCollider((size, 0.7 * size), friction=friction),
            CapsuleCollider(0.5 * size, 0.6 * size, friction=friction),
            ConvexPolygonCollider.regular(3 + k % 5, size, friction=friction),
        )[k % 4]
        place = (np.array((k % side, k // side)) + 0.5 + random.uniform(-0.04, 0.04, 2)) * PITCH
        world.create_entity(Transform(place, random.uniform(0.0, 2 * np.pi)), RigidBody(mass=1.0), Spin(), shape)
    return world


SCENE = Scene(
    name="rubble",
    description="discs, boxes, capsules and polygons fall into a bin",
    build=build,
    seconds=10.0,
    view=((-1.0, -1.0), (_width(BODIES) + 1.0, _width(BODIES) + 2.0)),
)

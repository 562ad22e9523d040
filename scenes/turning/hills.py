"""Hills: discs, boxes, capsules and polygons fall on a chain of segments and tumble down into its valleys."""

from __future__ import annotations

import numpy as np

from ...components import RigidBody, SphereCollider, Transform
from ...components.spin import Spin
from ...framework import Settings, World
from ...plugins import Physics, capsule, convex_polygon, terrain
from ...plugins.capsule import CapsuleCollider
from ...plugins.convex_polygon import ConvexPolygonCollider
from ...plugins.rotation import BoxCollider, Rotation
from ..protocol import Scene
from ..sizes import real, whole

BODIES = 60
WIDTH = 60.0  # m
SEGMENT = 0.25  # m, in x
SIZES = (0.2, 0.5)  # m, half of a body's width or so
RIM = 15.0  # m, height of the ground's ends
FRICTION = 0.5
GRAVITY = 9.81


def ground() -> np.ndarray:
    """(k, 2) points of the hills, from left to right; both ends go steeply up."""
    x = np.arange(0.0, WIDTH + SEGMENT / 2, SEGMENT)
    y = 1.6 * np.sin(x / 2.7) + 0.7 * np.sin(x / 1.1 + 1.0)
    return np.concatenate((((-1.0, RIM),), np.stack((x, y), axis=1), ((WIDTH + 1.0, RIM),)))


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES, friction: float = FRICTION) -> World:
    """``n`` bodies of mass 1, of each kind in turn, in rows of 30; ``seed`` chooses sizes, places and angles."""
    n, friction = whole(n, "n"), real(friction, "friction")
    plugins = Rotation(), terrain.plugin, capsule.plugin, convex_polygon.plugin
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), *plugins, settings=settings or Settings.balanced())
    terrain.create_chain(world, ground(), friction=friction)
    random = np.random.default_rng(seed)
    for k, size in enumerate(random.uniform(*SIZES, n)):
        shape = (
            SphereCollider(size, friction=friction),
            BoxCollider((size, 0.7 * size), friction=friction),
            CapsuleCollider(0.5 * size, 0.6 * size, friction=friction),
            ConvexPolygonCollider.regular(3 + k % 5, size, friction=friction),
        )[k % 4]
        place = np.array((1.5 + 1.95 * (k % 30), 4.0 + 1.3 * (k // 30))) + random.uniform(-0.1, 0.1, 2)
        world.create_entity(Transform(place, random.uniform(0.0, 2 * np.pi)), RigidBody(mass=1.0), Spin(), shape)
    return world


SCENE = Scene(
    name="hills",
    description="discs, boxes, capsules and polygons tumble down hills",
    build=build,
    seconds=10.0,
    view=((-1.0, -3.0), (WIDTH + 1.0, RIM)),
)

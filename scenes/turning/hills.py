"""Discs, boxes, capsules and polygons fall on hills and tumble down into the valleys."""

import numpy as np

from carom import Physics, Rotation, Settings, World, create_chain
from carom.framework.elementary import sines_and_cosines
from carom.plugins import capsule, convex_polygon, terrain
from carom.scenes.bodies import add_shapes, lattice
from carom.scenes.sizes import real, whole

BODIES = 60
WIDTH = 60.0  # m
SEGMENT = 0.25  # m, in x
SIZES = (0.2, 0.5)  # m, half of a body's width or so
RIM = 15.0  # m, height of the ground's ends
FRICTION = 0.5
GRAVITY = 9.81
SECONDS = 10.0
VIEW = ((-1.0, -3.0), (WIDTH + 1.0, RIM))


def ground() -> np.ndarray:
    """(k, 2) points of the hills, from left to right; both ends go steeply up."""
    x = np.arange(0.0, WIDTH + SEGMENT / 2, SEGMENT)
    y = 1.6 * sines_and_cosines(x / 2.7)[0] + 0.7 * sines_and_cosines(x / 1.1 + 1.0)[0]
    return np.concatenate((((-1.0, RIM),), np.stack((x, y), axis=1), ((WIDTH + 1.0, RIM),)))


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES, friction: float = FRICTION) -> World:
    """``n`` bodies of mass 1, of each kind in turn, in rows of 30; ``seed`` chooses sizes, places and angles."""
    n, friction = whole(n, "n"), real(friction, "friction")
    plugins = Rotation(), terrain.plugin, capsule.plugin, convex_polygon.plugin
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), *plugins, settings=settings)
    create_chain(world, ground(), friction=friction)
    places = np.array((1.5, 4.0)) + np.array((1.95, 1.3)) * lattice(n, 30)
    add_shapes(world, np.random.default_rng(seed), places, SIZES, jitter=0.1, friction=friction)
    return world

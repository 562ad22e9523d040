"""Discs, boxes, capsules and polygons fall into a bin, turn, and come to rest."""

import numpy as np

from carom import Physics, Rotation, Settings, World
from carom.plugins import capsule, convex_polygon
from carom.scenes.bodies import add_shapes, lattice
from carom.scenes.sizes import ceil_root, whole
from carom.scenes.walls import enclose

BODIES = 200
SIZES = (0.3, 0.5)  # m, half of a body's width or so
PITCH = 1.1  # of the lattice on which they start
FRICTION = 0.6
WIDTH = PITCH * ceil_root(BODIES, 2)  # of the bin for that many
SECONDS = 10.0
VIEW = ((-1.0, -1.0), (WIDTH + 1.0, WIDTH + 2.0))


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES, friction: float = FRICTION) -> World:
    """``n`` bodies of mass 1, one of each kind after the other; ``seed`` chooses their sizes, places and angles."""
    n = whole(n, "n")
    plugins = Rotation(), capsule.plugin, convex_polygon.plugin
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), *plugins, settings=settings)
    side = ceil_root(n, 2)
    enclose(world, (0.0, 0.0), (PITCH * side, 1.2 * (PITCH * side)), friction=friction, open_top=True)
    random, cells = np.random.default_rng(seed), lattice(n, side) + 0.5
    add_shapes(world, random, cells, SIZES, jitter=0.04, pitch=PITCH, friction=friction)
    return world

"""Gravity that is large against the sizes, bodies and floors of any shipped shape: nothing passes through another."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_pairwise import pairwise
from helpers_rest import SLOP, heights
from worlds import METHODS, MODES

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, capsule, convex_polygon, half_space, tile_grid

DT = 1 / 60
GRAVITIES = (1e-6, 1e-3, 0.05, 0.3, 1.0, 3.0, 10.0, 100.0, 1e4, 1e6)  # g dt^2 of a size
ALLOWED = SLOP + 1e-3  # the slop, and the softness of a stack of five
WIDE = 20.0

# Bodies of one metre. The floors' tops are at 0.
BODIES = {
    "ball": lambda d: SphereCollider(0.5),
    "box": lambda d: AABBCollider((0.5,) * d),
    "capsule": lambda d: capsule.CapsuleCollider(0.25, 0.25),
    "polygon": lambda d: convex_polygon.ConvexPolygonCollider([(-0.5, -0.5), (0.5, -0.5), (0.3, 0.5), (-0.3, 0.5)]),
}
FLOORS = {
    "box": (-1.0, lambda d: AABBCollider((WIDE, 1.0, WIDE)[:d])),
    "half_space": (0.0, lambda d: half_space.HalfSpaceCollider((0.0, 1.0, 0.0)[:d])),
    "tile_grid": (-1.0, lambda d: tile_grid.TileGridCollider(["#" * 20] * 2, 1.0)),
    "one_way": (0.0, lambda d: AABBCollider((WIDE, 0.0), one_way=(0.0, 1.0))),
}
PLUGINS = (capsule.plugin, half_space.plugin)
PLUGINS_2D = (convex_polygon.plugin, tile_grid.plugin)
SHIPPED = [
    (2, "capsule", "box"), (2, "polygon", "box"), (2, "box", "half_space"), (2, "box", "tile_grid"),
    (2, "ball", "one_way"), (3, "capsule", "half_space"),
]  # fmt: skip


@pytest.mark.slow  # its shapes take long to compile
@pytest.mark.parametrize(("case", "mode", "method", "gravity"), pairwise(SHIPPED, MODES, METHODS, GRAVITIES))
def test_a_stack_of_any_shipped_shape_keeps_its_order_and_its_place(case, mode, method, gravity):
    """Five on each other, at every step: none further than the slop from its place."""
    d, shape, ground = case
    settings = Settings(dt=DT, collision=mode, integrator=method)
    plugins = (*PLUGINS, *PLUGINS_2D) if d == 2 else PLUGINS
    world = World(Physics(d, gravity=(0.0, -gravity / DT**2, 0.0)[:d]), *plugins, settings=settings)
    top, make = FLOORS[ground]
    world.create_entity(Transform((0.0, top, 0.0)[:d]), make(d))
    places = 0.5 + np.arange(5)
    bodies = [world.create_entity(Transform((0.0, y, 0.0)[:d]), RigidBody(), BODIES[shape](d)) for y in places]
    for _ in range(120):
        world.step()
        y = heights(world, bodies)
        assert (np.diff(y) > 0).all(), (world.step_count, y)
        assert np.abs(y - places).max() < ALLOWED, (world.step_count, y)

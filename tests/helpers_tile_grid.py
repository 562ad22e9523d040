"""Worlds for tile maps, and the boxes of all their tiles."""

from __future__ import annotations

import numpy as np

from carom.components import AABBCollider, SphereCollider, Transform
from carom.framework import World
from carom.plugins import Physics, convex_polygon, tile_grid
from carom.plugins.convex_polygon import ConvexPolygonCollider


def boxes_of(cells, tile, lower=(0.0, 0.0)):
    """Lower and upper corners of all tiles, from the definition."""
    cells = np.asarray(cells)
    tiles = [(x, len(cells) - 1 - y) for y in range(len(cells)) for x in range(len(cells[0])) if cells[y][x]]
    low = np.array(tiles, float).reshape(-1, 2) * tile + lower
    return low, low + tile


def distances(points, low, high):
    """From each point to the nearest of the boxes."""
    away = np.maximum(np.maximum(low - points[:, None], points[:, None] - high), 0.0)
    return np.linalg.norm(away, axis=2).min(1)


def make_world(gravity=(0, -10), others=False):
    """A world with only spheres and tiles, or with all shapes of the tests, so that tests share compiled code."""
    world = World(Physics(dimensions=2, gravity=gravity), convex_polygon.plugin, tile_grid.plugin)
    world.create_entity(Transform((0, -5000)), SphereCollider(1.0))
    if others:
        world.create_entity(Transform((0, -6000)), AABBCollider(1.0))
        world.create_entity(Transform((0, -7000)), ConvexPolygonCollider.box(1.0))
    return world


def run(world, steps):
    for _ in range(steps):
        world.step()

"""The tiles of a map as boxes, by the definition."""

from __future__ import annotations

import numpy as np

from carom.plugins.tile_grid import TileShape


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


def polygons_of(cells, shapes):
    """(k, 2) corners, counter-clockwise, of each tile of size 1 with its shape; the map's lower left corner is at 0."""
    cells, shapes = np.asarray(cells), np.asarray(shapes)
    return [
        np.add(TileShape(shapes[y, x]).corners, (x, len(cells) - 1 - y))
        for y, x in np.argwhere(cells)
        if shapes[y, x] != TileShape.ONE_WAY
    ]


def distance_to_polygons(point, polygons):
    """From a point to the nearest of convex polygons; below 0 inside of one."""
    least = np.inf
    for corners in polygons:
        edges, arms = np.roll(corners, -1, axis=0) - corners, point - corners
        share = np.clip((arms * edges).sum(1) / (edges * edges).sum(1), 0.0, 1.0)
        away = np.linalg.norm(arms - share[:, None] * edges, axis=1).min()
        inside = (edges[:, 0] * arms[:, 1] - edges[:, 1] * arms[:, 0] >= 0.0).all()
        least = min(least, -away if inside else away)
    return least


def way_to_polygons(start, way, radius, polygons):
    """The part of a way after which a circle first touches convex polygons, by its distance; None if it does not."""
    share, speed = 0.0, np.linalg.norm(way)
    for _ in range(500):
        gap = distance_to_polygons(start + share * way, polygons) - radius
        if gap < 1e-10:
            return share
        share += gap / speed
        if share > 1.0:
            return None
    return None

"""The tiles of a map as boxes, by the definition."""

from __future__ import annotations

import numpy as np


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

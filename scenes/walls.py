"""Static walls around a rectangle or a cuboid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..components import AABBCollider, Transform
from ..framework import World


def enclose(
    world: World,
    lower: Sequence[float],
    upper: Sequence[float],
    *,
    thickness: float = 1.0,
    restitution: float = 0.0,
    friction: float | None = None,
    open_top: bool = False,
) -> list[int]:
    """Put one static box on each side of the space from ``lower`` to ``upper``; the boxes overlap in the
    corners. ``open_top`` leaves out the upper one of axis 1.

    Returns the entity ids: for each axis the lower wall, then the upper one.
    """
    low, high = np.asarray(lower, float), np.asarray(upper, float)
    walls = []
    for axis in range(len(low)):
        half = (high - low) / 2 + thickness
        half[axis] = thickness / 2
        for edge, outwards in ((low[axis], -1.0), (high[axis], 1.0)):
            if open_top and axis == 1 and outwards > 0:
                continue
            centre = (low + high) / 2
            centre[axis] = edge + outwards * thickness / 2
            walls.append(
                world.create_entity(
                    Transform(centre),
                    AABBCollider(half_extents=half, restitution=restitution, friction=friction),
                )
            )
    return walls


def block(
    world: World,
    lower: Sequence[float],
    upper: Sequence[float],
    *,
    restitution: float = 0.0,
    friction: float | None = None,
) -> int:
    """One static box from ``lower`` to ``upper``. Returns the entity id."""
    low, high = np.asarray(lower, float), np.asarray(upper, float)
    return world.create_entity(
        Transform((low + high) / 2), AABBCollider((high - low) / 2, restitution=restitution, friction=friction)
    )

"""The elastic gas in 3D: spheres in a cube, see :mod:`carom.scenes.gas`."""

from __future__ import annotations

from ...framework import Settings, World
from .. import gas


def build(settings: Settings | None = None, seed: int = 0, *, n: int = gas.BODIES[3]) -> World:
    """``n`` spheres in a cube; ``seed`` chooses places and velocities."""
    return gas.gas3d(settings, seed, n=n)


SCENE = gas.SCENE_3D

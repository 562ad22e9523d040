"""The elastic gas in 2D: discs in a square, see :mod:`carom.scenes.gas`."""

from __future__ import annotations

from ...framework import Settings, World
from .. import gas


def build(settings: Settings | None = None, seed: int = 0, *, n: int = gas.BODIES[2]) -> World:
    """``n`` discs in a square; ``seed`` chooses places and velocities."""
    return gas.gas2d(settings, seed, n=n)


SCENE = gas.SCENE_2D

"""The pile in 3D: spheres in a bin, see :mod:`carom.scenes.rest.pile`."""

from __future__ import annotations

from ...framework import Settings, World
from . import pile


def build(settings: Settings | None = None, seed: int = 0, *, n: int = pile.BODIES[3]) -> World:
    """``n`` spheres in a bin; ``seed`` chooses their places."""
    return pile.pile3d(settings, seed, n=n)


SCENE = pile.SCENE_3D

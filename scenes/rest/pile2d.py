"""The pile in 2D: discs in a bin, see :mod:`carom.scenes.rest.pile`."""

from __future__ import annotations

from ...framework import Settings, World
from . import pile


def build(settings: Settings | None = None, seed: int = 0, *, n: int = pile.BODIES[2]) -> World:
    """``n`` discs in a bin; ``seed`` chooses their places."""
    return pile.pile2d(settings, seed, n=n)


SCENE = pile.SCENE_2D

"""Which window shows a world, by what is installed."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from ..framework import World


def view_class(world: World, filmed: bool = False) -> Any:
    """:class:`View`; where pygame-ce is missing and pyglet is there :class:`PygletView`, for worlds in 2D that are not
    ``filmed``."""
    if world.dimensions == 2 and not filmed and find_spec("pygame") is None and find_spec("pyglet") is not None:
        from .pyglet_window import PygletView

        return PygletView
    from .pygame_window import View

    return View

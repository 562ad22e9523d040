"""What shows a world, by its dimensions and by what is installed."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np

from ..framework import World
from ..framework.typing import Vector
from .camera import Camera
from .space.orbit import OrbitCamera


def camera_of(world: World, size: Vector = (1280, 720)) -> Camera | OrbitCamera:
    """A camera for its worlds; in 3D gravity tells what is down."""
    if world.dimensions == 2:
        return Camera(size)
    down = np.asarray(world.gravity)
    return OrbitCamera(size, up=-down if np.any(down) else (0.0, 1.0, 0.0))


def painter_of(world: World) -> Any:
    """What paints drawing lists of such a world onto surfaces."""
    if world.dimensions == 2:
        from .plane.painter import Painter

        return Painter()
    from .space.painter import SpacePainter

    return SpacePainter()


def view_class(world: World, filmed: bool = False) -> Any:
    """:class:`View`; where pygame-ce is missing and pyglet is there :class:`PygletView`, for worlds in 2D that are not
    ``filmed``."""
    if world.dimensions == 2 and not filmed and find_spec("pygame") is None and find_spec("pyglet") is not None:
        from .pyglet_window import PygletView

        return PygletView
    from .pygame_window import View

    return View

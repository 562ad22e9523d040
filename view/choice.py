"""What shows a world, by its dimensions."""

from __future__ import annotations

from typing import Any

from ..drawing.up import up_of
from ..framework import World
from ..framework.typing import Vector
from .camera import Camera
from .space.orbit import OrbitCamera


def camera_of(world: World, size: Vector = (1280, 720)) -> Camera | OrbitCamera:
    """A camera for its worlds; in 3D gravity tells what is down."""
    if world.dimensions == 2:
        return Camera(size)
    return OrbitCamera(size, up=up_of(world))


def painter_of(world: World) -> Any:
    """What paints drawing lists of such a world onto surfaces."""
    if world.dimensions == 2:
        from .plane.painter import Painter

        return Painter()
    from .space.painter import SpacePainter

    return SpacePainter()

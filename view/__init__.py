"""A window on a world: it is shown, stopped, taken apart, and recorded.

>>> from carom.view import Camera, Sprites, View
>>> View(world).run()

Cameras need numpy alone; the others load pygame-ce when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .camera import Camera as Camera
    from .packages import MissingPackageError as MissingPackageError
    from .pygame_window import View as View
    from .pyglet_window import PygletView as PygletView
    from .space.orbit import OrbitCamera as OrbitCamera
    from .sprites import Sprites as Sprites
    from .window import DisplayError as DisplayError

_MODULES = {
    "Camera": "camera", "DisplayError": "window", "MissingPackageError": "packages", "OrbitCamera": "space.orbit",
    "PygletView": "pyglet_window", "Sprites": "sprites", "View": "pygame_window",
}  # fmt: skip
__all__ = ["Camera", "DisplayError", "MissingPackageError", "OrbitCamera", "PygletView", "Sprites", "View"]


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module 'carom.view' has no attribute {name!r}")
    import importlib

    value = globals()[name] = getattr(importlib.import_module(f".{_MODULES[name]}", __name__), name)
    return value

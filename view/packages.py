"""The packages that draw: imported when they are used, and one line that says what to install where one is missing."""

from __future__ import annotations

import importlib
import os
from typing import Any

from ..framework.errors import CaromError

EXTRAS = {"pygame": ("pygame-ce", "view"), "moderngl": ("moderngl", "view3d"), "pyglet": ("pyglet", "view-pyglet")}
EXTRAS |= {"PIL": ("pillow", "record"), "imageio_ffmpeg": ("imageio-ffmpeg", "record")}


class MissingPackageError(CaromError, ImportError):
    """A package that draws is not installed; the message says how to install it."""


def package(name: str, what: str, part: str = "") -> Any:
    """The package ``name``, or the module ``part`` of it; MissingPackageError, which says ``what`` needs it."""
    if name == "pygame":
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # else its import prints a line
    try:
        return importlib.import_module(f"{name}.{part}" if part else name)
    except ImportError as error:
        title, extra = EXTRAS[name]
        raise MissingPackageError(f"{what} needs {title}: pip install 'carom[{extra}]'") from error

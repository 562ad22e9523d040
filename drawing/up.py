"""What is up in a picture of a world in space: gravity tells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ..framework import World

Y_UP = (0.0, 1.0, 0.0)


def up_of(world: World) -> NDArray[np.float64]:
    """(3,), against the gravity of a world in 3D; y without gravity."""
    down = np.asarray(world.gravity, float)
    return -down if np.any(down) else np.array(Y_UP)


def axes_round(up: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3), unit vectors as rows at right angles: two level ones, and between them the one that points up; for y up
    they are x, y and z."""
    up = up / np.linalg.norm(up)
    ahead = np.eye(3)[int(np.argmin(np.abs(up)))]
    ahead = ahead - (ahead @ up) * up
    ahead /= np.linalg.norm(ahead)
    return np.array((ahead, up, np.cross(ahead, up)))

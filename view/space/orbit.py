"""A camera that goes round a place in space. No drawing library is in it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...drawing.up import Y_UP, axes_round
from ...framework.typing import Vector
from ..camera import pixels_of, place_of

Floats = NDArray[np.float64]

FIELD = math.radians(45.0)  # of view, from top to bottom
STEEPEST = math.radians(89.0)
NEAREST, FARTHEST = 1e-6, 1e7  # m
TURN = math.radians(0.3)  # by a pixel
NEAR, FAR = 0.02, 50.0  # planes, in distances


class OrbitCamera:
    """Looks at a place in space from a distance; pixels are counted from the upper left.

    size
        (width, height) of the screen, pixels
    middle
        (3,) m, what it looks at
    distance
        m, from there
    yaw, pitch
        rad, round the axis that points up, and above the ground
    up
        (3,), the axis of the world that points up
    """

    def __init__(
        self,
        size: Vector = (1280, 720),
        middle: Vector = (0.0, 0.0, 0.0),
        distance: float = 10.0,
        yaw: float = 0.6,
        pitch: float = 0.4,
        *,
        up: Vector = Y_UP,
    ) -> None:
        self.size, self.middle, self.distance, self.yaw, self.pitch = size, middle, distance, yaw, pitch
        self._ahead, self.up, self._side = axes_round(place_of(up, "OrbitCamera.up", 3))  # it looks there at a yaw of 0

    @property
    def size(self) -> tuple[int, int]:
        """(width, height), pixels; at least 1."""
        return self._size

    @size.setter
    def size(self, size: Vector) -> None:
        self._size = pixels_of(size, "OrbitCamera.size")

    @property
    def middle(self) -> Floats:
        """(3,) m."""
        return self._middle

    @middle.setter
    def middle(self, middle: Vector) -> None:
        self._middle = place_of(middle, "OrbitCamera.middle", 3)

    @property
    def distance(self) -> float:
        """Metres, m; ValueError for what is not above 0."""
        return self._distance

    @distance.setter
    def distance(self, distance: float) -> None:
        if not (distance > 0 and math.isfinite(distance)):
            raise ValueError(f"OrbitCamera.distance must be a finite number above 0, got {distance!r}")
        self._distance = min(max(float(distance), NEAREST), FARTHEST)

    @property
    def scale(self) -> float:
        """Pixels per m at the middle."""
        return self._size[1] / (2 * math.tan(FIELD / 2) * self._distance)

    @property
    def axes(self) -> Floats:
        """(3, 3): as rows, unit vectors to the right, upwards and ahead."""
        level = math.cos(self.yaw) * self._ahead + math.sin(self.yaw) * self._side
        ahead = math.cos(self.pitch) * level - math.sin(self.pitch) * self.up
        right = np.cross(ahead, self.up)
        right /= np.linalg.norm(right)
        return np.array((right, np.cross(right, ahead), ahead))

    @property
    def place(self) -> Floats:
        """(3,) m, where it is."""
        return self._middle - self._distance * self.axes[2]

    def matrix(self) -> Floats:
        """(4, 4), from places (x, y, z, 1) in m to clip space; applied from the left."""
        axes, (width, height) = self.axes, self._size
        view = np.eye(4)
        view[:3, :3] = axes * ((1,), (1,), (-1,))
        view[:3, 3] = -view[:3, :3] @ self.place
        near, far, factor = NEAR * self._distance, FAR * self._distance, 1 / math.tan(FIELD / 2)
        clip = np.zeros((4, 4))
        clip[0, 0], clip[1, 1] = factor * height / width, factor
        clip[2, 2], clip[2, 3], clip[3, 2] = (far + near) / (near - far), 2 * far * near / (near - far), -1.0
        return clip @ view

    def to_screen(self, points: Any) -> Floats:
        """Pixels (..., 2) of ``points`` (..., 3) m; nan for what is behind."""
        apart = (np.asarray(points, float) - self.place) @ self.axes.T
        with np.errstate(invalid="ignore", divide="ignore"):
            depth = np.where(apart[..., 2:] > NEAR * self._distance, apart[..., 2:], np.nan)
            flat = apart[..., :2] / depth * (self.scale * self._distance)
        return np.array(self._size) / 2 + flat * (1.0, -1.0)

    def ray(self, pixels: Vector) -> tuple[Floats, Floats]:
        """Where the ray through ``pixels`` (2,) begins, (3,) m, and its direction, a unit vector (3,)."""
        flat = (np.asarray(pixels, float) - np.array(self._size) / 2) * (1.0, -1.0) / (self.scale * self._distance)
        way = np.array((*flat, 1.0)) @ self.axes
        return self.place, way / np.linalg.norm(way)

    def to_world(self, pixels: Vector, at: Vector | None = None) -> Floats:
        """The place (3,) m under ``pixels`` (2,), as far away as ``at`` (3,) m, or as the middle."""
        place, way = self.ray(pixels)
        ahead = self.axes[2]
        depth = ahead @ (np.asarray(self._middle if at is None else at, float) - place)
        return place + way * (depth / (way @ ahead))

    # -- motion -----------------------------------------------------------------------------------

    def fit(self, lower: Vector, upper: Vector) -> None:
        """Show all from the ``lower`` to the ``upper`` corner (3,) m."""
        low, high = place_of(lower, "OrbitCamera.fit: lower", 3), place_of(upper, "OrbitCamera.fit: upper", 3)
        self.middle = (low + high) / 2
        narrow = min(1.0, self._size[0] / self._size[1])
        self.distance = max(float(np.linalg.norm(high - low)) / 2, 1e-3) / (math.sin(FIELD / 2) * narrow)

    def zoom(self, factor: float, at: Vector | None = None) -> None:
        """Come nearer by ``factor``; what is ``at`` these pixels (2,) stays there."""
        at = np.array(self._size) / 2 if at is None else at
        under = self.to_world(at)
        self.distance = self._distance / factor
        self._middle = self._middle + under - self.to_world(at)

    def pan(self, pixels: Vector) -> None:
        """Move what is seen by so many ``pixels`` (2,) of the screen."""
        right, up, _ = self.axes
        x, y = np.asarray(pixels, float) / self.scale
        self._middle = self._middle - x * right + y * up

    def turn(self, pixels: Vector) -> None:
        """Go round, by so many ``pixels`` (2,) that the mouse has moved."""
        x, y = (float(number) for number in pixels)
        self.yaw += TURN * x
        self.pitch = min(max(self.pitch + TURN * y, -STEEPEST), STEEPEST)

    def follow(self, point: Vector, seconds: float = 0.0, half_life: float = 0.1) -> None:
        """Move towards a ``point`` (3,) m, half of the way in each ``half_life`` of the ``seconds``; 0: at once."""
        goal = place_of(point, "OrbitCamera.follow: point", 3)
        part = 1.0 - 0.5 ** (seconds / half_life) if seconds > 0 and half_life > 0 else 1.0
        self._middle = self._middle + part * (goal - self._middle)

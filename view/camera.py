"""Where metres are on the screen. No drawing library is in it: what it makes are arrays."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..framework.typing import Vector

Floats = NDArray[np.float64]

SMALLEST, LARGEST = 1e-6, 1e6  # pixels per metre
MARGIN = 0.95  # of the screen, that what is fitted takes


class Camera:
    """A part of the plane on a screen: one scale in both directions, and no rotation.

    size
        (width, height) of the screen, pixels; set it when that changes
    middle
        (2,) m, what is in the middle of the screen
    scale
        pixels per metre, 1e-6 to 1e6; what is beyond is cut off
    y_up
        where pixels are counted from: False from the upper left as in pygame, True from the lower left as in pyglet and
        arcade
    bounds
        (lower corner, upper corner), m, of a level that :meth:`follow` does not look beyond; None: no such
    """

    def __init__(
        self,
        size: Vector = (1280, 720),
        middle: Vector = (0.0, 0.0),
        scale: float = 50.0,
        *,
        y_up: bool = False,
        bounds: tuple[Vector, Vector] | None = None,
    ) -> None:
        self.y_up, self.bounds = y_up, bounds
        self.size, self.middle, self.scale = size, middle, scale

    @property
    def size(self) -> tuple[int, int]:
        """(width, height), pixels; at least 1. ValueError for what is no two numbers."""
        return self._size

    @size.setter
    def size(self, size: Vector) -> None:
        self._size = pixels_of(size, "Camera.size")

    @property
    def middle(self) -> Floats:
        """(2,) m; ValueError for what is no place."""
        return self._middle

    @middle.setter
    def middle(self, middle: Vector) -> None:
        self._middle = place_of(middle, "Camera.middle")

    @property
    def scale(self) -> float:
        """Pixels per m; ValueError for what is not above 0."""
        return self._scale

    @scale.setter
    def scale(self, scale: float) -> None:
        if not (scale > 0 and math.isfinite(scale)):
            raise ValueError(f"Camera.scale must be a finite number above 0, got {scale!r}")
        self._scale = min(max(float(scale), SMALLEST), LARGEST)

    # -- places -----------------------------------------------------------------------------------

    @property
    def _factors(self) -> tuple[float, float]:
        return self._scale, self._scale if self.y_up else -self._scale

    def to_screen(self, points: Any) -> Floats:
        """Pixels (..., 2) of ``points`` (..., 2) m, as ``bodies.interpolated_position``."""
        return (np.asarray(points, float) - self._middle) * self._factors + (self._size[0] / 2, self._size[1] / 2)

    def to_world(self, pixels: Any, at: Any = None) -> Floats:
        """Places (..., 2) m of ``pixels`` (..., 2); ``at``, how far away, has a meaning in 3D alone."""
        middle = self._size[0] / 2, self._size[1] / 2
        return (np.asarray(pixels, float) - middle) / self._factors + self._middle

    @property
    def visible(self) -> tuple[Floats, Floats]:
        """The lower and the upper corner, (2,) m each, of what is on the screen."""
        half = np.array(self._size) / (2 * self._scale)
        return self._middle - half, self._middle + half

    # -- motion -----------------------------------------------------------------------------------

    def fit(self, lower: Vector, upper: Vector) -> None:
        """Show all from the ``lower`` to the ``upper`` corner (2,) m, with a margin; ValueError if these are none."""
        low, high = place_of(lower, "Camera.fit: lower"), place_of(upper, "Camera.fit: upper")
        self.middle = (low + high) / 2
        self.scale = MARGIN * float(np.min(np.array(self._size) / np.maximum(high - low, 1e-3)))

    def zoom(self, factor: float, at: Vector | None = None) -> None:
        """Make all larger by ``factor``; what is ``at`` these pixels (2,), or in the middle, stays there."""
        at = (self._size[0] / 2, self._size[1] / 2) if at is None else at
        under = self.to_world(at)
        self.scale = self._scale * factor
        self._middle = self._middle + under - self.to_world(at)

    def pan(self, pixels: Vector) -> None:
        """Move what is seen by so many ``pixels`` (2,) of the screen."""
        self._middle = self._middle - np.asarray(pixels, float) / self._factors

    def follow(self, point: Vector, seconds: float = 0.0, half_life: float = 0.1) -> None:
        """Move towards a ``point`` (2,) m, within :attr:`bounds`.

        seconds
            since the last frame; 0: be there at once
        half_life
            s in which half of the way is made, at any frame rate
        """
        goal = place_of(point, "Camera.follow: point")
        if self.bounds is not None:
            low, high = (np.asarray(end, float) for end in self.bounds)
            half = np.minimum(np.array(self._size) / (2 * self._scale), (high - low) / 2)  # a level that is too small
            goal = np.clip(goal, low + half, high - half)
        part = 1.0 - 0.5 ** (seconds / half_life) if seconds > 0 and half_life > 0 else 1.0
        self._middle = self._middle + part * (goal - self._middle)

    def __repr__(self) -> str:
        return f"Camera({self._size}, middle={self._middle.tolist()}, scale={self._scale:g}, y_up={self.y_up})"


def place_of(value: Any, name: str, dimensions: int = 2) -> Floats:
    """(d,), a copy; ValueError for anything else."""
    try:
        place = np.array(value, float)
    except (TypeError, ValueError):
        place = np.empty(0)
    if place.shape != (dimensions,) or not np.isfinite(place).all():
        count = {2: "two", 3: "three"}[dimensions]
        raise ValueError(f"{name} must be {count} finite numbers, got {value!r}")
    return place


def pixels_of(size: Any, name: str) -> tuple[int, int]:
    """(width, height), at least 1; ValueError for what is no two numbers."""
    width, height = place_of(size, name)
    return max(1, round(float(width))), max(1, round(float(height)))


FAR = 1e4  # m: half-spaces have no end, and decide nothing


def corners_of(shown: Any, positions: Floats) -> tuple[Floats, Floats] | None:
    """The lower and the upper corner (d,) m of a drawing list and of bodies (n, d) m; None where there is nothing."""
    some = [positions]
    for group in (*shown.polygons, *shown.fixed, *shown.lines, *shown.fixed_lines):
        some.append(group.points.reshape(-1, positions.shape[1]))
    for circles in (shown.circles, shown.fixed_circles):
        some += [circles.centre - circles.radius[:, None], circles.centre + circles.radius[:, None]]
    points = np.concatenate(some)
    points = points[(np.abs(points) < FAR).all(axis=1)]
    return (points.min(axis=0), points.max(axis=0)) if len(points) else None

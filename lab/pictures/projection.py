"""Projection of a scene onto the picture plane: 2D unchanged, 3D by a perspective camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...drawing.up import Y_UP, axes_round
from ...framework.typing import Vector

Floats = NDArray[np.float64]

AZIMUTH, ELEVATION = np.radians(-58.0), np.radians(20.0)
DISTANCE = 2.6  # of the camera from the middle of the view, in diagonals of the view


@dataclass(frozen=True)
class Projection:
    """The space between ``lower`` and ``upper``, viewed from outside.

    ``axes`` (d, d): rows are right, up and, in 3D, towards the camera; ``ground``: along it, up and along it.
    """

    lower: Floats
    upper: Floats
    axes: Floats
    distance: float
    ground: Floats

    @classmethod
    def of(cls, lower: Floats, upper: Floats, up: Vector = Y_UP) -> Projection:
        """A projection of the space between two corners; in 3D ``up`` is up in the picture, in 2D y."""
        if len(lower) == 2:
            return cls(lower, upper, np.eye(2), np.inf, np.eye(2))
        ahead, above, side = ground = axes_round(np.asarray(up, float))
        level = np.cos(AZIMUTH) * side - np.sin(AZIMUTH) * ahead
        toward = np.cos(ELEVATION) * level + np.sin(ELEVATION) * above
        right = np.cross(above, toward)
        right /= np.linalg.norm(right)
        axes = np.stack([right, np.cross(toward, right), toward])
        return cls(lower, upper, axes, DISTANCE * float(np.linalg.norm(upper - lower)), ground)

    @property
    def dimensions(self) -> int:
        return len(self.lower)

    @property
    def flat(self) -> bool:
        """Whether the scene is 2D."""
        return self.dimensions == 2

    def plane(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Points (..., d): places in the plane (..., 2), magnification (...), depth (...): 0 far, 1 near."""
        points = np.asarray(points, float)
        if self.flat:
            ones = np.ones(points.shape[:-1])
            return points, ones, ones
        relative = self._relative(points)
        ahead = self._relative(corners(self.lower, self.upper))[:, 2]
        depth = np.clip((relative[..., 2] - ahead.min()) / max(float(np.ptp(ahead)), 1e-300), 0.0, 1.0)
        magnification = self.distance / np.maximum(self.distance - relative[..., 2], 0.05 * self.distance)
        return relative[..., :2] * magnification[..., None], magnification, depth

    @property
    def camera(self) -> Floats:
        """The position of the camera, (3,)."""
        return (self.lower + self.upper) / 2 + self.distance * self.axes[2]

    def frame(self) -> tuple[Floats, Floats]:
        """The corners of the rectangle in the plane that encloses the view."""
        places, _, _ = self.plane(corners(self.lower, self.upper))
        return places.min(axis=0), places.max(axis=0)

    def clipped(self, ring: Floats) -> Floats:
        """The part of a flat convex polygon (m, 3) that is in the view; it may be empty."""
        for axis in range(3):
            for sign, end in ((-1.0, self.lower[axis]), (1.0, self.upper[axis])):
                over = sign * (ring[:, axis] - end)
                if not (over > 0.0).any():
                    continue
                after, further = np.roll(ring, -1, axis=0), np.roll(over, -1)
                crosses = (over > 0.0) != (further > 0.0)
                share = np.divide(over, over - further, out=np.zeros_like(over), where=crosses)
                both = np.stack([ring, ring + share[:, None] * (after - ring)], axis=1)
                ring = both[np.stack([over <= 0.0, crosses], axis=1)]
        return ring

    def _relative(self, points: Floats) -> Floats:
        return (points - (self.lower + self.upper) / 2) @ self.axes.T


def corners(lower: Floats, upper: Floats) -> Floats:
    """The 2^d corners; bit k of the row number selects the end of axis k."""
    d = len(lower)
    bits = (np.arange(2**d)[:, None] >> np.arange(d)) & 1
    return np.where(bits, upper, lower)

"""Where one thing is from another, and how it is turned."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...components.spin import axes_of
from ...framework.elementary import cos, sin
from ...framework.matrices import matrix_product
from ...systems.shapes.quaternions import product


class Pose(NamedTuple):
    """A position (d,) and a rotation: an angle, in space a unit quaternion (w, x, y, z)."""

    position: np.ndarray
    rotation: Any

    @classmethod
    def of(cls, position: Any, rotation: Any, dimensions: int) -> Pose:
        """The same from what fields hold, where a number may stand for a vector or for no rotation."""
        place = np.zeros(dimensions) + np.asarray(position, float)
        if dimensions == 2:
            return cls(place, float(rotation))
        return cls(place, np.array(rotation if np.ndim(rotation) else (1.0, 0.0, 0.0, 0.0), float))  # rows move

    def axes(self) -> np.ndarray:
        """(d, d): its axes as columns."""
        if len(self.position) == 2:
            c, s = cos(self.rotation), sin(self.rotation)
            return np.array(((c, -s), (s, c)))
        return axes_of(self.rotation)

    def point(self, local: Any) -> np.ndarray:
        return self.position + matrix_product(self.axes(), local)

    def local(self, point: Any) -> np.ndarray:
        return matrix_product(self.axes().T, np.asarray(point, float) - self.position)

    def then(self, inner: Pose) -> Pose:
        """The pose of what is at ``inner`` along the axes of this."""
        if len(self.position) == 2:
            return Pose(self.point(inner.position), self.rotation + inner.rotation)
        return Pose(self.point(inner.position), np.array(product(self.rotation, inner.rotation)))


def turned_by(rotations: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Rotations (n,) or (n, 4) of bodies, turned against them by turns (n, 4), to the bit as the stages of parts do."""
    if rotations.ndim == 1:
        return rotations + turns[:, 0]
    return _unit(np.stack(product(_unit(rotations).T, turns.T), axis=1))


def _unit(q: np.ndarray) -> np.ndarray:
    w, x, y, z = q.T
    return q / np.sqrt(w * w + x * x + y * y + z * z)[:, None]

"""Motion: the dynamic bodies' columns through one step, as integrators see them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...framework.compilation import kernel

if TYPE_CHECKING:
    from ..state import PhysicsState


@dataclass
class Motion:
    """Views of the dynamic rows; position and velocity hold the state that forces are evaluated at.

    position, velocity, force, start_position, start_velocity (n, d); inverse_mass, damping (n,).
    """

    position: np.ndarray
    velocity: np.ndarray
    force: np.ndarray
    inverse_mass: np.ndarray
    damping: np.ndarray
    start_position: np.ndarray
    start_velocity: np.ndarray
    evaluator: Callable[[float], None] | None  # None: no force depends on the state

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        return self.position, self.velocity, self.force, self.inverse_mass, self.damping

    @property
    def like(self) -> tuple[float, ...]:
        """Zeros, one for each dimension."""
        return (0.0,) * self.position.shape[1]

    @property
    def force_changes(self) -> bool:
        """Whether some force depends on position, velocity or time; else the forces of the start hold throughout."""
        return self.evaluator is not None

    def evaluate(self, seconds: float) -> None:
        """Sum the forces anew at the state in the columns, ``seconds`` into the step."""
        if self.evaluator is not None:
            self.evaluator(seconds)


@kernel
def limit_distance(points, origins, speed, seconds):
    """Bring points nearer that are farther than speed * seconds from their origin (speed nan: no limit).

    Scaled by the largest component, so that no square overflows.
    """
    for i in range(len(points)):
        limit = speed[i] * seconds
        largest = 0.0
        for k in range(points.shape[1]):
            largest = max(largest, abs(points[i, k] - origins[i, k]))
        if limit != limit or largest == 0.0 or not math.isfinite(largest):
            continue
        square = 0.0
        for k in range(points.shape[1]):
            square += ((points[i, k] - origins[i, k]) / largest) ** 2
        length = math.sqrt(square)
        if length > limit / largest:
            for k in range(points.shape[1]):
                points[i, k] = origins[i, k] + (points[i, k] - origins[i, k]) / largest * (limit / length)


def limit_speeds(state: PhysicsState) -> None:
    """Shorten the velocities of the dynamic bodies that exceed their max_linear_speed."""
    dynamic = state.bodies.dynamic
    state.table.keep("linear_velocity")
    velocity = dynamic.linear_velocity
    limit_distance(velocity, np.zeros_like(velocity), dynamic.max_linear_speed, 1.0)

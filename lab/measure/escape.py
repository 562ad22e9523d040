"""Bodies that escaped: non-finite, or beyond a wall that enclosed them at the start.

A wall exists on one side along one axis if static boxes reach as far out as any other, lie wholly beyond all bodies'
centres, and together cover at least half of the bodies' extent across that axis. Without a wall there is no escape on
that side: passing over an obstacle does not count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...framework import World
from .body_shapes import Floats, Shapes, dimensions_of, shapes_of

COVERED = 0.5
ROUNDING = 1e-9  # relative to the coordinates: tolerance for the faces of adjacent walls of different sizes


@dataclass(frozen=True)
class Enclosure:
    """The space inside the walls, up to their outer faces; infinite on a side without a wall."""

    lower: Floats
    upper: Floats

    @classmethod
    def around(cls, world: World) -> Enclosure:
        """The enclosure of the dynamic bodies by the static boxes of ``world`` in its present state."""
        dimensions = dimensions_of(world)
        lower, upper = np.full(dimensions, -np.inf), np.full(dimensions, np.inf)
        shapes = shapes_of(world)
        bodies, walls = shapes.where(~shapes.static), shapes.where(shapes.static & ~shapes.round & ~shapes.sensor)
        if len(bodies.entity) and len(walls.entity):
            for axis in range(dimensions):
                for sign, bounds in ((-1.0, lower), (1.0, upper)):
                    inner = sign * walls.centre[:, axis] - walls.half[:, axis]
                    outer = sign * walls.centre[:, axis] + walls.half[:, axis]
                    beyond = inner >= (sign * bodies.centre[:, axis]).max()
                    outermost = outer >= outer.max() - ROUNDING * np.abs(outer).max()
                    if _covered(bodies, walls.where(beyond & outermost), axis) >= COVERED:
                        bounds[axis] = sign * outer.max()
        return cls(lower, upper)

    def outside(self, positions: Floats) -> int:
        """The number of finite ``positions`` (n, d) outside."""
        return int(np.any((positions < self.lower) | (positions > self.upper), axis=1).sum())


def _covered(bodies: Shapes, walls: Shapes, axis: int) -> float:
    """The share of the bodies' extent across ``axis`` covered by walls; overlapping walls count twice."""
    lower, upper = bodies.lower.min(axis=0), bodies.upper.max(axis=0)
    span = np.minimum(walls.upper, upper) - np.maximum(walls.lower, lower)
    share = np.clip(span, 0, None) / np.maximum(upper - lower, np.finfo(float).tiny)
    return float(np.delete(share, axis, axis=1).prod(axis=1).sum())

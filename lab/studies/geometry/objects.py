"""The objects of the geometry study: convex polygons with their enclosing circle and box.

All have an area of 1 m2, so that equal numbers of objects in a world mean equal density.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

ENCLOSED = 1e-12  # of the radius: tolerance for corners on the smallest circle


@dataclass(frozen=True)
class Object:
    """A kind of object: its name, what it represents, and its corners in any unit and about any point."""

    name: str
    description: str
    drawn: tuple[tuple[float, float], ...]

    @cached_property
    def corners(self) -> np.ndarray:
        """(n, 2) m, counter-clockwise, of area 1 m2; the origin is the centre of the bounding box."""
        corners = np.array(self.drawn, float)
        corners -= (corners.min(axis=0) + corners.max(axis=0)) / 2
        return corners / math.sqrt(area(corners))

    @property
    def half_extents(self) -> np.ndarray:
        """(2,) m, of the bounding box of the upright object."""
        return self.corners.max(axis=0)

    @cached_property
    def circle(self) -> tuple[np.ndarray, float]:
        """Centre (2,) and radius, m, of the smallest enclosing circle."""
        return smallest_circle(self.corners)


def area(corners: np.ndarray) -> float:
    """Area of a polygon with these corners (n, 2), counter-clockwise."""
    x, y = corners.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def smallest_circle(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre (2,) and radius of the smallest circle that encloses the points (n, 2).

    Two or three of the points determine it. All pairs and triples are tried, so n should be small. ValueError for fewer
    than two points.
    """
    if len(points) < 2:
        raise ValueError(f"smallest_circle: points must be two or more, got {len(points)}")
    centres = [(one + two) / 2 for one, two in itertools.combinations(points, 2)]
    for one, two, three in itertools.combinations(points, 3):
        sides = np.stack((two - one, three - one))
        if abs(np.linalg.det(sides)) > 0.0:  # otherwise the three are collinear, and two of them suffice
            centres.append(one + np.linalg.solve(sides, (sides**2).sum(axis=1) / 2))
    radii = [float(np.linalg.norm(points - centre, axis=1).max()) for centre in centres]
    best = int(np.argmin(radii))  # each circle grown to hold all points; the smallest is the answer
    return centres[best], radii[best] * (1 + ENCLOSED)


OBJECTS = (
    Object(
        "asteroid", "irregular, nearly round",
        ((1.0, 0.1), (0.83, 0.55), (0.42, 0.92), (-0.1, 0.98), (-0.62, 0.76), (-0.9, 0.3), (-0.93, -0.22),
         (-0.64, -0.7), (-0.12, -0.93), (0.44, -0.84), (0.87, -0.42)),
    ),
    Object("crate", "a square", ((1, 1), (-1, 1), (-1, -1), (1, -1))),
    Object(
        "spaceship", "a wedge",
        ((0.15, 1.2), (-0.15, 1.2), (-0.8, -0.7), (-0.6, -1.0), (0.6, -1.0), (0.8, -0.7)),
    ),
    Object(
        "humanoid", "tall and narrow, 1:3",
        ((0.2, 0.0), (0.3, 0.75), (0.27, 1.4), (0.1, 1.8), (-0.1, 1.8), (-0.27, 1.4), (-0.3, 0.75), (-0.2, 0.0)),
    ),
    Object("plank", "a bar, 1:8", ((4, 0.5), (-4, 0.5), (-4, -0.5), (4, -0.5))),
)  # fmt: skip

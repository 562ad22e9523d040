"""The drawing list: plain arrays, in metres, with a style and an entity for each thing."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from enum import IntEnum
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Styles = NDArray[np.int8]
Entities = NDArray[np.int64]
NO_STYLES: Any = np.zeros(0, np.int8)
NO_ENTITIES: Any = np.zeros(0, np.int64)


class Style(IntEnum):
    """What a thing of the list is: of shapes what body they belong to, then what is drawn over them."""

    STATIC = 0
    KINEMATIC = 1
    DYNAMIC = 2
    ASLEEP = 3
    SENSOR = 4
    ONE_WAY = 5
    JOINT = 6
    CONTACT = 7
    NORMAL = 8
    VELOCITY = 9
    BOX = 10


@dataclass(frozen=True, eq=False)
class Things:
    """n things with a ``style (n,)`` and the ``entity (n,)`` that they belong to, 0: none."""

    def __len__(self) -> int:
        return len(getattr(self, fields(self)[0].name))

    def boxes(self) -> tuple[Floats, Floats]:
        """(n, d) m, the lower and the upper corners of the boxes around them."""
        points = getattr(self, fields(self)[0].name)
        return points.min(axis=1), points.max(axis=1)

    def where(self, chosen: Any) -> Self:
        """Those where ``chosen`` (n,) is true, or of these numbers."""
        return replace(self, **{each.name: getattr(self, each.name)[chosen] for each in fields(self)})


@dataclass(frozen=True, eq=False)
class Polygons(Things):
    """Closed polygons of k corners each: in a plane convex pieces of shapes, counter-clockwise; in space faces, flat,
    convex, counter-clockwise as seen from outside.

    points
        (n, k, d) m
    centre
        (n, d) m, of the whole shape that each is a piece or a face of
    """

    points: Floats
    style: Styles
    entity: Entities
    centre: Floats = field(default_factory=lambda: np.zeros((0, 2)))

    def triangles(self) -> Floats:
        """(n (k - 2), 3, d) m: triangles in place of them, k - 2 for each, one after the other."""
        fan = np.arange(1, self.points.shape[1] - 1)
        corners = np.stack((np.zeros_like(fan), fan, fan + 1), axis=1)
        return self.points[:, corners].reshape(-1, 3, self.points.shape[2])


@dataclass(frozen=True, eq=False)
class Circles(Things):
    """Circles; in space balls.

    centre, radius
        (n, d) m, (n,) m
    angle
        (n,) rad, to draw a mark; NaN without Spin. In space (n, 3, 3), the axes as columns
    """

    centre: Floats
    radius: Floats
    angle: Floats
    style: Styles
    entity: Entities

    def boxes(self) -> tuple[Floats, Floats]:
        """As of others."""
        return self.centre - self.radius[:, None], self.centre + self.radius[:, None]


@dataclass(frozen=True, eq=False)
class Capsules(Things):
    """In space all points within ``radius`` (n,) m of the segments between ``ends`` (n, 2, 3) m; in a plane they are
    polygons."""

    ends: Floats
    radius: Floats
    style: Styles
    entity: Entities

    def boxes(self) -> tuple[Floats, Floats]:
        """As of others."""
        return self.ends.min(axis=1) - self.radius[:, None], self.ends.max(axis=1) + self.radius[:, None]


@dataclass(frozen=True, eq=False)
class Lines(Things):
    """Segments: ``points`` (n, 2, d) m."""

    points: Floats
    style: Styles
    entity: Entities


@dataclass(frozen=True, eq=False)
class Points(Things):
    """Dots: ``points`` (n, d) m."""

    points: Floats
    style: Styles
    entity: Entities

    def boxes(self) -> tuple[Floats, Floats]:
        """The points."""
        return self.points, self.points


def no_circles(dimensions: int) -> Circles:
    angle = np.zeros((0, 3, 3) if dimensions == 3 else 0)
    return Circles(np.zeros((0, dimensions)), np.zeros(0), angle, NO_STYLES, NO_ENTITIES)


def no_capsules(dimensions: int) -> Capsules:
    return Capsules(np.zeros((0, 2, dimensions)), np.zeros(0), NO_STYLES, NO_ENTITIES)


@dataclass(frozen=True, eq=False)
class DrawingList:
    """A world as it is drawn: all arrays are its own, or never change.

    polygons, circles, capsules
        shapes of bodies that may move; polygons one group for each number of corners
    lines
        shapes that are lines, then what is drawn over all: joints, normals, velocities, boxes
    points
        anchors of joints and contacts
    fixed, fixed_circles, fixed_capsules, fixed_lines
        the same of static bodies: the same objects as long as nothing static changes
    fixed_version
        another number whenever they are others
    """

    dimensions: int
    polygons: list[Polygons]
    circles: Circles
    capsules: Capsules
    lines: list[Lines]
    points: list[Points]
    fixed: list[Polygons]
    fixed_circles: Circles
    fixed_capsules: Capsules
    fixed_lines: list[Lines]
    fixed_version: int

    def lines_of(self, style: Style) -> Lines:
        """Those of what is drawn over the shapes that have this ``style``, such as ``Style.JOINT``: all that match."""
        found = [each.where(each.style == style) for each in self.lines]
        empty = Lines(np.zeros((0, 2, self.dimensions)), NO_STYLES, NO_ENTITIES)
        return Lines(*(np.concatenate([getattr(one, each.name) for one in (empty, *found)]) for each in fields(Lines)))

    def __len__(self) -> int:
        """How many polygons, circles, capsules and lines of shapes and over them there are."""
        groups = (*self.polygons, *self.fixed, *self.lines, *self.fixed_lines)
        return sum(map(len, (*groups, self.circles, self.fixed_circles, self.capsules, self.fixed_capsules)))

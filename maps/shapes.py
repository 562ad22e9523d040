"""What was drawn, as shapes in metres with y up: of objects, and of tiles however they are flipped."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..components import AABBCollider, Collider, SphereCollider
from ..plugins.capsule import CapsuleCollider
from ..plugins.convex_polygon import ConvexPolygonCollider
from ..plugins.parts.outline import sound_corners
from ..plugins.rotation import BoxCollider
from .errors import RefusedError
from .formats.model import DIAGONAL, HORIZONTAL, VERTICAL, MapObject

CORNERS = 24  # of an ellipse
FLAT = 1e-9  # of the square of its extent: a polygon of less area has none
STRAIGHT = 1e-9  # sine: corners that turn by less are left out
SAME = 1e-9  # of the size: sides of an ellipse that differ by less are those of a circle


@dataclass
class Shape:
    """A shape in metres, y up, from the place of what it belongs to.

    kind: box, circle, capsule, polygon or line
    points: (n, 2); of box, circle and capsule corners, the centre, both ends of the segment
    """

    kind: str
    points: np.ndarray
    radius: float = 0.0

    @property
    def centre(self) -> np.ndarray:
        """(2,) m, of its area."""
        if self.kind != "polygon":
            return 0.5 * (self.points.min(axis=0) + self.points.max(axis=0))
        first = self.points[0]
        one, two = self.points[1:-1] - first, self.points[2:] - first
        areas = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
        return first + (areas[:, None] * (one + two)).sum(axis=0) / (3.0 * areas.sum())

    @property
    def area(self) -> float:
        if self.kind == "polygon" or self.kind == "box":
            return abs(signed_area(self.points))
        length = float(np.hypot(*(self.points[-1] - self.points[0])))
        return math.pi * self.radius**2 + 2.0 * self.radius * length

    def moved(self, transform: Any) -> Shape:
        """With other points."""
        return replace(self, points=transform(self.points))


def signed_area(points: np.ndarray) -> float:
    """Above 0 if they run counter-clockwise."""
    x, y = (points - points[0]).T
    return 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


def shape_of(thing: MapObject, scale: float, shape: str = "") -> Shape | None:
    """The shape of an object that is no tile, from its place and not turned; None of points, texts. RefusedError if it
    has no extent. ``shape``: what a rectangle is to be."""
    kind = shape if shape and thing.shape == "rectangle" and shape != "box" else thing.shape
    if kind in ("point", "text"):
        return None
    if thing.points is not None:
        points = thing.points * (scale, -scale)
        return Shape("line", _line(points)) if kind == "polyline" else Shape("polygon", _corners(points))
    w, h = thing.size[0] * scale, thing.size[1] * scale
    if not (w > 0.0 and h > 0.0):
        raise RefusedError(f"a {kind} of {thing.size[0]:g} x {thing.size[1]:g} pixels")
    middle = np.array((0.5 * w, -0.5 * h)) - (thing.origin[0] * w, -thing.origin[1] * h)
    if kind == "rectangle":
        return Shape("box", middle + 0.5 * np.array(((-w, -h), (w, -h), (w, h), (-w, h))))
    if abs(w - h) <= SAME * max(w, h):
        return Shape("circle", middle[None], 0.5 * w)
    if kind == "capsule":
        half = 0.5 * abs(w - h)
        along = np.array((half, 0.0) if w > h else (0.0, half))
        return Shape("capsule", np.stack((middle - along, middle + along)), 0.5 * min(w, h))
    return Shape("polygon", middle + 0.5 * np.array((w, h)) * _ring())


def _ring() -> np.ndarray:
    turn = np.arange(CORNERS) * (2.0 * math.pi / CORNERS)
    return np.stack((np.cos(turn), np.sin(turn)), axis=1)


def _line(points: np.ndarray) -> np.ndarray:
    """Without points that are twice in a row."""
    if len(points):
        points = points[np.append(True, (points[1:] != points[:-1]).any(axis=1))]
    if len(points) < 2:
        raise RefusedError("a polyline of less than two points")
    return points


def _corners(points: np.ndarray) -> np.ndarray:
    """Counter-clockwise, without those that turn by nothing."""
    if len(points) < 3:
        raise RefusedError(f"a polygon of {len(points)} points")
    points = points[(points != np.roll(points, 1, axis=0)).any(axis=1)]
    extent = np.ptp(points, axis=0).max() if len(points) else 0.0
    if len(points) < 3 or abs(signed_area(points)) <= FLAT * extent**2:
        raise RefusedError("the polygon has no area")
    before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    size = np.hypot(*before.T) * np.hypot(*after.T)
    points = points[np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]) > STRAIGHT * size]
    points = points if signed_area(points) > 0.0 else points[::-1].copy()
    try:
        return points if is_convex(points) else sound_corners(points)
    except ValueError as error:
        raise RefusedError(str(error)) from error


def is_convex(corners: np.ndarray) -> bool:
    """Of counter-clockwise corners; those that go round more than once are not."""
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    sines = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    turns = np.arctan2(sines, (before * after).sum(axis=1))
    return bool((sines > 0.0).all()) and turns.sum() < 3.0 * math.pi


def turned(points: Any, angle: float) -> np.ndarray:
    """Counter-clockwise by ``angle``, rad; by right angles exactly."""
    quarter = angle / (0.5 * math.pi)
    if abs(quarter - round(quarter)) < 1e-12:
        c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(quarter) % 4]
    else:
        c, s = math.cos(angle), math.sin(angle)
    x, y = np.asarray(points, float).T
    return np.stack((c * x - s * y, s * x + c * y), axis=-1)


# -- tiles -----------------------------------------------------------------------------------------------


def tile_shapes(
    shapes: list[MapObject], tile: tuple[float, float], flips: int, size: tuple[float, float]
) -> list[Shape]:
    """Shapes of a tile of ``tile`` pixels, flipped and stretched to ``size`` m; from its lower left corner."""
    width, height = tile
    across = (height, width) if flips & DIAGONAL else tile
    stretch = np.array((size[0] / across[0], size[1] / across[1]))
    even = abs(stretch[0] - stretch[1]) <= SAME * stretch.max()

    def placed(points: np.ndarray) -> np.ndarray:
        p = points[:, ::-1] if flips & DIAGONAL else points
        x = across[0] - p[:, 0] if flips & HORIZONTAL else p[:, 0]
        y = across[1] - p[:, 1] if flips & VERTICAL else p[:, 1]
        return np.stack((x, across[1] - y), axis=1) * stretch

    made = []
    for thing in shapes:
        shape = shape_of(thing, 1.0, str(thing.properties["shape"].value) if "shape" in thing.properties else "")
        if shape is None:
            continue
        angle = -math.radians(thing.angle)
        if angle % (0.5 * math.pi) if shape.kind == "box" else shape.kind in ("circle", "capsule") and not even:
            shape = as_polygon(shape)
        points = placed(thing.place + turned(shape.points, angle) * (1.0, -1.0))
        if shape.kind == "polygon":
            points = _corners(points)
        elif shape.kind == "line" and flips.bit_count() % 2:
            points = points[::-1]  # else a mirror would turn its solid side
        made.append(Shape(shape.kind, points, shape.radius * stretch[0]))
    return made


def as_polygon(shape: Shape) -> Shape:
    """A box, circle or capsule by its corners."""
    if shape.kind == "box":
        return Shape("polygon", shape.points)
    ends = shape.points[[0, -1]]
    along = ends[1] - ends[0]
    angle = math.atan2(along[1], along[0]) + 0.5 * math.pi if along.any() else 0.0
    ring = shape.radius * turned(_ring(), angle)
    if not along.any():
        return Shape("polygon", ends[0] + ring)
    half = CORNERS // 2 + 1
    return Shape("polygon", np.concatenate((ends[0] + ring[:half], ends[1] - ring[:half])))


def box_of(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner."""
    return shape.points.min(axis=0), shape.points.max(axis=0)


# -- colliders -------------------------------------------------------------------------------------------


def collider_of(shape: Shape, material: dict[str, Any], turns: bool) -> tuple[Collider, np.ndarray, float]:
    """(the collider of a convex shape, its centre, what it is turned by).

    turns
        whether it may be turned, so that an AABB will not do
    """
    centre = shape.centre
    if shape.kind == "circle":
        return SphereCollider(shape.radius, **material), centre, 0.0
    if shape.kind == "capsule":
        along = shape.points[1] - shape.points[0]
        angle = math.atan2(-along[0], along[1])  # from the y axis
        return CapsuleCollider(shape.radius, 0.5 * float(np.hypot(*along)), **material), centre, angle
    if shape.kind == "box":
        lower, upper = box_of(shape)
        kind: Any = BoxCollider if turns else AABBCollider
        return kind(0.5 * (upper - lower), **material), centre, 0.0
    return ConvexPolygonCollider(shape.points - centre, **material), centre, 0.0

"""Convex polygons in 2D, turned by the Transform: triangles, oriented boxes, regular and rounded polygons."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Self

import numpy as np

from ..components.colliders import AABBCollider, Collider, SphereCollider
from ..framework import Column, Plugin, array_column, column
from ..framework.elementary import atan2, cos, sin, sines_and_cosines
from ..framework.typing import ArrayField
from ..framework.vectors import dot, row, scale
from .capsule import CapsuleCollider
from .corners import along_axes, bounds_of, in_world, support_of
from .polygon_pairs import meet_by_edges
from .rotation.box import BoxCollider
from .rotation.box_pairs import level

__all__ = ["ConvexPolygonCollider"]

STRAIGHT = 1e-12  # sine of the turn at a corner; below it the corner counts as straight
FULL_TURN = 2.0 * math.pi
CORNERS = Column(dtype=int, minimum=3, owner="ConvexPolygonCollider.regular", name="n")
RADIUS = Column(positive=True, owner="ConvexPolygonCollider.regular", name="radius")

plugin = Plugin("convex_polygon", version="1.0")


def wrong_with(vertices: np.ndarray) -> str | None:
    """Why these corners are not a convex polygon, None if they are one; in either order."""
    extent = np.abs(vertices - vertices[0]).max()
    if not extent > 0.0:
        return "must not be one point"
    corners = vertices / extent  # avoids overflow at any size
    edges = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    if not lengths.all():
        i = int(np.argmin(lengths))
        return f"must not have the same corner twice in a row (corners {i} and {(i + 1) % len(vertices)})"
    before = np.roll(edges, 1, axis=0)
    size = np.roll(lengths, 1) * lengths
    sines = (before[:, 0] * edges[:, 1] - before[:, 1] * edges[:, 0]) / size
    cosines = (before * edges).sum(axis=1) / size
    straight = np.abs(sines) <= STRAIGHT
    if straight.any():
        i = int(np.argmax(straight))
        return f"must not have three corners on a line (corner {i} and its neighbours)"
    turns = np.arctan2(sines, cosines)
    if not (np.all(sines > 0.0) or np.all(sines < 0.0)):
        main = 1.0 if turns.sum() > 0.0 else -1.0
        return f"must be convex (it is not at corner {int(np.argmin(main * sines))})"
    if abs(turns.sum()) > 1.5 * FULL_TURN:
        return "must be convex (its edges cross each other)"
    return None


def _counter_clockwise(corners: np.ndarray) -> np.ndarray:
    """Reversed if clockwise."""
    x, y = ((corners - corners[0]) / np.abs(corners).max()).T
    return corners[::-1] if (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() < 0.0 else corners


@plugin.shape(cost=4)
class ConvexPolygonCollider(Collider):
    """A convex polygon in a 2D world; it turns with the Transform.

    vertices
        (n, 2) m, three or more corners around the shape's centre, in either order; stored counter-clockwise
    corner_radius
        m, the polygon extends this far beyond its corners and edges, which rounds the corners
    """

    __slots__ = ()

    dimensions: ClassVar[tuple[int, ...]] = (2,)
    rotates: ClassVar[bool] = True

    vertices: ArrayField = array_column(2, rows=(3, 2**31), check=wrong_with, convert=_counter_clockwise)
    corner_radius: float = column(default=0.0, minimum=0.0, kw_only=True, unit="m")

    @classmethod
    def box(cls, half_extents: Any, **common: Any) -> Self:
        """A box that turns with the Transform; ``half_extents``: (2,) m or one number, ValueError if not above 0."""
        half = np.asarray(half_extents, float)
        if half.shape not in ((), (2,)) or not (np.isfinite(half).all() and (half > 0.0).all()):
            raise ValueError(
                f"ConvexPolygonCollider.box: half_extents must be positive, one number or two, got {half_extents!r}"
            )
        return cls(np.array(((-1, -1), (1, -1), (1, 1), (-1, 1))) * half, **common)

    @classmethod
    def regular(cls, n: int, radius: float, **common: Any) -> Self:
        """A regular polygon of ``n`` corners on a circle of ``radius`` m, the first on the x axis.

        ValueError if ``n`` is below 3 or the radius not above 0.
        """
        count, reach = CORNERS.checked(n), RADIUS.checked(radius)
        sines, cosines = sines_and_cosines(np.arange(count) * (FULL_TURN / count))
        return cls(reach * np.stack((cosines, sines), axis=1), **common)

    @classmethod
    def sample(cls, **common: Any) -> Self:
        return cls.box(0.5, **common)

    @staticmethod
    def bounds(shape, dimensions):
        wide, high = bounds_of(shape.vertices, 0, shape)
        return wide + shape.corner_radius, high + shape.corner_radius

    @staticmethod
    def support(shape, direction):
        return support_of(shape.vertices, 0, shape, direction)

    @staticmethod
    def rounding(shape):
        return shape.corner_radius

    @staticmethod
    def outline(shape, dimensions):
        return shape.vertices, ()

    @staticmethod
    def second_moments(shape, dimensions):
        """Triangles from the centre to each edge, strips along the edges, and sectors around the corners."""
        r, count = shape.corner_radius, len(shape.vertices)
        area = mx = my = xx = xy = yy = 0.0
        for k in range(count):
            j, i = (k + 1) % count, (k - 1) % count
            px, py, qx, qy = shape.vertices[k, 0], shape.vertices[k, 1], shape.vertices[j, 0], shape.vertices[j, 1]
            triangle = 0.5 * (px * qy - py * qx)
            area, mx, my = area + triangle, mx + triangle * (px + qx) / 3.0, my + triangle * (py + qy) / 3.0
            xx += triangle * (px * px + px * qx + qx * qx) / 6.0
            xy += triangle * (2.0 * px * py + px * qy + qx * py + 2.0 * qx * qy) / 12.0
            yy += triangle * (py * py + py * qy + qy * qy) / 6.0
            if r > 0.0:
                tx, ty = qx - px, qy - py
                size = math.sqrt(tx * tx + ty * ty)
                nx, ny = ty / size, -tx / size
                cx, cy, strip = 0.5 * (px + qx + r * nx), 0.5 * (py + qy + r * ny), size * r
                along, across = size * size / 12.0, r * r / 12.0
                area, mx, my = area + strip, mx + strip * cx, my + strip * cy
                xx += strip * (cx * cx + along * ny * ny + across * nx * nx)
                xy += strip * (cx * cy + (across - along) * nx * ny)
                yy += strip * (cy * cy + along * nx * nx + across * ny * ny)
                before = atan2(py - shape.vertices[i, 1], px - shape.vertices[i, 0])
                turn = atan2(ty, tx) - before
                turn += FULL_TURN if turn < 0.0 else 0.0
                middle = before - 0.5 * math.pi + 0.5 * turn  # direction of the corner's sector
                ux, uy, sector = cos(middle), sin(middle), 0.5 * turn * r * r
                first, wide = 2.0 / 3.0 * r * r * r * sin(0.5 * turn), r * r * r * r / 8.0
                area, mx, my = area + sector, mx + sector * px + first * ux, my + sector * py + first * uy
                xx += sector * px * px + 2.0 * first * px * ux + wide * (turn + sin(turn) * (ux * ux - uy * uy))
                xy += sector * px * py + first * (px * uy + py * ux) + wide * 2.0 * sin(turn) * ux * uy
                yy += sector * py * py + 2.0 * first * py * uy + wide * (turn - sin(turn) * (ux * ux - uy * uy))
        if not area > 0.0:
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        return area, mx / area, my / area, xx / area, xy / area, yy / area


# -- pairs, each shape as polygon_pairs takes it ---------------------------------------------------


@plugin.kernel
def corner_of(shape, k, like):
    return in_world(shape, row(shape.vertices, k, like))


@plugin.kernel
def reach_of(shape, direction):
    along, farthest = along_axes(shape, direction), -math.inf
    for k in range(len(shape.vertices)):
        reach = dot(row(shape.vertices, k, along), along)
        farthest = reach if reach > farthest else farthest  # no branch that is mispredicted
    return farthest


@plugin.kernel
def box_corner(box, k, like):
    x, y = box.half_extents[0], box.half_extents[1]
    return in_world(box, (x if k == 0 or k == 3 else -x, y if k < 2 else -y))


@plugin.kernel
def box_reach(box, direction):
    x, y = abs(dot(box.axes[0], direction)), abs(dot(box.axes[1], direction))
    return x * box.half_extents[0] + y * box.half_extents[1]


@plugin.kernel
def segment_end(capsule, k, like):
    return scale(capsule.axes[1], capsule.half_height if k == 0 else -capsule.half_height)


@plugin.kernel
def segment_reach(capsule, direction):
    return abs(dot(capsule.axes[1], direction)) * capsule.half_height


@plugin.kernel
def centre_of(sphere, k, like):
    return scale(like, 0.0)


@plugin.kernel
def no_reach(sphere, direction):
    return 0.0


@plugin.kernel
def polygon(shape):
    return shape, len(shape.vertices), corner_of, reach_of


@plugin.pair(ConvexPolygonCollider, ConvexPolygonCollider)
def two_polygons(a, b, d):
    return meet_by_edges(polygon(a), polygon(b), d, a.corner_radius, b.corner_radius)


@plugin.pair(BoxCollider, ConvexPolygonCollider)
def box_polygon(a, b, d):
    return meet_by_edges((a, 4, box_corner, box_reach), polygon(b), d, 0.0, b.corner_radius)


@plugin.pair(AABBCollider, ConvexPolygonCollider)
def level_box_polygon(a, b, d):
    return meet_by_edges((level(a, d), 4, box_corner, box_reach), polygon(b), d, 0.0, b.corner_radius)


@plugin.pair(CapsuleCollider, ConvexPolygonCollider)
def capsule_polygon(a, b, d):
    return meet_by_edges((a, 2, segment_end, segment_reach), polygon(b), d, a.radius, b.corner_radius)


@plugin.pair(SphereCollider, ConvexPolygonCollider)
def sphere_polygon(a, b, d):
    return meet_by_edges((a, 1, centre_of, no_reach), polygon(b), d, a.radius, b.corner_radius)

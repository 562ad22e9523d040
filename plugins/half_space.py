"""A half-space: everything below an infinite plane through the body's centre. Unbounded ground."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..components import Collider
from ..framework import Column, Convex, Plugin
from ..framework.outlines import box_outline
from ..framework.typing import VectorField
from ..framework.vectors import add, add_scaled, divided, dot, length, negative, replace, scale, sub
from .corners import in_world

__all__ = ["HalfSpaceCollider"]

plugin = Plugin("half_space", version="1.0")

FAR = 1e4  # m, how far it is drawn
TILT = 1e-6  # radians; a face tilted by less lies flat on the plane and does not touch with one corner


class DirectionColumn(Column):
    """A vector field that is not zero."""

    def check_numbers(self, array: np.ndarray, shown: Any, entity: int | None) -> None:
        super().check_numbers(array, shown, entity)
        zero = ~np.atleast_1d(array).any(axis=-1)
        if zero.any():
            where = "" if array.ndim < 2 else f" (row {int(np.argmax(zero))})"
            raise self._error(array[int(np.argmax(zero))] if where else array, f"must not be zero{where}", entity)

    def _usual(self, value: Any) -> Any:
        usual = super()._usual(value)
        return usual if np.any(usual) else None


@plugin.shape(cost=1)
class HalfSpaceCollider(Collider):
    """Everything below a plane through the body's centre; any convex shape can rest on it.

    normal
        (d,) out of the half-space, up for ground; any length but 0. It turns with the Transform
    """

    __slots__ = ()

    rotates = True
    normal: VectorField = DirectionColumn(item="vector", unit="1")  # type: ignore[assignment]

    @staticmethod
    def bounds(shape, dimensions):
        if dimensions == 2:
            return math.inf, math.inf
        return math.inf, math.inf, math.inf

    @staticmethod
    def outline(shape, dimensions):
        """A large box below the plane, along it."""
        up = np.array(shape.normal) / np.linalg.norm(shape.normal)
        axes = [np.array((up[1], -up[0])), up]
        if dimensions == 3:
            aside = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
            aside /= np.linalg.norm(aside)
            axes = [aside, up, np.cross(aside, up)]
        corners, faces = box_outline(FAR, dimensions)
        return (corners - FAR * np.eye(dimensions)[1]) @ np.array(axes), faces


@plugin.kernel
def outwards(shape):
    """The unit normal in the world."""
    turned = in_world(shape, shape.normal)
    return divided(turned, length(turned))


@plugin.kernel
def depth_below(b, d, down, support, rounding):
    """Depth of the other's lowest point below the plane."""
    return rounding(b) + dot(add(d, support(b, down)), down)


@plugin.pair(HalfSpaceCollider, Convex)
def half_space_convex(a, b, d, support, rounding):
    """The normal always points out of the half-space, at any depth."""
    normal = outwards(a)
    down = negative(normal)
    depth = depth_below(b, d, down, support, rounding)
    # The point is the middle of the touching face: supports of slightly tilted directions give its opposite ends.
    tilt = scale(d, 0.0)
    for k in range(len(d)):
        tilt = replace(tilt, k, TILT / (1.0 + k))
    point = add(support(b, add(down, tilt)), support(b, sub(down, tilt)))
    point = add_scaled(d, point, 0.5)
    return depth >= 0.0, depth, normal, add_scaled(point, normal, -dot(point, normal) - 0.5 * depth)


@plugin.sweep(HalfSpaceCollider, Convex)
def half_space_convex_sweep(a, b, d, v, support, rounding):
    """The height of the lowest point over its downward speed."""
    down = negative(outwards(a))
    height, speed = -depth_below(b, d, down, support, rounding), dot(v, down)
    if height <= 0.0:
        return True, 0.0
    return (True, height / speed) if height <= speed else (False, 0.0)


@plugin.pair(HalfSpaceCollider, HalfSpaceCollider)
def two_half_spaces(a, b, d):
    """Never a contact: two half-spaces overlap unless they are parallel, and could never separate."""
    return False, -math.inf, d, d

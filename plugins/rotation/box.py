"""A box that turns with its body."""

from __future__ import annotations

from ...components import AABBCollider, Collider
from ...framework import Plugin
from ...framework.data.columns import special_column
from ...framework.outlines import box_outline
from ...framework.typing import VectorField
from ...framework.vectors import absolute, add_scaled, dot, filled, item, scale
from ..corners import along_axes, in_world

boxes = Plugin("boxes that turn")
edge_of_level = boxes.kernel(AABBCollider.edge)


@boxes.shape(cost=3)
class BoxCollider(Collider):
    """A box that turns with the Transform; an AABBCollider never does.

    half_extents
        (d,) m, half the size along each of the body's own axes, 0 or more
    """

    __slots__ = ()

    rotates = True
    half_extents: VectorField = special_column(
        unit="m", item="vector", minimum=0.0, also=("size", "extents", "half_size")
    )

    @staticmethod
    def bounds(shape, dimensions):
        reach = filled(shape.half_extents, 0.0)
        for j in range(len(reach)):
            reach = add_scaled(reach, absolute(shape.axes[j]), item(shape.half_extents, j))
        return reach

    @staticmethod
    def support(shape, direction):
        corner = scale(direction, 0.0)
        for j in range(len(direction)):
            half = item(shape.half_extents, j)
            corner = add_scaled(corner, shape.axes[j], half if dot(shape.axes[j], direction) >= 0.0 else -half)
        return corner

    @staticmethod
    def edge(shape, direction):
        one, two = edge_of_level(shape, along_axes(shape, direction))
        return in_world(shape, one), in_world(shape, two)

    @staticmethod
    def outline(shape, dimensions):
        return box_outline(shape.half_extents, dimensions)

    @staticmethod
    def second_moments(shape, dimensions):
        x, y = shape.half_extents[0], shape.half_extents[1]
        if dimensions == 2:
            return 4.0 * x * y, 0.0, 0.0, x * x / 3.0, 0.0, y * y / 3.0
        z = shape.half_extents[2]
        return 8.0 * x * y * z, 0.0, 0.0, 0.0, x * x / 3.0, y * y / 3.0, z * z / 3.0, 0.0, 0.0, 0.0

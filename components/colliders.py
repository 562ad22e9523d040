"""Colliders: simple shapes that approximate what is drawn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar, Self, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from ..framework.data.columns import REQUIRED, Column, special_column
from ..framework.data.component import Component
from ..framework.outlines import box_outline
from ..framework.typing import Entities, LayerField, Layers, Masks, Numbers, Vector, VectorField, Vectors
from ..framework.vectors import item, replace, scale

ALL_LAYERS = -1  # every bit set
BITS = ": bits of layers, as in 1 << 1 | 1 << 2"
LONGEST = 1e150  # m: squares of it, and of distances of such shapes that meet, are finite
# Arguments, checked like fields.
LOWER = Column(item="vector", owner="AABBCollider", name="from_bounds lower")
UPPER = Column(item="vector", owner="AABBCollider", name="from_bounds upper")


class MaterialFields(TypedDict, total=False):
    """The fields of every collider but ``offset``, for functions that make one and pass them on."""

    restitution: float
    friction: float | None
    sensor: bool
    enabled: bool
    layer: Layers
    mask: Layers
    group: int
    one_way: Vector | float
    surface_velocity: Vector | float


class MaterialRows(TypedDict, total=False):
    """The same fields of many colliders: one value for all, or one of each."""

    restitution: Numbers
    friction: Numbers | Sequence[float | None] | None
    sensor: bool | Sequence[bool] | NDArray[Any]
    enabled: bool | Sequence[bool] | NDArray[Any]
    layer: Masks
    mask: Masks
    group: int | Entities
    one_way: Vectors | Vector | float
    surface_velocity: Vectors | Vector | float


class ColliderFields(MaterialFields, total=False):
    """The fields of every collider."""

    offset: Vector | float


class Collider(Component, abstract=True):
    """The fields of every collider besides its shape.

    offset
        (d,) m, the shape's centre relative to the Transform's position, turned with it
    restitution
        relative speed after over before an impact; 1 conserves energy, below 1 loses, above 1 gains
    friction
        coefficient; None: use the other body's coefficient
    sensor
        reports contacts and does not react to them
    enabled
        False: it meets nothing, and no query finds it
    layer, mask
        two colliders meet if each one's layer has a bit in the other's mask; bits, or names that the world has
    group
        colliders of the same group, a whole number other than 0, never meet
    one_way
        (d,) a direction of any length, turned with the body: solid only for what comes from where it points to; 0:
        from all sides
    surface_velocity
        (d,) m/s along the body's own axes, relative to the body: friction drives what touches it to that, along the
        surface
    """

    __slots__ = ()

    makes_body: ClassVar[bool] = True
    _largest: ClassVar[float] = LONGEST
    stack: ClassVar[str] = "collider"
    stacked_columns: ClassVar[tuple[str, ...]] = (
        "offset", "restitution", "friction", "sensor", "enabled", "layer", "mask", "group", "one_way",
        "surface_velocity",
    )  # fmt: skip

    # Records of stages do not show these, so that worlds without them pay nothing: see state.bodies.shape and
    # state.colliders.
    hidden_columns: ClassVar[tuple[str, ...]] = ("enabled", "one_way", "surface_velocity")

    offset: VectorField = special_column(
        unit="m", default=0.0, item="vector", kw_only=True, on_demand=True, also=("centre",)
    )
    restitution: float = special_column(
        unit="1", default=0.0, minimum=0.0, kw_only=True, on_demand=True, also=("bounce", "bounciness", "elasticity")
    )
    friction: float | None = special_column(
        unit="1", default=None, optional=True, minimum=0.0, kw_only=True, on_demand=True
    )
    sensor: bool = special_column(default=False, dtype=bool, kw_only=True, on_demand=True, also=("trigger",))
    enabled: bool = special_column(default=True, dtype=bool, kw_only=True, on_demand=True, also=("active",))
    layer: LayerField = special_column(
        default=1, dtype=int, kw_only=True, on_demand=True, also=("category",),
        nonzero="in no layer it meets nothing; mask=0 says so", cure=BITS, layers=True,
    )  # fmt: skip
    mask: LayerField = special_column(
        default=ALL_LAYERS, dtype=int, kw_only=True, on_demand=True, also=("collides_with",), cure=BITS, layers=True
    )
    group: int = special_column(
        default=0, dtype=int, kw_only=True, on_demand=True, also=("group_index", "collision_group")
    )
    one_way: VectorField = special_column(
        unit="1", default=0.0, item="vector", kw_only=True, on_demand=True, also=("oneway", "one_way_platform")
    )
    surface_velocity: VectorField = special_column(
        unit="m/s", default=0.0, item="vector", kw_only=True, on_demand=True,
        also=("tangent_speed", "tangent_velocity", "conveyor_velocity"),
    )  # fmt: skip

    rotates: ClassVar[bool] = False  # True if its functions need the body's axes in the world, as ``shape.axes``
    dimensions: ClassVar[tuple[int, ...]] = (2, 3)  # dimensions of the worlds that support it
    convex: ClassVar[bool] = True  # the straight line between any two of its points lies inside

    @classmethod
    def sample(cls, **common: Any) -> Self:
        """A collider of this type with all required sizes 0.5, for compilation in advance and for checks.

        A shape that needs other values overrides ``sample``.
        """
        demanded = {name: 0.5 for name, field in cls.columns.items() if field.default is REQUIRED}
        return cls(**demanded, **common)


class SphereCollider(Collider):
    """A bounding sphere (a circle in 2D); ``radius``, m: 0 is a point."""

    __slots__ = ()

    radius: float = special_column(unit="m", minimum=0.0, also=("size", "diameter"))

    @staticmethod
    def bounds(shape, dimensions):
        if dimensions == 2:
            return shape.radius, shape.radius
        return shape.radius, shape.radius, shape.radius

    @staticmethod
    def support(shape, direction):
        """The core of a sphere is its centre."""
        return scale(direction, 0.0)

    @staticmethod
    def rounding(shape):
        return shape.radius

    @staticmethod
    def outline(shape, dimensions):
        return ((0.0,) * dimensions,), ()

    @staticmethod
    def second_moments(shape, dimensions):
        square = shape.radius * shape.radius
        if dimensions == 2:
            return math.pi * square, 0.0, 0.0, 0.25 * square, 0.0, 0.25 * square
        fifth = 0.2 * square
        return 4.0 / 3.0 * math.pi * square * shape.radius, 0.0, 0.0, 0.0, fifth, fifth, fifth, 0.0, 0.0, 0.0


class AABBCollider(Collider):
    """A box whose sides stay parallel to the axes; a turned Transform enlarges it to hold the turned box.

    half_extents
        (d,) m, half the size along each axis; zero is allowed
    """

    __slots__ = ()

    half_extents: VectorField = special_column(
        unit="m", item="vector", minimum=0.0, also=("size", "extents", "half_size")
    )

    @classmethod
    def from_bounds(cls, lower: Vector, upper: Vector, **common: Unpack[MaterialFields]) -> Self:
        """The box from ``lower`` to ``upper``, (d,) m relative to the Transform's position; ValueError if a lower bound
        exceeds the upper one."""
        low, high = np.asarray(LOWER.checked(lower)), np.asarray(UPPER.checked(upper))
        if low.shape != high.shape or not (low <= high).all():
            raise ValueError(f"AABBCollider.from_bounds: lower must not exceed upper, got {lower!r} and {upper!r}")
        return cls((high - low) / 2, offset=(low + high) / 2, **common)

    @staticmethod
    def bounds(shape, dimensions):
        return shape.half_extents

    @staticmethod
    def support(shape, direction):
        corner = shape.half_extents
        for k in range(len(direction)):
            if item(direction, k) < 0.0:
                corner = replace(corner, k, -item(corner, k))
        return corner

    @staticmethod
    def edge(shape, direction):
        x, y = shape.half_extents[0], shape.half_extents[1]
        across = abs(direction[0]) >= abs(direction[1])
        if (direction[0] if across else direction[1]) < 0.0:
            x, y = -x, -y
        return (x, -y if across else y), (x if across else -x, y)

    @staticmethod
    def outline(shape, dimensions):
        return box_outline(shape.half_extents, dimensions)

    @staticmethod
    def turned(shape, axes):
        """Half extents of the box around the turned one: |R| h (Ericson, Real-Time Collision Detection, 4.2.6)."""
        half = shape.half_extents
        result = half
        for k in range(len(half)):
            total = 0.0
            for j in range(len(half)):
                total += abs(axes[k, j]) * item(half, j)
            result = replace(result, k, total)
        return (result,)

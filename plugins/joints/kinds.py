"""The kinds of joints: components of entities of their own, and the rows of the solver that each of them is."""

from __future__ import annotations

import math
from collections.abc import Set
from typing import Any, ClassVar

import numpy as np

from ...framework.data.columns import special_column
from ...framework.matrices import magnitude, matrix_product, unit
from ...framework.typing import Vector
from ...framework.units import warn_of_degrees
from ...systems.joints.records import CONE, DRIVE, HOLD, LIMIT, POINT, ROD, SERVO, SLIDE, SPRING, TWIST
from .joint import LEAST, MOST, UNLIMITED, WORLD, Driven, Joint, Place, Row, ends_of, optional

SQUARE = 1e-6  # cosine between directions that are at right angles


class Distance(Joint):
    """A rod, a rope or a spring between two points.

    a, b
        entities of two bodies; None: the world
    point_a, point_b
        (d,) m, where it holds each of them, in the world, where the bodies are when the world takes the joint; None: at
        the position of the body
    length
        m; None: the distance when the world takes the joint. Two numbers, the least and the most: (0, 2) is a rope
    frequency, damping_ratio
        Hz, and 1 where it just does not swing: a spring; without a frequency it is rigid
    """

    __slots__ = ()
    fixed: ClassVar[tuple[str, ...]] = ("point_a", "point_b")

    a: int | None = special_column(dtype=int, minimum=0)
    b: int | None = special_column(default=WORLD, dtype=int, minimum=0)
    point_a: Vector | None = optional(unit="m", item="vector", largest=MOST, also=("anchor_a",))
    point_b: Vector | None = optional(unit="m", item="vector", largest=MOST, also=("anchor_b",))
    least: float | None = optional(unit="m", minimum=0.0, largest=MOST)
    most: float | None = optional(unit="m", minimum=0.0, largest=MOST)
    frequency: float | None = optional(unit="Hz", positive=True, largest=MOST)
    damping_ratio: float = special_column(unit="1", default=0.0, minimum=0.0, largest=MOST, kw_only=True)
    # whether it has hold of each body where that was taken: what is moved is one of the two
    held_a: bool = special_column(default=False, init=False, dtype=bool)
    held_b: bool = special_column(default=False, init=False, dtype=bool)

    def __init__(self, *args: Any, length: Any = None, **values: Any) -> None:
        for name in sorted(values.keys() & {"anchor_a", "anchor_b"}):
            raise TypeError(
                f"Distance.{name} was relative to the body, along its axes: give point_{name[-1]}, a place of the "
                f"world as the anchors of all joints are, where the bodies are when the world takes the joint"
            )
        if length is not None:
            values["least"], values["most"] = self._ends("length", length) if np.ndim(length) else (length, length)
        super().__init__(*args, **values)

    @property
    def length(self) -> Any:
        """m, or the least and the most."""
        if self.least is None and self.most is None:
            return self.start if self.attached else None
        return self.least if self.least == self.most else (self.least, self.most)

    @length.setter
    def length(self, value: Any) -> None:
        low, high = self._ends("length", value) if np.ndim(value) else (value, value)
        self.in_order("length", low, high)
        self.set_together(least=low, most=high)

    def check(self) -> None:
        low, high = self.in_order("length", self.least, self.most)
        if self.frequency is not None and low < high and (self.least is not None or self.most is not None):
            raise ValueError(f"Distance: a spring has one length, got {self.length!r}")

    def let_go(self, names: Set[str]) -> None:
        held_a = self.held_a and names.isdisjoint(("a", "point_a"))
        self.keep(held_a=held_a, held_b=self.held_b and names.isdisjoint(("b", "point_b")))
        super().let_go(names)

    def attach(self, a: Place, b: Place) -> None:
        new = not (self.held_a or self.held_b)
        if not self.held_a:
            self.keep(at_a=self.local(a, self.a, a.position if self.point_a is None else self.point_a))
        if not self.held_b:
            self.keep(at_b=self.local(b, self.b, b.position if self.point_b is None else self.point_b))
        if new:
            self.keep(start=magnitude(b.point(self.at_b) - a.point(self.at_a)))
        self.keep(held_a=True, held_b=True)

    def rows(self, dimensions: int) -> list[Row]:
        low, high = self.in_order("length", self.least, self.most)
        if self.least is None and self.most is None:
            low = high = self.start
        if self.frequency is not None:
            return [Row(ROD, SPRING, low, frequency=self.frequency, damping_ratio=self.damping_ratio)]
        return [Row(ROD, HOLD, low)] if low == high else [Row(ROD, LIMIT, max(low, 0.0), high)]


class Hinge(Driven):
    """Two bodies that turn about a common point, in space about a common axis.

    a, b
        entities of two bodies; None: the world
    anchor
        (d,) m, the point, where the bodies are when the world takes the joint
    axis
        in space, the direction of the axis, in the world as they are then
    limits
        rad, (least, most), of b against a as they are then; also the fields ``lower`` and ``upper``
    motor_speed, max_torque
        rad/s of b against a, and N m at most; None: no motor, and no limit
    frequency, damping_ratio
        Hz: a spring that turns b back to ``rest``, rad against a as they are then
    """

    __slots__ = ()
    fixed: ClassVar[tuple[str, ...]] = ("anchor", "axis")

    a: int | None = special_column(dtype=int, minimum=0)
    b: int | None = special_column(dtype=int, minimum=0)
    anchor: Vector = special_column(unit="m", item="vector", largest=MOST)
    axis: Vector = special_column(unit="1", default=0.0, item="vector", largest=MOST, kw_only=True)
    max_torque: float | None = optional(unit="N m", minimum=0.0)

    def __init__(self, *args: Any, limits: Any = None, **values: Any) -> None:
        super().__init__(*args, limits=limits, **values)  # stands here for checkers of types

    def check(self) -> None:
        super().check()
        warn_of_degrees("Hinge.limits", (self.lower, self.upper))

    def attach(self, a: Place, b: Place) -> None:
        self.hold(a, b, self.anchor)
        self.hold_axis(a, b, self.axis)

    def rows(self, dimensions: int) -> list[Row]:
        turns = self.counted(self.moving(self.turn(dimensions), self.max_torque), dimensions)
        return [Row(POINT, HOLD), *self.aligned(dimensions), *turns]


class Ball(Joint):
    """Two bodies, a and b, that keep a common point and turn freely; ``anchor``: (d,) m, where it is in the world."""

    __slots__ = ()

    a: int | None = special_column(dtype=int, minimum=0)
    b: int | None = special_column(dtype=int, minimum=0)
    anchor: Vector = special_column(unit="m", item="vector", largest=MOST)

    def attach(self, a: Place, b: Place) -> None:
        self.hold(a, b, self.anchor)

    def rows(self, dimensions: int) -> list[Row]:
        return [Row(POINT, HOLD)]


class Weld(Joint):
    """Two bodies, a and b, fixed to each other; ``anchor``: (d,) m, where they are joined in the world."""

    __slots__ = ()

    a: int | None = special_column(dtype=int, minimum=0)
    b: int | None = special_column(dtype=int, minimum=0)
    anchor: Vector = special_column(unit="m", item="vector", largest=MOST)

    def attach(self, a: Place, b: Place) -> None:
        self.hold(a, b, self.anchor)
        self.hold_axis(a, b, (0.0, 0.0, 1.0))

    def rows(self, dimensions: int) -> list[Row]:
        return [Row(POINT, HOLD), *self.aligned(dimensions), self.turn(dimensions)]


class Slider(Driven):
    """b slides along an axis of a, and does not turn against it.

    direction
        of the axis, in the world, as the bodies are when the world takes the joint
    limits
        m along it from there, (least, most); also the fields ``lower`` and ``upper``
    motor_speed, max_force
        m/s along it, and N at most; None: no motor, and no limit
    frequency, damping_ratio
        Hz: a spring that pushes b back to ``rest``, m along the axis: a suspension
    """

    __slots__ = ()
    fixed: ClassVar[tuple[str, ...]] = ("direction",)

    a: int | None = special_column(dtype=int, minimum=0)
    b: int | None = special_column(dtype=int, minimum=0)
    direction: Vector = special_column(unit="1", item="vector", largest=MOST)
    max_force: float | None = optional(unit="N", minimum=0.0)

    def __init__(self, *args: Any, limits: Any = None, **values: Any) -> None:
        super().__init__(*args, limits=limits, **values)  # stands here for checkers of types

    def check(self) -> None:
        super().check()
        if not np.any(np.abs(self.direction) > LEAST):
            raise ValueError(f"Slider.direction must not be 0, got {np.asarray(self.direction).tolist()}")

    def attach(self, a: Place, b: Place) -> None:
        self.hold(a, b, b.position if self.b != WORLD else a.position)
        self.hold_axis(a, b, self.direction)
        if len(a.position) == 2:
            self.keep(axis_a=a.along(unit(self.direction)))

    def rows(self, dimensions: int) -> list[Row]:
        along = np.asarray(self.axis_a)
        sides = [(-along[1], along[0])] if dimensions == 2 else [self.side_a, np.cross(along, self.side_a)]
        across = [Row(SLIDE, HOLD, axis=side) for side in sides]
        moving = self.moving(Row(SLIDE, HOLD, axis=along), self.max_force)
        return [*across, *self.aligned(dimensions), self.turn(dimensions), *moving]


class Wheel(Driven):
    """A wheel b on a car a: its anchor slides along an axis of a, on a spring, and it turns about the anchor.

    anchor
        (d,) m, the middle of the wheel, where the bodies are when the world takes the joint
    direction
        along which the anchor moves, in the world, as the bodies are then
    axis
        in space, about which the wheel turns, at right angles to the direction, in the world as the bodies are then
    limits
        m along the direction from there, (least, most); also the fields ``lower`` and ``upper``
    frequency, damping_ratio
        Hz: a spring that pushes the anchor back to ``rest``, m along the direction
    motor_speed, max_torque
        rad/s of b against a, and N m at most; None: no motor, and no limit
    """

    __slots__ = ()
    fixed: ClassVar[tuple[str, ...]] = ("anchor", "direction", "axis")

    a: int | None = special_column(dtype=int, minimum=0)
    b: int | None = special_column(dtype=int, minimum=0)
    anchor: Vector = special_column(unit="m", item="vector", largest=MOST)
    direction: Vector = special_column(unit="1", item="vector", largest=MOST)
    axis: Vector = special_column(unit="1", default=0.0, item="vector", largest=MOST, kw_only=True)
    max_torque: float | None = optional(unit="N m", minimum=0.0)

    def __init__(self, *args: Any, limits: Any = None, **values: Any) -> None:
        super().__init__(*args, limits=limits, **values)  # stands here for checkers of types

    def check(self) -> None:
        super().check()
        along, axis = np.asarray(self.direction), np.asarray(self.axis)
        if not np.any(np.abs(along) > LEAST):
            raise ValueError(f"Wheel.direction must not be 0, got {along.tolist()}")
        if along.shape != (3,) or axis.shape != (3,):
            return
        if abs(matrix_product(along, axis)) > SQUARE * magnitude(along) * magnitude(axis):
            raise ValueError(f"Wheel.axis must be at right angles to its direction, got {axis.tolist()}")

    def attach(self, a: Place, b: Place) -> None:
        self.hold(a, b, self.anchor)
        self.hold_axis(a, b, self.axis)
        along = unit(self.direction)
        self.keep(side_a=a.along(along), side_b=b.along(along))

    def rows(self, dimensions: int) -> list[Row]:
        along = np.asarray(self.side_a)
        across = [(-along[1], along[0])] if dimensions == 2 else [self.axis_a, np.cross(self.axis_a, along)]
        moving = self.moving(Row(SLIDE, HOLD, axis=along), self.max_torque, self.turn(dimensions))
        return [*(Row(SLIDE, HOLD, axis=side) for side in across), *self.aligned(dimensions), *moving]


class Motor(Joint):
    """Turns b against a: to an angular velocity, or to an angle.

    speed
        rad/s
    angle
        rad of b against a as they are then, in place of a speed
    max_torque
        N m at most; None: no limit
    axis
        in space, about which, in the world as the bodies are when the world takes the joint
    """

    __slots__ = ()
    fixed: ClassVar[tuple[str, ...]] = ("axis",)

    a: int | None = special_column(dtype=int, minimum=0)
    b: int | None = special_column(default=WORLD, dtype=int, minimum=0)
    speed: float | None = optional(unit="rad/s", largest=MOST)
    angle: float | None = optional(unit="rad", largest=MOST)
    max_torque: float | None = optional(unit="N m", minimum=0.0)
    axis: Vector = special_column(unit="1", default=0.0, item="vector", largest=MOST, kw_only=True)

    def check(self) -> None:
        if (self.speed is None) == (self.angle is None):
            raise ValueError(f"Motor takes a speed or an angle, got {'neither' if self.angle is None else 'both'}")
        warn_of_degrees("Motor.angle", (self.angle,))

    def attach(self, a: Place, b: Place) -> None:
        self.hold(a, b, b.position)
        self.hold_axis(a, b, self.axis)

    def rows(self, dimensions: int) -> list[Row]:
        row = self.turn(dimensions)._replace(most=math.inf if self.max_torque is None else self.max_torque)
        if self.angle is not None:
            return [row._replace(rule=SERVO, low=row.low + self.angle)]
        return [row._replace(rule=DRIVE, target=self.speed or 0.0)]


class Cone(Joint):
    """Two bodies in space that keep a common point: b's axis leaves that of a by ``swing`` at most, and turns about it
    within ``twist``: a shoulder.

    anchor, axis
        (3,) m and (3,), of both, in the world as they are when the world takes the joint
    swing
        rad, at most pi
    twist
        rad, (least, most); also the fields ``lower`` and ``upper``
    """

    __slots__ = ()
    dimensions: ClassVar[tuple[int, ...]] = (3,)
    fixed: ClassVar[tuple[str, ...]] = ("anchor", "axis")

    a: int | None = special_column(dtype=int, minimum=0)
    b: int | None = special_column(dtype=int, minimum=0)
    anchor: Vector = special_column(unit="m", item="vector", largest=MOST)
    axis: Vector = special_column(unit="1", item="vector", largest=MOST)
    swing: float = special_column(unit="rad", default=math.pi, minimum=0.0, kw_only=True)
    lower: float | None = optional(unit="rad", largest=MOST)
    upper: float | None = optional(unit="rad", largest=MOST)
    twist = ends_of("twist")

    def __init__(self, *args: Any, twist: Any = None, **values: Any) -> None:
        if twist is not None:
            values["lower"], values["upper"] = self._ends("twist", twist)
        super().__init__(*args, **values)

    def check(self) -> None:
        self.in_order("twist", self.lower, self.upper)
        warn_of_degrees("Cone.twist", (self.lower, self.upper))
        if self.swing > math.pi:
            raise ValueError(f"{self._name()}.swing must be at most pi, got {self.swing!r}")

    def attach(self, a: Place, b: Place) -> None:
        self.hold(a, b, self.anchor)
        self.hold_axis(a, b, self.axis)

    def rows(self, dimensions: int) -> list[Row]:
        twist = self.in_order("twist", self.lower, self.upper)
        limit = self.turn(dimensions)._replace(rule=LIMIT, low=twist[0], high=twist[1])
        swing = Row(CONE, LIMIT, -math.inf, self.swing, axis=self.side_a, ends=(self.axis_a, self.axis_b))
        turns = self.counted([limit] if twist != UNLIMITED else [], dimensions)
        return [Row(POINT, HOLD), swing, *(row._replace(kind=TWIST) for row in turns)]


class MousePull(Joint):
    """Pulls a body b, at the point where it was taken, to a place that moves.

    grip
        (d,) m, the point of the world where the body is taken
    target
        (d,) m, where to; set it at any time
    max_force
        N; None: no limit
    frequency, damping_ratio
        Hz, and 1 where it just does not swing, of the spring that pulls
    """

    __slots__ = ()
    fixed: ClassVar[tuple[str, ...]] = ("grip",)

    b: int | None = special_column(dtype=int, minimum=0)
    grip: Vector = special_column(unit="m", item="vector", largest=MOST)
    target: Vector = special_column(unit="m", item="vector", largest=MOST)
    max_force: float | None = optional(unit="N", minimum=0.0)
    frequency: float = special_column(unit="Hz", default=5.0, largest=MOST, positive=True, kw_only=True)
    damping_ratio: float = special_column(unit="1", default=1.0, minimum=0.0, largest=MOST, kw_only=True)
    a: int | None = special_column(default=WORLD, init=False, dtype=int)

    def check(self) -> None:
        if self.a != WORLD:
            raise ValueError(f"MousePull.a must be None, as it pulls to a place of the world, got {self.a}")
        self.keep(at_a=self.target)

    def attach(self, a: Place, b: Place) -> None:
        self.hold(a, b, self.grip)
        self.keep(at_a=self.target)

    def rows(self, dimensions: int) -> list[Row]:
        most = math.inf if self.max_force is None else self.max_force
        return [Row(POINT, SPRING, most=most, frequency=self.frequency, damping_ratio=self.damping_ratio)]


KINDS: tuple[type[Joint], ...] = (Distance, Hinge, Ball, Cone, Weld, Slider, Wheel, Motor, MousePull)

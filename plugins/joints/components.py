"""The kinds of joints: components of entities of their own, and the rows of the solver that each of them is."""

from __future__ import annotations

import math
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ...framework.data.columns import special_column
from ...framework.data.component import Component
from ...framework.typing import Vector
from ...systems.contacts.solving.joints import DRIVE, HOLD, LIMIT, LINE, POINT, SLIDE, SPRING, TURN

WORLD = 0  # in place of a body
FREE = -math.inf, math.inf


class Row(NamedTuple):
    """One row of a joint, as the record ``Joints`` has it."""

    kind: int
    rule: int
    low: float = 0.0
    high: float = 0.0
    target: float = 0.0
    most: float = math.inf
    frequency: float = 0.0
    damping_ratio: float = 0.0
    axis: Any = None  # of what slides, along the axes of a


class Place(NamedTuple):
    """Where a body is, or the world."""

    position: Any
    axes: Any  # (d, d), those of the body as columns
    angle: float

    def local(self, point: Any) -> np.ndarray:
        """A point of the world, as the body has it."""
        return self.axes.T @ (np.asarray(point, float) - self.position)

    def point(self, local: Any) -> np.ndarray:
        return self.position + self.axes @ np.asarray(local, float)


class Changes:
    """How often a field of any joint has been set: worlds look again when that is another number."""

    count = 0


def optional(**options: Any) -> Any:
    """A number that need not be given."""
    return special_column(default=None, optional=True, kw_only=True, **options)


class Joint(Component, abstract=True):
    """What all joints have.

    collide_connected
        whether the two bodies may touch
    breaking_force
        N, or None: the joint is gone after a step in which its mean force was higher, and joint_broken is sent
    """

    __slots__ = ()
    plugin: ClassVar[str] = "joints"
    flat_only: ClassVar[bool] = False  # in worlds of 2 dimensions alone
    fixed: ClassVar[tuple[str, ...]] = ("a", "b", "anchor")  # where these are set the joint begins anew

    a: int | None
    b: int | None
    collide_connected: bool = special_column(default=False, dtype=bool, kw_only=True)
    breaking_force: float | None = special_column(default=None, optional=True, positive=True, kw_only=True)
    attached: bool = special_column(default=False, init=False, dtype=bool)
    at_a: Vector = special_column(default=0.0, init=False, item="vector")  # the anchors, along the axes of each body
    at_b: Vector = special_column(default=0.0, init=False, item="vector")
    start: float = special_column(default=0.0, init=False)  # m or rad: the value of the row that has one

    def __init__(self, *args: Any, **values: Any) -> None:
        given = self._named(args, values)
        for name in ("a", "b"):
            if given.get(name, WORLD) is None:
                given[name] = WORLD
        super().__init__(**given)
        if self.a == self.b:
            raise ValueError(f"{type(self).__name__} needs two bodies, got {self.a or None} twice")
        self.check()

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self.columns and self._values is not None:
            if name in ("a", "b") and value is None:
                value = WORLD
            before = dict(self._values)
            super().__setattr__(name, value)
            if self.attached:
                try:
                    self.check()
                except ValueError:
                    self._values = before
                    raise
                if name in self.fixed:
                    self._values["attached"] = False
            Changes.count += 1
            return
        super().__setattr__(name, value)

    def _ends(self, name: str, value: Any) -> tuple[Any, Any]:
        try:
            low, high = value
        except TypeError:
            raise ValueError(f"{type(self).__name__}.{name} must be two numbers (least, most), got {value!r}") from None
        return low, high

    def check(self) -> None:
        """ValueError for fields that do not go together."""

    def in_order(self, name: str, low: float | None, high: float | None) -> tuple[float, float]:
        """Two limits, none where they are None; ValueError if the first is the larger."""
        least, most = -math.inf if low is None else low, math.inf if high is None else high
        if least > most:
            raise ValueError(f"{type(self).__name__}.{name} must be (least, most), got ({low}, {high})")
        return least, most

    def attach(self, a: Place, b: Place) -> None:
        """The bodies stand where the joint takes hold of them."""
        raise NotImplementedError

    def rows(self, dimensions: int) -> list[Row]:
        """The rows that it is now."""
        raise NotImplementedError

    def hold(self, a: Place, b: Place, anchor: Any) -> None:
        """Anchors at a point of the world."""
        self.keep(at_a=a.local(anchor), at_b=b.local(anchor), start=b.angle - a.angle)

    def keep(self, **values: Any) -> None:
        """Set what is hidden."""
        self._values.update(values)  # type: ignore[union-attr]

    def moving(self, row: Row, limits: tuple[float, float], drive: tuple[float | None, float | None]) -> list[Row]:
        """The rows that limit a value, whose 0 is at ``row.low``, drive it, or are its spring. drive: (speed, most)."""
        rows, (speed, most) = [], drive
        if limits != FREE:
            rows.append(row._replace(rule=LIMIT, low=row.low + limits[0], high=row.low + limits[1]))
        if speed is not None:
            rows.append(row._replace(rule=DRIVE, target=speed, most=math.inf if most is None else most))
        if self.frequency is not None:  # type: ignore[attr-defined]
            rest, ratio = self.rest, self.damping_ratio  # type: ignore[attr-defined]
            rows.append(row._replace(rule=SPRING, low=row.low + rest, frequency=self.frequency, damping_ratio=ratio))  # type: ignore[attr-defined]
        return rows


class Distance(Joint):
    """A rod, a rope or a spring between two points.

    a, b
        entities of two bodies; None: the world
    anchor_a, anchor_b
        m from the position of each, along its own axes; of the world a place
    length
        m; None: the distance when the world takes the joint. Two numbers, the least and the most: (0, 2) is a rope
    frequency, damping_ratio
        Hz, and 1 where it just does not swing: a spring; without a frequency it is rigid
    """

    __slots__ = ()
    fixed: ClassVar[tuple[str, ...]] = ("a", "b")

    a: int | None = special_column(dtype=int, minimum=0)
    b: int | None = special_column(default=WORLD, dtype=int, minimum=0)
    anchor_a: Vector = special_column(default=0.0, item="vector")
    anchor_b: Vector = special_column(default=0.0, item="vector")
    least: float | None = optional(minimum=0.0)
    most: float | None = optional(minimum=0.0)
    frequency: float | None = optional(positive=True)
    damping_ratio: float = special_column(default=0.0, minimum=0.0, kw_only=True)

    def __init__(self, *args: Any, length: Any = None, **values: Any) -> None:
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
        for name in ("least", "most") if (self.most is None or low <= self.most) else ("most", "least"):
            setattr(self, name, low if name == "least" else high)

    def check(self) -> None:
        low, high = self.in_order("length", self.least, self.most)
        if self.frequency is not None and low < high and (self.least is not None or self.most is not None):
            raise ValueError(f"Distance: a spring has one length, got {self.length!r}")

    def attach(self, a: Place, b: Place) -> None:
        self.keep(start=float(np.linalg.norm(b.point(self.anchor_b) - a.point(self.anchor_a))))

    def rows(self, dimensions: int) -> list[Row]:
        self.keep(at_a=self.anchor_a, at_b=self.anchor_b)
        low, high = self.in_order("length", self.least, self.most)
        if self.least is None and self.most is None:
            low = high = self.start
        if self.frequency is not None:
            return [Row(LINE, SPRING, low, frequency=self.frequency, damping_ratio=self.damping_ratio)]
        return [Row(LINE, HOLD, low)] if low == high else [Row(LINE, LIMIT, max(low, 0.0), high)]


class Hinge(Joint):
    """Two bodies that turn about a common point of a plane.

    a, b
        entities of two bodies; None: the world
    anchor
        the point, where the bodies are when the world takes the joint
    limits
        rad, (least, most), of b against a as they are then; also the fields ``lower`` and ``upper``
    motor_speed, max_torque
        rad/s of b against a, and N m at most; None: no motor, and no limit
    frequency, damping_ratio
        Hz: a spring that turns b back to ``rest``, rad against a as they are then
    """

    __slots__ = ()
    flat_only: ClassVar[bool] = True

    a: int | None = special_column(dtype=int, minimum=0)
    b: int | None = special_column(dtype=int, minimum=0)
    anchor: Vector = special_column(item="vector")
    lower: float | None = optional()
    upper: float | None = optional()
    motor_speed: float | None = optional()
    max_torque: float | None = optional(minimum=0.0)
    frequency: float | None = optional(positive=True)
    damping_ratio: float = special_column(default=0.0, minimum=0.0, kw_only=True)
    rest: float = special_column(default=0.0, kw_only=True)

    def __init__(self, *args: Any, limits: Any = None, **values: Any) -> None:
        if limits is not None:
            values["lower"], values["upper"] = self._ends("limits", limits)
        super().__init__(*args, **values)

    def check(self) -> None:
        self.in_order("limits", self.lower, self.upper)

    def attach(self, a: Place, b: Place) -> None:
        self.hold(a, b, self.anchor)

    def rows(self, dimensions: int) -> list[Row]:
        limits = self.in_order("limits", self.lower, self.upper)
        turn = Row(TURN, HOLD, self.start)
        return [Row(POINT, HOLD), *self.moving(turn, limits, (self.motor_speed, self.max_torque))]


class Ball(Joint):
    """Two bodies that keep a common point, and turn as they like."""

    __slots__ = ()

    a: int | None = special_column(dtype=int, minimum=0)
    b: int | None = special_column(dtype=int, minimum=0)
    anchor: Vector = special_column(item="vector")

    def attach(self, a: Place, b: Place) -> None:
        self.hold(a, b, self.anchor)

    def rows(self, dimensions: int) -> list[Row]:
        return [Row(POINT, HOLD)]


class Weld(Joint):
    """Two bodies that stay as they are to each other; ``anchor`` is a point of the world where they are held."""

    __slots__ = ()
    flat_only: ClassVar[bool] = True

    a: int | None = special_column(dtype=int, minimum=0)
    b: int | None = special_column(dtype=int, minimum=0)
    anchor: Vector = special_column(item="vector")

    def attach(self, a: Place, b: Place) -> None:
        self.hold(a, b, self.anchor)

    def rows(self, dimensions: int) -> list[Row]:
        return [Row(POINT, HOLD), Row(TURN, HOLD, self.start)]


class Slider(Joint):
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
    flat_only: ClassVar[bool] = True
    fixed: ClassVar[tuple[str, ...]] = ("a", "b", "direction")

    a: int | None = special_column(dtype=int, minimum=0)
    b: int | None = special_column(dtype=int, minimum=0)
    direction: Vector = special_column(item="vector")
    lower: float | None = optional()
    upper: float | None = optional()
    motor_speed: float | None = optional()
    max_force: float | None = optional(minimum=0.0)
    frequency: float | None = optional(positive=True)
    damping_ratio: float = special_column(default=0.0, minimum=0.0, kw_only=True)
    rest: float = special_column(default=0.0, kw_only=True)
    along: Vector = special_column(default=0.0, init=False, item="vector")  # the axis, along those of a

    def __init__(self, *args: Any, limits: Any = None, **values: Any) -> None:
        if limits is not None:
            values["lower"], values["upper"] = self._ends("limits", limits)
        super().__init__(*args, **values)

    def check(self) -> None:
        self.in_order("limits", self.lower, self.upper)
        if not np.any(self.direction):
            raise ValueError("Slider.direction must not be 0")

    def attach(self, a: Place, b: Place) -> None:
        self.hold(a, b, b.position if self.b != WORLD else a.position)
        self.keep(along=a.axes.T @ (np.asarray(self.direction) / np.linalg.norm(self.direction)))

    def rows(self, dimensions: int) -> list[Row]:
        limits, (x, y) = self.in_order("limits", self.lower, self.upper), self.along
        along = self.moving(Row(SLIDE, HOLD, axis=(x, y)), limits, (self.motor_speed, self.max_force))
        return [Row(SLIDE, HOLD, axis=(-y, x)), Row(TURN, HOLD, self.start), *along]


class Motor(Joint):
    """Turns b against a: to an angular velocity, or to an angle.

    speed
        rad/s
    angle
        rad of b against a, in place of a speed
    max_torque
        N m at most; None: no limit
    """

    __slots__ = ()
    flat_only: ClassVar[bool] = True
    fixed: ClassVar[tuple[str, ...]] = ("a", "b")

    a: int | None = special_column(dtype=int, minimum=0)
    b: int | None = special_column(default=WORLD, dtype=int, minimum=0)
    speed: float | None = optional()
    angle: float | None = optional()
    max_torque: float | None = optional(minimum=0.0)

    def check(self) -> None:
        if (self.speed is None) == (self.angle is None):
            raise ValueError("Motor takes a speed or an angle, and not both")

    def attach(self, a: Place, b: Place) -> None:
        self.hold(a, b, b.position)

    def rows(self, dimensions: int) -> list[Row]:
        most = math.inf if self.max_torque is None else self.max_torque
        if self.angle is not None:
            return [Row(TURN, HOLD, self.angle, most=most)]
        return [Row(TURN, DRIVE, target=self.speed or 0.0, most=most)]


class MousePull(Joint):
    """Pulls a body, at the point where it was taken, to a place that moves.

    grip
        the point of the world where the body is taken
    target
        where to; set it at any time
    max_force
        N; None: no limit
    """

    __slots__ = ()
    fixed: ClassVar[tuple[str, ...]] = ("b", "grip")

    b: int | None = special_column(dtype=int, minimum=0)
    grip: Vector = special_column(item="vector")
    target: Vector = special_column(item="vector")
    max_force: float | None = optional(minimum=0.0)
    frequency: float = special_column(default=5.0, positive=True, kw_only=True)
    damping_ratio: float = special_column(default=1.0, minimum=0.0, kw_only=True)
    a: int | None = special_column(default=WORLD, init=False, dtype=int)

    def attach(self, a: Place, b: Place) -> None:
        self.hold(a, b, self.grip)

    def rows(self, dimensions: int) -> list[Row]:
        self.keep(at_a=self.target)
        most = math.inf if self.max_force is None else self.max_force
        return [Row(POINT, SPRING, most=most, frequency=self.frequency, damping_ratio=self.damping_ratio)]


KINDS: tuple[type[Joint], ...] = (Distance, Hinge, Ball, Weld, Slider, Motor, MousePull)

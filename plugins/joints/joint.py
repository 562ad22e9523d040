"""What all joints have: fields, the moment in which they take hold of their bodies, and rows of the solver."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ...components import RigidBody
from ...components.part_of import PartOf
from ...framework.data.columns import special_column
from ...framework.data.component import Component
from ...framework.typing import Vector
from ...systems.contacts.solving.joints.records import ALIGN, DRIVE, GIVEN, HOLD, LIMIT, SPRING, TURN

WORLD = 0  # in place of a body
FREE = -math.inf, math.inf
MOST = 1e15  # m, rad, Hz and the like: further away numbers have no digits for what a step changes
FARTHEST = 1e8  # m from a body: further away its mass is lost beside the inertia of the arm
LEAST = 1e-100  # of an axis, whose square is taken


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
    axis: Any = None  # along the axes of a, of what slides or turns
    ends: Any = None  # of angles in space: unit vectors along the axes of a and of b
    part: int = 0  # of a GIVEN: which row of its function


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
    dimensions: ClassVar[tuple[int, ...]] = (2, 3)  # of its worlds
    fixed: ClassVar[tuple[str, ...]] = ("anchor",)  # where these, a or b are set the joint begins anew

    a: int | None
    b: int | None
    collide_connected: bool = special_column(default=False, dtype=bool, kw_only=True)
    breaking_force: float | None = special_column(default=None, optional=True, positive=True, kw_only=True)
    attached: bool = special_column(default=False, init=False, dtype=bool)
    changed: bool = special_column(default=True, init=False, dtype=bool)  # since the last step: its bodies wake
    at_a: Vector = special_column(default=0.0, init=False, item="vector")  # the anchors, along the axes of each body
    at_b: Vector = special_column(default=0.0, init=False, item="vector")
    start: float = special_column(default=0.0, init=False)  # m or rad: the value of the row that has one
    # in space: the axis, and a direction at right angles to it, along the axes of each body
    axis_a: Vector = special_column(default=0.0, init=False, item="vector")
    axis_b: Vector = special_column(default=0.0, init=False, item="vector")
    side_a: Vector = special_column(default=0.0, init=False, item="vector")
    side_b: Vector = special_column(default=0.0, init=False, item="vector")

    def __init__(self, *args: Any, **values: Any) -> None:
        given = self._named(args, values)
        for name in ("a", "b"):
            if given.get(name, WORLD) is None:
                given[name] = WORLD
        super().__init__(**given)
        if self.a == self.b:
            raise ValueError(f"{type(self).__name__} needs two bodies, got {self.a or None} twice")
        self.check()

    @classmethod
    def many(cls, *args: Any, **values: Any) -> Any:
        raise TypeError(f"joints are created one by one: world.create_entity({cls.__name__}(...))")

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self.columns and self._values is not None:
            self.set_together(**{name: value})
        else:
            super().__setattr__(name, value)

    def set_together(self, **values: Any) -> None:
        """Set fields that only fit each other; ValueError, with all as it was, if they do not."""
        before, version = dict(self._values or {}), self._version
        try:
            for name, value in values.items():
                super().__setattr__(name, WORLD if name in ("a", "b") and value is None else value)
            self.check()
            if version < -1:  # of a world of so many dimensions
                self.fit(-version)
        except ValueError as error:
            self._values, self._version = before, version
            if str(error).startswith("entity "):
                raise
            raise ValueError(str(error).replace(type(self).__name__, self._name(), 1)) from None
        now = self._values or {}
        if any(name in ("a", "b", *self.fixed) for name in values):
            self.keep(attached=False)
        elif all(np.isscalar(value) and np.all(before.get(name) == now[name]) for name, value in values.items()):
            return  # a game may set its motors in each step
        self.keep(changed=True)
        Changes.count += 1

    def _name(self) -> str:
        """For messages."""
        return f"{'' if self._entity is None else f'entity {self._entity}: '}{type(self).__name__}"

    def _ends(self, name: str, value: Any) -> tuple[Any, Any]:
        try:
            low, high = value
        except (TypeError, ValueError):
            raise ValueError(f"{type(self).__name__}.{name} must be two numbers (least, most), got {value!r}") from None
        return low, high

    def check(self) -> None:
        """ValueError for fields that do not go together."""

    def fit(self, dimensions: int, entity: int | None = None) -> None:
        name = f"{'' if entity is None else f'entity {entity}: '}{type(self).__name__}"
        if dimensions not in self.dimensions:
            raise ValueError(f"{name} is no joint of worlds of {dimensions} dimensions")
        if dimensions == 2 and "axis" in self.columns and np.any(self.axis):
            raise ValueError(f"{name}.axis is for 3D worlds, leave it out, got {np.asarray(self.axis).tolist()}")
        super().fit(dimensions, entity)
        self._entity = self._entity if entity is None else entity  # for messages
        if dimensions == 3 and "axis" in self.columns and not np.any(np.abs(self.axis) > LEAST):
            raise ValueError(f"{name} needs an axis in a world of 3 dimensions, got {np.asarray(self.axis).tolist()}")

    def check_in(self, contents: Any, entity: int | None, beside: Collection[type[Any]] = ()) -> None:
        """ValueError unless it has two bodies, or one and the world, one of which is dynamic, and an entity of its own.
        """
        name, dynamic = f"{'' if entity is None else f'entity {entity}: '}{type(self).__name__}", False
        for other in sorted({*beside, *contents.entities.types_of(entity)} - {type(self)}, key=lambda o: o.__name__):
            if issubclass(other, Joint) or getattr(other, "makes_body", False):
                raise ValueError(f"{name} is an entity of its own, not one that has a {other.__name__} as well")
        for body in (self.a, self.b):
            if body == WORLD:
                continue
            body = body if body in contents.dead else _whole(contents, body)
            types = () if body in contents.dead else contents.entities.types_of(body)
            if not any(getattr(kind, "makes_body", False) for kind in types):
                why = "is no body of this world" if types else "does not exist in this world"
                raise ValueError(f"{name} joins entity {body}, which {why}")
            dynamic |= RigidBody in types and contents.entities.handle(body, RigidBody).kind == "dynamic"
        if not dynamic:
            raise ValueError(f"{name} joins no dynamic body")
        self.check_apart(contents, entity)

    def check_apart(self, contents: Any, entity: int | None) -> None:
        """ValueError if both are parts of one body, or one is a part of the other."""
        if WORLD not in (self.a, self.b) and _whole(contents, self.a) == (body := _whole(contents, self.b)):
            name = f"{'' if entity is None else f'entity {entity}: '}{type(self).__name__}"
            raise ValueError(f"{name} joins entity {self.a} and entity {self.b}, which are both of one body, {body}")

    def in_order(self, name: str, low: float | None, high: float | None) -> tuple[float, float]:
        """Two limits, none where they are None; ValueError if the first is the larger, or one is no number."""
        try:
            least, most = -math.inf if low is None else float(low), math.inf if high is None else float(high)
        except (TypeError, ValueError, OverflowError):
            raise ValueError(f"{self._name()}.{name} must be numbers, got {low!r} and {high!r}") from None
        if least > most:
            raise ValueError(f"{self._name()}.{name} must be (least, most), got ({low}, {high})")
        return least, most

    def attach(self, a: Place, b: Place) -> None:
        """The bodies stand where the joint takes hold of them."""

    def rows(self, dimensions: int) -> list[Row]:
        """The rows that it is now. A joint of a plugin keeps the value of its first row, unless it says otherwise."""
        return [Row(GIVEN, HOLD, self.start)]

    def hold(self, a: Place, b: Place, anchor: Any) -> None:
        """Anchors at a point of the world."""
        at_a, at_b = a.local(anchor), b.local(anchor)
        for body, at in ((self.a, at_a), (self.b, at_b)):
            if body != WORLD and np.abs(at).max() > FARTHEST:
                raise ValueError(
                    f"entity {self.entity}: {type(self).__name__} holds entity {body} at {at.tolist()} along its axes, "
                    f"which must be at most {FARTHEST:g} m away"
                )
        self.keep(at_a=at_a, at_b=at_b, start=b.angle - a.angle)

    def hold_axis(self, a: Place, b: Place, axis: Any) -> None:
        """In space, an axis of both."""
        if len(a.position) == 2:
            return
        axis = np.asarray(axis, float) / np.linalg.norm(axis)
        side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        side /= np.linalg.norm(side)
        self.keep(axis_a=a.axes.T @ axis, axis_b=b.axes.T @ axis, side_a=a.axes.T @ side, side_b=b.axes.T @ side)

    def turn(self, dimensions: int) -> Row:
        """About the axis; its value is 0 where the joint took hold."""
        if dimensions == 2:
            return Row(TURN, HOLD, self.start)
        return Row(TURN, HOLD, axis=self.axis_a, ends=(self.side_a, self.side_b))

    def aligned(self, dimensions: int) -> list[Row]:
        """The axes of both bodies stay parallel."""
        if dimensions == 2:
            return []
        axes, sides = (self.axis_a, self.axis_b), (self.side_a, np.cross(self.axis_a, self.side_a))
        return [Row(ALIGN, HOLD, axis=side, ends=axes) for side in sides]

    def keep(self, **values: Any) -> None:
        """Set what is hidden."""
        self._values.update(values)  # type: ignore[union-attr]


def _whole(contents: Any, body: Any) -> int:
    """The body that an entity is a part of; itself, if it is none."""
    while PartOf in contents.entities.types_of(body):
        body = contents.entities.handle(body, PartOf).body
    return body


class Driven(Joint, abstract=True):
    """What has limits, a motor and a spring of its one free value."""

    __slots__ = ()

    lower: float | None = special_column(default=None, optional=True, largest=MOST, kw_only=True)
    upper: float | None = special_column(default=None, optional=True, largest=MOST, kw_only=True)
    motor_speed: float | None = special_column(default=None, optional=True, largest=MOST, kw_only=True)
    frequency: float | None = special_column(
        default=None, optional=True, positive=True, largest=MOST, kw_only=True
    )
    damping_ratio: float = special_column(default=0.0, minimum=0.0, largest=MOST, kw_only=True)
    rest: float = special_column(default=0.0, kw_only=True, largest=MOST)

    def __init__(self, *args: Any, limits: Any = None, **values: Any) -> None:
        if limits is not None:
            values["lower"], values["upper"] = self._ends("limits", limits)
        super().__init__(*args, **values)

    def check(self) -> None:
        self.in_order("limits", self.lower, self.upper)

    def moving(self, row: Row, most: float | None, driven: Row | None = None) -> list[Row]:
        """The rows that drive the value, which is 0 at ``row.low``, or that of another row, with ``most``, are its
        spring, or limit it."""
        rows, limits = [], self.in_order("limits", self.lower, self.upper)
        if self.motor_speed is not None:
            limit = math.inf if most is None else most
            rows.append((driven or row)._replace(rule=DRIVE, target=self.motor_speed, most=limit))
        if self.frequency is not None:
            low, ratio = row.low + self.rest, self.damping_ratio
            rows.append(row._replace(rule=SPRING, low=low, frequency=self.frequency, damping_ratio=ratio))
        if limits != FREE:  # solved last: no motor is stronger
            rows.append(row._replace(rule=LIMIT, low=row.low + limits[0], high=row.low + limits[1]))
        return rows

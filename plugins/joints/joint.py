"""What all joints have: fields, the moment in which they take hold of their bodies, and rows of the solver."""

from __future__ import annotations

import math
from collections.abc import Mapping, Set
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from ...components import RigidBody
from ...components.part_of import PartOf
from ...framework.data.columns import Column, special_column
from ...framework.data.component import NOTHING, Component
from ...framework.matrices import matrix_product, unit
from ...framework.typing import Vector
from ...systems.joints.own import OwnJoint, own_joint
from ...systems.joints.records import ALIGN, CUSTOM, DRIVE, FREE, HOLD, LIMIT, SPRING, TURN

WORLD = 0  # in place of a body
UNLIMITED = -math.inf, math.inf
MOST = 1e15  # m, rad, Hz and the like: further away numbers have no digits for what a step changes
FARTHEST = 1e8  # m from a body: further away its mass is lost beside the inertia of the arm
LEAST = 1e-100  # of an axis, whose square is taken


class Row(NamedTuple):
    """One row of a joint, as the record ``Joints`` has it.

    kind, rule
        what its value is, in joints of plugins CUSTOM; what is done about it: HOLD, LIMIT, DRIVE, SERVO, SPRING, FREE
    low, high
        m or rad: the least and the most; or where the value is held, ``low``
    target, most
        m/s or rad/s: how fast a DRIVE changes it; N or N m at most
    frequency, damping_ratio
        Hz, of a SPRING; 1 where it just does not swing
    axis, ends
        along the axes of a, of what slides or turns; of angles in space unit vectors along the axes of a and of b
    part
        of a CUSTOM: which row of its function, from 0
    """

    kind: int
    rule: int
    low: float = 0.0
    high: float = 0.0
    target: float = 0.0
    most: float = math.inf
    frequency: float = 0.0
    damping_ratio: float = 0.0
    axis: Any = None
    ends: Any = None
    part: int = 0


class Place(NamedTuple):
    """Where a body is, or the world."""

    position: Any
    axes: Any  # (d, d), those of the body as columns
    angle: float

    def along(self, vector: Any) -> np.ndarray:
        """A vector of the world along the axes of the body."""
        return matrix_product(self.axes.T, vector)

    def local(self, point: Any) -> np.ndarray:
        """A point of the world, as the body has it."""
        return self.along(np.asarray(point, float) - self.position)

    def point(self, local: Any) -> np.ndarray:
        return self.position + matrix_product(self.axes, local)


class Watched(Column):
    """A vector that may be written in place: the world's Joints are told of each that the game has got."""

    def __get__(self, handle: Any, owner: type | None = None) -> Any:
        value = super().__get__(handle, owner)
        if handle is None or not isinstance(value, np.ndarray):
            return value
        if self.optional and np.isnan(value[0]):
            return None
        if handle._taken is None:
            handle._saved = None  # the game may write into it at any time
        else:
            handle._taken.watch(handle, self.name, value)
        return value

    def value_of(self, handle: Any) -> Any:
        """The same for reading only."""
        taken, saved, handle._taken = handle._taken, handle._saved, None
        value = self.__get__(handle)
        handle._taken, handle._saved = taken, saved
        return value


def optional(**options: Any) -> Any:
    """A number that need not be given."""
    return special_column(default=None, optional=True, kw_only=True, **options)


class Joint(Component, abstract=True):
    """What all joints have.

    a, b
        entities of two bodies; None: the world
    collide_connected
        whether the two may touch
    breaking_force, breaking_torque
        N, N m, or None: the joint is gone after a step in which its mean force or torque was higher, and joint_broken
        is sent
    """

    __slots__ = ("_contents", "_taken")
    plugin: ClassVar[str] = "joints"
    dimensions: ClassVar[tuple[int, ...]] = (2, 3)  # of its worlds
    fixed: ClassVar[tuple[str, ...]] = ("anchor",)  # where these, a or b are set the joint begins anew

    a: int | None
    b: int | None
    collide_connected: bool = special_column(default=False, dtype=bool, kw_only=True)
    breaking_force: float | None = special_column(unit="N", default=None, optional=True, positive=True, kw_only=True)
    breaking_torque: float | None = special_column(unit="N m", default=None, optional=True, positive=True, kw_only=True)
    attached: bool = special_column(default=False, init=False, dtype=bool)
    changed: bool = special_column(default=True, init=False, dtype=bool)  # since the last step: its bodies wake
    # the anchors, along the axes of each body
    at_a: Vector = special_column(unit="m", default=0.0, init=False, item="vector")
    at_b: Vector = special_column(unit="m", default=0.0, init=False, item="vector")
    # m or rad: the value of the row that has one
    start: float = special_column(unit="m or rad", default=0.0, init=False)
    # in space: the axis, and a direction at right angles to it, along the axes of each body
    axis_a: Vector = special_column(unit="1", default=0.0, init=False, item="vector")
    axis_b: Vector = special_column(unit="1", default=0.0, init=False, item="vector")
    side_a: Vector = special_column(unit="1", default=0.0, init=False, item="vector")
    side_b: Vector = special_column(unit="1", default=0.0, init=False, item="vector")

    def __init_subclass__(cls, **options: Any) -> None:
        for name, column in list(vars(cls).items()):
            if isinstance(column, Column) and column.item == "vector" and column.constructor:
                setattr(cls, name, Watched(**vars(column)))
        super().__init_subclass__(**options)
        cls._lends = False  # as they are watched

    def __new__(cls, *args: Any, **values: Any) -> Self:
        self = super().__new__(cls)
        self._contents = self._taken = None  # of the world; the Joints that have rows for it
        return self

    def __init__(self, *args: Any, **values: Any) -> None:
        given = self._named(args, values)
        for name in ("a", "b"):
            if given.get(name, WORLD) is None:
                given[name] = WORLD
        super().__init__(**given)
        self.check_ends()
        self.check()

    @classmethod
    def of_plugin(cls, plugin: Any) -> OwnJoint:
        """Called by :meth:`carom.framework.Plugin.joint` of that ``plugin``."""
        return own_joint(plugin, cls)

    @classmethod
    def many(cls, *args: Any, **values: Any) -> Any:
        """TypeError: each joint is created by itself."""
        raise TypeError(f"joints are created one by one: world.create_entity({cls.__name__}(...))")

    def _as_saved(self) -> dict[str, Any] | None:
        return None if self._taken is not None and self._taken.is_written(self._entity) else self._saved

    def _to_save(self) -> dict[str, Any]:
        values = super()._to_save()
        if self._taken is None or self._taken.is_written(self._entity):
            self._saved = None
        return values

    def _hold(self, values: Mapping[str, Any]) -> None:
        super()._hold(values)
        self._taken = None  # its rows are of other values

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self.columns and self._values is not None:
            self.set_together(**{name: value})
        else:
            super().__setattr__(name, value)

    def set_together(self, **values: Any) -> None:
        """Set fields that only fit each other; ValueError, with all as it was, if they do not."""
        held, version, taken, saved = self._values or {}, self._version, self._taken, self._saved
        before, ends = {name: held.get(name) for name in values}, not values.keys().isdisjoint(("a", "b"))
        self._taken = None  # what looks at vectors here does not write into them
        try:
            for name, value in values.items():
                super().__setattr__(name, WORLD if name in ("a", "b") and value is None else value)
            self.check()
            whole = all(map(np.isscalar, map(held.get, values)))
            if version < -1 and not whole:  # of a world of so many dimensions
                self.fit(-version)
            if ends:
                self.check_ends()
                if self._contents is not None:
                    self.check_in(self._contents, self._whose())
        except ValueError as error:
            held.update(before)
            self._version = version
            if str(error).startswith("entity "):
                raise
            raise ValueError(str(error).replace(type(self).__name__, self._name(), 1)) from None
        finally:
            self._taken = taken
        self._version = version if whole else self._version
        if ends or not values.keys().isdisjoint(self.fixed):
            self.let_go(values.keys())
        elif all(_same(before[name], held[name]) for name in values):  # a game may set its motors in each step
            held.update(before)
            self._saved = saved
            return
        held["changed"] = True
        if taken is not None:
            taken.note(self, values)

    def let_go(self, names: Set[str]) -> None:
        """Attach again at the next step, because the fields ``names`` were set."""
        self.keep(attached=False)

    def check_ends(self) -> None:
        """ValueError unless a and b are two."""
        if self.a == self.b:
            raise ValueError(f"{type(self).__name__} needs two bodies, got {self.a or None} as a and as b")

    def _whose(self) -> int | None:
        """Its entity, also before a step has taken it."""
        if self._entity is None and self._contents is not None:
            kind, contents = type(self), self._contents
            found = (e for e in contents.members.get(kind, ()) if contents.components_of(e)[kind] is self)
            self._entity = next(found, None)
        return self._entity

    def _name(self) -> str:
        """For messages."""
        return f"{'' if self._whose() is None else f'entity {self._entity}: '}{type(self).__name__}"

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

    def check_in(self, contents: Any, entity: int | None, beside: Mapping[type[Any], Any] = NOTHING) -> None:
        """ValueError unless it has two bodies, or one and the world, one of which is dynamic, and an entity of its own.
        """
        self._contents = contents
        name, dynamic = f"{'' if entity is None else f'entity {entity}: '}{type(self).__name__}", False
        for other in sorted({*beside, *contents.entities.types_of(entity)} - {type(self)}, key=lambda o: o.__name__):
            if issubclass(other, Joint) or getattr(other, "makes_body", False):
                raise ValueError(f"{name} is an entity of its own, not one that has a {other.__name__} as well")
        for body in (self.a, self.b):
            if body == WORLD:
                continue
            body = body if body in contents.dead else whole_body(contents, body)
            types = () if body in contents.dead else contents.entities.types_of(body)
            if not any(getattr(kind, "makes_body", False) for kind in types):
                why = "is no body of this world" if types else "does not exist in this world"
                raise ValueError(f"{name} joins entity {body}, which {why}")
            dynamic |= RigidBody in types and contents.entities.handle(body, RigidBody).kind == "dynamic"
        if not dynamic:
            raise ValueError(f"{name} joins no dynamic body: a is {self.a or None}, b is {self.b or None}")
        self.check_apart(contents, entity)

    def check_apart(self, contents: Any, entity: int | None) -> None:
        """ValueError if in ``contents`` both are parts of one body, or one is a part of the other."""
        whole, body = self.whole_ends(contents)
        if WORLD != whole == body:
            name = f"{'' if entity is None else f'entity {entity}: '}{type(self).__name__}"
            raise ValueError(f"{name} joins entity {self.a} and entity {self.b}, which are both of one body, {body}")

    def whole_ends(self, contents: Any) -> list[Any]:
        """The two bodies of ``contents`` of which its own may be parts; ``WORLD`` is itself."""
        return [body if body == WORLD else whole_body(contents, body) for body in (self.a, self.b)]

    def in_order(self, name: str, low: float | None, high: float | None) -> tuple[float, float]:
        """The limits ``low`` and ``high``, in the unit of field ``name``; None: no limit. ValueError if ``low`` is the
        larger, or one is no number."""
        try:
            least, most = -math.inf if low is None else float(low), math.inf if high is None else float(high)
        except (TypeError, ValueError, OverflowError):
            raise ValueError(f"{self._name()}.{name} must be numbers, got {low!r} and {high!r}") from None
        if least > most:
            raise ValueError(f"{self._name()}.{name} must be (least, most), got ({low}, {high})")
        return least, most

    def attach(self, a: Place, b: Place) -> None:
        """Keep what :meth:`rows` needs of where both bodies are when the joint begins to act."""

    def rows(self, dimensions: int) -> list[Row]:
        """The rows that it is now. A joint of a plugin keeps the value of its first row, unless it says otherwise."""
        return [Row(CUSTOM, HOLD, self.start)]

    def hold(self, a: Place, b: Place, anchor: Any) -> None:
        """Keep ``anchor``, (d,) m in the world, as the anchor on both."""
        self.keep(at_a=self.local(a, self.a, anchor), at_b=self.local(b, self.b, anchor), start=b.angle - a.angle)

    def local(self, place: Place, body: int | None, point: Any) -> np.ndarray:
        """(d,) m: a ``point`` of the world along the axes of a ``body`` at ``place``; ValueError if too far away."""
        at = place.local(point)
        if body != WORLD and np.abs(at).max() > FARTHEST:
            raise ValueError(
                f"entity {self.entity}: {type(self).__name__} holds entity {body} at {at.tolist()} along its axes, "
                f"which must be at most {FARTHEST:g} m away"
            )
        return at

    def hold_axis(self, a: Place, b: Place, axis: Any) -> None:
        """In 3D, keep ``axis`` as the axis of both."""
        if len(a.position) == 2:
            return
        axis = unit(axis)
        side = unit(np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))]))
        self.keep(axis_a=a.along(axis), axis_b=b.along(axis), side_a=a.along(side), side_b=b.along(side))

    def turn(self, dimensions: int) -> Row:
        """About the axis; its value is 0 where the joint took hold."""
        if dimensions == 2:
            return Row(TURN, HOLD, self.start)
        return Row(TURN, HOLD, axis=self.axis_a, ends=(self.side_a, self.side_b))

    def counted(self, rows: list[Row], dimensions: int) -> list[Row]:
        """These rows of angles; in space, if there are none, one that is only counted: in a plane rotations are."""
        return rows if rows or dimensions == 2 else [self.turn(dimensions)._replace(rule=FREE)]

    def aligned(self, dimensions: int) -> list[Row]:
        """The axes of both bodies stay parallel."""
        if dimensions == 2:
            return []
        axes, sides = (self.axis_a, self.axis_b), (self.side_a, np.cross(self.axis_a, self.side_a))
        return [Row(ALIGN, HOLD, axis=side, ends=axes) for side in sides]

    def keep(self, **values: Any) -> None:
        """Set what is hidden."""
        self._values.update(values)  # type: ignore[union-attr]
        self._saved = None


def _same(one: Any, other: Any) -> bool:
    if type(one) is float is type(other):
        return one == other
    return one == other if np.isscalar(one) and np.isscalar(other) else np.array_equal(one, other)


def whole_body(contents: Any, body: Any) -> int:
    """The body that an entity is a part of; itself, if it is none."""
    while PartOf in contents.entities.types_of(body):
        body = contents.entities.handle(body, PartOf).body
    return body


def ends_of(name: str) -> property:
    """The property of that name: the fields ``lower`` and ``upper``."""

    def get(self: Any) -> tuple[float | None, float | None] | None:
        """(least, most) in the unit of ``lower`` and ``upper``; None where there is no limit."""
        return None if self.lower is self.upper is None else (self.lower, self.upper)

    def put(self: Any, value: Any) -> None:
        lower, upper = (None, None) if value is None else self._ends(name, value)
        self.set_together(lower=lower, upper=upper)

    return property(get, put)


class Driven(Joint, abstract=True):
    """What has limits, a motor and a spring of its one free value.

    lower, upper, rest
        m or rad: from where to where it may go, None: any; and where the spring draws it to
    motor_speed
        m/s or rad/s; None: no motor
    frequency, damping_ratio
        Hz, of the spring, None: none; 1 where it just does not swing
    """

    __slots__ = ()

    lower: float | None = special_column(unit="m or rad", default=None, optional=True, largest=MOST, kw_only=True)
    upper: float | None = special_column(unit="m or rad", default=None, optional=True, largest=MOST, kw_only=True)
    motor_speed: float | None = special_column(
        unit="m/s or rad/s", default=None, optional=True, largest=MOST, kw_only=True
    )
    frequency: float | None = special_column(
        unit="Hz", default=None, optional=True, positive=True, largest=MOST, kw_only=True
    )
    damping_ratio: float = special_column(unit="1", default=0.0, minimum=0.0, largest=MOST, kw_only=True)
    rest: float = special_column(unit="m or rad", default=0.0, kw_only=True, largest=MOST)

    limits = ends_of("limits")

    def __init__(self, *args: Any, limits: Any = None, **values: Any) -> None:
        if limits is not None:
            values["lower"], values["upper"] = self._ends("limits", limits)
        super().__init__(*args, **values)

    def check(self) -> None:
        self.in_order("limits", self.lower, self.upper)

    def moving(self, row: Row, most: float | None, driven: Row | None = None) -> list[Row]:
        """The rows that drive the value, which is 0 at ``row.low``, or that of ``driven``, with ``most``, are its
        spring, or limit it."""
        rows, limits = [], self.in_order("limits", self.lower, self.upper)
        if self.motor_speed is not None:
            limit = math.inf if most is None else most
            rows.append((driven or row)._replace(rule=DRIVE, target=self.motor_speed, most=limit))
        if self.frequency is not None:
            low, ratio = row.low + self.rest, self.damping_ratio
            rows.append(row._replace(rule=SPRING, low=low, frequency=self.frequency, damping_ratio=ratio))
        if limits != UNLIMITED:  # solved last: no motor is stronger
            rows.append(row._replace(rule=LIMIT, low=row.low + limits[0], high=row.low + limits[1]))
        return rows

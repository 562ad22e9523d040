"""Spin: how a body turns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..framework.compilation import part
from ..framework.data.columns import Column, special_column
from ..framework.data.component import Component
from ..framework.errors import CaromError
from ..framework.matrices import matrix_product
from ..framework.typing import Vector
from ..framework.vectors import item
from .colliders import AABBCollider, Collider
from .part_of import PartOf, rows_of_parts
from .rigid_body import RigidBody, add_push, force_applied
from .second_moments import moments_of

UNKNOWN = "Spin.inertia is None, and it has no collider that tells it, or several: give a number"
FASTEST_TURN = 1e150  # rad/s: squares of it are finite
MOST_TORQUE = 1e150  # N m
ROUNDING = 1e-9  # by which sums of moments may be too small
SINGULAR = 1e-13  # of the trace cubed: a determinant below it is that of a line, and rounding
Angular = float | np.ndarray
# Arguments, checked like fields.
TORQUE = Column(item="angular", owner="Spin", name="apply_torque", largest=MOST_TORQUE)
FORCE = Column(item="vector", owner="Spin", name="apply_force")
IMPULSE = Column(item="vector", owner="Spin", name="apply_impulse")
POINT = Column(item="vector", owner="Spin", name="at")
FORCE_AT = Column(item="angular", owner="Spin", name="apply_force: its torque", largest=MOST_TORQUE)


class InertiaColumn(Column):
    """Principal moments: no body has one that is larger than the sum of the two others."""

    def check_numbers(self, array: np.ndarray, shown: Any, entity: int | None) -> None:
        super().check_numbers(array, shown, entity)
        if array.ndim and array.shape[-1] == 3:
            wrong = np.atleast_1d(2.0 * array.max(axis=-1) > (1.0 + ROUNDING) * array.sum(axis=-1))
            if wrong.any():
                where = "" if array.ndim < 2 else f" (row {int(np.argmax(wrong))})"
                value = array[int(np.argmax(wrong))] if where else array
                rule = f"must be of a body, no moment exceeds the sum of the two others{where}"
                raise self._error(value, rule, entity)


class Spin(Component):
    """How a body turns, in a world with the plugin ``Rotation``.

    angular_velocity
        rad/s; in 3D (3,), along the world's axes
    inertia
        kg m^2 about the body's position; in 3D the (3,) principal moments about its own axes. None: of its mass, spread
        evenly over its last collider, also after that has been removed
    angular_damping
        rate c in 1/s: the angular velocity decays as exp(-c t)
    max_angular_speed
        rad/s, or None
    rolling_friction
        m, 0 or more: contacts resist rolling, and spinning about their normal, with a torque of up to this length times
        the force between the two; the larger of both bodies counts, so that of static ground, too
    constant_torque
        N m, acts always; in 3D (3,), along the world's axes

    Kinematic bodies turn with their angular velocity; dynamic ones under torques and by their contacts, in 3D also as
    their inertia makes them (Euler's equations).
    """

    __slots__ = ()

    excludes: ClassVar[Mapping[type[Component], str]] = {
        AABBCollider: "its sides never turn; give it a BoxCollider, from carom.plugins.rotation"
    }
    makes_body: ClassVar[bool] = True
    needs: ClassVar[tuple[type[Component], ...]] = (RigidBody,)
    plugin: ClassVar[str] = "rotation"
    until_frame_ends: ClassVar[tuple[str, str]] = ("applied_torque", "applied_frame")

    angular_velocity: Angular = special_column(
        unit="rad/s", default=0.0, item="angular", largest=FASTEST_TURN, also=("velocity", "speed", "omega")
    )
    inertia: Angular | None = InertiaColumn(  # type: ignore[assignment]
        unit="kg m^2",
        default=None, item="angular", optional=True, positive=True, also=("moment",)
    )
    angular_damping: float = special_column(unit="1/s", default=0.0, minimum=0.0, kw_only=True, also=("damping",))
    max_angular_speed: float | None = special_column(
        unit="rad/s", default=None, optional=True, minimum=0.0, kw_only=True, also=("max_speed",)
    )
    rolling_friction: float = special_column(unit="m", default=0.0, minimum=0.0, kw_only=True)
    constant_torque: Angular = special_column(
        unit="N m", default=0.0, item="angular", largest=MOST_TORQUE, kw_only=True, also=("torque",)
    )
    # Not for the constructor, as in RigidBody.
    applied_torque: Angular = special_column(unit="N m", default=0.0, item="angular", init=False)
    applied_frame: int = special_column(default=-1, dtype=int, init=False, on_write=force_applied)
    step_torque: Angular = special_column(unit="N m", default=0.0, item="angular", init=False)
    # m^2, of the collider that it had last: inertia per mass, in 3D xx, yy, zz and xy, xz, yz.
    gyration: Angular | None = special_column(unit="m^2", default=None, item="angular", optional=True, init=False)
    gyration_products: Angular = special_column(unit="m^2", default=0.0, item="angular", init=False)

    def apply_torque(self, torque: Angular) -> None:
        """Turn with ``torque``, N m; in 3D (3,), along the world's axes. How long it acts: as a force does, see
        :meth:`RigidBody.apply_force`; kinematic and static bodies do not react."""
        self._turn(self._checked(TORQUE, torque))

    def apply_force(self, force: Vector, at: Vector) -> None:
        """Push with ``force``, (d,) N, at the point ``at`` of the world, (d,) m."""
        push, arm = self._checked(FORCE, force), self._arm(at)
        self._turn(self._checked(FORCE_AT, _cross(arm, push)))  # first: this may be refused
        self._handle(RigidBody).apply_force(push)

    def apply_impulse(self, impulse: Vector, at: Vector) -> None:
        """Change both velocities at once by an ``impulse``, (d,) N s, at the point ``at`` of the world, (d,) m."""
        push, arm, body = self._checked(IMPULSE, impulse), self._arm(at), self._handle(RigidBody)
        if body.kind == "dynamic":
            self.angular_velocity = self.angular_velocity + self._turned_by(_cross(arm, push))  # may be refused
            body.apply_impulse(push)

    def velocity_at(self, point: Vector) -> np.ndarray:
        """(d,) m/s: the velocity of the body at ``point``, (d,) m in the world."""
        return self._handle(RigidBody).linear_velocity + turning_velocity(self.angular_velocity, self._arm(point))

    @property
    def moments(self) -> Angular:
        """kg m^2: the inertia about the body's position; in 3D (3, 3), along its own axes. CaromError if none is given
        and no collider tells it."""
        given, store = self.inertia, self._in_world()
        if given is not None:
            return np.diag(given) if np.ndim(given) else float(given)
        row = store.find(self._entity)
        parts, mass = rows_of_parts(store, int(store.column("entity")[row])), float(store.column("mass")[row])
        if not len(parts):
            found = inertia_without_parts(store, row, mass)
            if found is None:
                raise CaromError(f"entity {self._entity}: {UNKNOWN}")
            return found
        masses, turns = store.column("part_of.added")[parts], store.column("part_of.turn")[parts]
        own, share = mass - masses.sum(), min(1.0, mass / max(masses.sum(), mass))
        total: Any = 0.0
        for k, weight, turn in zip((row, *parts), (own, *share * masses), (0.0, *turns), strict=True):
            found = inertia_without_parts(store, k, weight, turn) if weight > 0.0 else None
            if found is not None:
                total = total + found
        return total

    def _turned_by(self, twist: Any) -> Angular:
        """The change of the angular velocity by an angular impulse, N m s, along the world's axes."""
        moments = self.moments
        if not np.ndim(moments):
            return float(twist / moments) if moments > 0.0 else 0.0
        axes = self._axes()
        return matrix_product(_turned_tensor(axes, _inverse(moments)), twist)

    def _axes(self) -> np.ndarray:
        """The matrix of the body's quaternion w, x, y, z."""
        store = self._in_world()
        return axes_of(store.column("rotation")[store.find(self._entity)])

    def _turn(self, torque: Any) -> None:
        if self._store is None or self._handle(RigidBody).kind == "dynamic":
            add_push(self, torque, ("applied_torque", "step_torque"))

    def _in_world(self) -> Any:
        if self._store is None or self._entity is None:
            raise CaromError(
                "this Spin belongs to no body: a new one does after a look at world.bodies, or a step; that of a "
                "deleted entity does no more"
            )
        return self._store

    def _handle(self, component: type[Any]) -> Any:
        """A handle of another component of the entity."""
        handle = object.__new__(component)
        handle._bind(self._in_world(), self._entity)
        return handle

    def _arm(self, point: Any) -> np.ndarray:
        at = self._checked(POINT, point)
        store = self._in_world()
        return at - store.column("position")[store.find(self._entity)]

    def _checked(self, argument: Column, value: Any) -> Any:
        found = argument.checked(value, self._entity)
        d = -self._version if self._store is None else self._store.dimensions  # below 2 no world knows it yet
        if d > 1:
            argument.check_dimensions(found, d, self._entity)
            found = argument.whole(found, d) if argument.item_shape(d) else found
        return found


def turning_velocity(spin: Any, arm: np.ndarray) -> np.ndarray:
    """(d,) m/s: w x r of a point at an arm (d,) m from the position, with a spin in rad/s."""
    return np.cross(spin, arm) if np.ndim(spin) else spin * np.array((-arm[1], arm[0]))


def axes_of(rotation: np.ndarray) -> np.ndarray:
    """The matrix of a quaternion w, x, y, z."""
    w, x, y, z = rotation.tolist()
    across = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    return np.eye(3) + 2.0 * w * across + 2.0 * matrix_product(across, across)


def _inverse(moments: Any) -> np.ndarray:
    """Of a symmetric matrix; 0 about an axis without inertia."""
    diagonal = np.diagonal(moments)
    if not (moments - np.diag(diagonal)).any():
        return np.diag([1.0 / x if x > 0.0 else 0.0 for x in diagonal.tolist()])
    adjoint = np.array([np.cross(moments[k - 2], moments[k - 1]) for k in range(3)])
    size, whole = float((adjoint[0] * moments[0]).sum()), float(diagonal.sum())
    if size > SINGULAR * whole * whole * whole:
        return adjoint / size
    return np.linalg.pinv(moments, hermitian=True)  # of a line askew


def _turned_tensor(axes: np.ndarray, tensor: Any) -> np.ndarray:
    return matrix_product(matrix_product(axes, tensor), axes.T)


class MassOfShape(NamedTuple):
    """The only collider of a body, as what its mass is spread over.

    centre
        (d,) m from the body's position, along its own axes
    moments
        measure, centre and second moments, as the shape tells them
    """

    centre: np.ndarray
    moments: Any
    offset: np.ndarray

    def inertia(self, mass: float, turn: Any = 0.0) -> Any:
        """kg m^2 about the body's position; in 3D (3, 3), along the axes that it is turned against."""
        xx, yy, zz, xy, xz, yz = inertia_about(self.moments, self.offset, mass)
        if len(self.offset) == 2:
            return float(zz)
        axes = axes_of(turn) if np.ndim(turn) else np.eye(3)
        return _turned_tensor(axes, ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))


def mass_of_shape(store: Any, row: Any) -> MassOfShape | None:
    """That of a row; None without a collider that tells it, or with several."""
    colliders = [component for component in store.types_in(row) if issubclass(component, Collider)]
    if len(colliders) != 1 or not hasattr(colliders[0], "second_moments"):
        return None
    moments = moments_of(colliders[0], store.dimensions).of(store, np.array((row,)))[0]
    offset = store.values(colliders[0].columns["offset"].key, row)
    return MassOfShape(offset + np.array(moments[1 : 1 + store.dimensions]), moments, offset)


def inertia_without_parts(store: Any, row: Any, mass: float, turn: Any = 0.0) -> Any:
    """kg m^2 of a row by its collider, or the one that it had last; None if it had none that tells it."""
    shape = mass_of_shape(store, row)
    if shape is not None:
        return shape.inertia(mass, turn)
    kind = "part_of" if PartOf in store.types_in(row) else "spin"
    if f"{kind}.gyration" not in store.arrays or np.isnan(store.arrays[f"{kind}.gyration"][row]).any():
        return None
    if any(issubclass(component, Collider) for component in store.types_in(row)):
        return None
    own, products = (store.arrays[f"{kind}.{name}"][row] for name in ("gyration", "gyration_products"))
    if store.dimensions == 2:
        return mass * float(own)
    (xx, yy, zz), (xy, xz, yz) = own, products
    axes = axes_of(turn) if np.ndim(turn) else np.eye(3)
    return _turned_tensor(axes, mass * np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))))


def keep_gyration(store: Any, component: type[Component], rows: np.ndarray) -> None:
    """Bodies and parts about to lose that component turn on as they do if it was their only collider."""
    turning = {"spin": Spin, "part_of": PartOf} if issubclass(component, Collider) else {}
    for kind, of in ((kind, of) for kind, of in turning.items() if of in store.mask_names):
        for row in rows[store.has_mask(of)[rows]].tolist():
            shape = mass_of_shape(store, row)
            if shape is not None:
                tensor = shape.inertia(1.0)
                own, products = store.make(f"{kind}.gyration"), store.make(f"{kind}.gyration_products")
                own[row] = np.diagonal(tensor) if np.ndim(tensor) else tensor
                products[row] = tensor[(0, 0, 1), (1, 2, 2)] if np.ndim(tensor) else 0.0


def _cross(arm: np.ndarray, push: np.ndarray) -> Angular:
    """arm x push; in a plane its only component."""
    return np.cross(arm, push) if len(arm) == 3 else float(arm[0] * push[1] - arm[1] * push[0])


@part
def number(values, k):
    """One of several; k need not be known when this compiles."""
    return values[k]


@part
def inertia_about(found, offset, mass):
    """(xx, yy, zz, xy, xz, yz) of the inertia about a body's position, along its own axes, in a plane zz alone: from
    the second moments that its shape tells, about a centre at ``offset``."""
    d, x, y, at_x, at_y = len(offset), item(offset, 0), item(offset, 1), number(found, 1), number(found, 2)
    xx = number(found, 1 + d) + x * (2.0 * at_x + x)
    yy = number(found, 5) + y * (2.0 * at_y + y)
    if d == 2:
        return 0.0, 0.0, mass * (xx + yy), 0.0, 0.0, 0.0
    z, at_z = item(offset, d - 1), number(found, d)
    zz = number(found, d + 3) + z * (2.0 * at_z + z)
    xy = number(found, d + 4) + x * at_y + y * at_x + x * y
    xz = number(found, d + 5) + x * at_z + z * at_x + x * z
    yz = number(found, d + 6) + y * at_z + z * at_y + y * z
    return mass * (yy + zz), mass * (xx + zz), mass * (xx + yy), -mass * xy, -mass * xz, -mass * yz

"""RigidBody: mass, velocity and forces of a body."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from ..framework.data import esper_bridge
from ..framework.data.columns import Column, special_column
from ..framework.data.component import Component
from ..framework.data.driven import drive
from ..framework.data.table import KINDS
from ..framework.errors import CaromError
from ..framework.typing import Vector, VectorField

WEIGHTLESS = 1e-200  # kg, of the RigidBody of a part: what a part weighs is in its body's mass
FASTEST = 1e307  # m/s along each axis: differences of two such velocities, and their lengths, are finite
OF_A_SPIN = (
    "angular_velocity", "inertia", "moment", "angular_damping", "max_angular_speed", "rolling_friction", "torque",
    "constant_torque", "apply_torque", "apply_angular_impulse", "velocity_at", "moments",
)  # fmt: skip
AT_A_POINT = (
    "RigidBody.{0} acts at the centre and turns nothing: world.component_for_entity(entity, Spin).{0}(..., at=point) "
    "turns the body too, from carom import Spin"
)
Kind = Literal["dynamic", "kinematic", "static"]
# Arguments, checked like fields.
FORCE = Column(item="vector", owner="RigidBody", name="apply_force")
IMPULSE = Column(item="vector", owner="RigidBody", name="apply_impulse")
PLACE = Column(item="vector", owner="RigidBody", name="move_to")
TURN = Column(item="rotation", owner="RigidBody", name="move_to: its rotation")


def force_applied(table: Any, row: int) -> None:
    """A push was applied from outside a step."""
    table.frames_applied = True


def add_push(handle: Any, push: Any, names: tuple[str, str]) -> None:
    """Add a push to the first of these columns, till the frame ends, or inside a system to the second, for one step."""
    store, (applied, step) = handle._store, names
    if store.in_step if hasattr(store, "in_step") else esper_bridge.step_is_running():
        setattr(handle, step, getattr(handle, step) + push)
        return
    frame = getattr(store, "frame", 0)
    setattr(handle, applied, getattr(handle, applied) + push if handle.applied_frame == frame else 0.0 + push)
    handle.applied_frame = frame


def _kind_written(table: Any, row: int) -> None:
    table.kind_changed = True


class RigidBody(Component, flat=True):
    """How a body moves.

    mass
        kg, above zero
    linear_velocity
        (d,) m/s, along each axis at most 1e307
    constant_force
        (d,) N, acts always
    gravity_scale
        factor on the world's gravity
    linear_damping
        rate c in 1/s: speed decays as exp(-c t)
    kind
        dynamic: moved by forces and contacts; kinematic: moved by its velocity alone, as if infinitely heavy;
        static: does not move
    max_linear_speed
        m/s, or None
    ccd
        continuous collision detection: in a discrete world, this body and what it meets are swept as in a continuous
        one, so that it never jumps through anything
    """

    __slots__ = ()

    makes_body: ClassVar[bool] = True
    until_frame_ends: ClassVar[tuple[str, ...]] = ("applied_force", "applied_frame")

    mass: float = special_column(unit="kg", default=1.0, positive=True)
    linear_velocity: VectorField = special_column(
        unit="m/s", default=0.0, item="vector", largest=FASTEST, also=("velocity", "speed")
    )
    constant_force: VectorField = special_column(
        unit="N", default=0.0, item="vector", kw_only=True, on_demand=True, also=("force",)
    )
    gravity_scale: float = special_column(unit="1", default=1.0, kw_only=True, on_demand=True, also=("gravity",))
    linear_damping: float = special_column(
        unit="1/s", default=0.0, minimum=0.0, kw_only=True, on_demand=True, also=("damping", "drag")
    )
    kind: Kind = special_column(
        default="dynamic", choices=KINDS, kw_only=True, on_write=_kind_written, also=("type", "body_type")
    )
    max_linear_speed: float | None = special_column(
        unit="m/s", default=None, optional=True, minimum=0.0, kw_only=True, on_demand=True, also=("max_speed",)
    )
    ccd: bool = special_column(default=False, dtype=bool, kw_only=True, on_demand=True, also=("bullet", "continuous"))
    # Not for the constructor: pushes until the frame ends, the frame they are of, and pushes for one step.
    applied_force: VectorField = special_column(unit="N", default=0.0, item="vector", on_demand=True, init=False)
    applied_frame: int = special_column(default=-1, dtype=int, on_demand=True, init=False, on_write=force_applied)
    step_force: VectorField = special_column(unit="N", default=0.0, item="vector", on_demand=True, init=False)

    @classmethod
    def _unknown(cls, name: str) -> TypeError:
        if name not in OF_A_SPIN:
            return super()._unknown(name)
        return TypeError(f"RigidBody has no field {name!r}: that of a Spin turns bodies, from carom import Spin")

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            if name not in OF_A_SPIN:
                return super().__getattr__(name)
            raise AttributeError(
                f"RigidBody has no attribute {name!r}: world.component_for_entity(entity, Spin) turns bodies, "
                f"from carom import Spin"
            )

        def __setattr__(self, name: str, value: Any) -> None:
            if name in OF_A_SPIN:
                getattr(self, name)
            super().__setattr__(name, value)

    @property
    def asleep(self) -> bool:
        """Whether the body sleeps: see ``Settings.sleeping``."""
        store: Any = self._store
        if not hasattr(store, "asleep") or self._entity is None:
            return False
        row = store.find(self._entity)
        return bool(store.asleep(slice(row, row + 1))[0])

    def apply_impulse(self, impulse: Vector | float, *, at: None = None) -> None:
        """Change the velocity at once by impulse / mass; (d,) N s. Kinematic and static bodies do not react. TypeError
        for a point ``at`` which it is to act: see :meth:`Spin.apply_impulse`."""
        if at is not None:
            raise TypeError(AT_A_POINT.format("apply_impulse"))
        if self.kind == "dynamic":
            self.linear_velocity = self.linear_velocity + self._vector(IMPULSE, impulse) / self._own_mass()

    def apply_force(self, force: Vector | float, *, at: None = None) -> None:
        """Push with ``force``, (d,) N; TypeError for a point ``at`` which it is to act, as of :meth:`apply_impulse`.

        Inside a system: for that step, or for the next one if this step has moved the bodies already. Outside: in
        every step of the next ``step()`` or ``advance()`` that takes one. Forces of one frame add up; those of a frame
        that took no step give way to the next frame's, so a push held down is the same at any frame rate. Kinematic
        and static bodies do not react.
        """
        if at is not None:
            raise TypeError(AT_A_POINT.format("apply_force"))
        push = self._vector(FORCE, force)
        store: Any = self._store
        if self.kind != "dynamic":
            return
        if hasattr(store, "in_step") and store.in_step and store.forces_are_summed():
            store.make("force")[store.find(self._entity)] += push
        else:
            add_push(self, push, ("applied_force", "step_force"))

    def move_to(self, position: Vector | float, rotation: Any = None) -> None:
        """Have the velocity with which the next step ends there, and stand still after it: a kinematic body that is
        moved so in each step, by a tween, carries and pushes with its true speed.

        position
            (d,) m; the step ends there to within 2**-53 of it and 2**-51 of the way
        rotation
            rad, in 3D a unit quaternion, the short way, of a body with a :class:`Spin`. None: it turns as it did

        Within a step that has moved the bodies already it is for the next one. CaromError before a world has taken the
        body; ValueError if it is not kinematic, has no Spin and is to turn, or cannot come there.
        """
        store: Any = self._store
        if getattr(store, "clock", None) is None:
            raise CaromError("this RigidBody is in no world yet: a look at world.bodies, or a step, takes it there")
        if self.kind != "kinematic":
            why = f'RigidBody.move_to moves kinematic bodies, RigidBody(kind="kinematic"): this one is {self.kind}'
            raise ValueError(f"entity {self._entity}: {why}")
        place, d = self._vector(PLACE, position), store.dimensions
        turn = None if rotation is None else TURN.checked(rotation, self._entity)
        if turn is not None:
            TURN.check_dimensions(turn, d, self._entity)
            turn = np.array([turn if np.ndim(turn) else TURN.whole(turn, d)])
        drive(store, np.array([store.find(self._entity)]), PLACE.whole(place, d)[None], turn, "RigidBody.move_to")

    def _own_mass(self) -> float:
        """kg; of a part that which it goes on with once it is none, also before the next step knows that it is none."""
        store: Any = self._store
        mass = self.mass
        if mass == WEIGHTLESS and "part_of.added" in getattr(store, "arrays", ()):
            return store.column("part_of.added").item(store.find(self._entity)) or 1.0
        return mass

    def _vector(self, argument: Column, value: Any) -> Any:
        vector, velocity = argument.checked(value, self._entity), self.linear_velocity
        if np.ndim(velocity):
            argument.check_dimensions(vector, len(velocity), self._entity)
        return vector

"""RigidBody: mass, velocity and forces of a body."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

import numpy as np

from ..framework.data import esper_bridge
from ..framework.data.columns import Column, column, on_demand
from ..framework.data.component import Component
from ..framework.data.table import KINDS

FASTEST = 1e307  # m/s along each axis: differences of two such velocities, and their lengths, are finite
Kind = Literal["dynamic", "kinematic", "static"]
# Arguments, checked like fields.
FORCE = Column(item="vector", owner="RigidBody", name="apply_force")
IMPULSE = Column(item="vector", owner="RigidBody", name="apply_impulse")


def _force_applied(table: Any, row: int) -> None:
    table.frames_applied = True


def _kind_written(table: Any, row: int) -> None:
    table.kind_changed = True


class RigidBody(Component, flat=True):
    """How a body moves.

    mass
        kilograms, above zero
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

    mass = column(1.0, positive=True)
    linear_velocity = dataclasses.replace(column(0.0, item="vector"), largest=FASTEST)
    constant_force = on_demand(column(0.0, item="vector"))
    gravity_scale = on_demand(column(1.0))
    linear_damping = on_demand(column(0.0, minimum=0.0))
    kind = dataclasses.replace(column("dynamic", choices=KINDS), on_write=_kind_written)
    max_linear_speed = on_demand(column(None, optional=True, minimum=0.0))
    ccd = on_demand(column(False, dtype=bool))
    applied_force = dataclasses.replace(on_demand(column(0.0, item="vector")), constructor=False)  # till the frame ends
    applied_frame = dataclasses.replace(on_demand(column(-1, dtype=int)), constructor=False, on_write=_force_applied)
    step_force = dataclasses.replace(on_demand(column(0.0, item="vector")), constructor=False)  # for one step

    def __init__(
        self,
        mass: float = 1.0,
        linear_velocity: Any = 0.0,
        *,
        constant_force: Any = 0.0,
        gravity_scale: float = 1.0,
        linear_damping: float = 0.0,
        kind: Kind = "dynamic",
        max_linear_speed: float | None = None,
        ccd: bool = False,
    ) -> None:
        self._fill(
            {
                "mass": mass,
                "linear_velocity": linear_velocity,
                "constant_force": constant_force,
                "gravity_scale": gravity_scale,
                "linear_damping": linear_damping,
                "kind": kind,
                "max_linear_speed": max_linear_speed,
                "ccd": ccd,
            }
        )

    def apply_impulse(self, impulse: Any) -> None:
        """Change the velocity at once by impulse / mass; (d,) N s. Kinematic and static bodies do not react."""
        if self.kind == "dynamic":
            self.linear_velocity = self.linear_velocity + self._vector(IMPULSE, impulse) / self.mass

    def apply_force(self, force: Any) -> None:
        """Push with ``force``, (d,) N.

        Inside a system: for that step, or for the next one if this step has moved the bodies already. Outside: in
        every step of the next ``step()`` or ``advance()`` that takes one. Forces of one frame add up; those of a frame
        that took no step give way to the next frame's, so a push held down is the same at any frame rate. Kinematic
        and static bodies do not react.
        """
        force = self._vector(FORCE, force)
        store: Any = self._store
        if self.kind != "dynamic":
            return
        if store.in_step if hasattr(store, "in_step") else esper_bridge.step_is_running():
            if hasattr(store, "in_step") and store.forces_are_summed():
                store.make("force")[store.find(self._entity)] += force
            else:
                self.step_force = self.step_force + force
            return
        frame = getattr(store, "frame", 0)
        self.applied_force = self.applied_force + force if self.applied_frame == frame else 0.0 + force
        self.applied_frame = frame

    def _vector(self, argument: Column, value: Any) -> Any:
        vector, velocity = argument.checked(value, self._entity), self.linear_velocity
        if np.ndim(velocity):
            argument.check_dimensions(vector, len(velocity), self._entity)
        return vector

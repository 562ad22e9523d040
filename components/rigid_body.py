"""RigidBody: mass, velocity and what acts on a body."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

import numpy as np

from ..framework.columns import column
from ..framework.component import Component
from ..framework.table import KINDS

Kind = Literal["dynamic", "kinematic", "static"]


def _kind_written(table: Any, row: int) -> None:
    table.kind_changed = True


class RigidBody(Component, flat=True):
    """How a body moves.

    mass
        kilograms, above zero
    linear_velocity
        (d,) m/s
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
    """

    __slots__ = ()

    mass = column(1.0, positive=True)
    linear_velocity = column(0.0, item="vector")
    constant_force = column(0.0, item="vector")
    gravity_scale = column(1.0)
    linear_damping = column(0.0, minimum=0.0)
    kind = dataclasses.replace(column("dynamic", choices=KINDS), on_write=_kind_written)
    max_linear_speed = column(None, optional=True, minimum=0.0)
    applied_force = dataclasses.replace(column(0.0, item="vector"), constructor=False)  # until the window's end
    step_force = dataclasses.replace(column(0.0, item="vector"), constructor=False)  # for one step

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
            }
        )

    def apply_impulse(self, impulse: Any) -> None:
        """Change the velocity at once by impulse / mass; (d,) N s. Kinematic and static bodies do not react."""
        if self.kind == "dynamic":
            self.linear_velocity = self.linear_velocity + self._vector(impulse, "impulse") / self.mass

    def apply_force(self, force: Any) -> None:
        """Push with ``force``, (d,) N.

        Inside a system: for that step, or for the next one if this step has moved the bodies already. Outside: in
        every step of the next ``step()`` or ``advance()`` that takes one.
        """
        force = self._vector(force, "force")
        store = self._store
        if store is None or not getattr(store, "in_step", False):
            self.applied_force = self.applied_force + force
        elif store.forces_summed:
            row = store.find(self._entity)
            store.arrays["force"][row] += force
        else:
            self.step_force = self.step_force + force

    def _vector(self, value: Any, name: str) -> np.ndarray:
        vector = np.asarray(value, float)
        velocity = np.asarray(self.linear_velocity)
        if vector.ndim > 1 or not np.isfinite(vector).all() or (
            vector.ndim == velocity.ndim == 1 and vector.shape != velocity.shape
        ):
            raise ValueError(f"{name} must be {velocity.shape[0] if velocity.ndim else 'd'} finite numbers, got {value!r}")
        return vector

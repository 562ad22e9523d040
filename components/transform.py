"""Transform: position and rotation of a body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..framework.data.columns import special_column
from ..framework.data.component import Component
from ..framework.data.interpolation import interpolated, restart
from ..framework.typing import RotationField, VectorField


def _teleport(table: Any, row: int) -> None:
    """An assigned position is a teleport: no sweep, and interpolation restarts."""
    restart(table, row, ("position",))


def _turn_at_once(table: Any, row: int) -> None:
    """The same of an assigned rotation."""
    restart(table, row, ("rotation",))
    if table.stops[0] <= row < table.stops[1]:
        table.turned.add(int(table.column("entity")[row]))


class Transform(Component, flat=True):
    """Position, (d,) m, and rotation: an angle in 2D, rad, a unit quaternion (w, x, y, z) in 3D.

    Rotation is set by the game, or by a Spin; it enlarges boxes and turns offsets. Assigning ``position`` is a
    teleport; a single number is a ValueError. For a dynamic or kinematic body ``position`` is a writable view.
    """

    __slots__ = ()

    position: VectorField = special_column(unit="m", item="vector", on_write=_teleport, also=("pos", "location"))
    rotation: RotationField = special_column(
        unit="rad or 1", default=0.0, item="rotation", on_demand=True, on_write=_turn_at_once, also=("angle",)
    )

    def _fill(self, given: Mapping[str, Any]) -> None:
        position = given.get("position", ())
        if type(position) is not tuple and np.ndim(position) == 0:
            raise ValueError(f"Transform.position must be 2 or 3 numbers, got {position!r}")
        super()._fill(given)

    @property
    def x(self) -> float:
        """m, the position along the first axis; may be set."""
        return self._get(0)

    @x.setter
    def x(self, value: float) -> None:
        self._set(0, value)

    @property
    def y(self) -> float:
        """m, along the second axis."""
        return self._get(1)

    @y.setter
    def y(self, value: float) -> None:
        self._set(1, value)

    @property
    def z(self) -> float:
        """m, along the third axis; IndexError in 2D."""
        return self._get(2)

    @z.setter
    def z(self, value: float) -> None:
        self._set(2, value)

    def _get(self, axis: int) -> float:
        position = self.position
        return float(position[axis] if np.ndim(position) else position)  # a single number holds for all axes

    def _set(self, axis: int, value: float) -> None:
        position = np.array(self.position)
        if not position.ndim:
            raise ValueError(f"Transform.position is {self.position!r} for every axis: assign the whole position")
        position[axis] = value
        self.position = position

    @property
    def interpolated_position(self) -> np.ndarray:
        """(d,) m between the last two steps, by ``world.alpha``: the position to draw."""
        return self._interpolated("position")

    @property
    def interpolated_rotation(self) -> float | np.ndarray:
        """The rotation to draw, of a body that turns by its Spin: rad in 2D, (4,) in 3D."""
        found = self._interpolated("rotation")
        return found if found.ndim else float(found)

    def _interpolated(self, name: str) -> np.ndarray:
        store: Any = self._store
        if not hasattr(store, "clock"):  # of no world
            return np.array(getattr(self, name))
        row = self._row if self._version == store.version else self._locate()
        return interpolated(store, name, row)

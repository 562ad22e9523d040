"""What a character wishes, how it moves, and what it knows: columns all."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np

from ...components import RigidBody
from ...framework import Component, column
from ...framework.data.columns import Column, special_column
from ...framework.data.component import NOTHING
from ...framework.typing import RotationField, VectorField
from .checks import refusal
from .records import LEAVES, NEVER, STATES


class SlopeColumn(Column):
    """An angle from the horizontal, up to a right one."""

    def check_numbers(self, array: np.ndarray, shown: Any, entity: int | None) -> None:
        if not np.all((array >= 0.0) & (array <= math.pi / 2)):
            rule = "must be from 0 to pi / 2, in radians: math.radians(45)"
            raise self._error(array.tolist() if shown is None else shown, rule, entity)


class UpColumn(Column):
    """A direction, of any length but 0."""

    def checked(self, value: Any, entity: int | None = None) -> Any:
        made = super().checked(value, entity)
        if not np.any(made):
            raise self._error(value, "must be a direction, not 0", entity)
        return made

    def check_numbers(self, array: np.ndarray, shown: Any, entity: int | None) -> None:
        super().check_numbers(array, shown, entity)
        if not np.all(np.any(array, axis=-1)):
            raise self._error(array.tolist() if shown is None else shown, "must be a direction, not 0", entity)


def known(default: Any = 0.0, **options: Any) -> Any:
    """A column that the plugin writes."""
    return column(default, init=False, **options)


class Ladder(Component):
    """On a sensor: characters that are in it can climb."""

    __slots__ = ()
    plugin: ClassVar[str] = "character"
    plugin_class: ClassVar[str] = "Characters"


class Character(Component):
    """Makes a kinematic body with one collider walk, jump, climb and ride.

    Wishes, written before the step:

    move
        m/s along the ground; in 2D one number, positive to the right of up; in 3D a vector, whose part along up counts
        for nothing
    climb
        m/s on a :class:`Ladder`
    jump, drop
        whether the keys are held: to jump, to fall through what holds from one side only

    Settings:

    max_slope
        rad, from 0 to pi / 2: it walks on slopes up to that, and slides down steeper ones
    step_height, snap
        m: it steps onto edges so high; it stays on a floor that falls away by so much in a step
    skin
        m, above 0, that it keeps to all it meets on its own way
    acceleration, air_acceleration
        m/s^2, towards ``move`` on the ground and in the air
    gravity
        m/s^2; None: as strong as the world's
    max_fall
        m/s
    jump_speed, jump_height
        m/s, 9 if neither is given, or m
    jump_cut
        of the speed upwards, what is left when jump is let go on the way up
    coyote, buffer
        s: it may still jump so long after it has left the ground, and jumps if the key was pressed so long before it
        lands
    air_jumps
        how often it may jump again before it lands
    wall_slide
        m/s: it falls no faster while it walks into a wall; None: as fast as elsewhere
    wall_jump, wall_jump_up
        m/s away from the wall, 0 for none, and upwards; None: as fast as other jumps
    push_force
        N, on what it walks against, which gets no faster than it wants to walk
    pushable
        whether characters that meet it push it, against the mass of its body; else they block each other
    weight
        N, on a dynamic body that it stands on
    up
        (d,) a direction; None: against gravity, and the second axis without any
    leave
        of the velocity of what has carried it, what it keeps when it leaves: ``"all"``, ``"up"``, the part upwards, or
        ``"none"``; a jump loses nothing by a floor that sinks

    What it knows after the step:

    state
        ``"air"``, ``"floor"``, ``"steep"``, on a slope that is too steep, or ``"climb"``
    velocity
        (d,) m/s, its own, without what carries it
    floor_entity, floor_normal, floor_velocity
        what it stands on, -1 for nothing; (d,) a unit vector, 0 in the air; (d,) m/s
    on_wall, wall_entity, wall_normal
        whether it touches a wall, or walks into one, not over a step; which, -1 for none; (d,) a unit vector away from
        the last one
    on_ceiling
        whether it has run against something above
    crushed
        the entity that squeezes it, -1 for none
    """

    __slots__ = ()
    plugin: ClassVar[str] = "character"
    plugin_class: ClassVar[str] = "Characters"
    needs: ClassVar[tuple[type[Component], ...]] = (RigidBody,)

    move: RotationField = column(0.0, item="angular", unit="m/s")
    climb: float = column(0.0, unit="m/s")
    jump: bool = column(default=False, dtype=bool)
    drop: bool = column(default=False, dtype=bool)

    max_slope: float = SlopeColumn(math.radians(50.0), minimum=0.0, largest=math.pi / 2, kw_only=True, unit="rad")  # type: ignore[assignment]
    step_height: float = column(0.3, minimum=0.0, kw_only=True, unit="m")
    snap: float = column(0.3, minimum=0.0, kw_only=True, unit="m")
    skin: float = column(0.01, positive=True, kw_only=True, unit="m")
    acceleration: float = column(80.0, minimum=0.0, kw_only=True, unit="m/s^2")
    air_acceleration: float = column(40.0, minimum=0.0, kw_only=True, unit="m/s^2")
    gravity: float | None = column(None, minimum=0.0, optional=True, kw_only=True, unit="m/s^2")
    max_fall: float = column(30.0, minimum=0.0, kw_only=True, unit="m/s")
    jump_speed: float | None = column(None, minimum=0.0, optional=True, kw_only=True, unit="m/s")
    jump_height: float | None = column(None, minimum=0.0, optional=True, kw_only=True, unit="m")
    jump_cut: float = special_column(1.0, minimum=0.0, largest=1.0, kw_only=True, unit="1")
    coyote: float = column(0.1, minimum=0.0, kw_only=True, unit="s")
    buffer: float = column(0.1, minimum=0.0, kw_only=True, unit="s")
    air_jumps: int = column(0, dtype=int, minimum=0, kw_only=True)
    wall_slide: float | None = column(None, minimum=0.0, optional=True, kw_only=True, unit="m/s")
    wall_jump: float = column(0.0, minimum=0.0, kw_only=True, unit="m/s")
    wall_jump_up: float | None = column(None, minimum=0.0, optional=True, kw_only=True, unit="m/s")
    push_force: float = column(60.0, minimum=0.0, kw_only=True, unit="N")
    pushable: bool = column(default=False, dtype=bool, kw_only=True)
    weight: float = column(0.0, minimum=0.0, kw_only=True, unit="N")
    up: VectorField = UpColumn(None, item="vector", optional=True, kw_only=True, unit="1")  # type: ignore[assignment]
    leave: Literal["all", "up", "none"] = column("all", choices=LEAVES, kw_only=True)

    state: Literal["air", "floor", "steep", "climb"] = known("air", choices=STATES)
    velocity: VectorField = known(item="vector", unit="m/s")
    floor_entity: int = known(-1, dtype=int)
    floor_normal: VectorField = known(item="vector", unit="1")
    floor_velocity: VectorField = known(item="vector", unit="m/s")
    on_wall: bool = known(default=False, dtype=bool)
    wall_normal: VectorField = known(item="vector", unit="1")
    wall_entity: int = known(-1, dtype=int)
    on_ceiling: bool = known(default=False, dtype=bool)
    crushed: int = known(-1, dtype=int)
    # Its memory: seconds since, whether the key was held, where it was left, what others have given it, with what force
    # it pushes what, and the floor as it was last seen: its middle, from there to the point of it that is under the
    # character's middle, and its axes.
    since_floor: float = known(NEVER, unit="s")
    since_press: float = known(NEVER, unit="s")
    since_wall: float = known(NEVER, unit="s")
    since_drop: float = known(NEVER, unit="s")
    held: bool = known(default=False, dtype=bool)
    jumping: bool = known(default=False, dtype=bool)
    air_jumped: int = known(0, dtype=int)
    place: VectorField = known(item="vector", unit="m")
    pushed: VectorField = known(item="vector", unit="m/s")
    push: VectorField = known(item="vector", unit="N")
    push_entity: int = known(-1, dtype=int)
    push_row: int = known(-1, dtype=int)
    floor_row: int = known(-1, dtype=int)
    floor_place: VectorField = known(item="vector", unit="m")
    floor_arm: VectorField = known(item="vector", unit="m")
    floor_x: VectorField = known(item="vector", unit="1")
    floor_y: VectorField = known(item="vector", unit="1")

    def check_in(self, contents: Any, entity: int | None, beside: Mapping[type[Any], Any] = NOTHING) -> None:
        """ValueError if its entity cannot be a character."""
        own = {} if entity is None else contents.entities.get(entity, {})
        body = beside.get(RigidBody) or own.get(RigidBody)
        why = refusal(entity, {*beside, *own}, "static" if body is None else body.kind)
        if why:
            raise ValueError(why)
        if self.jump_speed is not None and self.jump_height is not None:
            name = "Character" if entity is None else f"entity {entity}: Character"
            raise ValueError(
                f"{name} takes a jump_speed or a jump_height, got {self.jump_speed} and {self.jump_height}"
            )


WRITTEN = tuple(name for name, each in Character.columns.items() if not each.constructor)

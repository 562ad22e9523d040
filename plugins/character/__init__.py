"""Characters: ``World(Physics(), Characters())``, then kinematic bodies with a collider and a ``Character(...)``."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any, ClassVar, Literal

from ...components import Collider, RigidBody, Transform
from ...components.part_of import PartOf
from ...components.spin import Spin
from ...framework import Component, Plugin, World, column
from ...framework.data.columns import special_column
from ...framework.typing import VectorField
from ...framework.vectors import add, dot, scale
from ...systems.queries.compiled import NEAR
from .records import CRUSHED, HIT, LANDED, LEAVES, MOST_HITS, NEVER, ROWS, STATES, WORK
from .walk import move_one

__all__ = ["Character", "Characters", "Ladder"]

EVENTS = {CRUSHED: "crushed", LANDED: "landed", HIT: "character_hit"}


def known(default: Any = 0.0, **options: Any) -> Any:
    """A column that the plugin writes."""
    return special_column(default, init=False, **options)


class Ladder(Component):
    """On a sensor: characters in it climb."""

    __slots__ = ()
    plugin: ClassVar[str] = "character"


class Character(Component):
    """..."""

    __slots__ = ()
    plugin: ClassVar[str] = "character"
    needs: ClassVar[tuple[type[Component], ...]] = (RigidBody,)

    # wishes, written before the step
    move: Angular = column(0.0, item="angular", unit="m/s")
    climb: float = column(0.0, unit="m/s")
    jump: bool = column(default=False, dtype=bool)
    drop: bool = column(default=False, dtype=bool)
    # settings
    max_slope: float = special_column(math.radians(50.0), kw_only=True, minimum=0.0, largest=math.pi / 2, unit="rad")
    step_height: float = column(0.3, minimum=0.0, kw_only=True, unit="m")
    snap: float = column(0.3, minimum=0.0, kw_only=True, unit="m")
    skin: float = column(0.01, positive=True, kw_only=True, unit="m")
    acceleration: float = column(80.0, minimum=0.0, kw_only=True, unit="m/s^2")
    air_acceleration: float = column(40.0, minimum=0.0, kw_only=True, unit="m/s^2")
    gravity: float | None = column(None, minimum=0.0, optional=True, kw_only=True, unit="m/s^2")
    max_fall: float = column(30.0, minimum=0.0, kw_only=True, unit="m/s")
    jump_speed: float = column(9.0, minimum=0.0, kw_only=True, unit="m/s")
    jump_height: float | None = column(None, minimum=0.0, optional=True, kw_only=True, unit="m")
    jump_cut: float = column(1.0, minimum=0.0, kw_only=True, unit="1")
    coyote: float = column(0.1, minimum=0.0, kw_only=True, unit="s")
    buffer: float = column(0.1, minimum=0.0, kw_only=True, unit="s")
    air_jumps: int = column(0, dtype=int, minimum=0, kw_only=True)
    wall_slide: float | None = column(None, minimum=0.0, optional=True, kw_only=True, unit="m/s")
    wall_jump: float = column(0.0, minimum=0.0, kw_only=True, unit="m/s")
    wall_jump_up: float | None = column(None, minimum=0.0, optional=True, kw_only=True, unit="m/s")
    push_force: float = column(60.0, minimum=0.0, kw_only=True, unit="N")
    pushable: bool = column(default=False, dtype=bool, kw_only=True)
    weight: float = column(0.0, minimum=0.0, kw_only=True, unit="N")
    up: VectorField | None = column(None, item="vector", optional=True, kw_only=True, unit="1")
    leave: Literal["all", "up", "none"] = column("all", choices=LEAVES, kw_only=True)
    # what it knows
    state: str = known("air", choices=STATES)
    velocity: VectorField = known(item="vector", unit="m/s")
    floor_entity: int = known(-1, dtype=int)
    floor_normal: VectorField = known(item="vector", unit="1")
    floor_velocity: VectorField = known(item="vector", unit="m/s")
    on_wall: bool = known(default=False, dtype=bool)
    wall_normal: VectorField = known(item="vector", unit="1")
    wall_entity: int = known(-1, dtype=int)
    on_ceiling: bool = known(default=False, dtype=bool)
    crushed: int = known(-1, dtype=int)
    # what it remembers
    since_floor: float = known(NEVER, unit="s")
    since_press: float = known(NEVER, unit="s")
    since_wall: float = known(NEVER, unit="s")
    since_drop: float = known(NEVER, unit="s")
    held: bool = known(default=False, dtype=bool)
    jumping: bool = known(default=False, dtype=bool)
    air_jumped: int = known(0, dtype=int)
    pushed: VectorField = known(item="vector", unit="m/s")
    floor_row: int = known(-1, dtype=int)
    floor_place: VectorField = known(item="vector", unit="m")
    floor_x: VectorField = known(item="vector", unit="1")
    floor_y: VectorField = known(item="vector", unit="1")


WRITTEN = tuple(name for name, each in Character.columns.items() if not each.constructor)


class Characters(Plugin):
    """Moves the bodies that have a :class:`Character`, last in the step."""

    def __init__(self) -> None:
        super().__init__("character", version="1.0", needs_physics=True)
        self.component(Character)
        self.component(Ladder)
        self.event(*EVENTS.values())
        self.stage(
            before="update_sleep", records=(Character, NEAR, WORK), optional=(Ladder,), needed="colliders",
            reads=("tree", "static_tree", "grid", "static_grid", *(f"character.{name}" for name in Character.columns)),
            writes=("position", "linear_velocity", *(f"character.{name}" for name in WRITTEN)),
        )(move_characters)  # fmt: skip

    def install(self, world: World) -> None:
        """Called by the world; NoPhysicsError if it has none."""
        super().install(world)
        world.physics.plugin_stages.finishers.append(tell_events)


def tell_events(world: Any) -> None:
    """What has happened to characters in the step, in their order."""
    work = world.physics.record(WORK)
    count, work.events = work.events, 0
    for k in range(count):
        name, entity, other = EVENTS[int(work.event[k])], int(work.entity[k]), int(work.other[k])
        if name == "crushed":
            world.events.dispatch(name, entity, other)
        elif name == "landed":
            world.events.dispatch(name, entity, other, float(work.speed[k]))
        else:
            world.events.dispatch(name, entity, other, work.normal[k].copy(), float(work.speed[k]))


def move_characters(state, dt, character, near, work, ladder):
    """Characters walk, jump, climb and are carried"""
    count = 0
    for i in range(state.dynamic, state.moving):
        count += character.present[i]
    rows = max(ROWS, state.count, 2 * MOST_HITS * count)
    if len(work.event) < rows or len(near.row) < rows:
        return rows
    work.events = work.pushes = 0
    for i in range(state.dynamic, state.moving):
        if character.present[i]:
            move_one(state, near, character, ladder, work, i, dt)
    bodies = state.bodies
    for i in range(state.dynamic, state.moving):
        if character.present[i]:
            bodies.position[i], character.velocity[i] = work.place[i], work.velocity[i]
            character.pushed[i] = scale(work.place[i], 0.0)
    for k in range(work.pushes):
        j = work.pushed[k]
        change, most = work.push[j], work.most_push[j]
        size = math.sqrt(dot(change, change))
        velocity = character.velocity[j] if character.present[j] else bodies.linear_velocity[j]
        speed = dot(velocity, change) / size
        change = scale(change, max(0.0, min(size, most - speed)) / size)
        if character.present[j]:
            character.pushed[j] = change
        else:
            bodies.linear_velocity[j] = add(velocity, change)
        work.push[j], work.most_push[j] = scale(change, 0.0), 0.0
    work.statics_version = state.statics_version
    return rows

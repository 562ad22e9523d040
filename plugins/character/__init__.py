"""Characters: ``World(Physics(), Characters())``, then kinematic bodies with a collider and a ``Character(...)``."""

from __future__ import annotations

from typing import Any

from ...components.spin import Spin
from ...framework import Plugin
from ...systems.queries.compiled import NEAR
from .checks import CharacterCheck
from .component import WRITTEN, Character, Ladder
from .records import CRUSHED, HIT, LANDED, WORK
from .stage import move_characters, press_bodies, tilt_bodies

__all__ = ["Character", "Characters", "Ladder"]

EVENTS = {CRUSHED: "crushed", LANDED: "landed", HIT: "character_hit"}


class Characters(Plugin):
    """Moves the bodies that have a :class:`Character`: last in the step, when all else is where it will be drawn.

    Sends ``crushed(entity, by)`` when something begins to squeeze one, ``landed(entity, floor, speed)``, and
    ``character_hit(entity, other, normal, speed)`` for what it runs against and for sensors that it comes into on its
    way in this step; normals lead from the other to the character, speeds are m/s.
    """

    def __init__(self) -> None:
        super().__init__("character", version="1.0", needs_physics=True)
        self.component(Character)
        self.component(Ladder)
        self.event(*EVENTS.values())
        self.before_step(CharacterCheck(Character))
        self.after_step(tell_events)
        settings = tuple(f"character.{name}" for name in Character.columns if name not in WRITTEN)
        known = tuple(f"character.{name}" for name in WRITTEN)
        self.stage(after="sum_forces", records=(Character,), reads=(*settings, *known), writes=("force",))(press_bodies)
        self.stage(
            after="read_bodies", records=(Character,), optional=(Spin,),
            reads=("position", *settings, *known), writes=("spin.step_torque",),
        )(tilt_bodies)  # fmt: skip
        self.stage(
            before="update_sleep", records=(Character, NEAR, WORK), optional=(Ladder,), needed="colliders",
            reads=("tree", "static_tree", "grid", "static_grid", "rotation", *settings),
            writes=("position", "linear_velocity", *known),
        )(move_characters)  # fmt: skip


def tell_events(world: Any) -> None:
    """What has happened to characters in the step, in their order."""
    work = world.physics.record(WORK)
    count, work.events = work.events, 0
    for k in range(count):
        name, entity, other = EVENTS[int(work.event[k])], int(work.entity[k]), int(work.other[k])
        if name == "crushed":
            world.dispatch_event(name, entity, other)
        elif name == "landed":
            world.dispatch_event(name, entity, other, float(work.speed[k]))
        else:
            world.dispatch_event(name, entity, other, work.normal[k].copy(), float(work.speed[k]))

"""A hero runs and jumps as the recorded keys say: carom trade examples/games/platformer.py"""

from __future__ import annotations

from pathlib import Path

from carom import AABBCollider, Component, Phase, Physics, RigidBody, SphereCollider, System, Transform, World
from carom.lab import Inputs
from carom.plugins.character import Character, Characters

KEYS = Inputs.read(Path(__file__).with_name("platformer.keys"))  # recorded while somebody played
seconds = 6.0


class Coin(Component):
    """Is taken when touched."""


class Control(System):
    """Keys to wishes, before the step; counts coins and landings, and when the last coin was taken."""

    phase = Phase.START
    taken = landings = 0
    last = 0.0

    def process(self, dt):
        held = KEYS.held(self.world.time, dt)
        for _, hero in self.world.get_component(Character):
            hero.move = 5.0 * (("right" in held) - ("left" in held))
            hero.jump = "jump" in held

    def hit(self, hero, other, normal, speed):
        if self.world.has_component(other, Coin):
            self.taken += 1
            self.last = self.world.time
            self.world.delete_entity(other)

    def land(self, hero, floor, speed):
        self.landings += 1


def build(settings, seed=0):
    world = World(Physics(dimensions=2, gravity=(0, -30)), Characters(), settings=settings)
    control = Control()
    world.add_system(control)
    world.on("character_hit", control.hit)
    world.on("landed", control.land)
    for x, y, half in ((0, -0.5, 6.0), (9.5, 0.5, 2.0), (15, 1.5, 2.0), (20, 0.0, 3.0)):
        world.create_entity(Transform((x, y)), AABBCollider((half, 0.5), friction=0.5))
    for x, y in ((2.0, 2.2), (6.5, 2.5), (12.0, 3.5), (18.0, 3.0), (10.0, 1.6)):
        world.create_entity(Transform((x, y)), SphereCollider(0.3, sensor=True), Coin())
    hero = Character(jump_speed=11.0)
    world.create_entity(Transform((-4, 0.51)), RigidBody(kind="kinematic"), AABBCollider((0.4, 0.5)), hero)
    world.create_entity(Transform((19, 1.0)), RigidBody(mass=2.0), AABBCollider((0.5, 0.5), friction=0.4))
    return world


def compared(world):
    """What carom trade compares."""
    ((_, (_, hero)),) = world.get_components(Character, Transform)
    game = world.get_processor(Control)
    return {"hero": hero.position, "coins": game.taken, "last coin at": game.last, "landings": game.landings}

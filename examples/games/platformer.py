"""A hero runs and jumps as the recorded keys say: carom trade examples/games/platformer.py"""

from __future__ import annotations

from pathlib import Path

from carom import AABBCollider, Component, Phase, Physics, RigidBody, SphereCollider, System, Transform, World
from carom.lab import Inputs

KEYS = Inputs.read(Path(__file__).with_name("platformer.keys"))  # recorded while somebody played
seconds = 6.0


class Player(Component):
    """The hero."""


class Coin(Component):
    """Is taken when touched."""


class Control(System):
    """Keys to velocities, before the step."""

    phase = Phase.START
    jumps = 0

    def process(self, dt):
        held = KEYS.held(self.world.time, dt)
        for player, (_, body) in self.world.get_components(Player, RigidBody):
            ground = [c for c in self.world.contacts.of(player) if c.normal[1] < -0.7]
            body.linear_velocity[0] = 5.0 * (("right" in held) - ("left" in held))
            if "jump" in held and ground:
                body.linear_velocity[1] = 11.0
                self.jumps += 1


class Coins(System):
    """Counts them, and when the last one was taken."""

    taken = 0
    last = 0.0

    def process(self, dt):
        for _, coin, _ in self.world.contacts.begin.pairs(Player, Coin):
            self.taken += 1
            self.last = self.world.time
            self.world.delete_entity(coin)


def build(settings, seed=0):
    world = World(Physics(dimensions=2, gravity=(0, -30)), settings=settings)
    world.add_system(Control())
    world.add_system(Coins())
    for x, y, half in ((0, -0.5, 6.0), (9.5, 0.5, 2.0), (15, 1.5, 2.0), (20, 0.0, 3.0)):
        world.create_entity(Transform((x, y)), AABBCollider((half, 0.5), friction=0.0))
    for x, y in ((2.0, 2.2), (6.5, 2.5), (12.0, 3.5), (18.0, 3.0), (10.0, 1.6)):
        world.create_entity(Transform((x, y)), SphereCollider(0.3, sensor=True), Coin())
    world.create_entity(Transform((-4, 0.5)), RigidBody(), AABBCollider((0.4, 0.5), friction=0.0), Player())
    world.create_entity(Transform((19, 1.0)), RigidBody(mass=2.0), AABBCollider((0.5, 0.5), friction=0.4))
    return world


def compared(world):
    """What carom trade compares."""
    ((_, (_, hero)),) = world.get_components(Player, Transform)
    coins = world.get_processor(Coins)
    return {
        "hero": hero.position,
        "coins": coins.taken,
        "last coin at": coins.last,
        "jumps": world.get_processor(Control).jumps,
    }

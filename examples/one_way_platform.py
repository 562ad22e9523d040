"""A platform to jump through from below, to stand on, and to drop through: python examples/one_way_platform.py

A system between NARROW, which finds the contacts, and RESPONSE, which acts on them, disables those of bodies that come
from below. It uses the body's position at the start of the step, so a jump is the same at any frame rate, and a body at
rest on the platform stays on it although it overlaps slightly.
"""

from __future__ import annotations

import numpy as np

from carom import AABBCollider, Component, Phase, Physics, RigidBody, SphereCollider, System, Transform, World, column

SLACK = 0.05  # of the body's height: a body no deeper than this counts as on top


class Platform(Component):
    """Marks a platform: stops bodies from above, lets all others pass."""


class Drops(Component):
    """Lets its entity fall through platforms until that time of the world."""

    until: float = column(default=0.0)


class OneWay(System):
    """Clears ``enabled`` of platforms' contacts, unless the other body was above when the step began, and sinks."""

    phase = Phase.NARROW

    def process(self, dt):
        contacts, bodies = self.world.contacts, self.world.bodies
        platforms = bodies.entity[bodies.has(Platform)]
        first, second = np.isin(contacts.entity_a, platforms), np.isin(contacts.entity_b, platforms)
        for index in np.flatnonzero(first != second):
            platform, body = int(contacts.entity_a[index]), int(contacts.entity_b[index])
            if second[index]:
                platform, body = body, platform
            contacts.enabled[index] = self.holds(platform, body)

    def holds(self, platform, body):
        world, bodies = self.world, self.world.bodies
        if world.has_component(body, Drops) and world.time < world.component_for_entity(body, Drops).until:
            return False
        rows = [bodies.row_of(body), bodies.row_of(platform)]
        before, now = bodies.previous_position[rows, 1], bodies.position[rows, 1]
        half, platform_half = half_height(world, body), half_height(world, platform)
        gap = (before[0] - half) - (before[1] + platform_half)
        rise = (now[0] - before[0]) - (now[1] - before[1])  # relative to the platform
        return gap >= -SLACK * 2 * half and rise <= 0.1 * SLACK * 2 * half


def half_height(world, entity):
    """Half the height of the deciding collider (of a box in a sphere, the box); offsets are ignored here."""
    box = world.try_component(entity, AABBCollider)
    return world.component_for_entity(entity, SphereCollider).radius if box is None else box.half_extents[1]


def main():
    world = World(Physics(dimensions=2, gravity=(0, -20)))
    world.add_system(OneWay())
    names = {
        world.create_entity(Transform((0, -0.5)), AABBCollider((20, 0.5))): "floor",
        world.create_entity(Transform((0, 1.75)), AABBCollider((2, 0.25)), Platform()): "platform",
    }
    player = world.create_entity(Transform((0, 0.5)), RigidBody(), AABBCollider((0.4, 0.5)), Drops())
    transform, body = (world.component_for_entity(player, kind) for kind in (Transform, RigidBody))

    def tell(what):
        below = [names[contact.entity_b] for contact in world.contacts.of(player) if contact.normal[1] < -0.7]
        where = f"stands on the {below[0]}" if below else "is in the air"
        print(f"{world.time:4.2f} s  y = {transform.y:4.2f}  {what}: the player {where}")

    world.advance(0.1)
    tell("at the start")
    body.linear_velocity = (0, 12)
    for _ in range(4):
        world.advance(0.1)
        tell("jumps")
    while body.linear_velocity[1] or transform.y > 2.6:
        world.advance(0.1)
    tell("has landed")
    world.component_for_entity(player, Drops).until = world.time + 0.2
    world.advance(0.1)
    tell("drops")
    for _ in range(10):
        world.advance(0.1)
    tell("has dropped")


if __name__ == "__main__":
    main()

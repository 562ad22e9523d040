"""Worlds that sleep, and what wakes them."""

from __future__ import annotations

import operator

import numpy as np
from worlds import ball, box, floor, make_world

from carom.components import AABBCollider, RigidBody, Transform
from carom.framework import World

MODES = ("discrete", "continuous", "event_driven")
GRAVITY = 9.81


def sleepy_world(d: int = 2, **settings) -> World:
    world = make_world(d, GRAVITY, **{"sleeping": True, **settings})
    floor(world, friction=0.5)
    return world


def tower(world: World, x: float, height: int = 3) -> list[int]:
    """Boxes on the floor, one upon the other."""
    d = world.dimensions or 2
    return [box(world, (x, 0.5 + k, 0.0)[:d], friction=0.5) for k in range(height)]


def is_asleep(world: World, *entities: int) -> list[bool]:
    return [world.component_for_entity(entity, RigidBody).asleep for entity in entities]


def sleep(world: World, *entities: int, steps: int = 90) -> None:
    """Step until these are asleep, and two more steps, so that nothing is about to."""
    for _ in range(steps):
        if all(is_asleep(world, *entities)):
            break
        world.step()
    assert all(is_asleep(world, *entities))
    world.step()
    world.step()
    assert all(is_asleep(world, *entities))


def sleeping_tower(height: int = 3, **settings) -> tuple[World, list[int]]:
    """(world, boxes of a tower that sleeps in it)."""
    world = sleepy_world(**settings)
    boxes = tower(world, 0.0, height)
    sleep(world, *boxes)
    return world, boxes


def two_towers():
    """Two towers that sleep, apart, and their snapshot."""
    world = sleepy_world()
    boxes, others = tower(world, 0.0), tower(world, 20.0)
    sleep(world, *boxes, *others)
    return world, boxes, others, world.snapshot()


def part(world, entity, component):
    return world.component_for_entity(entity, component)


def write(world, entity, column, change):
    values, row = operator.attrgetter(column)(world.bodies), world.bodies.row_of(entity)
    values[row] = change(values[row])


def ground(world):
    return min(world.get_entities())


CAUSES = {  # what wakes the tower of these boxes
    "push": lambda world, boxes: part(world, boxes[1], RigidBody).apply_force((30.0, 0.0)),
    "constant force": lambda world, boxes: setattr(part(world, boxes[2], RigidBody), "constant_force", (0.5, 0.0)),
    "in a column": lambda world, boxes: write(world, boxes[0], "linear_velocity", lambda _: (0.5, 0.0)),
    "in place": lambda world, boxes: part(world, boxes[0], RigidBody).linear_velocity.__setitem__(0, 0.5),
    "size in a column": lambda world, boxes: write(world, boxes[1], "aabb_collider.half_extents", lambda _: 0.6),
    "floor in a column": lambda world, boxes: write(world, ground(world), "position", lambda _: (0.0, -2.0)),
    "teleported": lambda world, boxes: write(world, boxes[2], "position", lambda place: np.add(place, (0.2, 0.5))),
    "grown": lambda world, boxes: setattr(part(world, boxes[1], AABBCollider), "half_extents", (0.6, 0.6)),
    "heavier": lambda world, boxes: write(world, boxes[2], "mass", lambda _: 5.0),
    "other layer": lambda world, boxes: setattr(part(world, boxes[0], AABBCollider), "layer", 4),
    "one group": lambda world, boxes: [setattr(part(world, box, AABBCollider), "group", 3) for box in boxes],
    "sensor": lambda world, boxes: setattr(part(world, boxes[1], AABBCollider), "sensor", True),
    "not enabled": lambda world, boxes: setattr(part(world, boxes[1], AABBCollider), "enabled", False),
    "not enabled in a column": lambda world, boxes: write(world, boxes[0], "aabb_collider.enabled", lambda _: False),
    "floor not enabled": lambda world, boxes: setattr(part(world, ground(world), AABBCollider), "enabled", False),
    "floor runs": lambda world, boxes: setattr(part(world, ground(world), AABBCollider), "surface_velocity", 1.0),
    "floor runs in a column": lambda world, boxes: write(
        world, ground(world), "aabb_collider.surface_velocity", lambda _: (1.0, 0.0)
    ),
    "lighter": lambda world, boxes: setattr(part(world, boxes[1], RigidBody), "gravity_scale", 0.5),
    "gravity": lambda world, boxes: setattr(world, "gravity", (0.0, -5.0)),
    "settings": lambda world, boxes: setattr(world, "settings", world.settings.replace(dt=1 / 120)),
    "bottom deleted": lambda world, boxes: world.delete_entity(boxes[0]),
    "floor deleted": lambda world, boxes: world.delete_entity(ground(world)),
    "floor moved": lambda world, boxes: setattr(part(world, ground(world), Transform), "position", (0.0, -2.0)),
    "floor without collider": lambda world, boxes: world.remove_component(ground(world), AABBCollider),
    "without collider": lambda world, boxes: world.remove_component(boxes[1], AABBCollider),
    "another kind": lambda world, boxes: setattr(part(world, boxes[0], RigidBody), "kind", "static"),
    "static placed": lambda world, boxes: world.create_entity(Transform((0.9, 1.5)), AABBCollider((0.5, 0.2))),
    "body placed": lambda world, boxes: ball(world, (0.0, 3.49)),
    "touched": lambda world, boxes: ball(world, (-2.0, 1.5), (40.0, 0.0), radius=0.3),
    "touched by kinematic": lambda world, boxes: box(world, (-1.6, 2.5), (3.0, 0.0), kind="kinematic"),
    "told": lambda world, boxes: world.wake(boxes[1]),
}
EVERYWHERE = {
    "gravity", "settings", "floor deleted", "floor moved", "floor in a column", "floor without collider",
    "floor not enabled", "floor runs", "floor runs in a column",
}  # fmt: skip

"""Worlds that sleep, and what wakes them."""

from __future__ import annotations

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


def two_towers():
    """Two towers that sleep, apart, and their snapshot."""
    world = sleepy_world()
    boxes, others = tower(world, 0.0), tower(world, 20.0)
    sleep(world, *boxes, *others)
    return world, boxes, others, world.snapshot()


def push(world, boxes):
    world.component_for_entity(boxes[1], RigidBody).apply_force((30.0, 0.0))


def constant(world, boxes):
    world.component_for_entity(boxes[2], RigidBody).constant_force = (0.5, 0.0)


def in_a_column(world, boxes):
    world.bodies.linear_velocity[world.bodies.row_of(boxes[0])] = (0.5, 0.0)


def teleported(world, boxes):
    world.bodies.position[world.bodies.row_of(boxes[2])] += (0.2, 0.5)


def grown(world, boxes):
    world.component_for_entity(boxes[1], AABBCollider).half_extents = (0.6, 0.6)


def heavier(world, boxes):
    world.bodies.mass[world.bodies.row_of(boxes[2])] = 5.0


def other_layer(world, boxes):
    world.component_for_entity(boxes[0], AABBCollider).layer = 4


def sensor(world, boxes):
    world.component_for_entity(boxes[1], AABBCollider).sensor = True


def lighter(world, boxes):
    world.component_for_entity(boxes[1], RigidBody).gravity_scale = 0.5


def gravity(world, boxes):
    world.gravity = (0.0, -5.0)


def settings(world, boxes):
    world.settings = world.settings.replace(dt=1 / 120)


def bottom_deleted(world, boxes):
    world.delete_entity(boxes[0])


def floor_deleted(world, boxes):
    world.delete_entity(min(world.get_entities()))


def floor_moved(world, boxes):
    world.component_for_entity(min(world.get_entities()), Transform).position = (0.0, -2.0)


def floor_without_collider(world, boxes):
    world.remove_component(min(world.get_entities()), AABBCollider)


def without_collider(world, boxes):
    world.remove_component(boxes[1], AABBCollider)


def another_kind(world, boxes):
    world.component_for_entity(boxes[0], RigidBody).kind = "static"


def static_placed(world, boxes):
    world.create_entity(Transform((0.9, 1.5)), AABBCollider((0.5, 0.2)))


def body_placed(world, boxes):
    ball(world, (0.0, 3.49))


def touched(world, boxes):
    ball(world, (-2.0, 1.5), (40.0, 0.0), radius=0.3)


def touched_by_kinematic(world, boxes):
    box(world, (-1.6, 2.5), (3.0, 0.0), kind="kinematic")


def told(world, boxes):
    world.wake(boxes[1])

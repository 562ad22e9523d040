"""Worlds in which bodies come and go, whose future depends on nothing but their state."""

from __future__ import annotations

import numpy as np

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, Phase, Settings, System, World, column
from carom.plugins import Physics, capsule, convex_polygon, half_space, tile_grid
from carom.plugins.springs import Springs

EVENTS = ("contact_begin", "contact_stay", "contact_end", "impact", "spring_lost")


class Bullet(Component):
    expires = column(default=0.0)


class Tag:
    """An ordinary object."""

    def __init__(self, name):
        self.name = name


class Churn(System):
    """Fires bullets, deletes what has expired, takes colliders away and gives them back."""

    phase = Phase.START

    def process(self, dt):
        world, step = self.world, self.world.step_count
        d = world.dimensions
        rng = np.random.default_rng(step)
        if step % 3 == 0:
            place, speed = rng.uniform(-4, 4, d), rng.normal(0, 8, d)
            world.create_entity(
                Transform(place + 6.0), RigidBody(mass=0.5, linear_velocity=speed),
                SphereCollider(0.15, restitution=0.6), Bullet(world.time + 0.4), Tag(step),
            )  # fmt: skip
        for entity, bullet in world.get_component(Bullet):
            if world.time > bullet.expires:
                world.delete_entity(entity)
        if step % 7 == 0:
            movers = world.bodies.dynamic.entity
            entity = int(movers[rng.integers(len(movers))])
            world.component_for_entity(entity, RigidBody).apply_impulse(rng.normal(size=d))
            if world.has_component(entity, SphereCollider) and not world.has_component(entity, Bullet):
                radius = world.remove_component(entity, SphereCollider).radius
                world.add_component(entity, SphereCollider(min(radius * 1.02, 0.6)))
        if step % 50 == 0:
            movers = world.bodies.dynamic.entity
            world.delete_entity(int(movers[rng.integers(len(movers))]), immediate=True)


def plugins(d, springs=True):
    flat = [capsule.plugin, half_space.plugin, convex_polygon.plugin, tile_grid.plugin]
    return [Physics(dimensions=d, gravity=(0.0, -9.81, 0.0)[:d]), *(flat if d == 2 else flat[:2]), Springs()][
        : None if springs else -1
    ]


def make(d, mode, **settings):
    """The empty world with its systems."""
    world = World(*plugins(d), settings=Settings(dt=1 / 60, collision=mode, **settings))
    world.add_system(Churn())
    return world


def springs_of(world):
    return next(plugin for plugin in world.plugins if plugin.name == "springs")


def fill(world):
    """Floors, shapes of all plugins, a heap, springs, kinematic and static bodies, bodies in bulk, things without."""
    d = world.dimensions
    rng = np.random.default_rng(3)
    at = lambda x, y: (x, y, 0.0)[:d]  # noqa: E731
    world.create_entity(Transform(at(0, -1)), half_space.HalfSpaceCollider(at(0, 1), restitution=0.2))
    world.create_entity(Transform(at(0, 0)), AABBCollider((30.0, 0.5, 30.0)[:d], friction=0.4))
    world.create_entity(
        Transform(at(-3, 2)), RigidBody(kind="kinematic", linear_velocity=at(0.3, 0)), AABBCollider((1.0, 0.2, 1.0)[:d])
    )
    if d == 2:
        world.create_entity(Transform((6, 2)), AABBCollider((2, 0), one_way=(0, 1)))
        world.create_entity(Transform((-8, 3)), *[tile_grid.TileGridCollider(((1, 0, 1), (1, 1, 1)), 1.0)])
        world.create_entity(
            Transform((0, 6)), RigidBody(), convex_polygon.ConvexPolygonCollider(((0, 0), (1, 0), (0.5, 0.8)))
        )
    for k in range(4):
        rod = capsule.CapsuleCollider(0.3, 0.3, friction=0.5)
        world.create_entity(Transform(at(-2 + 1.5 * k, 4)), RigidBody(), rod)
    heap = [
        world.create_entity(
            Transform(np.array(at(1.02 * (k % 5), 1 + 1.05 * (k // 5))) + rng.normal(0, 0.02, d)), RigidBody(),
            SphereCollider(0.5, restitution=0.3, friction=0.3), Tag(k),
        )
        for k in range(25)
    ]  # fmt: skip
    world.create_entities(
        12, Transform.many(rng.uniform(3, 9, (12, d))), RigidBody.many(), SphereCollider.many(radius=0.3)
    )
    world.create_entities(3, Bullet.many(expires=[1e9, 2e9, 3e9]))  # no bodies
    world.create_entity(Bullet(1e9))
    world.create_entity(Tag("alone"))
    world.create_entity()
    for a, b in zip(heap[::5], heap[1::5], strict=True):
        springs_of(world).connect(a, b, stiffness=30.0, damping=0.2)


def log_events(world, log):
    def note(name):
        def handler(c):
            if name == "spring_lost":
                log.append((name, c.a, c.b))
            else:
                log.append((name, c.entity_a, c.entity_b, c.step, c.depth, c.normal_impulse, c.time_of_impact))

        return handler

    for name in EVENTS:
        world.on(name, note(name))

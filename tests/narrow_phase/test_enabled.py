"""Colliders that are not enabled: a world goes on as if they were not there, and as if they had come when they are."""

from __future__ import annotations

from copy import copy

import numpy as np
import pytest
from helpers_modes import along
from worlds import MODES, make_world, mostly_2d

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import World
from carom.plugins import Physics
from carom.plugins.parts import PartOf, Parts
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.plugins.tile_grid import TileGridCollider, plugin

TYPES = SphereCollider, AABBCollider


def crowd(d, mode, **settings):
    """Spheres and boxes that fall on a floor and on each other, of which some are both, some static, some sensors."""
    world, random = make_world(d, 9.81, collision=mode, **settings), np.random.default_rng(7)
    made = [world.create_entity(Transform(along(d, 0.0, -1.0)), AABBCollider(along(d, 9.0, 1.0, 9.0), friction=0.5))]
    for k in range(16):
        place = along(d, 1.1 * (k % 8) - 4.0, 0.6 + 1.2 * (k // 8), 0.3 * random.normal())
        body = RigidBody(linear_velocity=random.normal(0.0, 1.0, d), kind="static" if k == 5 else "dynamic")
        ball, box = SphereCollider(0.55, restitution=0.3, sensor=k == 9), AABBCollider((0.3,) * d, friction=0.4)
        shapes = (ball, box) if k % 4 == 0 else (ball if k % 2 else box,)
        made.append(world.create_entity(Transform(place), body, *shapes))
    # Without bodies of two levels steps round otherwise: one has them throughout.
    world.create_entity(Transform(along(d, 30.0)), SphereCollider(0.55), AABBCollider((0.3,) * d))
    return world, made


def schedule(world, made):
    """Ten sets of what is off: (entity, type)."""
    random = np.random.default_rng(1)
    has = [(entity, kind) for entity in made for kind in TYPES if world.has_component(entity, kind)]
    return [{one for one in has if random.random() < (0.1 if one[0] == made[0] else 0.35)} for _ in range(10)]


def switch(world, changed, off, by_column):
    for entity, kind in changed:
        if by_column:
            getattr(world.bodies, kind.prefix[:-1]).enabled[world.bodies.row_of(entity)] = (entity, kind) not in off
        else:
            world.component_for_entity(entity, kind).enabled = (entity, kind) not in off


def seen(world):
    """Places, contacts, their events, and what queries find."""
    bodies, contacts, d = world.bodies, world.contacts, world.dimensions
    order = np.argsort(bodies.entity)
    rays = world.ray_cast(along(d, -1.5, 9.0), along(d, 0.0, -1.0), 20.0)
    told = [(each.entity_a.tolist(), each.entity_b.tolist()) for each in (contacts, contacts.begin, contacts.end)]
    return (
        bodies.position[order].tolist(), bodies.linear_velocity[order].tolist(), told,
        [(hit.entity, hit.distance) for hit in rays], world.query_nearest(along(d, 0.3, 3.0)).entity,
        world.query_aabb(along(d, -2.0, 0.0, -9.0), along(d, 2.0, 2.0, 9.0)),
    )  # fmt: skip


@pytest.mark.slow
@mostly_2d
@pytest.mark.parametrize("mode", MODES)
def test_a_world_goes_on_as_if_they_were_not_there(mode, d, tmp_path):
    (one, made), (two, _) = crowd(d, mode), crowd(d, mode)
    plan, removed, before = schedule(one, made), {}, set()
    for k, off in enumerate(plan):
        switch(one, off ^ before, off, by_column=k % 2 == 0)
        for entity, kind in off - before:
            removed[entity, kind] = two.remove_component(entity, kind)
        for entity, kind in before - off:
            two.add_component(entity, removed.pop((entity, kind)))
        if k == 4:  # rows move
            ball = Transform(along(d, 2.0, 4.0)), RigidBody(), SphereCollider(0.2)
            more = [each.create_entity(*map(copy, ball)) for each in (one, two)]
        if k == 6:
            one.delete_entity(more[0])
            two.delete_entity(more[1])
            saved = one.snapshot()
            one.save(tmp_path / "saved")
        assert seen(one)[3:] == seen(two)[3:], k  # at once
        for _ in range(6):
            one.step()
            two.step()
            assert seen(one) == seen(two), k
        before = off
    end = one.state_hash()
    loaded = World.load(tmp_path / "saved", Physics(dimensions=d, gravity=along(d, 0.0, -9.81)))
    one.restore(saved)
    for world in (one, loaded):
        for k in range(6, 10):
            if k > 6:
                switch(world, plan[k] ^ plan[k - 1], plan[k], by_column=k % 2 == 0)
            for _ in range(6):
                world.step()
        assert world.state_hash() == end


def test_ground_of_any_kind_and_parts_go_and_come_back():
    """What lies on them falls as in free flight, and lands again on what is enabled in time."""
    world = World(Physics(2, gravity=(0, -10)), Rotation(), parts := Parts(), plugin)
    tiles = world.create_entity(Transform((0, -0.5)), TileGridCollider(["###"], 1.0))
    body = world.create_entity(Transform((5, -2)), RigidBody(kind="kinematic"))
    shelf = world.create_entity(PartOf(body, (0, 1.5)), BoxCollider((1, 0.5)))
    balls = [world.create_entity(Transform((x, 0.25)), RigidBody(), SphereCollider(0.25)) for x in (0, 5)]
    assert parts.of(body) == [shelf]
    grounds = [world.component_for_entity(tiles, TileGridCollider), world.component_for_entity(shelf, BoxCollider)]
    places = [world.component_for_entity(ball, Transform) for ball in balls]
    for _ in range(10):
        world.step()
    assert np.allclose([place.position[1] for place in places], 0.25, atol=1e-9)
    for ground in grounds:
        ground.enabled = False
    for _ in range(9):  # semi-implicit Euler: g dt^2 (1 + 2 + ... + 9)
        world.step()
    assert np.allclose([place.position[1] for place in places], 0.25 - 10 / 3600 * 45, atol=1e-9)
    assert len(world.contacts) == 0
    for ground, place in zip(grounds, places, strict=True):
        ground.enabled = True
        place.position = place.position[0], 1.0
    for _ in range(60):
        world.step()
    assert np.allclose([place.position[1] for place in places], 0.25, atol=1e-6)


def test_what_is_not_enabled_turns_as_before():
    """Its inertia is that of its collider, and of its parts."""
    turned = []
    for off in (False, True):
        world = World(Physics(2), Rotation(), Parts())
        body = world.create_entity(
            Transform((0, 0)), RigidBody(3.0), Spin(1.0, constant_torque=0.5), SphereCollider(0.5, enabled=not off)
        )
        world.create_entity(PartOf(body, (1, 0), mass=1.0), SphereCollider(0.25, enabled=not off))
        for _ in range(30):
            world.step()
        turned.append(world.component_for_entity(body, Transform).rotation)
    assert turned[0] == turned[1]

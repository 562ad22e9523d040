"""Half-spaces: unbounded ground in small and large worlds, in 2D and 3D; their pairs are in test_shipped_pairs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_modes import along, turn
from worlds import both_dimensions, mostly_2d, position, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, half_space
from carom.plugins.half_space import HalfSpaceCollider

G = 10.0


def make_world(d, ground=None, angle=0.0, body=(), **settings):
    """Ground below y = 0, and a box and a ball far up, so that all tests share compiled code."""
    options = {"integrator": "velocity_verlet"} | settings
    world = World(Physics(dimensions=d, gravity=along(d, 0, -G)), half_space.plugin, settings=Settings(**options))
    ground = HalfSpaceCollider(along(d, 0, 1), friction=1.0) if ground is None else ground
    world.create_entity(Transform(along(d), turn(d, angle)), ground, *body)
    world.create_entity(Transform(along(d, 0, 1e6)), AABBCollider(0.5))
    world.create_entity(Transform(along(d, 0, 2e6)), SphereCollider(0.5))
    return world


@mostly_2d
def test_bodies_rest_on_it_as_on_a_box(d):
    """The same heights as on a box of any size; a point has no size, so its slop is that of the box."""
    colliders = SphereCollider(0.5), AABBCollider(0.5), SphereCollider(0), AABBCollider(along(d, 2, 0.25, 1))
    lows = np.array((0.5, 0.5, 0.0, 0.25))
    heights = []
    for ground in (None, AABBCollider(along(d, 100, 1, 100), offset=along(d, 0, -1), friction=1.0)):
        world = make_world(d, ground)
        entities = [
            world.create_entity(Transform(along(d, 5 * k, 0.3 + low)), RigidBody(), collider)
            for k, (collider, low) in enumerate(zip(colliders, lows, strict=True))
        ]
        for _ in range(240):
            world.step()
        heights.append([position(world, entity)[1] for entity in entities])
        assert [len(world.contacts.of(entity)) for entity in entities] == [1] * 4
        on_ground = world.contacts.of(entities[3])[0].point  # of a box: in the middle of its face
        np.testing.assert_allclose(np.delete(on_ground, 1), np.delete(position(world, entities[3]), 1), atol=1e-9)
        world.close()
    heights = np.array(heights)
    assert np.abs(heights[0] - heights[1])[lows > 0].max() < 1e-12
    assert np.abs(heights[0] - lows).max() < 0.0025


@mostly_2d
def test_a_slope_made_by_the_transform(d):
    """Frictionless at 30 degrees: v = g sin 30 t; with friction 1 it stays."""
    angle, down = math.pi / 6, np.array((-math.cos(math.pi / 6), -0.5))
    for friction, speed in ((0.0, 5.0), (1.0, 0.0)):
        world = make_world(d, HalfSpaceCollider(along(d, 0, 5), friction=friction), angle)
        place = Transform(along(d, 0.5 * down[1], -0.5 * down[0]))
        slider = world.create_entity(place, RigidBody(), SphereCollider(0.5, friction=friction))
        start = position(world, slider)
        for _ in range(60):
            world.step()
        assert velocity(world, slider)[:2] @ down == pytest.approx(speed, abs=0.02)
        height = (position(world, slider) - start)[:2] @ (down[1], -down[0])
        assert abs(height) < 0.0025
        world.close()


@pytest.mark.slow
@both_dimensions
def test_a_rising_one_lifts_what_is_on_it(d):
    """In one tree with moving bodies, among few and among many; half-spaces do not meet each other."""
    for count in (3, 300):
        rises = RigidBody(kind="kinematic", linear_velocity=along(d, 0, 1))
        world = make_world(d, body=(rises,))
        world.create_entity(
            Transform(along(d, 0, -20)), HalfSpaceCollider(along(d, 1, 1)), RigidBody(kind="kinematic"))
        places = np.zeros((count, d))
        places[:, 0], places[:, 1] = np.arange(count) * 1.5, 0.5
        world.create_entities(count, Transform.many(places), RigidBody.many(), SphereCollider.many(radius=0.5))
        for _ in range(60):
            world.step()
        dynamic = world.bodies.dynamic
        assert dynamic.position[:, 1] == pytest.approx(np.full(count, 1.5), abs=0.005)
        assert dynamic.linear_velocity[:, 1] == pytest.approx(np.ones(count), abs=1e-3)
        assert len(world.contacts) == count
        world.close()


@mostly_2d
def test_queries_and_casts_find_it_everywhere(d):
    world = make_world(d)
    for where in (0.0, -5e7):
        assert world.query_point(along(d, where, -1e-3)) == [1]
        assert world.query_point(along(d, where, 1e-3)) == []
        assert world.query_sphere(along(d, where, 1), 1.5) == [1]
        assert world.query_aabb(along(d, where, 1, -1), along(d, where + 1, 2, 1)) == []
        hit = world.ray_cast(along(d, where, 8), along(d, 1, -1))[0]
        assert hit.entity == 1
        assert hit.distance == pytest.approx(8 * math.sqrt(2))
        assert np.allclose(hit.normal, along(d, 0, 1))
        assert world.ray_cast(along(d, where, 8), along(d, 1, 0)) == []
        assert world.query_nearest(along(d, where, 7)).distance == pytest.approx(7)
        fallen = world.shape_cast(AABBCollider(0.5), along(d, where, 8), along(d, 0, -20))[0]
        assert (fallen.entity, fallen.distance) == (1, pytest.approx(7.5))
    world.close()


@pytest.mark.parametrize("normal", [(0, 0), 0, (0.0, 0.0, 0.0), (math.nan, 1), "up"])
def test_a_normal_without_direction_is_refused(normal):
    with pytest.raises(ValueError, match=r"HalfSpaceCollider\.normal"):
        HalfSpaceCollider(normal)
    ground = HalfSpaceCollider((0, 1))
    with pytest.raises(ValueError, match=r"HalfSpaceCollider\.normal"):
        ground.normal = normal


def test_the_row_of_a_normal_without_direction_is_named():
    world = make_world(2)
    with pytest.raises(ValueError, match=r"normal must not be zero \(row 1\)"):
        world.create_entities(2, Transform.many((0, 0)), HalfSpaceCollider.many([(0, 1), (0, 0)]))
    world.close()

"""Shapes of plugins in a world: one that turns with its body, one with an array field; edges of shipped ones."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.components.colliders import Collider
from carom.framework import Plugin, PluginError, World, array_column
from carom.framework.plugins.laws import edge_laws
from carom.plugins import Physics
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.rotation import BoxCollider
from carom.systems.shapes.convex.edges import edge_towards

pytestmark = pytest.mark.plain


class CloudCollider(Collider):
    """Points around the centre: for contacts, a sphere through the farthest one."""

    dimensions = (2,)
    points = array_column(2, rows=(1, 100), check=lambda p: "must be near" if np.abs(p).max() > 1e12 else None)

    @classmethod
    def sample(cls, **common):
        return cls([[0.5, 0.0], [0.0, -0.5]], **common)

    def bounds(shape, dimensions):
        reach = 0.0
        for k in range(len(shape.points)):
            reach = max(reach, math.sqrt(shape.points[k, 0] ** 2 + shape.points[k, 1] ** 2))
        return reach, reach


def cloud_plugin():
    plugin = Plugin("clouds")
    plugin.shape(cost=3)(CloudCollider)

    @plugin.pair(CloudCollider, SphereCollider)
    def cloud_sphere(a, b, d):
        nearest, x, y = math.inf, 1.0, 0.0
        for k in range(len(a.points)):
            gap = math.hypot(d[0] - a.points[k, 0], d[1] - a.points[k, 1])
            if gap < nearest:
                nearest, x, y = gap, d[0] - a.points[k, 0], d[1] - a.points[k, 1]
        depth = b.radius - nearest
        normal = (x / nearest, y / nearest) if nearest > 0.0 else (1.0, 0.0)
        return depth >= 0.0, depth, normal, (d[0] - normal[0] * b.radius, d[1] - normal[1] * b.radius)

    return plugin


def test_a_field_may_be_an_array():
    """Each body has its own number of rows; assigned values count from the next step; equal arrays are shared."""
    world = World(Physics(), cloud_plugin())
    one = world.create_entity(Transform((0, 0)), CloudCollider([(3.0, 0.0), (0.0, 1.0), (0.0, 2.0)]))
    world.create_entity(Transform((20, 0)), CloudCollider([(1.0, 0.0)]))
    ball = world.create_entity(Transform((3.5, 0)), RigidBody(), SphereCollider(1.0))
    world.step()
    assert [contact.normal.tolist() for contact in world.contacts] == [[1.0, 0.0]]
    cloud = world.component_for_entity(one, CloudCollider)
    np.testing.assert_array_equal(cloud.points, [(3, 0), (0, 1), (0, 2)])
    before = world.snapshot()
    seen = world.state_hash()
    cloud.points = np.ones((90, 2)) * np.arange(90)[:, None]
    assert world.state_hash() != seen
    world.step()
    assert len(world.contacts) == 0
    world.component_for_entity(ball, Transform).position = (70.5, 70.0)
    world.step()
    assert len(world.contacts) == 1
    world.restore(before)
    assert world.state_hash() == seen
    assert len(world.component_for_entity(one, CloudCollider).points) == 3
    with pytest.raises(ValueError, match="read-only"):
        cloud.points[0, 0] = 7


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([], "must be an array of shape|must have 1 to 100 rows"),
        ([(1, 2, 3)], r"must be an array of shape \(n, 2\)"),
        ([(1, math.nan)], "must be finite"),
        ("abc", "must be numbers"),
        ([(0, 0)] * 101, "must have 1 to 100 rows"),
        ([(1e13, 0)], "must be near"),
    ],
)
def test_an_array_is_checked_where_it_enters(value, message):
    with pytest.raises(ValueError, match=rf"CloudCollider.points ({message})"):
        CloudCollider(value)
    cloud = CloudCollider([(1, 0)])
    with pytest.raises(ValueError, match=rf"CloudCollider.points ({message})"):
        cloud.points = value
    np.testing.assert_array_equal(cloud.copy().points, [(1, 0)])


def test_arrays_in_bulk():
    world = World(Physics(), cloud_plugin())
    arrays = [np.full((k, 2), float(k)) for k in (1, 2, 3)]
    world.create_entities(3, Transform.many(np.zeros((3, 2))), CloudCollider.many(points=arrays))
    entities = world.create_entities(2, Transform.many(np.ones((2, 2))), CloudCollider.many(points=arrays[2]))
    world.step()
    assert [len(world.component_for_entity(e, CloudCollider).points) for e in (1, 2, 3, *entities)] == [1, 2, 3, 3, 3]
    with pytest.raises(PluginError):
        Plugin("x").shape(cost=1)(type("Other", (Collider,), {"points": array_column(2)}))


def test_queries_know_shapes_with_arrays():
    world = World(Physics(), cloud_plugin())
    cloud = world.create_entity(Transform((5, 0)), CloudCollider([(0.0, 0.0), (2.0, 0.0)]))
    assert world.query_sphere((8.5, 0), 2.0) == [cloud]
    assert [hit.distance for hit in world.shape_cast(SphereCollider(0.5), (0, 0), (20, 0))] == [pytest.approx(4.5)]
    world.create_entity(Transform((0, 9)), RigidBody(), SphereCollider(1.0))
    (hit,) = world.shape_cast(CloudCollider([(0.0, 0.0), (1.0, 0.0)]), (-9, 9), (20, 0), exclude=cloud)
    assert hit.distance == pytest.approx(7.0)


@pytest.mark.compiled
@pytest.mark.parametrize("kind", [AABBCollider, BoxCollider, CapsuleCollider])
def test_edges_that_shapes_tell_are_those_that_their_support_finds(kind):
    random, found = np.random.default_rng(60), 0
    for _ in range(300):
        angle, (x, y) = random.uniform(0.0, 7.0), random.uniform(0.1, 2.0, 2)
        axes = ((1.0, 0.0), (0.0, 1.0))
        if kind is not AABBCollider:
            axes = (math.cos(angle), math.sin(angle)), (-math.sin(angle), math.cos(angle))
        shape = SimpleNamespace(half_extents=(x, y), half_height=x, axes=axes)
        look = np.array((math.cos(2.0 * angle), math.sin(2.0 * angle)))
        edge = kind.edge(shape, tuple(look))

        def support(ways, shape=shape):
            return np.array([kind.support(shape, tuple(way)) for way in ways]), np.zeros(len(ways))

        ends = [np.array([end]) for end in edge]
        assert not any(law.is_broken for law in edge_laws(ends, support, look[None]))
        one, two = edge_towards(shape, kind.support, tuple(look), 0.3)
        if one != two:
            found += 1
            assert np.abs(np.subtract((one, two), edge)).max() < 1e-12
    assert found > 20

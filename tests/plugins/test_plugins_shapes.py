"""Plugin shapes at work in a world: one that turns with its body, and one with an array field."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carom.components import RigidBody, SphereCollider, Transform
from carom.components.colliders import Collider
from carom.framework import Plugin, PluginError, Settings, World, array_column, column
from carom.framework.vectors import add, divided, dot, length, negative, scale, sub
from carom.plugins import Physics

pytestmark = pytest.mark.plain


class RodCollider(Collider):
    """A rounded rod along the body's y axis: a shape that turns, written with the public functions only."""

    rotates = True

    radius = column(positive=True)
    half_length = column(positive=True)

    def bounds(shape, dimensions):
        axis = shape.axes[1]
        x, y = abs(axis[0]) * shape.half_length + shape.radius, abs(axis[1]) * shape.half_length + shape.radius
        if dimensions == 2:
            return x, y
        return x, y, abs(axis[2]) * shape.half_length + shape.radius

    def support(shape, direction):
        end = scale(shape.axes[1], shape.half_length)
        return end if dot(end, direction) >= 0.0 else negative(end)

    def rounding(shape):
        return shape.radius


def make_plugin():
    plugin = Plugin("rods")
    plugin.shape(cost=2)(RodCollider)

    @plugin.kernel
    def on_rod(rod, d):
        """The point of the rod's core that is nearest to d."""
        along = dot(rod.axes[1], d)
        return scale(rod.axes[1], max(-rod.half_length, min(rod.half_length, along)))

    @plugin.pair(RodCollider, SphereCollider)
    def rod_sphere(a, b, d):
        nearest = on_rod(a, d)
        gap = sub(d, nearest)
        distance = length(gap)
        depth = a.radius + b.radius - distance
        normal = divided(gap, distance) if distance > 0.0 else a.axes[0]
        return depth >= 0.0, depth, normal, add(nearest, scale(normal, a.radius - 0.5 * depth))

    return plugin


@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("sphere_first", [True, False])
def test_a_shape_of_a_plugin_bounces_at_the_right_height(d, sphere_first):
    """Dropped from h with restitution e a ball returns to e^2 h; here e = 1, over a horizontal rod."""
    up, here = np.eye(d)[1], np.zeros(d)
    turned = math.pi / 2 if d == 2 else (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    settings = Settings(integrator="velocity_verlet")
    world = World(Physics(dimensions=d, gravity=-10 * up), make_plugin(), settings=settings)

    def make_ball():
        return world.create_entity(Transform(5 * up), RigidBody(), SphereCollider(0.5, restitution=1.0))

    ball = make_ball() if sphere_first else None
    world.create_entity(Transform(here, rotation=turned), RodCollider(1.0, 6.0))
    ball = make_ball() if ball is None else ball
    lowest, highest, falling = 5.0, 0.0, True
    for _ in range(200):
        world.step()
        y = world.component_for_entity(ball, Transform).y
        lowest = min(lowest, y)
        falling = falling and not world.contacts.impacts.pairs(RodCollider, SphereCollider)
        highest = highest if world.time < 1.0 else max(highest, y)
    assert lowest == pytest.approx(1.5, abs=0.2)  # lowest between two steps of up to .14 m
    assert highest == pytest.approx(5.0, abs=10 / 8 / 60**2 + 1e-9)  # the apex lies between two steps
    assert world.kinetic_energy() + world.potential_energy() == pytest.approx(50.0, rel=1e-12)
    world.close()


def test_a_rod_turns_with_its_body():
    world = World(Physics(), make_plugin())
    rod = world.create_entity(Transform((0, 0)), RodCollider(0.5, 3.0))
    ball = world.create_entity(Transform((0, 3.9)), RigidBody(), SphereCollider(0.5))
    world.step()
    assert [contact.normal.tolist() for contact in world.contacts] == [[0.0, 1.0]]
    world.component_for_entity(rod, Transform).rotation = math.pi / 2
    world.component_for_entity(ball, Transform).position = (3.9, 0.0)
    world.step()
    (contact,) = world.contacts
    np.testing.assert_allclose(contact.normal, (1, 0), atol=1e-12)
    world.component_for_entity(ball, Transform).position = (0.0, 3.9)
    world.step()
    assert len(world.contacts) == 0
    world.close()


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
    world.close()


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
    world.close()


def test_queries_know_shapes_with_arrays():
    world = World(Physics(), cloud_plugin())
    cloud = world.create_entity(Transform((5, 0)), CloudCollider([(0.0, 0.0), (2.0, 0.0)]))
    assert world.query_sphere((8.5, 0), 2.0) == [cloud]
    assert [hit.distance for hit in world.shape_cast(SphereCollider(0.5), (0, 0), (20, 0))] == [pytest.approx(4.5)]
    world.create_entity(Transform((0, 9)), RigidBody(), SphereCollider(1.0))
    (hit,) = world.shape_cast(CloudCollider([(0.0, 0.0), (1.0, 0.0)]), (-9, 9), (20, 0), exclude=cloud)
    assert hit.distance == pytest.approx(7.0)
    world.close()

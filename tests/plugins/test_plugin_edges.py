"""The edge of a shape of one's own that has no support: what spins lies on it with both corners."""

from __future__ import annotations

import math

import pytest

from carom.components import Collider, RigidBody, Transform
from carom.framework import Convex, Plugin, PluginError, World, column
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation, Spin


def shelf_plugin(told):
    """A level shelf from -width to width, solid below, as a shape that is not convex."""
    plugin = Plugin("shelf", version="1.0")

    @plugin.shape(cost=3)
    class Shelf(Collider):
        __slots__ = ()
        dimensions = (2,)
        convex = False
        edge = staticmethod(told)
        width: float = column(positive=True)

        @classmethod
        def sample(cls, **common):
            return cls(2.0, **common)

        @staticmethod
        def bounds(shape, dimensions):
            return shape.width, 1.0

    @plugin.pair(Shelf, Convex)
    def on_shelf(a, b, d, support, rounding):
        low = support(b, (0.0, -1.0))
        x, depth = d[0] + low[0], rounding(b) - d[1] - low[1]
        if x < -a.width or x > a.width:
            return False, min(-0.1, depth), (0.0, 1.0), (x, 0.0)
        return depth >= 0.0, depth, (0.0, 1.0), (x, -0.5 * depth)

    return plugin, Shelf


def ends(shape, direction, point):
    return (shape.width, 0.0), (-shape.width, 0.0)


def test_a_crate_lies_on_the_edge_of_a_shape_without_a_support():
    """As deep at rest as on a box, and its angle stays; by one point it would rock from corner to corner."""
    plugin, shelf = shelf_plugin(ends)
    with World(Physics(dimensions=2, gravity=(0, -10)), Rotation(), plugin) as world:
        world.create_entity(Transform((0, 0)), shelf(2.0, friction=0.5))
        crates = [
            world.create_entity(Transform((0, y)), RigidBody(), Spin(), BoxCollider((0.4, 0.4), friction=0.5))
            for y in (0.4, 1.25)
        ]
        for _ in range(240):
            world.step()
        for entity, height in zip(crates, (0.4, 1.2), strict=True):
            place = world.component_for_entity(entity, Transform)
            assert place.y == pytest.approx(height, abs=0.002)
            assert math.isclose(place.rotation, 0.0, abs_tol=1e-6)


def test_an_edge_without_a_support_takes_the_point():
    def edge(shape, direction):
        return direction, direction

    with pytest.raises(PluginError, match="point"):
        shelf_plugin(edge)

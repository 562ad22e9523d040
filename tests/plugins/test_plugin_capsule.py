"""Capsules in worlds, in 2D and 3D: queries; their pairs are in test_shipped_pairs and test_capsule_box."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_modes import along, turn
from worlds import both_dimensions

from carom.components import AABBCollider, SphereCollider, Transform
from carom.framework import World
from carom.plugins import Physics, capsule
from carom.plugins.capsule import CapsuleCollider

pytestmark = pytest.mark.slow  # its shapes take long to compile


def make_world(d):
    """A world with a floor, its top at 0, and a distant sphere."""
    world = World(Physics(dimensions=d, gravity=along(d, 0, -10)), capsule.plugin)
    world.create_entity(Transform(along(d, 0, -1)), AABBCollider(along(d, 50, 1, 50), friction=1.0))
    world.create_entity(Transform(along(d, 1e4, 0)), SphereCollider(1.0))
    return world


@both_dimensions
def test_queries_and_casts_find_it(d):
    world = make_world(d)
    place = np.array(along(d, 0, 100))
    leaning = world.create_entity(Transform(place, turn(d, -math.pi / 4)), CapsuleCollider(0.5, 2.0))
    axis = np.array(along(d, 1, 1)) / math.sqrt(2)
    assert world.query_point(place + 2.4 * axis) == [leaning]
    assert world.query_point(place + 2.6 * axis) == []
    assert world.query_point(place + along(d, 1.5, -1.5)) == []  # in its box, not in it
    assert world.query_sphere(place + along(d, 1.0, -1.0), math.sqrt(2) - 0.4) == [leaning]
    assert world.query_sphere(place + along(d, 1.0, -1.0), math.sqrt(2) - 0.6) == []
    hit = world.ray_cast(place + along(d, 1, 10), along(d, 0, -1))[0]
    assert hit.entity == leaning
    assert hit.distance == pytest.approx(9 - 0.5 * math.sqrt(2))
    assert hit.normal[:2] == pytest.approx((-math.sqrt(0.5), math.sqrt(0.5)))
    end = world.ray_cast(place + 10 * axis, -axis)[0]
    assert end.distance == pytest.approx(7.5)
    swept = world.shape_cast(CapsuleCollider(0.25, 1.0), place + along(d, 0.5, 10), along(d, 0, -20))[0]
    assert swept.entity == leaning
    # its lower end, at x = 0.5, comes to within 0.75 of the line
    assert swept.distance == pytest.approx(9.5 - 0.75 * math.sqrt(2) - 1.0)
    world.close()


@pytest.mark.parametrize("arguments", [(-0.1, 1.0), (0.1, -1.0), (math.nan, 1.0), ("x", 1.0)])
def test_wrong_sizes_are_named(arguments):
    with pytest.raises(ValueError, match=r"CapsuleCollider\.(radius|half_height)"):
        CapsuleCollider(*arguments)

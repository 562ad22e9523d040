"""Walks over floors whose parts lie flush: nothing stops a walker where two parts meet, and it stays level."""

from __future__ import annotations

import pytest
from helpers_walks import MODES, polygon

from carom.components import AABBCollider, RigidBody, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, convex_polygon


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (36.0, 2.0), (0.1, 0.3), (1e3, 17.0)])
@pytest.mark.parametrize("speed", [3.0, 6.0, 8.0])
def test_a_box_goes_up_a_slope_that_begins_on_the_floor(mode, x, y, speed):
    """The tip of the slope touches the side of the box, exactly where some step ends."""
    with World(Physics(2, gravity=(0, -30)), convex_polygon.plugin, settings=Settings(collision=mode)) as world:
        world.create_entity(Transform((x, y - 0.5)), AABBCollider((20, 0.5), friction=0.0))
        polygon(world, ((x + 4, y), (x + 8, y + 2), (x + 8, y)), friction=0.0)
        player = world.create_entity(Transform((x + 2, y + 0.7)), RigidBody(), AABBCollider((0.4, 0.7), friction=0.0))
        body, place = (world.component_for_entity(player, kind) for kind in (RigidBody, Transform))
        top = y
        while world.time < 7.0 / speed:
            body.linear_velocity = (speed, body.linear_velocity[1])
            world.step()
            top = max(top, place.y)
        assert place.x > x + 7.0
        assert top > y + 2.0

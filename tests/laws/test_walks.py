"""Walks over floors whose parts lie flush: nothing stops a walker where two parts meet, and it stays level."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_pairwise import half
from laws.helpers_walks import FLOORS, MODES, WALKERS, polygon, random_walk

from carom.components import AABBCollider, RigidBody, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, convex_polygon

JITTER = 1e-6  # of the unit of length
LOST = 1e-6  # of the speed


def check(seeds, **kinds):
    walks = {seed: random_walk(seed, **kinds) for seed in seeds}
    assert {seed: walk for seed, walk in walks.items() if walk.jitter > JITTER or walk.lost > LOST} == {}


@pytest.mark.parametrize("walker", WALKERS)
def test_walks(walker):
    check(range(6), walkers=(walker,))


@pytest.mark.slow
@pytest.mark.parametrize(("walker", "floor"), half(WALKERS, FLOORS))
def test_walks_over_one_kind_of_floor(floor, walker):
    check(range(1000, 1003), floors=(floor,), walkers=(walker,))


@pytest.mark.long
def test_ten_thousand_walks():
    check(range(10_000))


@pytest.mark.slow
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


def test_a_body_alone_stands_as_high_on_one_floor_as_on_two():
    with World(Physics(2, gravity=(0, -10))) as world:
        for x in (-1.0, 1.0):
            world.create_entity(Transform((x, -0.5)), AABBCollider((1, 0.5)))
        ids = [world.create_entity(Transform((x, 1)), RigidBody(), AABBCollider((0.3, 0.5))) for x in (-1, 0, 1)]
        for _ in range(120):
            world.step()
        heights = [world.component_for_entity(e, Transform).y for e in ids]
        np.testing.assert_allclose(heights, 0.5, rtol=0, atol=1e-15)
        assert len(world.contacts) == 4

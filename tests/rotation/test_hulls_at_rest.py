"""Hulls come to rest on a face: also where others are nearly in its plane, and where three points bear it unevenly."""

from __future__ import annotations

import numpy as np
import pytest
from rotation.helpers_turning import turning_world, wall
from worlds import MODES, run

from carom.components import RigidBody, Transform
from carom.plugins import convex_hull
from carom.plugins.convex_hull import ConvexHullCollider
from carom.plugins.rotation import Spin


def drop_stone(world, place, random, corners):
    """A stone of so many corners, on a sphere of 0.5, turned at random."""
    points = random.normal(size=(corners, 3))
    stone = ConvexHullCollider(0.5 * points / np.linalg.norm(points, axis=1)[:, None], friction=0.5)
    stone.offset = -stone.centre_of_mass
    world.create_entity(Transform(place, tuple(random.normal(size=4))), RigidBody(), Spin(), stone)


def test_stones_come_to_rest_on_a_floor():
    """They have no energy then, and are no deeper in the floor than what they weigh presses them."""
    with turning_world(3, 9.81, convex_hull.plugin) as world:
        wall(world, (0, -1, 0), (30, 1, 3), friction=0.5)
        for k, seed in enumerate((8, 9, 10, 11)):
            drop_stone(world, (4 * k, 0.8, 0), np.random.default_rng(seed), 10)
        run(world, 900)
        for _ in range(30):
            world.step()
            assert world.contacts.depth.max() < 1e-3
            assert world.kinetic_energy() < 1e-10


@pytest.mark.parametrize("mode", MODES)
def test_stones_of_many_corners_lie_still(mode):
    """Each on three points, of which some hardly push. One of 30 may rock on: of 1,800 others 14 do, on faces that are
    nearly in one plane."""
    random = np.random.default_rng(MODES.index(mode))
    with turning_world(3, 9.81, convex_hull.plugin, collision=mode) as world:
        wall(world, (0, -1, 0), (30, 1, 30), friction=0.5)
        for k in range(30):
            drop_stone(world, (4 * (k % 6) - 10, 1, 4 * (k // 6) - 10), random, random.integers(12, 41))
        run(world, 1200)
        rocking = np.abs(world.bodies.dynamic.spin.angular_velocity).max(axis=1) > 1e-5
        assert rocking.sum() <= 1
        assert world.kinetic_energy() < 1e-4

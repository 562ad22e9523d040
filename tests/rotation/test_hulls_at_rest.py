"""Hulls come to rest on a face: also where others are nearly in its plane, and where three points bear it unevenly."""

from __future__ import annotations

import numpy as np
import pytest
from worlds import MODES

from carom.components import RigidBody, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, convex_hull
from carom.plugins.convex_hull import ConvexHullCollider
from carom.plugins.rotation import BoxCollider, Rotation, Spin


@pytest.mark.parametrize(("corners", "seed"), [(10, seed) for seed in (8, 9, 10, 11)])
def test_a_stone_comes_to_rest_on_a_floor(corners, seed):
    """It has no energy then, and is no deeper in the floor than what it weighs presses it."""
    random = np.random.default_rng(seed)
    points = random.normal(size=(corners, 3))
    stone = ConvexHullCollider(0.5 * points / np.linalg.norm(points, axis=1)[:, None], friction=0.5)
    stone.offset = -stone.centre_of_mass
    with World(Physics(3, gravity=(0, -9.81, 0)), Rotation(), convex_hull.plugin) as world:
        world.create_entity(Transform((0, -1, 0)), BoxCollider((3, 1, 3), friction=0.5))
        world.create_entity(Transform((0, 0.8, 0), tuple(random.normal(size=4))), RigidBody(), Spin(), stone)
        for _ in range(900):
            world.step()
        energies = []
        for _ in range(30):
            world.step()
            energies.append(world.kinetic_energy())
            assert world.contacts.depth.max() < 1e-3
        assert max(energies) < 1e-10


@pytest.mark.parametrize("mode", MODES)
def test_stones_of_many_corners_lie_still(mode):
    """Each on three points, of which some hardly push. One of 30 may rock on: of 1,800 others 14 do, on faces that are
    nearly in one plane."""
    random = np.random.default_rng(MODES.index(mode))
    with World(
        Physics(3, gravity=(0, -9.81, 0)), Rotation(), convex_hull.plugin, settings=Settings(collision=mode)
    ) as world:
        world.create_entity(Transform((0, -1, 0)), BoxCollider((30, 1, 30), friction=0.5))
        for k in range(30):
            points = random.normal(size=(random.integers(12, 41), 3))
            stone = ConvexHullCollider(0.5 * points / np.linalg.norm(points, axis=1)[:, None], friction=0.5)
            stone.offset = -stone.centre_of_mass
            place, turn = (4 * (k % 6) - 10, 1, 4 * (k // 6) - 10), tuple(random.normal(size=4))
            world.create_entity(Transform(place, turn), RigidBody(), Spin(), stone)
        for _ in range(1200):
            world.step()
        rocking = np.abs(world.bodies.dynamic.spin.angular_velocity).max(axis=1) > 1e-5
        assert rocking.sum() <= 1
        assert world.kinetic_energy() < 1e-4

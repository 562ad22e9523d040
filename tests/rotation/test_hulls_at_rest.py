"""Hulls with faces that are nearly in one plane lie still on one of them."""

from __future__ import annotations

import numpy as np
import pytest

from carom.components import RigidBody, Transform
from carom.framework import World
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

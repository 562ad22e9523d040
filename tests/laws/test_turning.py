"""What bodies do that turn: over the seams of a floor, and flat onto it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rotation.helpers_turning import G, box, motion, pose, turning_world, wall
from worlds import MODES

from carom.components import RigidBody, Transform
from carom.plugins import capsule, convex_polygon
from carom.plugins.rotation import Spin


def seams(seed, mode):
    """(how far it rises, m; how far it turns, rad) of a body with round corners that slides over boxes laid flush."""
    random = np.random.default_rng([seed, 60])
    radius, speed, width = random.choice([0.01, 0.03, 0.1, 0.3]), random.uniform(3.0, 30.0), random.uniform(0.4, 1.5)
    half, high, turn = random.uniform((0.3, 0.25), (0.8, 0.5)), radius, -0.5 * math.pi
    shape = capsule.CapsuleCollider(radius, half[0])
    if seed % 2:
        shape, high, turn = convex_polygon.ConvexPolygonCollider.box(half, corner_radius=radius), half[1] + radius, 0.0
    with turning_world(2, G, capsule.plugin, convex_polygon.plugin, collision=mode, on_fault="ignore") as world:
        wall(world, (-10.0, -0.5), (10.0, 0.5))
        for k in range(math.ceil(speed / width) + 2):
            wall(world, ((k + 0.5) * width, -0.5), (0.5 * width, 0.5))
        start = Transform((-2.5 - 5 / 60 * speed, high), turn)
        entity, poses = world.create_entity(start, RigidBody(1.0, (speed, 0)), Spin(), shape), []
        for _ in range(60):
            world.step()
            poses.append(pose(world, entity) - (0.0, high, turn))
        return np.max(poses, axis=0)[1], np.abs(poses).max(axis=0)[2]


@pytest.mark.parametrize("mode", MODES)
def test_round_corners_do_not_catch_at_the_seams_of_a_floor(mode):
    """Nor do they rise over these, though they may pass more than one in a step. 82: it rose by .67 m."""
    for seed in (*range(6), 82):
        rises, turns = seams(seed, mode)
        assert rises < 3e-3
        assert turns < 0.01


def fall(seed, mode, d):
    """The fastest spin of a box that falls flat, in two seconds; all lengths are sums of powers of two."""
    random = np.random.default_rng([seed, 61])
    half, x = random.integers(16, 64, d) / 64, random.integers(-128, 128) / 64
    with turning_world(d, G, collision=mode) as world:
        wall(world, (0.0, -1.0, 0.0)[:d], (16.0, 1.0, 16.0)[:d], friction=0.5)
        place, fastest = (x, half[1] + random.uniform(0.0, 2.0), 0.0)[:d], 0.0
        entity = box(world, place, half, (0.0, random.uniform(-8.0, 0.0), 0.0)[:d], mass=random.uniform(0.1, 10.0))
        for _ in range(120):
            world.step()
            fastest = max(fastest, np.abs(motion(world, entity)[1]).max())
        assert abs(pose(world, entity)[1] - half[1]) < 1e-3
        return fastest


@pytest.mark.parametrize("mode", MODES)
def test_what_falls_flat_does_not_turn_by_a_bit(mode):
    assert [fall(seed, mode, 2) for seed in range(20)] == [0.0] * 20


def test_what_falls_flat_in_space_turns_by_rounding_alone():
    assert max(fall(seed, "discrete", 3) for seed in range(6)) < 1e-12

"""Boxes that turn by their contacts at rest: tipping, sliding, standing and falling, against statics and laws."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carom.components import RigidBody, Transform
from carom.framework import Settings, World
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation, Spin

MODES = ("discrete", "continuous", "event_driven")
G = 9.81


def ground(slope=0.0, friction=0.5, **settings):
    """A world in which the ground is level, its surface at 0, and gravity leans by ``slope``."""
    down = G * math.sin(slope), -G * math.cos(slope)
    world = World(Physics(2, gravity=down), Rotation(), settings=Settings(**settings))
    world.create_entity(Transform((0, -1)), RigidBody(kind="static"), BoxCollider((100, 1), friction=friction))
    return world


def box(world, place, half, rotation=0.0, friction=0.5, mass=1.0, **spin):
    body = RigidBody(mass=mass)
    return world.create_entity(Transform(place, rotation), body, Spin(**spin), BoxCollider(half, friction=friction))


def pose(world, entity):
    """(x, y, angle)."""
    transform = world.component_for_entity(entity, Transform)
    return np.array((*transform.position, transform.rotation))


@pytest.mark.parametrize("mode", MODES)
def test_a_box_tips_where_its_centre_stands_over_its_edge(mode):
    """At tan a = width / height, 1 % to either side; it lies on its side then."""
    for times in (0.99, 1.01):
        with ground(math.atan(times * 0.5), friction=2.0, collision=mode) as world:
            entity = box(world, (0, 0.5), (0.25, 0.5), friction=2.0)
            for _ in range(300):
                world.step()
            x, y, angle = pose(world, entity)
        if times < 1.0:
            assert (abs(x), y, abs(angle)) == pytest.approx((0, 0.5, 0), abs=1e-6)
        else:
            assert (y, angle) == pytest.approx((0.25, -math.pi / 2), abs=2e-3)


@pytest.mark.plain
@pytest.mark.parametrize("mode", MODES)
def test_a_box_slides_where_friction_ends_and_does_not_turn(mode):
    """At tan a = mu, 1 % to either side; with g (sin a - mu cos a), but for the first steps, in which it settles
    and keeps some mm/s."""
    mu, seconds = 0.3, 1.0
    for times in (0.99, 1.01, 1.5):
        slope = math.atan(times * mu)
        with ground(slope, mu, collision=mode) as world:
            entity = box(world, (0, 0.5), (0.5, 0.5), friction=mu)
            for _ in range(60):
                world.step()
            x, y, angle = pose(world, entity)
        way = 0.5 * G * max(0.0, math.sin(slope) - mu * math.cos(slope)) * seconds**2
        assert x == pytest.approx(way, rel=0.02, abs=4e-3)
        assert (y, angle) == pytest.approx((0.5, 0.0), abs=1e-6)


@pytest.mark.plain
def test_a_box_that_stands_on_its_corner_falls_to_its_side_and_rests():
    with ground() as world:
        entity = box(world, (0, 0.7), (0.5, 0.5), rotation=0.7)
        for _ in range(120):
            world.step()
        x, y, angle = pose(world, entity)
        assert (y, angle) == pytest.approx((0.5, 0.0), abs=1e-6)
        for _ in range(60):
            world.step()
        assert pose(world, entity) == pytest.approx((x, y, angle), abs=1e-9)


@pytest.mark.parametrize("mode", MODES)
def test_ten_boxes_stand(mode):
    """Turned by less than 2.5e-4 after 10 s; they sag by what soft contacts give."""
    with ground(collision=mode) as world:
        entities = [box(world, (0, 0.5 + k), (0.5, 0.5)) for k in range(10)]
        for _ in range(600):
            world.step()
        poses = np.array([pose(world, entity) for entity in entities])
    assert np.abs(poses[:, 2]).max() < 2.5e-4
    assert np.abs(poses[:, 0]).max() < 2e-3
    assert poses[:, 1] == pytest.approx(np.arange(10) + 0.5, abs=0.04)


def test_dominoes_fall_at_a_speed_that_does_not_depend_on_the_step():
    """Within 2 % from 1/60 s on."""
    speeds = []
    for rate in (60, 120, 240):
        with ground(friction=0.5, dt=1 / rate) as world:
            entities = [
                box(world, (0.5 * k, 0.5), (0.05, 0.5), angular_velocity=-2.0 if k == 0 else 0.0) for k in range(40)
            ]
            fallen = {}
            while 30 not in fallen:
                world.step()
                for k in (15, 30):
                    if k not in fallen and pose(world, entities[k])[2] < -0.2:
                        fallen[k] = world.time
                assert world.time < 10.0
        speeds.append(7.5 / (fallen[30] - fallen[15]))
    assert speeds[0] == pytest.approx(speeds[2], rel=0.02)
    assert speeds[1] == pytest.approx(speeds[2], rel=0.02)


def test_boxes_that_fall_askew_come_to_rest():
    """Eight, one on the other, turned by up to .3: no energy is left, and none is inside another."""
    random = np.random.default_rng(3)
    with ground() as world:
        entities = [box(world, (random.uniform(-0.1, 0.1), 1 + 1.3 * k), (0.5, 0.5), random.uniform(-0.3, 0.3))
                    for k in range(8)]  # fmt: skip
        for _ in range(900):
            world.step()
        moving = world.bodies.dynamic
        energy = 0.5 * (moving.linear_velocity**2).sum() + (moving.spin.angular_velocity**2).sum() / 12
        assert energy < 1e-9
        assert all(pose(world, entity)[1] > 0.45 for entity in entities)
        assert world.contacts.depth.max() < 0.02

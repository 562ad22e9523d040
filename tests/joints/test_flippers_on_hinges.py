"""Flippers of mass on hinges, which a motor starts: what they meet in the step in which that turns them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from worlds import run

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics
from carom.plugins.joints import Hinge, Joints
from carom.plugins.parts import PartOf, Parts
from carom.plugins.rotation import BoxCollider, Rotation, Spin

HALF, RADIUS, SPEED = 0.1, 0.2, 15.0


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["discrete", "continuous", "event_driven"])
@pytest.mark.parametrize("e", [0.0, 0.5])
@pytest.mark.parametrize("above", [0.0, 0.3])
def test_a_flipper_that_a_motor_starts_throws_the_ball_over_it(above, e, mode):
    """Its point at the ball moves by up to .45 m in the step in which the motor starts: it sinks in by less than a
    fifth of that, is thrown as fast as that point moves, or faster, and is on its face as long as it is beside it."""
    c, s, up = math.cos(-0.4), math.sin(-0.4), HALF + RADIUS + 0.01 + above
    for where in (0.4, 1.2, 1.8):
        with World(
            Physics(2, gravity=(0, -9.81)), Rotation(), Joints(), settings=Settings(collision=mode, on_fault="ignore")
        ) as world:
            box = BoxCollider((1, HALF), restitution=e)
            flipper = world.create_entity(Transform((c, s), -0.4), RigidBody(10.0), Spin(0.0), box)
            hinge = Hinge(None, flipper, anchor=(0, 0), motor_speed=0.0, limits=(0.0, 1.2))
            world.create_entity(hinge)
            ball = world.create_entity(
                Transform((where * c - s * up, where * s + c * up)), RigidBody(), SphereCollider(RADIUS, restitution=e)
            )
            run(world, 2)
            hinge.motor_speed, fastest = SPEED, 0.0
            for _ in range(4):
                world.step()
                angle = world.component_for_entity(flipper, Transform).rotation
                x, y = world.component_for_entity(ball, Transform).position
                fastest = max(fastest, np.linalg.norm(world.component_for_entity(ball, RigidBody).linear_velocity))
                along, high = math.cos(angle) * x + math.sin(angle) * y, math.cos(angle) * y - math.sin(angle) * x
                assert high > HALF + RADIUS - 0.09 or not 0 < along < 2
            assert fastest > 0.95 * SPEED * where


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["discrete", "continuous", "event_driven"])
@pytest.mark.parametrize("parts", [False, True])
def test_a_motor_strikes_in_the_step_in_which_it_starts_in_a_loaded_world_too(tmp_path, parts, mode):
    """How far it may turn its body is no matter of the step before; what turns may be a part of the body."""
    plugins = Physics(2, gravity=0), Rotation(), Joints(), Parts()
    with World(*plugins, settings=Settings(collision=mode, on_fault="ignore")) as world:
        bar = BoxCollider((2, HALF))
        own = Transform((0, 0)), RigidBody(10.0), Spin(inertia=4.0)
        flipper = world.create_entity(*own, *([] if parts else [bar]))
        if parts:
            world.create_entity(PartOf(flipper, (0, 0), mass=0.0), bar)
        hinge = Hinge(None, flipper, anchor=(0, 0), motor_speed=0.0, max_torque=4000.0)
        world.create_entity(hinge)
        ball = world.create_entity(Transform((1.8, HALF + RADIUS + 0.2)), RigidBody(0.1), SphereCollider(RADIUS))
        world.step()
        hinge.motor_speed = SPEED
        world.save(tmp_path / "flipper")
        with World.load(tmp_path / "flipper", Physics(2), Rotation(), Joints(), Parts()) as loaded:
            for one in (world, loaded):
                one.step()
                assert one.component_for_entity(ball, Transform).y > HALF + RADIUS + 0.21
            assert loaded.state_hash() == world.state_hash()

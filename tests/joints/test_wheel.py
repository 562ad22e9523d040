"""Wheels on a spring, which turn freely or are driven, in two and three dimensions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from joints.helpers_joints import G, at, joint_world
from worlds import run

from carom import RigidBody, Transform, World
from carom.plugins.joints import Joints, Wheel
from carom.plugins.rotation import Spin

pytestmark = [pytest.mark.plain, pytest.mark.parametrize("d", [2, 3])]


def make(d: int, gravity: float = 0.0) -> tuple[World, Joints, dict[str, Any]]:
    """A world, its joints, and what a wheel about the last axis is given besides."""
    return *joint_world((0.0, -gravity, 0.0)[:d], d), {} if d == 2 else {"axis": (0.0, 0.0, 2.0)}


def body(world: World, place: Any, mass: float, inertia: float, spin: Any = 0.0, **moves: Any) -> int:
    flat = world.dimensions == 2
    turns = Spin(spin, inertia=inertia) if flat else Spin(spin, inertia=(inertia, 0.7 * inertia, 1.3 * inertia))
    return world.create_entity(Transform(place), RigidBody(mass=mass, **moves), turns)


@pytest.mark.compiled
def test_it_hangs_on_its_spring_on_its_axis_and_turns_as_its_motor_can(d):
    world, joints, axle = make(d, G)
    velocity, spin = ((3.0, 0.0), 0.0) if d == 2 else ((3.0, 0.0, 2.0), (1.0, -2.0, 0.0))
    b = body(world, (1.0, 2.0, 0.5)[:d], 3.0, 0.5, spin, linear_velocity=velocity)
    about = 0.5 if d == 2 else 0.65
    motor = {"motor_speed": 4.0, "max_torque": 2.0}
    wheel = Wheel(None, b, (1.0, 2.0, 0.5)[:d], (0, 1, 0)[:d], frequency=2.0, damping_ratio=1.0, **axle, **motor)
    entity = world.create_entity(wheel)
    run(world, 30)
    turning = float(np.atleast_1d(world.component_for_entity(b, Spin).angular_velocity)[-1])
    assert turning == pytest.approx(2.0 / about * 0.5, rel=1e-3)
    run(world, 300)
    omega = 2.0 * math.pi * 2.0
    sag, place = G / omega**2, at(world, b).position
    less = omega / 240.0  # of the sag: weight and damping act one after the other in a substep
    assert (1.0 - less - 0.01) * sag < 2.0 - place[1] < sag
    assert place[::2] == pytest.approx((1.0, 0.5)[: d - 1], abs=1e-3)
    assert joints.state(entity).value == pytest.approx(place[1] - 2.0, abs=1e-12)
    spin = np.atleast_1d(world.component_for_entity(b, Spin).angular_velocity)
    assert spin == pytest.approx([4.0] if d == 2 else [0.0, 0.0, 4.0], abs=1e-3)
    wheel.lower = -0.5 * sag
    run(world, 120)
    assert joints.state(entity).value == pytest.approx(-0.5 * sag, abs=1e-3)
    assert joints.state(entity).speed == pytest.approx(0.0, abs=1e-6)


def test_what_no_wheel_can_be_is_refused_at_the_call(d):
    world, _, axle = make(d)
    b, anchor = body(world, (0.0,) * d, 1.0, 1.0), (0.0,) * d
    with pytest.raises(ValueError, match=r"Wheel\.direction must not be 0"):
        Wheel(None, b, anchor, (0.0,) * d, **axle)
    if d == 3:
        with pytest.raises(ValueError, match="at right angles"):
            Wheel(None, b, anchor, (0, 1, 1), **axle)
        with pytest.raises(ValueError, match="needs an axis"):
            world.create_entity(Wheel(None, b, anchor, (0, 1, 0)))

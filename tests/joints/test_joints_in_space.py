"""Joints of three dimensions against closed forms: hinges, welds, sliders, cones, a gyroscope."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from joints.helpers_joints import G, at, joint_world
from worlds import run

from carom import Physics, RigidBody, Transform, World
from carom.plugins.joints import Ball, Cone, Hinge, Joints, Motor, Slider, Weld, Wheel
from carom.plugins.rotation import BoxCollider, Rotation, Spin

TURN = (math.cos(0.3), 0.2 * math.sin(0.3), -0.6 * math.sin(0.3), math.sqrt(0.6) * math.sin(0.3))


def space(gravity: Any = (0.0, 0.0, -G), **settings: Any) -> tuple[World, Joints]:
    return joint_world(gravity, 3, **settings)


def block(world: World, place: Any, half: Any = (0.5, 0.1, 0.2), mass: float = 1.0, rotation: Any = 0.0) -> int:
    return world.create_entity(Transform(place, rotation), RigidBody(mass=mass), BoxCollider(half, mask=0), Spin())


def spin_of(world: World, body: int) -> np.ndarray:
    return np.array(world.component_for_entity(body, Spin).angular_velocity)


@pytest.mark.slow
def test_door_swings_about_its_axis_with_its_period():
    world, joints = space()
    body = block(world, (0.5, 0, 0))
    hinge = world.create_entity(Hinge(None, body, anchor=(0, 0, 0), axis=(0, 2, 0)))
    moment = (0.25 + 0.04) / 3.0 + 0.25  # about the axis, of 1 kg
    angles = []
    for _ in range(600):
        world.step()
        state = joints.state(hinge)
        angles.append(state.value - math.pi / 2)
        x, y, z = at(world, body).position
        assert abs(y) < 1e-9
        assert math.hypot(x, z) == pytest.approx(0.5, abs=2e-3)
        assert math.cos(math.atan2(-z, x) - state.value) > 1.0 - 1e-5
    passes = [k + a / (a - b) for k, (a, b) in enumerate(itertools.pairwise(angles)) if a < 0 <= b]
    exact = 4.0 * math.sqrt(moment / (G * 0.5)) * 1.8540746773013719  # K(sin(45 degrees)): it falls from 90
    assert np.diff(passes).mean() / 60 == pytest.approx(exact, rel=2e-3)


def test_hinge_has_a_motor():
    axis = np.array((1.0, 2.0, 2.0)) / 3.0
    world, joints, body, hinge = hinged(motor_speed=4.0, max_torque=4.0)
    run(world, 30)
    np.testing.assert_allclose(spin_of(world, body), axis, atol=1e-9)  # T t / I
    np.testing.assert_allclose(joints.state(hinge).torque, 4.0 / 60 * axis, atol=1e-9)
    assert joints.state(hinge).value == pytest.approx(0.25, abs=0.02)
    run(world, 120)
    np.testing.assert_allclose(spin_of(world, body), 4.0 * axis, atol=1e-6)


def free_body() -> tuple[World, Joints, int]:
    """One without weight, alike about all axes."""
    world, joints = space(0)
    spin = Spin(inertia=np.full(3, 2.0))
    return world, joints, world.create_entity(Transform((1, 2, 3), TURN), RigidBody(), spin)


def hinged(limits: Any = None, **fields: Any) -> tuple[World, Joints, int, int]:
    """A body on a skew hinge through its centre, without weight."""
    world, joints, body = free_body()
    hinge = Hinge(None, body, anchor=(1, 2, 3), axis=(1, 2, 2), limits=limits, **fields)
    return world, joints, body, world.create_entity(hinge)


@pytest.mark.slow
@pytest.mark.parametrize("limits", [(0.0, 3.2), (-0.5, 6.5), (-1.0, 15.0), (-1.0, 3.0)])
def test_hinge_turns_to_its_limit_however_far_that_is(limits: Any):
    world, joints, body, hinge = hinged(limits, motor_speed=4.0, max_torque=8.0)
    for _ in range(300):  # it reaches 4 rad/s in a second, 2 rad from where it was
        world.step()
        assert joints.state(hinge).value < limits[1] + 1e-3
        assert np.linalg.norm(spin_of(world, body)) < 4.0 + 1e-6
    assert joints.state(hinge).value == pytest.approx(limits[1], abs=1e-3)


@pytest.mark.parametrize("angle", [3.1, 3.2, -10.0, 40.0])
def test_servo_turns_to_its_angle_however_far_that_is(angle: float):
    world, joints, body = free_body()
    servo = world.create_entity(Motor(None, body, angle=angle, max_torque=20.0, axis=(1, 2, 2)))
    run(world, 600)
    assert joints.state(servo).value == pytest.approx(angle, abs=1e-3)
    assert np.linalg.norm(spin_of(world, body)) < 1e-3


@pytest.mark.parametrize("speed", [7.0, -400.0])
def test_whole_turns_of_a_hinge_are_counted_through_changes_snapshots_and_files(speed: float, tmp_path: Any):
    world, joints, body, hinge = hinged()
    world.component_for_entity(body, Spin).angular_velocity = speed * np.array((1.0, 2.0, 2.0)) / 3.0
    run(world, 60)
    assert joints.state(hinge).value == pytest.approx(speed, rel=1e-9)
    field = world.component_for_entity(hinge, Hinge)
    field.lower = -1e6  # other rows
    run(world, 60)
    before = world.snapshot()
    world.save(tmp_path / "turns.carom")
    run(world, 60)
    assert joints.state(hinge).value == joints.columns()["value"][0] == pytest.approx(3 * speed, rel=1e-9)
    after = world.state_hash(), joints.state(hinge).value
    world.restore(before)
    run(world, 60)
    assert (world.state_hash(), joints.state(hinge).value) == after
    again = Joints()
    with World.load(tmp_path / "turns.carom", Physics(dimensions=3), Rotation(), again) as loaded:
        run(loaded, 60)
        assert (loaded.state_hash(), again.state(hinge).value) == after
    field.anchor = (1.0, 2.0, 3.0)  # it takes hold once more: of the body as it is
    world.step()
    assert joints.state(hinge).value == pytest.approx(speed / 60, rel=1e-6)


@pytest.mark.parametrize("twist", [None, (-1.0, 8.0)])
def test_twist_of_a_cone_counts_whole_turns(twist: Any):
    world, joints, body = free_body()
    cone = world.create_entity(Cone(None, body, anchor=(1, 2, 3), axis=(1, 2, 2), swing=0.5, twist=twist))
    world.component_for_entity(body, Spin).angular_velocity = np.array((2.0, 4.0, 4.0))
    run(world, 120)
    assert joints.state(cone).value == pytest.approx(12.0 if twist is None else 8.0, abs=1e-3)


FREE_PAIRS = {  # what holds two free blocks, beside each other along x
    "ball": lambda a, b: Ball(a, b, (0, 0, 0)),
    "hinge": lambda a, b: Hinge(a, b, (0, 0, 0), axis=(0.3, 0.2, 1.0)),
    "limits": lambda a, b: Hinge(a, b, (0, 0, 0), axis=(0.3, 0.2, 1.0), limits=(-0.3, 0.3)),
    "weld": lambda a, b: Weld(a, b, (0, 0, 0)),
    "slider": lambda a, b: Slider(a, b, (1.0, 0.3, 0.0), limits=(-0.2, 0.2)),
    "cone": lambda a, b: Cone(a, b, (0, 0, 0), axis=(1, 0, 0), swing=0.4, twist=(-0.3, 0.3)),
    "motor": lambda a, b: Motor(a, b, speed=2.0, max_torque=3.0, axis=(0.3, 0.2, 1.0)),
    "wheel": lambda a, b: Wheel(a, b, (0.6, 0, 0), (0, 1, 0), axis=(0, 0, 1), frequency=3.0, damping_ratio=0.5),
    "driven wheel": lambda a, b: Wheel(
        a, b, (0.6, 0, 0), (0, 1, 0), axis=(0, 0, 1), frequency=3.0, motor_speed=-20.0, max_torque=1.0
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", FREE_PAIRS)
def test_two_free_blocks_keep_their_angular_momentum(kind: str):
    """To the gap of the joint, of order (w h)^2 with w h = 0.02 in a substep; and none gives energy of itself."""
    for seed, substeps, most in ((0, 4, 3e-4), (1, 4, 3e-4), (3, 32, 1e-4)):
        q = np.random.default_rng(seed)
        world, _ = space(0, substeps=substeps)
        a, b = (
            world.create_entity(
                Transform((x, 0, 0)), RigidBody(mass=mass, linear_velocity=q.normal(size=3)),
                BoxCollider((0.4, 0.2, 0.1), mask=0), Spin(3.0 * q.normal(size=3)),
            )
            for x, mass in ((-0.6, 1.0), (0.6, 2.0))
        )  # fmt: skip
        world.create_entity(FREE_PAIRS[kind](a, b))

        def momentum(world: World = world, bodies: Any = (a, b)) -> tuple[np.ndarray, float]:
            parts = []
            for body in bodies:
                move, spin = world.component_for_entity(body, RigidBody), world.component_for_entity(body, Spin)
                turn = axes_of(at(world, body).rotation)
                parts.append(move.mass * np.cross(at(world, body).position, move.linear_velocity))
                parts.append(turn @ spin.moments @ turn.T @ np.asarray(spin.angular_velocity))
            return np.sum(parts, axis=0), float(np.linalg.norm(parts, axis=1).sum())

        world.refresh_queries()
        (before, size), least = momentum(), world.kinetic_energy()
        for _ in range(240):
            world.step()
            energy = world.kinetic_energy()
            if kind not in ("motor", "wheel", "driven wheel"):
                assert energy <= least * (1.0 + 1e-9)
            least = min(least, energy)
        assert np.linalg.norm(momentum()[0] - before) < most * size


def axes_of(rotation: Any) -> np.ndarray:
    """The matrix of a quaternion."""
    w, x, y, z = rotation
    cross = np.array(((0, -z, y), (z, 0, -x), (-y, x, 0)))
    return np.eye(3) + 2.0 * (w * cross + cross @ cross)


def test_slider_in_space_stops_at_its_limit():
    world, joints = space()
    along = np.array((0.6, 0.0, -0.8))
    body = block(world, (0, 0, 0), rotation=TURN)
    slider = world.create_entity(Slider(None, body, direction=along, limits=(-1.0, 2.0)))
    run(world, 30)
    assert joints.state(slider).speed == pytest.approx(G * 0.8 * 0.5, rel=1e-5)
    run(world, 120)
    assert joints.state(slider).value == pytest.approx(2.0, abs=2e-3)
    np.testing.assert_allclose(at(world, body).position, 2.0 * along, atol=5e-3)
    assert abs(np.dot(at(world, body).rotation, TURN)) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.slow
def test_cone_bounds_swing_and_twist():
    world, joints = space()
    body = block(world, (0, 0, 0.5), half=(0.1, 0.2, 0.5))
    cone = world.create_entity(Cone(None, body, anchor=(0, 0, 0), axis=(0, 0, 1), swing=0.5, twist=(-0.3, 0.3)))
    world.component_for_entity(body, Spin).angular_velocity = np.array((0.3, 0.2, 2.0))
    for _ in range(600):
        world.step()
        x, y, z = at(world, body).position
        assert math.atan2(math.hypot(x, y), z) < 0.53
        assert abs(joints.state(cone).value) < 0.35
    assert math.atan2(math.hypot(x, y), z) == pytest.approx(0.5, abs=0.01)


@pytest.mark.slow
def test_a_wide_cone_bounds_its_twist_and_holds():
    """The twist is 2 atan2(q . axis, q_w) of the turn q of b against a, at any swing; without gravity, energy falls."""
    for seed in range(12):
        random = np.random.default_rng(seed)
        swing, most, axis = random.uniform(0.5, 2.5), random.uniform(0.2, 1.0), random.normal(size=3)
        axis /= np.linalg.norm(axis)
        world, joints = space(gravity=0.0)
        a, b = block(world, (0, 0, 0)), block(world, (1.5, 0, 0))
        for body in (a, b):
            world.component_for_entity(body, Spin).angular_velocity = random.normal(0.0, 3.0, 3)
        cone = world.create_entity(Cone(a, b, anchor=(0.75, 0, 0), axis=axis, swing=swing, twist=(-most, most)))
        first = world.kinetic_energy()
        for _ in range(90):
            world.step()
            one, other = joints.anchors()
            assert np.linalg.norm(one - other) < 0.02, seed
            (p, *u), (q, *v) = (np.array(at(world, body).rotation) for body in (a, b))
            real, turn = p * q + np.dot(u, v), p * np.array(v) - q * np.array(u) - np.cross(u, v)
            twist = math.remainder(2.0 * math.atan2(turn @ axis, real), 2.0 * math.pi)
            assert abs(twist) < most + 0.05, seed
            assert joints.state(cone).value == pytest.approx(twist, abs=1e-9)
        assert world.kinetic_energy() <= first * 1.001
        world.close()


def test_gyroscope_precesses():
    """A wheel at the end of a horizontal arm goes round at m g r / (I w)."""
    world, _ = space(dt=1 / 240)
    inertia, arm, speed = np.array((0.5, 0.26, 0.26)), 0.5, 60.0
    wheel = world.create_entity(Transform((arm, 0, 0)), RigidBody(), Spin(inertia=inertia))
    rate = G * arm / (inertia[0] * speed)
    spin = world.component_for_entity(wheel, Spin)
    spin.angular_velocity = np.array((speed, 0.0, rate))
    world.component_for_entity(wheel, RigidBody).linear_velocity = (0.0, rate * arm, 0.0)
    world.create_entity(Ball(None, wheel, anchor=(0, 0, 0)))
    run(world, 240)
    x, y, z = at(world, wheel).position
    assert math.atan2(y, x) == pytest.approx(rate, rel=0.02)
    assert abs(z) < 0.02
    assert math.hypot(x, y) == pytest.approx(arm, abs=2e-3)


@pytest.mark.plain
def test_hinges_and_cones_need_their_axis():
    world, _ = space()
    body = block(world, (0, 0, 0))
    for joint in (Hinge(None, body, anchor=(0, 0, 0)), Motor(None, body, speed=1.0)):
        with pytest.raises(ValueError, match="needs an axis in a world of 3 dimensions"):
            world.create_entity(joint)
    hinge = Hinge(None, body, anchor=(0, 0, 0), axis=(0, 0, 1))
    world.create_entity(hinge)
    with pytest.raises(ValueError, match="needs an axis"):
        hinge.axis = (0, 0, 0)
    world.step()
    assert hinge.axis.tolist() == [0, 0, 1]

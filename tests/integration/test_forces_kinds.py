"""Forces on bodies with a speed limit, and on those that are not dynamic."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_forces import DT, Calls, body
from helpers_motion import Oscillator, SpringAndDrag, all_methods, record
from worlds import EPS, make_world, position, run, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Phase

pytestmark = pytest.mark.plain


@all_methods
def test_speed_limit(method):
    """Falling at 10 m/s^2 with a cap of 3 m/s: never faster, and at the cap exactly 3 dt per step."""
    world = make_world(gravity=10.0, dt=DT, integrator=method)
    world.create_entity(Transform((0, 0)), RigidBody(max_linear_speed=3.0))
    world.create_entity(Transform((9, 0)), RigidBody())
    positions, velocities = record(world, 12)
    speed = np.hypot(*velocities[:, 0].T)
    assert (speed <= 3.0 * (1 + 2 * EPS)).all()
    travel = np.hypot(*np.diff(positions[:, 0], axis=0).T)
    assert (travel <= 3.0 * DT * (1 + 1e-14)).all()
    np.testing.assert_allclose(travel[4:], 3.0 * DT, rtol=1e-14)
    assert velocities[-1, 1, 1] == pytest.approx(-12 * 10.0 * DT, rel=1e-14)  # the other body has none


@all_methods
@pytest.mark.parametrize("speed", [1e3, 1e200, 1e307])
def test_speed_limit_holds_after_an_impulse(method, speed):
    """C12: the direction is kept and nothing overflows, in the very next step too."""
    world = make_world(dt=DT, integrator=method)
    rigid = body(world, max_linear_speed=5.0)
    rigid.apply_impulse((0.6 * speed, -0.8 * speed))
    world.step()
    np.testing.assert_allclose(rigid.linear_velocity, (3.0, -4.0), rtol=1e-14)
    np.testing.assert_allclose(world.bodies.position[0], (3.0 * DT, -4.0 * DT), rtol=1e-14)


@all_methods
def test_drag_does_not_see_more_than_the_limit(method):
    """An impulse of 1e6 m/s against a drag that is stable at the limit: it slows down and never reverses."""
    world = make_world(dt=DT, integrator=method)
    rigid = RigidBody(max_linear_speed=5.0)
    world.create_entity(Transform((0, 0)), rigid, Oscillator(0.0, 1.0))
    world.add_system(SpringAndDrag())
    rigid.apply_impulse((1e6, 0.0))
    _, velocities = record(world, 10)
    assert (velocities[1:, 0, 0] > 0).all()
    assert (velocities[1:, 0, 0] <= 5.0).all()


def test_speed_limit_of_zero_and_none():
    world = make_world(gravity=10.0, dt=DT)
    held = body(world, max_linear_speed=0.0)
    free = body(world, max_linear_speed=None)
    run(world, 3)
    assert held.linear_velocity.tolist() == [0, 0]
    assert world.bodies.position[0].tolist() == [0, 0]
    assert free.linear_velocity[1] == -30 * DT
    free.max_linear_speed = 1.0
    world.step()
    assert free.linear_velocity[1] == -1.0


@all_methods
def test_kinematic_bodies_move_by_their_velocity_alone(method):
    """No gravity, no constant or applied force, no force system, no damping, no impulse, no cap: x = x0 + v t."""
    world = make_world(gravity=10.0, dt=DT, integrator=method)
    rigid = RigidBody(
        2.0, (1.0, -0.5), kind="kinematic", constant_force=(5.0, 5.0), linear_damping=3.0, max_linear_speed=0.1
    )
    world.create_entity(Transform((4, 4)), rigid, Oscillator(9.0, 9.0))
    world.create_entity(Transform((0, 0)), RigidBody(), Oscillator(1.0, 0.0))
    world.add_system(SpringAndDrag())
    rigid.apply_impulse((7.0, 7.0))
    for _ in range(8):
        rigid.apply_force((7.0, 7.0))
        world.step()
    assert position(world, 1).tolist() == [5.0, 3.5]
    assert velocity(world, 1).tolist() == [1.0, -0.5]


@pytest.mark.parametrize("kind", ["kinematic", "static"])
@pytest.mark.parametrize("inside", [False, True])
def test_pushes_on_other_kinds_are_not_kept_for_later(kind, inside):
    """A body that was pushed without effect does not jump when it becomes dynamic."""
    world = make_world(dt=DT)
    rigid = body(world, kind=kind)
    world.step()
    system = Calls(Phase.START, lambda: rigid.apply_force((7.0, 0.0)))
    if inside:
        world.add_system(system)
        run(world, 3)
        world.remove_system(system)
    else:
        rigid.apply_force((7.0, 0.0))
        run(world, 3)
    rigid.kind = "dynamic"
    run(world, 2)
    assert not rigid.linear_velocity.any()


@all_methods
def test_static_bodies_do_not_move(method):
    """A static RigidBody, even with a velocity, and a collider without one."""
    world = make_world(gravity=10.0, dt=DT, integrator=method)
    world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(1, 1), constant_force=(1, 1), kind="static"))
    world.create_entity(Transform((3, 3)), AABBCollider((1, 1)))
    world.create_entity(Transform((9, 9)), RigidBody(), SphereCollider(0.5))
    positions, velocities = record(world, 5)
    still = slice(world.bodies.dynamic.rows.stop, None)
    assert (positions[:, still] == positions[0, still]).all()
    assert not velocities[1:, still].any()

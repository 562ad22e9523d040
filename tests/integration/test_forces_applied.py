"""Gravity, constant forces, impulses and applied forces: when they act, and on which bodies."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_motion import DRIFT, Oscillator, SpringAndDrag, all_methods, record
from integration.helpers_forces import DT, body
from worlds import EPS, Calls, make_world, run

from carom.components import RigidBody, Transform
from carom.framework import Phase


@all_methods
def test_gravity_scale_and_constant_force(method):
    """a = s g + F / m, each body its own; v_n = n a dt."""
    world = make_world(gravity=(1.0, -10.0), dt=DT, integrator=method)
    rng = np.random.default_rng(1)
    mass, scale, force = rng.uniform(0.1, 9, 40), rng.uniform(-2, 2, 40), rng.normal(size=(40, 2))
    scale[0] = 0.0
    world.create_entities(
        40, Transform.many(np.zeros((40, 2))), RigidBody.many(mass, constant_force=force, gravity_scale=scale)
    )
    positions, velocities = record(world, 20)
    acceleration = scale[:, None] * (1.0, -10.0) + force / mass[:, None]
    t = DT * np.arange(21)[:, None, None]
    np.testing.assert_allclose(velocities, t * acceleration, rtol=1e-13, atol=1e-13)
    expected = (t * t + DRIFT.get(method, 0) * -DT * t) / 2 * acceleration
    np.testing.assert_allclose(positions, expected, rtol=1e-12, atol=1e-12)


def test_gravity_can_be_replaced_between_steps():
    world = make_world(gravity=(0.0, -8.0), dt=DT)
    rigid = body(world)
    world.step()
    world.gravity = (4.0, 0.0)
    world.step()
    assert rigid.linear_velocity.tolist() == [4.0 * DT, -8.0 * DT]


@pytest.mark.parametrize("gravity", [(0, 0, -9.81), (0, float("nan")), 9.81, "down"])
def test_gravity_that_does_not_fit_is_refused(gravity):
    world = make_world()
    with pytest.raises(ValueError, match=r"gravity|could not convert"):
        world.gravity = gravity
    assert world.gravity.tolist() == [0, 0]


def test_impulse_acts_at_once():
    """dv = J / m, before any step; two add up."""
    world = make_world(dt=DT)
    rigid = body(world, 4.0, (1.0, 0.0))
    rigid.apply_impulse((2.0, -8.0))
    assert rigid.linear_velocity.tolist() == [1.5, -2.0]
    world.step()
    rigid.apply_impulse((2.0, 0.0))
    assert rigid.linear_velocity.tolist() == [2.0, -2.0]
    world.step()
    assert world.bodies.position[0].tolist() == [3.5 * DT, -4.0 * DT]


@pytest.mark.parametrize("phase", list(Phase))
def test_impulse_inside_a_system_acts_once(phase):
    """In any phase: after enough steps the velocity contains exactly one impulse per step."""
    world = make_world(dt=DT)
    rigid = body(world, 2.0)
    world.add_system(Calls(phase, lambda: rigid.apply_impulse((1.0, 0.0))))
    run(world, 5)
    assert rigid.linear_velocity.tolist() == [2.5, 0.0]


@pytest.mark.slow
@all_methods
@pytest.mark.parametrize("with_force_system", [False, True])
@pytest.mark.parametrize("phase", list(Phase))
def test_force_applied_in_a_system_acts_for_one_step(method, phase, with_force_system):
    """dv = F dt / m per call: in this step up to INTEGRATION's start, in the next one after it."""
    world = make_world(dt=DT, integrator=method)
    rigid = body(world, 2.0)
    if with_force_system:  # then the stages sum the forces again
        world.add_system(SpringAndDrag())
        world.create_entity(Transform((0, 5)), RigidBody(), Oscillator(1.0, 0.0))
    calls = []

    def push():
        if world.step_count in (1, 2, 5):
            calls.append(world.step_count)
            rigid.apply_force((4.0, -2.0))
            rigid.apply_force((0.0, 2.0))

    world.add_system(Calls(phase, push))
    gained = []
    for _ in range(8):
        before = rigid.linear_velocity[0]
        world.step()
        gained.append((rigid.linear_velocity[0] - before) / (4.0 * DT / 2.0))
    delay = phase >= Phase.INTEGRATION  # its systems run after the built-in one
    expected = [1.0 if n - delay in (1, 2, 5) else 0.0 for n in range(8)]
    np.testing.assert_allclose(gained, expected, rtol=0, atol=4 * EPS)
    assert rigid.linear_velocity[1] == 0.0
    assert calls == [1, 2, 5]


@pytest.mark.parametrize("adopted", [False, True])
def test_force_applied_outside_is_held_for_the_whole_advance(adopted):
    """In every step of the next advance that takes one, then it clears; an advance of no step keeps it."""
    world = make_world(dt=DT)
    rigid = body(world, 2.0)
    if adopted:
        world.step()
    rigid.apply_force((2.0, 0.0))
    rigid.apply_force((2.0, 0.0))
    assert world.advance(DT / 4) == 0
    assert world.advance(DT / 4) == 0
    assert rigid.linear_velocity[0] == 0.0
    assert world.advance(3 * DT) == 3
    assert rigid.linear_velocity[0] == 3 * 2.0 * DT
    assert world.advance(DT) == 1
    assert rigid.linear_velocity[0] == 3 * 2.0 * DT


@pytest.mark.parametrize("hz", [2, 4, 8, 16])
def test_force_of_every_frame_does_not_depend_on_the_frame_rate(hz):
    """A key held down for 4 s: v = F t / m at any frame rate; 8 steps a second."""
    world = make_world(dt=DT)
    rigid = body(world, 2.0)
    for _ in range(4 * hz):
        rigid.apply_force((3.0, 0.0))
        world.advance(1 / hz)
    assert rigid.linear_velocity[0] == pytest.approx(3.0 * 4.0 / 2.0, rel=1e-14)


@pytest.mark.parametrize("frame", [DT, 2 * DT, 4 * DT, 8 * DT])
def test_force_on_a_body_that_a_system_has_just_made(frame):
    """It acts for one step, like any force that a system applies, whatever the frame rate."""
    world = make_world(dt=DT)
    made = []

    def make():
        if world.step_count == 1:
            made.append(body(world))
            made[0].apply_force((1.0, 0.0))

    world.add_system(Calls(Phase.END, make))
    while world.step_count < 8:
        world.advance(frame)
    assert made[0].linear_velocity[0] == DT

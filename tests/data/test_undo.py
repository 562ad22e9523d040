"""Undoing a step in which only carom's own systems have run: their stages keep what they overwrite."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_steps import both_ways  # noqa: F401  every test with each
from worlds import ball, floor, make_world

from carom.components import RigidBody, Transform
from carom.framework import Phase, StepError, System
from carom.framework.schedule.stages import PythonPart
from carom.systems import ContactEvents, ForceAccumulation, Integration, Response

KEPT = ("position", "previous_position", "linear_velocity", "step_force", "applied_force", "applied_frame")


def fail_after(patch, world, kind):
    """From now on that built-in system raises at the end of its work."""
    system = next(s for s in world.systems if isinstance(s, kind))
    parts = system.parts()

    def no_more(dt):
        raise RuntimeError("no more")

    patch.setattr(system, "_parts", lambda: [*parts, PythonPart(system.name, no_more)])
    world.settings = world.settings.replace(max_steps_per_advance=7)  # parts are looked at again


def busy_world(colliders):
    world = make_world(gravity=9.81)
    if colliders:
        floor(world, restitution=0.5)
        ball(world, (0.0, 0.6), (0.3, -2.0), restitution=0.7)  # about to have an impact
        ball(world, (0.2, 4.0), (-0.1, 0.0), restitution=0.2)
    world.create_entity(Transform((5, 5)), RigidBody(2.0, (1, 0), max_linear_speed=0.5))  # beyond its limit
    world.create_entity(Transform((-5, 5)), RigidBody(kind="kinematic", linear_velocity=(0.1, 0.2)))
    pushed = world.create_entity(Transform((9, 5)), RigidBody(2.0, (1, 0)))
    world.component_for_entity(pushed, RigidBody).apply_force((3.0, 0.0))
    return world


def columns(world):
    return {name: np.array(getattr(world.bodies, name)) for name in KEPT}


@pytest.mark.parametrize("colliders", [True, False])
@pytest.mark.parametrize("limited", [True, False])
@pytest.mark.parametrize("system", [ForceAccumulation, Integration, Response, ContactEvents])
def test_a_step_of_built_in_systems_that_fails_leaves_no_trace(monkeypatch, system, limited, colliders):
    with monkeypatch.context() as patch, busy_world(colliders) as world:
        for _ in range(3):
            world.step()
        for _, body in world.get_component(RigidBody):
            if not limited:
                body.max_linear_speed = None
            body.linear_velocity = 4.0 * body.linear_velocity  # beyond the limit, where there is one
            body.step_force = (1.0, 2.0)  # as left by a user system
            body.apply_force((0.5, 0.25))
        before, steps, hashed = columns(world), world.step_count, world.state_hash()
        twin = world.snapshot()
        fail_after(patch, world, system)
        with pytest.raises(StepError, match="no more"):
            world.step()
        after = columns(world)
        for name in KEPT:
            np.testing.assert_array_equal(after[name], before[name], err_msg=name)
        assert world.step_count == steps
        assert world.state_hash() == hashed
        patch.undo()
        world.step()
        straight = world.state_hash()
        world.restore(twin)
        world.step()
        assert world.state_hash() == straight


def test_without_the_built_in_integration_all_is_kept(monkeypatch):
    """Everything must be saved: the response overwrites the positions of overlapping bodies."""
    with make_world(gravity=9.81) as world:
        floor(world)
        ball(world, (0.0, 0.45), (0.0, -1.0))
        world.remove_system(next(s for s in world.systems if isinstance(s, Integration)))
        before = columns(world)
        fail_after(monkeypatch, world, Response)
        with pytest.raises(StepError, match="no more"):
            world.step()
        after = columns(world)
        for name in KEPT:
            np.testing.assert_array_equal(after[name], before[name], err_msg=name)


class PushLate(System):
    """Pushes after the forces were summed, by writing into the columns."""

    phase = Phase.END

    def process(self, dt):
        self.world.bodies.dynamic.applied_force[:] = 5.0
        self.world.bodies.dynamic.step_force[:] = 0.0


def test_forces_applied_late_do_not_outlive_the_window():
    with make_world() as world:
        entity = world.create_entity(Transform((0, 0)), RigidBody())
        push = PushLate()
        world.add_system(push)
        world.step()
        body = world.component_for_entity(entity, RigidBody)
        assert body.applied_force.tolist() == [0.0, 0.0]
        world.remove_system(push)
        world.step()
        assert body.linear_velocity.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("steps", [1, 3])
def test_forces_written_into_the_columns_act_for_one_window(steps):
    """A force of 6 N on 2 kg for that many steps of dt: v = 3 n dt; then no more."""
    with make_world() as world:
        world.create_entity(Transform((0, 0)), RigidBody(2.0))
        world.bodies.applied_force[:] = (6.0, 0.0)
        dt = world.settings.dt
        assert world.advance(steps * dt) == steps
        assert world.bodies.linear_velocity[0, 0] == pytest.approx(3.0 * steps * dt, rel=1e-14)
        world.step()
        assert world.bodies.linear_velocity[0, 0] == pytest.approx(3.0 * steps * dt, rel=1e-14)


def test_step_forces_written_between_steps_act_once():
    """A force of 6 N on 2 kg for one step: v = 3 dt."""
    with make_world() as world:
        world.create_entity(Transform((0, 0)), RigidBody(2.0))
        world.bodies.step_force[:] = (6.0, 0.0)
        world.step()
        world.step()
        assert world.bodies.linear_velocity[0, 0] == pytest.approx(3.0 * world.settings.dt, rel=1e-14)
        assert not world.bodies.step_force.any()

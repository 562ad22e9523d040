"""Joined bodies sleep and wake together, also in worlds that went back or were loaded."""

from __future__ import annotations

import itertools

import pytest
from joints.helpers_joints import at, disc, joint_world
from worlds import run

from carom import Physics, RigidBody, SphereCollider, Transform, World
from carom.plugins.joints import Distance, Joints, MousePull
from carom.plugins.rotation import Rotation


def test_joined_bodies_sleep_and_wake_together():
    world, _ = joint_world(sleeping=True)
    world.create_entity(Transform((0, -1)), RigidBody(kind="static"), SphereCollider(0.5))
    bodies = [disc(world, (k, 0.0), 0.3) for k in range(3)]
    world.create_entity(Transform((1, -10.3)), SphereCollider(10.0))
    for a, b in itertools.pairwise(bodies):
        world.create_entity(Distance(a, b))
    for body in bodies:
        world.create_entity(Distance(None, body, point_a=(at(world, body).x, 2.0)))
    run(world, 300)
    asleep = [world.component_for_entity(body, RigidBody).asleep for body in bodies]
    assert all(asleep)
    before = [at(world, body).y for body in bodies]
    world.component_for_entity(bodies[2], RigidBody).apply_impulse((0.0, 1.0))
    world.step()
    assert not any(world.component_for_entity(body, RigidBody).asleep for body in bodies)
    run(world, 5)
    assert at(world, bodies[2]).y > before[2]


def test_a_new_joint_wakes_its_bodies():
    """A disc on a rope above a ball that holds it."""
    world, _ = joint_world(sleeping=True)
    disc_, ground = disc(world, (0.0, 0.0), 0.3), Transform((0, -10.3))
    world.create_entity(ground, SphereCollider(10.0))
    world.create_entity(Distance(None, disc_, point_a=(0.0, 2.0), length=(0.0, 2.1)))
    run(world, 200)
    body = world.component_for_entity(disc_, RigidBody)
    assert body.asleep
    pull = MousePull(disc_, grip=(0.0, 0.0), target=(0.0, 1.0))
    world.create_entity(pull)
    run(world, 300)
    assert at(world, disc_).y == pytest.approx(1.0, abs=0.05)
    pull.target = (0.0, 1.0)  # as before
    run(world, 1)
    assert body.asleep
    pull.target[1] = 0.5
    run(world, 1)
    assert not body.asleep


CHANGES = {
    "field": lambda world, hook, rope: setattr(world.component_for_entity(rope, Distance), "length", (0.0, 3.0)),
    "body": lambda world, hook, rope: setattr(world.component_for_entity(rope, Distance), "b", disc(world, (1.5, 4))),
    "end": lambda world, hook, rope: world.delete_entity(rope),
    "kinematic": lambda world, hook, rope: setattr(
        world.component_for_entity(hook, RigidBody), "linear_velocity", (0.0, -1.0)
    ),
    "static": lambda world, hook, rope: setattr(world.component_for_entity(hook, Transform), "position", (0.0, 4.0)),
}


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES)
def test_what_hangs_asleep_wakes_when_its_joint_changes_and_not_before(change, tmp_path):
    """Also in a world that goes back, or is loaded, between the change and the next step."""
    world, _ = joint_world(sleeping=True)
    kind = "kinematic" if change == "kinematic" else "static"
    hook = world.create_entity(Transform((0, 5)), RigidBody(kind=kind), SphereCollider(0.1))
    lamp = disc(world, (0, 3))
    rope = world.create_entity(Distance(hook, lamp, length=(0.0, 2.0)))
    run(world, 300)
    body, start = world.component_for_entity(lamp, RigidBody), world.snapshot()
    world.component_for_entity(rope, Distance).most = 2.0  # as before
    run(world, 1)
    assert body.asleep
    for _ in range(2):
        world.restore(start)
        run(world, 10)
        assert body.asleep
        CHANGES[change](world, hook, rope)
        changed = world.snapshot()
        run(world, 60)
        assert at(world, lamp).y < 2.5
        after = world.state_hash()
        world.restore(changed)
        world.save(tmp_path / "lamp.carom")
        run(world, 60)
        assert world.state_hash() == after
        loaded = World.load(tmp_path / "lamp.carom", Physics(dimensions=2), Rotation(), Joints())
        run(loaded, 60)
        assert loaded.state_hash() == after

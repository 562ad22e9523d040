"""What worlds do with joints: errors, events, going back, files, sleep, contacts between joined bodies."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from helpers_joints import G, at, chain, disc, gaps, joint_world, plank, run, run_failing

from carom import Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.plugins.joints import Ball, Cone, Distance, Hinge, Joints, Motor, MousePull, Slider, Weld
from carom.plugins.rotation import BoxCollider, Rotation, Spin


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Hinge(1, 1, anchor=(0, 0)), "two bodies"),
        (lambda: Distance(None, None), "two bodies"),
        (lambda: MousePull(None, grip=(0, 0), target=(1, 1)), "two bodies"),
        (lambda: Hinge(1, 2, anchor=(0, math.nan)), "finite"),
        (lambda: Hinge(1, 2, anchor=(0, 0), limits=(1.0, -1.0)), "least, most"),
        (lambda: Hinge(1, 2, anchor=(0, 0), limits=1.0), "two numbers"),
        (lambda: Hinge(1, 2, anchor=(0, 0), max_torque=-1.0), "at least 0"),
        (lambda: Hinge(1, 2, anchor=(0, 0), frequency=0.0), "positive"),
        (lambda: Distance(1, 2, length=(2.0, 1.0)), "least, most"),
        (lambda: Distance(1, 2, length=(1.0, 2.0, 3.0)), "two numbers"),
        (lambda: Distance(1, 2, length=-1.0), "at least 0"),
        (lambda: Distance(1, 2, length=(0.0, 1.0), frequency=2.0), "one length"),
        (lambda: Weld(1, 2, anchor=(0, 0), breaking_force=0.0), "positive"),
        (lambda: Slider(1, 2, direction=(0, 0)), "not be 0"),
        (lambda: Slider(1, 2, direction=(0, 1e-200)), "not be 0"),
        (lambda: Motor(1, 2), "speed or an angle"),
        (lambda: Motor(1, 2, speed=1.0, angle=1.0), "speed or an angle"),
    ],
)
def test_what_no_joint_can_be_is_refused_at_the_call(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.plain
@pytest.mark.parametrize("number", [1e16, 1e29, 1e160, 1e300])
def test_numbers_that_no_step_can_take_are_refused_with_their_field(number):
    for make, field in (
        (lambda: Distance(1, 2, length=number), "Distance.least"),
        (lambda: Distance(1, 2, length=(0.0, number)), "Distance.most"),
        (lambda: Distance(1, 2, anchor_b=(0, number)), "Distance.anchor_b"),
        (lambda: Hinge(1, 2, anchor=(0, number)), "Hinge.anchor"),
        (lambda: Hinge(1, 2, anchor=(0, 0, 0), axis=(0, 0, number)), "Hinge.axis"),
        (lambda: Hinge(1, 2, anchor=(0, 0), limits=(-number, 0.0)), "Hinge.lower"),
        (lambda: Hinge(1, 2, anchor=(0, 0), frequency=number), "Hinge.frequency"),
        (lambda: Slider(1, 2, direction=(0, number)), "Slider.direction"),
        (lambda: Slider(1, 2, direction=(0, 1), rest=number), "Slider.rest"),
        (lambda: Slider(1, 2, direction=(0, 1), motor_speed=number), "Slider.motor_speed"),
        (lambda: Motor(1, 2, speed=number), "Motor.speed"),
        (lambda: Motor(1, 2, angle=number), "Motor.angle"),
        (lambda: MousePull(1, grip=(0, number), target=(0, 0)), "MousePull.grip"),
        (lambda: Weld(1, 2, anchor=(number, 0)), "Weld.anchor"),
    ):
        with pytest.raises(ValueError, match=rf"{field} must be at most 1e\+15 along each axis, got"):
            make()
    world, _ = joint_world()
    pull = MousePull(disc(world, (0, 0)), grip=(0, 0), target=(1, 0), max_force=number)
    entity = world.create_entity(pull)
    run(world, 10)
    with pytest.raises(ValueError, match=rf"entity {entity}: MousePull\.target must be at most"):
        pull.target = (0, number)
    run(world, 10)
    assert np.isfinite(world.bodies.position).all()


@pytest.mark.plain
@pytest.mark.parametrize("add", [False, True])
def test_what_no_world_can_have_is_refused_at_the_call(add):
    world, _ = joint_world()
    disc(world, (0, 0))
    moving = world.create_entities(3, Transform.many((0, 0)), RigidBody.many(), SphereCollider.many(0.1))
    wall = world.create_entity(Transform((3, 0)), SphereCollider(0.5))
    lift = world.create_entity(Transform((3, 3)), RigidBody(kind="kinematic"))
    gone, going, empty = disc(world, (5, 0)), disc(world, (6, 0)), world.create_entity(Transform((0, 0)))
    world.delete_entity(gone, immediate=True)
    world.delete_entity(going)
    for joint, message in (
        (Hinge(moving[0], gone, anchor=(0, 0)), f"entity {gone}, which does not exist"),
        (Hinge(going, moving[0], anchor=(0, 0)), f"entity {going}, which does not exist"),
        (Hinge(moving[0], empty, anchor=(0, 0)), f"entity {empty}, which is no body"),
        (MousePull(99, grip=(0, 0), target=(0, 0)), "entity 99, which does not exist"),
        (Hinge(None, wall, anchor=(0, 0)), "no dynamic body"),
        (Weld(lift, wall, anchor=(0, 0)), "no dynamic body"),
        (Cone(moving[1], moving[0], anchor=(0, 0), axis=(0, 1)), "2 dimensions"),
        (Hinge(moving[1], moving[0], anchor=(0, 0, 1)), "must have 2 components"),
    ):
        with pytest.raises(ValueError, match=message) as error:
            world.add_component(empty, joint) if add else world.create_entity(joint)
        assert str(error.value).startswith(f"entity {empty}: ") == add
    with pytest.raises(TypeError, match="one by one"):
        Ball.many(moving[0], moving[1], anchor=(0, 0))
    world.create_entity(Ball(moving[0], moving[1], anchor=(0, 0)))
    world.step()


@pytest.mark.plain
def test_what_comes_to_be_wrong_is_told_by_the_step_and_can_be_cured():
    world, joints = joint_world(gravity=(0, 0))
    a, b, c = (disc(world, (k, 0)) for k in range(3))
    joint = Ball(a, b, anchor=(0.5, 0))
    entity = world.create_entity(joint)
    joint.b = 99
    for _ in range(2):
        with pytest.raises(ValueError, match=rf"entity {entity}: .* 99, which does not exist.*delete_entity"):
            world.step()
    joint.b, joint.anchor = c, (0.5, 1e9)
    with pytest.raises(ValueError, match=rf"entity {entity}: Ball holds entity {a} at .* at most 1e\+08 m away"):
        world.step()
    joint.anchor = (0.5, 0)
    world.step()
    assert joints.of(c) == [entity]
    joint.b = 99
    world.delete_entity(entity)
    world.step()
    assert len(joints) == 0


@pytest.mark.plain
@pytest.mark.parametrize("immediate", [False, True])
def test_a_joint_is_lost_if_its_body_goes_before_it_takes_hold(immediate):
    world, joints = joint_world()
    a, b, c = (disc(world, (k, 0)) for k in range(3))
    lost = []
    world.on("joint_lost", lambda entity, joint: lost.append((entity, joint.b)))
    entity = world.create_entity(Hinge(a, b, anchor=(0, 0)))
    world.create_entity(Hinge(a, c, anchor=(0, 0)))
    world.delete_entity(b, immediate=immediate)
    world.step()
    assert lost == [(entity, b)]
    assert not world.entity_exists(entity)
    assert len(joints) == 1


@pytest.mark.plain
def test_joints_belong_to_one_world_with_physics():
    joints = Joints()
    with pytest.raises(Exception, match="need physics"):
        World(Joints())
    _kept = World(Physics(dimensions=2), joints)
    with pytest.raises(ValueError, match="belong to world"):
        World(Physics(dimensions=2), joints)
    with pytest.raises(KeyError, match="entity 7 has no joint"):
        joints.state(7)
    bare = World(Physics(dimensions=2))
    with pytest.raises(ValueError, match=r"Hinge does nothing without its plugin: World\(Physics\(...\), Joints\(\)\)"):
        bare.create_entity(Hinge(None, 1, anchor=(0, 0)))


def test_fields_that_do_not_fit_leave_the_joint_as_it_is():
    world, _ = joint_world()
    leaf = plank(world, (0.5, 0))
    hinge = Hinge(None, leaf, anchor=(0, 0), limits=(-0.5, 0.5))
    world.create_entity(hinge)
    world.step()
    with pytest.raises(ValueError, match="least, most"):
        hinge.lower = 1.0
    assert hinge.lower == -0.5
    hinge.lower = -1.0
    run(world, 300)
    assert at(world, leaf).rotation == pytest.approx(-1.0, abs=2e-3)


def test_ends_that_do_not_fit_the_world_are_refused_at_the_call():
    world, joints = joint_world(gravity=(0, 0))
    rope = world.create_entity(Distance(disc(world, (0, 0)), disc(world, (2, 0))))
    world.step()
    joint = world.component_for_entity(rope, Distance)
    joint.anchor_b = (0.5, 0.5)
    world.step()
    assert joints.state(rope).value == pytest.approx(math.hypot(2.5, 0.5), abs=0.5)
    with pytest.raises(ValueError, match=r"Distance\.anchor_b must have 2 components"):
        joint.anchor_b = (0, 0, 1)
    assert np.array_equal(joint.anchor_b, (0.5, 0.5))
    world.step()


def test_joints_of_deleted_bodies_are_lost():
    world, joints = joint_world()
    bodies, hinges = chain(world, 3, (1, 0), (0.5, 0.1))
    lost = []
    world.on("joint_lost", lambda entity, joint: lost.append((entity, joint.b)))
    world.step()
    assert joints.of(bodies[1]) == hinges[1:]
    world.delete_entity(bodies[1])
    world.step()
    assert lost == [(hinges[1], bodies[1]), (hinges[2], bodies[2])]
    assert not world.entity_exists(hinges[1])
    assert len(joints) == 1
    world.delete_entity(hinges[0])
    before = at(world, bodies[0]).y
    run(world, 60)
    assert len(joints) == 0
    assert at(world, bodies[0]).y < before - 0.4 * G


@pytest.mark.plain
def test_joint_breaks_at_its_force():
    world, joints = joint_world()
    for x, most in enumerate((1.2 * G, 0.9 * G)):
        world.create_entity(Distance(None, disc(world, (x, -1)), anchor_a=(x, 0), breaking_force=most))
    broken = []
    world.on("joint_broken", lambda entity, joint: broken.append((joint.breaking_force, world.step_count)))
    run(world, 30)
    assert broken == [(pytest.approx(0.9 * G), broken[0][1])]
    assert broken[0][1] < 3
    assert len(joints) == 1


def test_joined_bodies_touch_only_if_they_may():
    for connected in (False, True):
        world, _ = joint_world(0)
        a, b = disc(world, (0, 0), 0.6), disc(world, (1, 0), 0.6)
        world.create_entity(Distance(a, b, length=1.0, collide_connected=connected))
        world.step()
        assert (len(world.contacts) > 0) == connected


def test_same_joints_same_bits_and_back_again():
    def build():
        world, joints = joint_world()
        plank(world, (0, -6), (20, 0.5), mass=50.0)
        _, hinges = chain(world, 8, (0.8, 0.6), (0.45, 0.1))
        world.create_entity(Transform((0, -8)), RigidBody(kind="static"))
        return world, joints, hinges

    world, joints, hinges = build()
    other, _, _ = build()
    run(world, 40)
    run(other, 40)
    assert world.state_hash() == other.state_hash()
    snapshot, forces = world.snapshot(), [joints.state(hinge).impulse for hinge in hinges]
    run(world, 40)
    later = world.state_hash()
    assert later != other.state_hash()
    world.delete_entity(hinges[3])
    run(world, 3)
    world.restore(snapshot)
    assert world.state_hash() == other.state_hash()
    run(world, 40)
    assert world.state_hash() == later
    world.restore(snapshot)
    world.step()
    assert not np.allclose([joints.state(hinge).impulse for hinge in hinges], 0 * np.array(forces))


def test_saved_world_goes_on_to_the_bit(tmp_path):
    world, _ = joint_world()
    chain(world, 8, (0.8, 0.6), (0.45, 0.1))
    run(world, 40)
    world.save(tmp_path / "chain.carom")
    loaded = World.load(tmp_path / "chain.carom", Physics(dimensions=2, gravity=(0, -G)), Rotation(), Joints())
    run(world, 40)
    run(loaded, 40)
    assert loaded.state_hash() == world.state_hash()


def test_step_that_fails_leaves_the_forces_as_they_were():
    hashes = []
    for fails in (False, True):
        world, _ = joint_world()
        chain(world, 8, (0.8, 0.6), (0.45, 0.1))
        run_failing(world, 20, 5 if fails else -1)
        hashes.append(world.state_hash())
    assert hashes[0] == hashes[1]


def test_joined_bodies_sleep_and_wake_together():
    world, _ = joint_world(sleeping=True)
    world.create_entity(Transform((0, -1)), RigidBody(kind="static"), SphereCollider(0.5))
    bodies = [disc(world, (k, 0.0), 0.3) for k in range(3)]
    world.create_entity(Transform((1, -10.3)), SphereCollider(10.0))
    for a, b in itertools.pairwise(bodies):
        world.create_entity(Distance(a, b))
    for body in bodies:
        world.create_entity(Distance(None, body, anchor_a=(at(world, body).x, 2.0)))
    run(world, 300)
    asleep = [world.component_for_entity(body, RigidBody).asleep for body in bodies]
    assert all(asleep)
    before = [at(world, body).y for body in bodies]
    world.component_for_entity(bodies[2], RigidBody).apply_impulse((0.0, 1.0))
    world.step()
    assert not any(world.component_for_entity(body, RigidBody).asleep for body in bodies)
    run(world, 5)
    assert at(world, bodies[2]).y > before[2]


@pytest.mark.parametrize("kind", [Ball, Distance])
def test_pendulum_in_space_keeps_its_moment_about_the_vertical(kind):
    world = World(Physics(dimensions=3, gravity=(0, 0, -G)), Rotation(), Joints())
    spin = [Spin(inertia=np.full(3, 0.1))] if kind is Ball else []
    where = math.sin(0.5), 0.0, -math.cos(0.5)
    body = world.create_entity(Transform(where), RigidBody(linear_velocity=(0, 1, 0)), SphereCollider(0.1), *spin)
    world.create_entity(Ball(None, body, anchor=(0, 0, 0)) if kind is Ball else Distance(None, body))
    if kind is Ball:  # it turns about the pivot, as its velocity says
        world.component_for_entity(body, Spin).angular_velocity = np.cross(where, (0, 1, 0))
    before = world.kinetic_energy() + world.potential_energy()
    for _ in range(300):
        world.step()
        x, y, z = at(world, body).position
        assert math.hypot(x, y, z) == pytest.approx(1.0, abs=2e-3)
    vx, vy, _ = world.component_for_entity(body, RigidBody).linear_velocity
    moment, start = x * vy - y * vx, math.sin(0.5)
    if kind is Ball:
        moment += 0.1 * np.asarray(world.component_for_entity(body, Spin).angular_velocity)[2]
        start += 0.1 * np.cross(where, (0, 1, 0))[2]
    assert moment == pytest.approx(start, rel=1e-3)
    assert world.kinetic_energy() + world.potential_energy() == pytest.approx(before, abs=0.02 * G)


def test_bridge_bears_what_lies_on_it():
    world, joints = joint_world()
    bodies, hinges = chain(world, 20, (1, 0), (0.5, 0.1))
    hinges.append(world.create_entity(Hinge(bodies[-1], None, anchor=(20, 0))))
    for k in range(5):
        plank(world, (6 + 2 * k, 0.6), (0.4, 0.4), mass=2.0)
    run(world, 600)
    impulse = 0.0
    for _ in range(600):
        world.step()
        impulse += joints.state(hinges[0]).impulse[1] - joints.state(hinges[-1]).impulse[1]
        assert gaps(world, hinges).max() < 0.03
    assert impulse == pytest.approx((20 + 10) * G * 10, rel=0.02)  # it still swings a little


def hanging(world):
    """A disc on a rope above a ball that holds it, asleep; and its rope."""
    body = disc(world, (0.0, 0.0), 0.3)
    world.create_entity(Transform((0, -10.3)), SphereCollider(10.0))
    rope = world.create_entity(Distance(None, body, anchor_a=(0.0, 2.0), length=(0.0, 2.1)))
    run(world, 200)
    assert world.component_for_entity(body, RigidBody).asleep
    return body, rope


@pytest.mark.parametrize("back", [False, True])
def test_a_field_that_is_set_wakes_the_bodies(back):
    world, _ = joint_world(sleeping=True)
    body, rope = hanging(world)
    if back:
        world.restore(world.snapshot())
    world.component_for_entity(rope, Distance).most = 1.5
    run(world, 120)
    assert at(world, body).y == pytest.approx(0.5, abs=0.01)


def test_a_new_joint_wakes_its_bodies():
    world, _ = joint_world(sleeping=True)
    body, _ = hanging(world)
    world.create_entity(MousePull(body, grip=(0.0, 0.0), target=(0.0, 1.0)))
    run(world, 120)
    assert at(world, body).y == pytest.approx(1.0, abs=0.05)


def test_going_back_wakes_only_what_was_to_wake():
    world, _ = joint_world(sleeping=True)
    body, rope = hanging(world)
    snapshot = world.snapshot()
    run(world, 3)
    later = world.state_hash()
    world.restore(snapshot)
    run(world, 3)
    assert world.state_hash() == later
    assert world.component_for_entity(body, RigidBody).asleep
    world.component_for_entity(rope, Distance).most = 1.5
    snapshot = world.snapshot()
    run(world, 3)
    later = world.state_hash()
    world.restore(snapshot)
    run(world, 3)
    assert world.state_hash() == later
    assert not world.component_for_entity(body, RigidBody).asleep


def test_forces_stay_with_their_rows_when_a_joint_gets_more():
    world, joints = joint_world()
    arm = plank(world, (1, 0), (1.0, 0.1))
    hinge = Hinge(None, arm, anchor=(0, 0), motor_speed=0.0, max_torque=50.0)
    entity = world.create_entity(hinge)
    run(world, 60)
    before = joints.state(entity).torque
    hinge.lower, hinge.upper = -1.0, 1.0
    world.step()
    assert joints.state(entity).torque == pytest.approx(before, rel=1e-6)
    assert joints.columns()["torque"] == pytest.approx([before], rel=1e-6)
    np.testing.assert_allclose(joints.columns()["impulse"], [joints.state(entity).impulse])
    assert joints.columns()["entity"].tolist() == [entity]


def test_fields_set_in_each_step_are_as_if_given_at_once():
    hashes = []
    for again in (False, True):
        world, _ = joint_world()
        bodies, hinges = chain(world, 6, (0.8, 0.6), (0.45, 0.1))
        for hinge in hinges:
            world.component_for_entity(hinge, Hinge).motor_speed = 1.0
        for _ in range(30):
            if again:
                world.component_for_entity(hinges[3], Hinge).motor_speed = 2.0
                world.component_for_entity(hinges[3], Hinge).motor_speed = 1.0
            world.step()
        hashes.append(world.state_hash())
        assert len(bodies) == 6
    assert hashes[0] == hashes[1]


def test_body_that_is_taken_out_pulls_at_nothing():
    world, joints = joint_world(on_fault="ignore")
    bodies = [disc(world, (0, -1 - k)) for k in range(4)]
    for before, body in itertools.pairwise((None, *bodies)):
        world.create_entity(Distance(before, body))
    run(world, 10)
    world.bodies.position[world.bodies.row_of(bodies[2])] = math.nan
    run(world, 60)
    np.testing.assert_allclose(at(world, bodies[1]).position, (0.0, -2.0), atol=0.01)
    assert at(world, bodies[3]).y < -4.0 - 0.4 * G
    assert len(joints) == 4


def test_kinematic_body_carries_what_hangs_on_it():
    world, joints = joint_world()
    trolley = world.create_entity(Transform((0, 0)), RigidBody(kind="kinematic", linear_velocity=(1.0, 0.0)))
    load = disc(world, (0, -1))
    rod = world.create_entity(Distance(trolley, load))
    run(world, 600)
    assert at(world, load).x == pytest.approx(10.0, abs=1.0)
    assert joints.state(rod).value == pytest.approx(1.0, abs=1e-3)


CHANGES = {
    "field": lambda world, hook, rope: setattr(world.component_for_entity(rope, Distance), "length", (0.0, 3.0)),
    "body": lambda world, hook, rope: setattr(world.component_for_entity(rope, Distance), "b", disc(world, (1.5, 4))),
    "end": lambda world, hook, rope: world.delete_entity(rope),
    "kinematic": lambda world, hook, rope: setattr(
        world.component_for_entity(hook, RigidBody), "linear_velocity", (0.0, -1.0)
    ),
    "static": lambda world, hook, rope: setattr(world.component_for_entity(hook, Transform), "position", (0.0, 4.0)),
}


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


def test_world_is_saved_with_its_forces_right_after_it_went_back(tmp_path):
    world, _ = joint_world()
    chain(world, 8, (0.8, 0.6), (0.45, 0.1))
    run(world, 40)
    start = world.snapshot()
    run(world, 40)
    later = world.state_hash()
    world.restore(start)
    world.save(tmp_path / "chain.carom")
    loaded = World.load(tmp_path / "chain.carom", Physics(dimensions=2), Rotation(), Joints())
    run(loaded, 40)
    assert loaded.state_hash() == later


@pytest.mark.plain
@pytest.mark.parametrize("d", [2, 3])
def test_columns_have_values_and_the_speeds_at_which_these_change(d):
    """Of thrown bodies, some of which are held by the world; numbers are those of state()."""
    joints = Joints()
    world = World(Physics(dimensions=d), Rotation(), joints, settings=Settings(dt=1e-4))
    generator = np.random.default_rng(3)

    def body(x):
        place = (x, 0) if d == 2 else (x, 0, 0)
        turn = 0.3 if d == 2 else generator.normal(size=4)
        w = generator.normal() if d == 2 else generator.normal(size=3)
        spin = Spin(w, inertia=1.0 if d == 2 else np.ones(3))
        return world.create_entity(Transform(place, turn), RigidBody(linear_velocity=generator.normal(size=d)), spin)

    axis: Any = {} if d == 2 else {"axis": (0.6, 0.0, 0.8)}
    x, side = (1.0, 0.0) if d == 2 else (1.0, 0.0, 0.0), np.eye(d)[0] + np.eye(d)[1]
    made = []
    for first in (body, lambda x: None):
        made += [
            Distance(first(0), body(1), anchor_b=x, length=(0.0, 9.0)), Hinge(first(0), body(1), anchor=x, **axis),
            Slider(first(0), body(1), direction=side), Weld(first(0), body(1), anchor=x),
            Ball(first(0), body(1), anchor=x), Motor(first(0) or body(2), body(1), speed=1.0, max_torque=0.1, **axis),
        ]  # fmt: skip
    if d == 3:
        made.append(Cone(body(0), body(1), anchor=x, swing=3.0, **axis))
    entities = [world.create_entity(joint) for joint in made]
    run(world, 20)
    before = joints.columns()
    world.step()
    after = joints.columns()
    assert after["entity"].tolist() == entities
    for key in ("value", "speed"):
        np.testing.assert_array_equal(after[key], [getattr(joints.state(entity), key) for entity in entities])
    ends_a, ends_b = joints.anchors()
    apart = np.linalg.norm(ends_b - ends_a, axis=1)
    np.testing.assert_allclose(apart[[0, 6]], after["value"][[0, 6]], rtol=1e-12)
    held = [k for k, joint in enumerate(made) if isinstance(joint, Hinge | Weld | Ball | Cone)]
    assert apart[held].max() < 1e-3
    exact = np.array([isinstance(joint, Distance | Hinge | Slider) for joint in made])  # others let their axis go
    change = (after["value"] - before["value"]) / 1e-4
    np.testing.assert_allclose(change[exact], after["speed"][exact], rtol=1e-3, atol=1e-3)
    assert (abs(after["speed"][exact]) > 0.01).all()


@pytest.mark.parametrize("mode", ["continuous", "event_driven"])
@pytest.mark.parametrize("ropes", [False, True])
def test_fast_boxes_pass_no_thin_wall_whether_something_holds_them_or_not(mode, ropes):
    """The touch turns a box far within the step."""
    for k in range(20):
        world, _ = joint_world((0.0, 0.0), collision=mode)
        world.create_entity(Transform((5, 0)), BoxCollider((0.02, 50)))
        fast = RigidBody(linear_velocity=(100.0 + 3 * k, 40.0))
        box = world.create_entity(Transform((0, 0), 0.15 * k), fast, BoxCollider((0.2, 0.1)), Spin())
        if ropes:
            world.create_entity(Distance(None, box, length=(0.0, 1000.0)))
        run(world, 8)
        assert at(world, box).x < 5.02, k
        world.close()

"""What joints cannot be or hold: refused at the call, or told by the step and cured."""

from __future__ import annotations

import math

import numpy as np
import pytest
from joints.helpers_joints import at, disc, joint_world, plank
from worlds import run

from carom import Physics, RigidBody, Rotation, SphereCollider, Transform, World
from carom.plugins.joints import Ball, Cone, Distance, Hinge, Joints, Motor, MousePull, Slider, Weld


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
        (lambda: Motor(1, 2), "speed or an angle, got neither"),
        (lambda: Motor(1, 2, speed=1.0, angle=1.0), "speed or an angle, got both"),
    ],
)
def test_what_no_joint_can_be_is_refused_at_the_call(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize("number", [1e16, 1e160, 1e300])
def test_numbers_that_no_step_can_take_are_refused_with_their_field(number):
    for make, field in (
        (lambda: Distance(1, 2, length=number), "Distance.least"),
        (lambda: Distance(1, 2, length=(0.0, number)), "Distance.most"),
        (lambda: Distance(1, 2, point_b=(0, number)), "Distance.point_b"),
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
        with pytest.raises(ValueError, match=rf"{field} must be at most 1e\+15( along each axis)?, got"):
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
        (Hinge(moving[1], moving[0], anchor=(0, 0), axis=(0, 0, 1)), "axis is for 3D worlds"),
    ):
        with pytest.raises(ValueError, match=message) as error:
            world.add_component(empty, joint) if add else world.create_entity(joint)
        assert str(error.value).startswith(f"entity {empty}: ") == add
    with pytest.raises(TypeError, match="one by one"):
        Ball.many(moving[0], moving[1], anchor=(0, 0))
    world.create_entity(Ball(moving[0], moving[1], anchor=(0, 0)))
    world.step()


@pytest.mark.plain
def test_bodies_that_do_not_exist_are_refused_at_the_call_and_what_comes_to_be_wrong_by_the_step():
    world, joints = joint_world(gravity=(0, 0))
    a, b, c = (disc(world, (k, 0)) for k in range(3))
    wall, floor = (world.create_entity(Transform((0, y)), SphereCollider(0.1)) for y in (5, 6))
    joint = Ball(a, b, anchor=(0.5, 0))
    entity = world.create_entity(joint)
    wrong = (
        ({"b": 99}, "99, which does not exist"), ({"b": a}, "needs two bodies"), ({"b": entity}, "no body"),
        ({"a": None, "b": None}, "two bodies"), ({"a": wall, "b": floor}, "no dynamic body"),
    )  # fmt: skip
    for ends, why in wrong:
        with pytest.raises(ValueError, match=f"Ball.*{why}"):
            joint.set_together(**ends)
        assert (joint.a, joint.b) == (a, b)
    with pytest.raises(ValueError, match=r"Ball\.a must be an integer: give its entity"):
        Ball(at(world, a), b, anchor=(0.5, 0))
    kinds = [world.component_for_entity(body, RigidBody) for body in (a, b)]
    for kind in ("static", "dynamic"):
        for body in kinds:
            body.kind = kind
        if kind == "static":
            with pytest.raises(ValueError, match=rf"entity {entity}: Ball joins no dynamic body.*delete_entity"):
                world.step()
    joint.b, joint.anchor = c, (0.5, 1e9)
    with pytest.raises(ValueError, match=rf"entity {entity}: Ball holds entity {a} at .* at most 1e\+08 m away"):
        world.step()
    joint.anchor = (0.5, 0)
    world.step()
    assert joints.of(c) == [entity]
    world.delete_entity(entity)
    assert len(joints) == 0
    world.step()
    assert len(joints) == 0


@pytest.mark.plain
def test_joints_belong_to_one_world_with_physics():
    joints = Joints()
    with pytest.raises(Exception, match="needs physics"):
        World(Joints())
    _kept = World(Physics(dimensions=2), joints)
    with pytest.raises(ValueError, match="belong to world"):
        World(Physics(dimensions=2), joints)
    with pytest.raises(KeyError, match="entity 7 has no joint"):
        joints.state(7)
    bare = World(Physics(dimensions=2))
    with pytest.raises(ValueError, match=r"Hinge does nothing without its plugin: World\(Physics\(...\), Joints\(\)\)"):
        bare.create_entity(Hinge(None, 1, anchor=(0, 0)))


def test_a_joint_is_an_entity_of_its_own():
    world, joints = joint_world()
    leaf, parts = plank(world, (0.5, 0)), (Transform((2, 0)), RigidBody(), SphereCollider(0.5))
    name = "Hinge is an entity of its own, not one that has a "
    with pytest.raises(ValueError, match=rf"^entity {leaf}: {name}BoxCollider as well"):
        world.add_component(leaf, Hinge(None, leaf, anchor=(0, 0)))
    with pytest.raises(ValueError, match=f"^{name}RigidBody as well"):
        world.create_entity(*parts, Hinge(None, leaf, anchor=(0, 0)))
    with pytest.raises(ValueError, match=f"^{name}Motor as well"):
        world.create_entity(Hinge(None, leaf, anchor=(0, 0)), Motor(None, leaf, speed=1.0))
    world.step()
    assert len(joints) == 0


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
    rope = Distance(1, 2, length=2.0)
    for wrong in ({}, "x", (1.0, {}), 10**400):
        with pytest.raises(ValueError, match=r"Distance\.length must be numbers, got"):
            rope.length = wrong
    assert rope.length == 2.0
    with pytest.raises(ValueError, match=r"Cone\.swing must be at most pi, got 4"):
        Cone(1, 2, anchor=(0, 0, 0), axis=(0, 0, 1), swing=4.0)


def test_the_two_ends_of_a_length_are_set_together():
    """All of it or nothing; that of a spring, which has one, too."""
    world, _ = joint_world(gravity=0)
    ends = [disc(world, (x, 0)) for x in (0.0, 2.0)]
    spring = Distance(*ends, length=2.0, frequency=2.0, damping_ratio=1.0)
    entity = world.create_entity(spring)
    world.step()
    spring.length = 3.0
    run(world, 180)
    assert at(world, ends[1]).x - at(world, ends[0]).x == pytest.approx(3.0, abs=1e-3)
    for wrong, why in (
        ((0.5, math.nan), "finite, got nan"), ((0.0, 1.0), "one length"), ((2.0, 1.0), "least, most"),
        ((-1.0, 4.0), "at least 0"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=rf"entity {entity}: Distance.*{why}"):
            spring.length = wrong
        assert spring.length == 3.0
    world.restore(world.snapshot())
    with pytest.raises(ValueError, match=rf"entity {entity}: Distance\.damping_ratio must be at least"):
        spring.damping_ratio = -1.0


def test_a_pull_by_the_mouse_has_no_other_body():
    world, joints = joint_world(gravity=0)
    one, other = disc(world, (2, 2)), disc(world, (4, 2))
    pull = MousePull(one, grip=(2, 2), target=(2, 2))
    entity = world.create_entity(pull)
    world.step()
    with pytest.raises(ValueError, match=rf"entity {entity}: MousePull\.a must be None, .* got {other}"):
        pull.a = other
    assert joints.of(other) == []
    pull.b = other
    run(world, 120)
    assert at(world, one).x == 2.0
    assert joints.of(other) == [entity]


def test_ends_that_do_not_fit_the_world_are_refused_at_the_call():
    world, joints = joint_world(gravity=(0, 0))
    rope = world.create_entity(Distance(disc(world, (0, 0)), disc(world, (2, 0))))
    world.step()
    joint = world.component_for_entity(rope, Distance)
    joint.point_b = (2.5, 0.5)
    world.step()
    assert joints.state(rope).value == pytest.approx(math.hypot(2.5, 0.5), abs=0.5)
    with pytest.raises(ValueError, match=r"Distance\.point_b must have 2 components"):
        joint.point_b = (0, 0, 1)
    assert np.array_equal(joint.point_b, (2.5, 0.5))
    world.step()


def test_ends_are_refused_alike_after_a_world_was_loaded_or_restored(tmp_path):
    """Also of a joint that no step has taken yet."""
    world, _ = joint_world(gravity=(0, 0))
    ball = disc(world, (0, 0))
    first, second = (world.create_entity(Transform((x, 0)), SphereCollider(0.5)) for x in (3, 6))
    entity = world.create_entity(Hinge(ball, first, anchor=(0, 0)))
    for taken in (False, True):
        if taken:
            world.step()
        snapshot = world.snapshot()
        world.save(tmp_path / f"saved{taken}")
        world.restore(snapshot)
        loaded = World.load(tmp_path / f"saved{taken}", Physics(2, gravity=(0, 0)), Rotation(), Joints())
        for one in (world, loaded):
            with pytest.raises(ValueError, match=f"entity {entity}: Hinge joins no dynamic body: a is {second}"):
                one.component_for_entity(entity, Hinge).a = second

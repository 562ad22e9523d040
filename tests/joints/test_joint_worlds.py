"""What worlds do with joints: events, going back, files, failing steps, contacts between joined bodies."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from joints.helpers_joints import G, at, chain, disc, joint_world, plank, run_failing
from joints.helpers_machines import Gear, Pulley, machine_world, machines
from worlds import MODES, run

from carom import AABBCollider, Physics, RigidBody, Settings, SphereCollider, StepError, Transform, World
from carom.plugins.joints import Ball, Cone, Distance, Hinge, Joints, Motor, Slider, Weld, Wheel
from carom.plugins.rotation import BoxCollider, Rotation, Spin


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


def test_joint_breaks_at_its_force():
    world, joints = joint_world()
    for x, most in enumerate((1.2 * G, 0.9 * G)):
        world.create_entity(Distance(None, disc(world, (x, -1)), point_a=(x, 0), breaking_force=most))
    broken = []
    world.on("joint_broken", lambda entity, joint: broken.append((joint.breaking_force, world.step_count)))
    run(world, 30)
    assert broken == [(pytest.approx(0.9 * G), broken[0][1])]
    assert broken[0][1] < 3
    assert len(joints) == 1


@pytest.mark.parametrize("mode", MODES)
def test_an_impact_of_the_step_before_moves_nothing_once_colliders_are_gone(mode):
    """A weld holds its body where it is, but for the slack of one step of its springs."""
    settings = Settings(collision=mode)
    with World(Physics(dimensions=2), Rotation(), Joints(), settings=settings) as world:
        shape, body = SphereCollider(0.25, restitution=0.5), RigidBody(linear_velocity=(9, 2))
        one = world.create_entity(Transform((0, 0)), body, shape, Spin(inertia=1.0))
        wall = world.create_entity(Transform((1, 0)), RigidBody(kind="static"), AABBCollider((0.25, 5)))
        while not len(world.contacts.impacts):
            world.step()
        world.remove_component(one, SphereCollider)
        world.delete_entity(wall, immediate=True)
        place = np.array(at(world, one).position)
        world.create_entity(Weld(None, one, anchor=tuple(place)))
        world.component_for_entity(one, RigidBody).apply_impulse((3.0, -4.0))
        world.step()
        np.testing.assert_allclose(at(world, one).position, place, rtol=0, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("event", ["joint_broken", "joint_lost"])
def test_step_whose_handler_raises_is_taken_again_with_the_same_events(event):
    """As if nothing had happened; the world is no longer in the step."""
    ends = []
    for due in (0, 1, 2):
        world, joints = joint_world()
        bodies, hinges = chain(world, 8, (1, 0), (0.45, 0.1))
        if event == "joint_broken":  # both in the same step
            for k in (2, 5):
                world.component_for_entity(hinges[k], Hinge).breaking_force = 1e-3
        told, calls = [], 0

        def handle(entity, joint, due=due, told=told):
            nonlocal calls
            calls += 1
            if calls == due:
                raise RuntimeError("once")
            told.append(entity)

        world.on(event, handle)
        if event == "joint_lost":
            run(world, 3)
            world.delete_entity(bodies[3])
        if due:
            before = world.state_hash()
            with pytest.raises(StepError, match=f"a handler of {event}: RuntimeError: once"):
                world.step()
            assert event == "joint_lost" or world.state_hash() == before
        run(world, 30)
        ends.append((world.state_hash(), len(joints), len(world.get_entities()), sorted(set(told))))
        assert len(told) == 2 + (due == 2)
    assert ends[0] == ends[1] == ends[2]


def test_joined_bodies_touch_only_if_they_may():
    for connected in (False, True):
        world, _ = joint_world(0)
        a, b = disc(world, (0, 0), 0.6), disc(world, (1, 0), 0.6)
        world.create_entity(Distance(a, b, length=1.0, collide_connected=connected))
        world.step()
        assert (len(world.contacts) > 0) == connected


def hanging_chain():
    world, joints = machine_world()
    plank(world, (0, -6), (20, 0.5), mass=50.0)
    chain(world, 8, (0.8, 0.6), (0.45, 0.1))
    world.create_entity(Transform((0, -8)), RigidBody(kind="static"))
    return world, joints


def car_of_five_wheels():
    """Whose rows are solved side by side with those of others, not one after the other."""
    world, joints = machine_world()
    world.create_entity(Transform((0, -0.5)), BoxCollider((100, 0.5)))
    car = RigidBody(10, linear_velocity=(3, 0))
    body = world.create_entity(Transform((0, 1.2)), car, Spin(), BoxCollider((2, 0.3)))
    springs = {"frequency": 4, "damping_ratio": 0.5, "motor_speed": -5, "max_torque": 20}
    for x in np.linspace(-1.5, 1.5, 5):
        wheel = world.create_entity(Transform((x, 0.5)), RigidBody(), Spin(), SphereCollider(0.4, friction=0.8))
        world.create_entity(Wheel(body, wheel, (x, 0.5), (0, 1), **springs))
    return world, joints


def joints_of_a_plugin():
    world, joints = machine_world()
    a, b = disc(world, (0, -1), mass=2.0), disc(world, (2, -2))
    chain(world, 4, (0.8, 0.6), (0.45, 0.1))
    world.create_entity(Pulley(a, b, (0, 0), (2, 0), anchor_a=(0.1, 0.1)))
    world.create_entity(Gear(a, b, 0.7))
    world.component_for_entity(a, Spin).angular_velocity = 5.0
    world.create_entity(Distance(None, b, point_a=(2.5, 0)))
    return world, joints


@pytest.mark.slow
@pytest.mark.parametrize("build", [hanging_chain, car_of_five_wheels, joints_of_a_plugin])
def test_worlds_with_joints_go_on_to_the_bit(build, tmp_path):
    """As others that are made alike, also if a step fails; and after they went back, or were loaded from what was saved
    right then."""

    def go_on(world, joints, due=-1):
        run_failing(world, 40, due)
        columns = joints.columns()
        return [world.state_hash(), *(columns[name].tolist() for name in ("value", "impulse"))]

    (world, joints), (other, others) = build(), build()
    assert go_on(world, joints) == go_on(other, others, due=5)
    snapshot, forces = world.snapshot(), joints.columns()["impulse"]
    later = go_on(world, joints)
    world.delete_entity(int(joints.columns()["entity"][2]))
    run(world, 3)
    world.restore(snapshot)
    world.save(tmp_path / "joints.carom")
    assert world.state_hash() == other.state_hash() != later[0]
    np.testing.assert_array_equal(joints.columns()["impulse"], forces)
    assert go_on(world, joints) == later
    again = Joints()
    with World.load(tmp_path / "joints.carom", Physics(2, gravity=(0, -G)), Rotation(), again, machines) as loaded:
        assert go_on(loaded, again) == later


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
            Distance(first(0), body(1), point_b=x, length=(0.0, 9.0)), Hinge(first(0), body(1), anchor=x, **axis),
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


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["continuous", "event_driven"])
@pytest.mark.parametrize("ropes", [False, True])
def test_fast_boxes_pass_no_thin_wall_whether_something_holds_them_or_not(mode, ropes):
    """The touch turns a box far within the step."""
    for k in range(0, 20, 2):
        world, _ = joint_world((0.0, 0.0), collision=mode)
        world.create_entity(Transform((5, 0)), BoxCollider((0.02, 50)))
        fast = RigidBody(linear_velocity=(100.0 + 3 * k, 40.0))
        box = world.create_entity(Transform((0, 0), 0.15 * k), fast, BoxCollider((0.2, 0.1)), Spin())
        if ropes:
            world.create_entity(Distance(None, box, length=(0.0, 1000.0)))
        run(world, 8)
        assert at(world, box).x < 5.02, k
        world.close()


def test_a_joint_that_is_to_take_hold_anew_goes_on_to_the_bit_after_restore():
    """Its rows keep what they have borne, and are there at once."""
    world, joints = joint_world()
    ball = disc(world, (0, 0))
    entity = world.create_entity(Hinge(None, ball, anchor=(0, 1)))
    run(world, 20)
    world.component_for_entity(entity, Hinge).anchor = (0.1, 1.2)
    snapshot, seen = world.snapshot(), []
    for _ in range(2):
        impulse = joints.columns()["impulse"]
        run(world, 5)
        seen.append((len(joints), impulse.tobytes(), world.state_hash()))
        world.restore(snapshot)
    assert seen[0] == seen[1]

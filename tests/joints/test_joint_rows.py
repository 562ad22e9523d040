"""How joints are stored: changes, and worlds that go back, are those of joints that are made anew."""

from __future__ import annotations

import operator
import pickle

import numpy as np
import pytest
from joints.helpers_joints import G, at, chain, disc, joint_world, plank
from worlds import run

from carom import Physics, RigidBody, SphereCollider, Transform, World
from carom.plugins.joints import Ball, Distance, Hinge, Joints, MousePull, Weld
from carom.plugins.joints.rows import JointRows
from carom.plugins.rotation import BoxCollider, Rotation


def test_a_change_writes_the_rows_of_what_it_changes(monkeypatch):
    written, put = [], JointRows.put

    def counted(rows, joint, *made):
        written.append(joint.entity)
        return put(rows, joint, *made)

    monkeypatch.setattr(JointRows, "put", counted)
    world, joints = joint_world()
    bodies, hinges = chain(world, 40, (1, 0), (0.45, 0.1))
    run(world, 2)
    assert written == hinges
    for _ in range(2):  # the second time as before: nothing to write
        world.component_for_entity(hinges[7], Hinge).motor_speed = 1.0
    loose = disc(world, (0, 50))
    run(world, 2)
    for gone in (loose, hinges[20], bodies[30]):
        world.delete_entity(gone)
    new = world.create_entity(Ball(bodies[0], bodies[39], anchor=(20, 0)))
    run(world, 2)
    assert written[40:] == [hinges[7], new]
    left = [entity for k, entity in enumerate(hinges) if k not in (20, 30, 31)]
    assert joints.columns()["entity"].tolist() == [*left, new]


def test_a_world_that_goes_back_writes_the_rows_of_what_has_changed(monkeypatch):
    world, joints = joint_world()
    _, hinges = chain(world, 40, (1, 0), (0.45, 0.1))
    run(world, 5)
    before = world.snapshot()
    world.restore(before)  # from here on all fields are known as a snapshot has them
    run(world, 5)
    after = world.state_hash()
    written, put = [], JointRows.put

    def counted(rows, joint, *made):
        written.append(joint.entity)
        return put(rows, joint, *made)

    monkeypatch.setattr(JointRows, "put", counted)
    world.component_for_entity(hinges[7], Hinge).motor_speed = 1.0
    world.delete_entity(hinges[20])
    run(world, 3)
    written.clear()
    world.restore(before)
    assert written == [hinges[7], hinges[20]]
    run(world, 5)
    assert world.state_hash() == after
    assert joints.columns()["entity"].tolist() == hinges


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_joints_that_come_go_and_change_move_as_if_all_were_written_again(seed):
    """Twins: one goes back to where it is before each step, which writes all rows from the components."""
    ends = []
    for again in (False, True):
        random = np.random.default_rng(seed)
        world, joints = joint_world(dt=1 / 60)
        bodies, hinges = chain(world, 12, (1, 0), (0.45, 0.1))
        for step in range(60):
            what, k = int(random.integers(0, 6)), int(random.integers(0, 12))
            joint = world.component_for_entity(hinges[k], Hinge) if world.entity_exists(hinges[k]) else None
            if what == 0 and joint is not None:
                joint.limits = (-0.5, float(random.random()))
            elif what == 1 and joint is not None:
                joint.motor_speed = float(random.normal())
                joint.max_torque = 1.0
            elif what == 2 and joint is not None and step > 30:
                world.delete_entity(hinges[k])
            elif what == 3:
                hinges.append(world.create_entity(Distance(None, bodies[k], length=(0.0, 20.0))))
            elif what == 4 and step == 40:
                world.delete_entity(bodies[k])
            if again:
                world.restore(world.snapshot())
            world.step()
        ends.append((world.state_hash(), len(joints), joints.columns()["impulse"].tolist()))
        world.close()
    assert ends[0] == ends[1]


def test_going_back_and_loading_show_joints_at_once(tmp_path):
    world, joints = joint_world()
    body = plank(world, (1, 0), (1, 0.1))
    hinge = world.create_entity(Hinge(None, body, anchor=(0, 0)))
    run(world, 10)

    def seen(of):
        state = of.state(hinge)
        return len(of), of.of(body), state.value, state.impulse.tolist(), [end.tolist() for end in of.anchors()]

    before, snapshot = seen(joints), world.snapshot()
    world.save(tmp_path / "hinge.carom")
    world.step()
    world.restore(snapshot)
    assert seen(joints) == before
    for immediate in (False, True):
        world.delete_entity(hinge, immediate=immediate)
        assert (len(joints), joints.of(body), joints.columns()["entity"].tolist()) == (0, [], [])
        with pytest.raises(KeyError, match="no joint"):
            joints.state(hinge)
        world.step()
        world.restore(snapshot)
        assert seen(joints) == before
    other = Joints()
    loaded = World.load(tmp_path / "hinge.carom", Physics(dimensions=2), Rotation(), other)
    assert seen(other) == before
    run(world, 5)
    run(loaded, 5)
    assert world.state_hash() == loaded.state_hash()


def test_what_is_set_between_two_steps_is_told_alike_before_and_after_going_back():
    """A joint that is to hold another body holds the old one until the next step; a target is the new one at once,
    also where bodies sleep."""
    world, joints = joint_world(sleeping=True)
    one, other = plank(world, (1, 0), (1, 0.1)), plank(world, (5, 0), (1, 0.1))
    hinge, pull = Hinge(None, one, anchor=(0, 0)), MousePull(other, grip=(5, 0), target=(5, 1))
    entity = world.create_entity(hinge)
    world.create_entity(pull)
    run(world, 10)

    def seen():
        columns = joints.columns()
        state = [np.ravel(part).tolist() for part in joints.state(entity)]
        return [columns[name].tolist() for name in columns], state, [end.tolist() for end in joints.anchors()]

    before = seen()
    hinge.b = other
    pull.target = 7.0, 2.0
    after, snapshot = seen(), world.snapshot()
    assert after[:2] == before[:2]
    assert after[2][0] == [before[2][0][0], [7.0, 2.0]]
    assert after[2][1] == before[2][1]
    for again in (snapshot, pickle.loads(pickle.dumps(snapshot))):
        world.step()
        assert joints.of(one) == []
        world.restore(again)
        assert seen() == after


@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_weld_breaks_above_its_torque_and_tells_the_load(dimensions):
    """A plank that a wall holds at its end weighs m g times its half length there; its force alone breaks nothing."""
    torque, told = 2.0 * G * 1.0, {}
    for share in (0.99, 1.01):
        joints, broken = Joints(), []
        world = World(Physics(dimensions, gravity=(0, -G, 0)[:dimensions]), Rotation(), joints)
        body = plank(world, (1, 0, 0)[:dimensions], (1.0, 0.1, 0.1)[:dimensions], mass=2.0,
                     angle=0.0 if dimensions == 2 else (1, 0, 0, 0))  # fmt: skip
        weld = world.create_entity(Weld(None, body, anchor=(0, 0, 0)[:dimensions]))
        run(world, 120)
        world.component_for_entity(weld, Weld).breaking_torque = torque / share

        def note(entity, joint, broken=broken, joints=joints):
            broken.append((entity, joint.breaking_torque, joints.state(entity).load))

        world.on("joint_broken", note)
        load = joints.state(weld).load
        assert load == pytest.approx(share, rel=1e-3)
        assert joints.columns()["load"].tolist() == [load]
        run(world, 2)
        assert world.entity_exists(weld) == (share < 1.0)
        told[share] = broken
        world.close()
    assert not told[0.99]
    assert told[1.01] == [(weld, torque / 1.01, pytest.approx(1.01, rel=1e-3))]


def test_vectors_of_joints_can_be_written_into():
    world, joints = joint_world(gravity=(0, 0))
    body, lamp = disc(world, (0, 0)), disc(world, (5, 0))
    pull = world.create_entity(MousePull(body, grip=(0, 0), target=(0, 0)))
    rope = world.create_entity(Distance(None, lamp, point_a=(5, 1)))
    run(world, 2)
    target, point = (world.component_for_entity(e, c) for e, c in ((pull, MousePull), (rope, Distance)))
    held = target.target
    held[0] = 3.0
    point.point_a[1] = 2.0  # the rod keeps its length, and is pulled up
    run(world, 240)
    assert at(world, body).position == pytest.approx((3, 0), abs=1e-6)
    assert at(world, lamp).position == pytest.approx((5, 1), abs=0.01)
    target.target = 1.0  # one number is for all of it
    assert held.tolist() == [1, 1]
    held[1] = np.nan
    with pytest.raises(ValueError, match=rf"entity {pull}: MousePull\.target must be finite"):
        world.step()
    assert held.tolist() == [1, 1]
    run(world, 240)
    assert at(world, body).position == pytest.approx((1, 1), abs=1e-6)
    assert joints.anchors()[0].tolist() == [[1, 1], [5, 2]]


@pytest.mark.parametrize("d", [2, 3])
def test_snapshots_share_the_values_of_joints_that_were_not_set_between(d):
    """However many there are: a training that begins anew a thousand times copies nothing."""
    world, _ = joint_world(gravity=(0.0,) * d, d=d)
    bodies = [disc(world, np.eye(d)[0] * 3.0 * k, inertia=(0.01,) * 3 if d == 3 else 0.01) for k in range(12)]
    balls = [world.create_entity(Ball(None, body, anchor=at(world, body).position)) for body in bodies]
    run(world, 2)
    first = world.snapshot()
    handles = [world.component_for_entity(ball, Ball) for ball in balls]
    lent = handles[5].anchor, handles[6].anchor
    run(world, 3)
    world.restore(first)
    assert all(map(operator.is_, first.loose.handles, world.snapshot().loose.handles))
    lent[0][1], handles[8].breaking_force = 1.0, 10.0
    then = world.snapshot()
    assert [k for k in range(12) if first.loose.handles[k] is not then.loose.handles[k]] == [5, 8]
    world.restore(first)
    assert handles[5].anchor.tolist() == (15.0 * np.eye(d)[0]).tolist()
    assert handles[8].breaking_force is None
    world.restore(then)
    assert (handles[5].anchor[1], handles[8].breaking_force) == (1.0, 10.0)


@pytest.mark.parametrize("seed", range(4))
def test_going_back_repeats_what_followed_whatever_was_set_or_written_into(seed):
    random = np.random.default_rng(seed)
    world, _ = joint_world(dt=1 / 60)
    bodies = [disc(world, (2.0 * k, 0)) for k in range(6)]
    for k, body in enumerate(bodies):
        kind = (MousePull(body, grip=(2 * k, 0), target=(2 * k, 1)), Distance(None, body, point_a=(2 * k, 1)))[k % 2]
        world.create_entity(kind)
    joints = [joint for kind in (MousePull, Distance) for _, joint in world.get_component(kind)]
    known, held = [], [getattr(joint, "target" if hasattr(joint, "target") else "point_a") for joint in joints]

    def followed(snapshot):
        world.restore(snapshot)
        shown = list(map(repr, joints))
        run(world, 3)
        return shown, world.state_hash(), list(map(repr, joints))

    for _ in range(40):
        what, k = int(random.integers(0, 7)), int(random.integers(0, 6))
        field = "target" if hasattr(joints[k], "target") else "point_a"
        if what == 0:
            held[k] = getattr(joints[k], field)
        elif what == 1:
            held[k][:] = random.normal(size=2)
        elif what == 2:
            setattr(joints[k], field, random.normal(size=2))
        elif what == 3:
            world.step()
        elif what == 4 or not known:
            snapshot = world.snapshot()
            known.append((snapshot, followed(snapshot)))
            world.restore(snapshot)
        else:
            snapshot, after = known[int(random.integers(0, len(known)))]
            assert followed(snapshot) == after
            if what == 5:
                world.restore(snapshot)


def test_points_of_a_distance_are_places_of_the_world_and_its_ends_move_one_by_one():
    world, joints = joint_world(gravity=(0, 0))
    a, b = plank(world, (1, 1), angle=0.5), plank(world, (4, 1), angle=-0.5)
    rope = world.create_entity(Distance(a, b, point_a=(1.5, 1), point_b=(4, 2), length=(0.0, 9.0)))
    world.step()
    for found, right in zip(joints.anchors(), ((1.5, 1), (4, 2)), strict=True):
        assert found[0] == pytest.approx(right, abs=1e-9)
    world.component_for_entity(b, RigidBody).linear_velocity = (1, 0)
    run(world, 30)
    local = joints.anchors()[1]
    world.component_for_entity(rope, Distance).point_a = (1, 1.2)
    world.step()
    assert joints.anchors()[1][0] == pytest.approx(local[0], abs=0.05)  # not taken anew at (4, 2)
    with pytest.raises(TypeError, match=r"Distance\.anchor_b was relative to the body.*point_b"):
        Distance(a, b, anchor_b=(0, 1))
    with pytest.raises(TypeError, match="takes 2 values"):
        Distance(a, b, (0, 0), (0, 1))


def test_limits_are_read_and_set_as_a_pair():
    hinge = Hinge(1, 2, anchor=(0, 0))
    assert hinge.limits is None
    hinge.limits = (-1.0, None)
    assert (hinge.limits, hinge.lower, hinge.upper) == ((-1.0, None), -1.0, None)
    with pytest.raises(ValueError, match="least, most"):
        hinge.limits = (1.0, -1.0)
    assert hinge.limits == (-1.0, None)
    hinge.limits = None
    assert hinge.limits is None


def test_what_should_turn_and_has_no_spin_is_told_once():
    world, _ = joint_world(on_fault="ignore")
    body = world.create_entity(Transform((1, 0)), RigidBody(), BoxCollider((1, 0.1)))
    other = world.create_entity(Transform((9, 0)), RigidBody(), SphereCollider(0.1))
    world.create_entity(Ball(None, other, anchor=(9, 1)))  # a point of it is held: it needs none
    hinge = world.create_entity(Hinge(None, body, anchor=(0, 0), motor_speed=3.0))
    run(world, 3)
    world.component_for_entity(hinge, Hinge).limits = (-1, 1)
    run(world, 3)
    (fault,) = (text for text in map(str, world.faults) if "turns nothing" in text)
    assert f"entity {hinge}: this Hinge turns nothing, for it joins bodies without Spin: entity {body}" in fault

"""Joints of plugins, whose rows a function gives: gears, pulleys, and one that is a built-in one again."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from joints.helpers_joints import G, at, disc, plank, run_failing
from joints.helpers_machines import Gear, Pulley, Rail, Rod, Stop, body, machine_world, machines
from worlds import run

from carom import Physics, Plugin, PluginError, RigidBody, SphereCollider, StepError, Transform, World, column
from carom.framework.vectors import scale
from carom.plugins.joints import CUSTOM, DRIVE, HOLD, LIMIT, SERVO, SPRING, Distance, Joint, Joints, Motor, Row
from carom.plugins.rotation import BoxCollider, Spin


@pytest.mark.parametrize("dimensions", [2, 3])
def test_gear_keeps_its_ratio_under_a_torque(dimensions):
    world, joints = machine_world(dimensions, gravity=0.0)
    a, b = body(world, (0, 0), 1.0), body(world, (5, 0), 2.0)
    space: Any = {} if dimensions == 2 else {"axis": (0, 0, 1)}
    axles: Any = {} if dimensions == 2 else {"axle_a": (0, 0, 1), "axle_b": (0, 1, 0)}  # bevel wheels
    world.create_entity(Motor(None, a, speed=1e3, max_torque=9.0, **space))
    gear = world.create_entity(Gear(a, b, 0.5, **axles))
    run(world, 120)
    w_a, w_b = (np.atleast_1d(world.component_for_entity(each, Spin).angular_velocity) for each in (a, b))
    w_a, w_b = w_a[-1], w_b[-1 if dimensions == 2 else 1]
    assert w_a == pytest.approx(9.0 / (1.0 + 2.0 / 0.5**2) * 2.0, rel=1e-9)  # T t / (I_a + I_b / ratio^2)
    assert w_a + 0.5 * w_b == pytest.approx(0.0, abs=1e-9)
    assert abs(joints.state(gear).value) < 1e-4  # rad
    if dimensions == 2:
        assert at(world, a).rotation == pytest.approx(-0.5 * at(world, b).rotation, abs=1e-4)
        assert abs(joints.state(gear).torque - 2.0 * w_b / 120) < 1e-9


@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize("inertia", [0.0, 0.4])
@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_pulley_falls_as_atwood_says(dimensions, inertia, ratio):
    world, joints = machine_world(dimensions)
    a, b = body(world, (0, -1), inertia, mass=3.0), body(world, (2, -8), inertia)
    pulley = world.create_entity(Pulley(a, b, (0, 0, 0)[:dimensions], (2, 0, 0)[:dimensions], ratio))
    run(world, 60)
    speed = -world.component_for_entity(a, RigidBody).linear_velocity[1]
    fall = G * (3.0 - 1.0 / ratio) / (3.0 + 1.0 / ratio**2)
    assert speed == pytest.approx(fall, rel=1e-4)
    assert joints.state(pulley).value == pytest.approx(1.0 + 8.0 * ratio, abs=1e-3)
    assert joints.state(pulley).impulse[1] * 60 == pytest.approx(ratio * 3.0 * (G - fall), rel=1e-3)


def test_pulley_in_balance_stays_where_it_is():
    world, _ = machine_world(sleeping=True)
    a, b = body(world, (0, -1), mass=2.0), body(world, (2, -2))
    world.create_entity(Pulley(a, b, (0, 0), (2, 0), 0.5))
    run(world, 600)
    np.testing.assert_allclose(at(world, a).position, (0, -1), atol=1e-3)
    assert world.kinetic_energy() < 1e-6


def test_pulley_on_bodies_that_swing_and_turn_keeps_its_length_and_gains_no_energy():
    world, joints = machine_world(dt=1 / 240)
    a, b = body(world, (0.8, -1), 0.2, mass=1.2), body(world, (2, -2), 0.3)
    pulley = world.create_entity(Pulley(a, b, (0, 0), (2, 0), anchor_a=(0.2, 0.1), anchor_b=(0, 0.3)))
    before = world.kinetic_energy() + world.potential_energy()
    world.step()
    whole = joints.state(pulley).value
    for _ in range(240):
        world.step()
        assert joints.state(pulley).value == pytest.approx(whole, abs=3e-3)
        now = world.kinetic_energy() + world.potential_energy()
        assert now < before + 0.01 * G
    assert now > before - 0.05 * G


@pytest.mark.compiled
@pytest.mark.plain
@pytest.mark.parametrize("dimensions", [2, 3])
def test_turns_are_counted_beyond_the_first(dimensions):
    world, joints = machine_world(dimensions, gravity=0.0)
    wheel = body(world, (0, 0), 1.0)
    world.component_for_entity(wheel, Spin).angular_velocity = 8.0 if dimensions == 2 else np.array((0, 0, 8.0))
    axle: Any = 0.0 if dimensions == 2 else (0, 0, 1)
    stop = world.create_entity(Stop(None, wheel, axle=axle, most=15.0))
    run(world, 90)
    assert joints.state(stop).value == pytest.approx(8.0 * 1.5, abs=1e-9)
    run(world, 90)
    assert joints.state(stop).value == pytest.approx(15.0, abs=1e-3)
    turned: Any = at(world, wheel).rotation
    share = turned / 2 if dimensions == 2 else math.asin(turned[3]) + 2 * math.pi
    assert share == pytest.approx(15.0 / 2, abs=1e-3)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_rod_as_a_function_moves_as_the_built_in_one(dimensions):
    places = []
    for kind in (Distance, Rod):
        world, _ = machine_world(dimensions)
        a, b = body(world, (0, 0), 1.0), body(world, (1, 0.5), 0.5)
        world.component_for_entity(a, RigidBody).linear_velocity = (0, 3, 1)[:dimensions]
        world.component_for_entity(a, Spin).angular_velocity = 2.0 if dimensions == 2 else np.array((1.0, 2.0, 3.0))
        for one, other, ends in ((a, b, ((0.1, 0, 0.3), (0, 0.2, 0.1))), (None, a, ((0, 2, 1), (0.0, 0.1, -0.2)))):
            ends = [np.array(end[:dimensions]) for end in ends]
            if kind is Distance:
                point_a = ends[0] + (at(world, one).position if one else 0.0)
                world.create_entity(Distance(one, other, point_a=point_a, point_b=at(world, other).position + ends[1]))
            else:
                world.create_entity(Rod(one, other, *ends))
        run(world, 120)
        places.append([np.hstack((at(world, each).position, at(world, each).rotation)) for each in (a, b)])
    np.testing.assert_allclose(places[0], places[1], atol=1e-9)


def test_values_obey_every_rule():
    world, joints = machine_world(gravity=0.0)
    rails = {}
    for rule, to in ((HOLD, 0.5), (LIMIT, 0.5), (DRIVE, 0.25), (SPRING, 0.5), (SERVO, 0.5)):
        rails[rule] = world.create_entity(Rail(None, body(world, (0, 0), linear_velocity=(0.1, 0)), rule, to))
    driven = world.create_entity(Rail(None, body(world, (0, 0)), lower=-1.0, upper=1.0, motor_speed=0.5))
    heights = [world.component_for_entity(entity, Rail).b or 0 for entity in (*rails.values(), driven)]
    ways = []
    for _ in range(240):
        world.step()
        ways.append(joints.state(rails[SPRING]).value)
    for rule, to in ((HOLD, 0.5), (DRIVE, 1.0), (SERVO, 0.5)):
        assert joints.state(rails[rule]).value == pytest.approx(to, abs=0.01)
    assert joints.state(rails[DRIVE]).speed == pytest.approx(0.25)
    assert joints.state(rails[LIMIT]).value > 0.49
    assert joints.state(driven).value == pytest.approx(1.0, abs=1e-3)
    passes = np.flatnonzero((np.array(ways[:-1]) < 0.5) & (np.array(ways[1:]) >= 0.5))
    assert np.diff(passes).mean() / 60 == pytest.approx(1.0, abs=0.03)  # s
    assert max(abs(at(world, each).y) for each in heights) < 1e-9


def test_fields_are_seen_at_once_and_wake_the_bodies():
    world, joints = machine_world(sleeping=True)
    plank(world, (0, -1.5), (20, 0.5), mass=1e3)
    world.create_entity(Transform((0, -3)), BoxCollider((20.0, 1.0)))
    a, b = disc(world, (0, -0.9)), disc(world, (5, -0.9))
    gear = world.create_entity(Gear(a, b))
    run(world, 120)
    assert world.component_for_entity(a, RigidBody).asleep
    world.component_for_entity(gear, Gear).ratio = -3.0
    world.step()
    assert not world.component_for_entity(b, RigidBody).asleep
    world.component_for_entity(a, Spin).angular_velocity = 10.0
    world.step()
    w_a, w_b = (world.component_for_entity(each, Spin).angular_velocity for each in (a, b))
    assert w_a == pytest.approx(3.0 * w_b, rel=1e-3)
    assert w_b > 0.1
    assert joints.of(a) == [gear]


@pytest.mark.parametrize("kind", [Distance, Pulley])
def test_step_that_fails_while_balls_bounce_on_a_body_leaves_the_directions_of_forces(kind):
    hashes = []
    for due in (-1, 27, 31, 45):
        world, _ = machine_world()
        board = plank(world, (0.3, -1))
        for (x, y), end in (((0.0, 0.0), (-0.4, 0.0)), ((1.0, 0.2), (0.4, 0.0))):
            if kind is Distance:
                world.create_entity(Distance(None, board, point_a=(x, y), point_b=(0.3 + end[0], -1.0)))
            else:
                world.create_entity(Pulley(None, board, (0, -1), (x, y), anchor_b=end))
        for k in range(3):
            place, ball = Transform((0.3 + 0.1 * k, 0.2 + 0.6 * k)), SphereCollider(0.1, restitution=0.8)
            world.create_entity(place, RigidBody(), ball, Spin())
        run_failing(world, 60, due)
        hashes.append(world.state_hash())
    assert len(set(hashes)) == 1


def test_they_break_and_are_lost_as_others():
    world, joints = machine_world()
    a, b = body(world, (0, -1), mass=3.0), body(world, (2, -2))
    events = []
    for event in ("joint_broken", "joint_lost"):
        world.on(event, lambda entity, joint, event=event: events.append((event, joint)))
    least = {"breaking_force": 0.99 * 1.5 * G}  # of 2 m_a m_b g / (m_a + m_b)
    pulley, again = (Pulley(a, b, (0, 0), (2, 0), **limit) for limit in (least, {}))
    world.create_entity(pulley)
    run(world, 3)
    assert events == [("joint_broken", pulley)]
    world.create_entity(again)
    run(world, 30)
    world.delete_entity(b)
    world.step()
    assert events[1:] == [("joint_lost", again)]
    assert len(joints) == 0


def declared(returned):
    """A joint whose function returns that, registered."""

    def constraint(joint, a, b):
        return returned(a, b)

    fields = {"a": column(dtype=int), "b": column(dtype=int), "constraint": constraint, "__module__": __name__}
    return Plugin("wrong").joint(type("Wrong", (Joint,), fields))


@pytest.mark.plain
@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (lambda a, b: 1.0, r"returned 1.0: return \(value, along_a"),
        (lambda a, b: (1.0, a.position), "or a tuple of such rows"),
        (lambda a, b: (1.0, a.position, (0.0,), a.position, a.position), r"turn_a.*\(in 2D a turn is \(turn, 0.0\)\)"),
        (lambda a, b: (math.nan, *(a.position,) * 4), "nan as value: return a number, or None"),
        (lambda a, b: (1.0 / a.position[0], *(a.position,) * 4), "raised ZeroDivisionError"),
    ],
)
def test_what_no_constraint_returns_is_refused_when_it_is_registered(returned, message):
    with pytest.raises(PluginError, match=f"plugin wrong: joint Wrong: constraint, tried in 2D, .*{message}"):
        declared(returned)


@pytest.mark.plain
def test_vectors_that_are_not_the_change_of_the_value_are_refused():
    """The height of an axis of b, which changes as b turns."""

    def height(factor):
        def row(a, b):
            axis, nothing = b.axes[0], scale(b.axes[0], 0.0)
            turn = (axis[0], 0.0) if len(axis) == 2 else (-axis[2], 0.0, axis[0])
            return axis[1], nothing, nothing, nothing, scale(turn, factor)

        return row

    assert issubclass(declared(height(1.0)), Joint)
    with pytest.raises(PluginError, match=r"2D, row 0: its value changes by -0.48, by its vectors -0.96: along_a"):
        declared(height(2.0))


def test_what_is_no_joint_is_refused():
    for thing, message in ((Transform, "derive a class from carom.plugins.joints.Joint"), (Distance, "no constraint")):
        with pytest.raises(PluginError, match=message):
            Plugin("wrong").joint(thing)
    with pytest.raises(ValueError, match=r"Gear does nothing without the plugin .* World\(.*, plugin\)"):
        World(Physics(), Joints()).create_entity(Gear(None, 1))
    with pytest.raises(ValueError, match=r"Gear does nothing without its plugin: World\(Physics\(...\), Joints\(\)\)"):
        World(Physics(), machines).create_entity(Gear(None, 1))


@pytest.mark.plain
def test_numbers_that_are_not_finite_name_joint_and_entity():
    world, _ = machine_world()
    a = body(world, (0, 0))
    pulley = Pulley(None, a, (1, 0), (0, 0))
    entity = world.create_entity(pulley)
    with pytest.raises(ValueError, match=f"entity {entity}: Pulley: where it takes hold .* not finite"):
        world.step()
    pulley.wheel_b = (0, 2)
    world.step()
    before = world.state_hash()
    pulley.wheel_b = at(world, a).position
    with pytest.raises(StepError, match=f"plugin machines: constraint of Pulley, entity {entity}: .* not finite"):
        world.step()
    assert world.state_hash() == before


@pytest.mark.plain
def test_rows_of_a_part_that_there_is_not_are_refused():
    class Half(Joint):
        a: int | None = column(dtype=int)
        b: int | None = column(dtype=int)

        @staticmethod
        def constraint(joint, a, b):
            return (None, *(scale(a.position, 0.0),) * 4)

        def rows(self, dimensions):
            return [Row(CUSTOM, HOLD, part=1)]

    half = Plugin("half")
    half.joint(Half)
    world, _ = machine_world()
    world.add_plugin(half)
    world.create_entity(Half(body(world, (0, 0)), body(world, (1, 0))))
    with pytest.raises(ValueError, match="speak of part 1, but its constraint returns 1"):
        world.step()

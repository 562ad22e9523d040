"""Joints against closed forms: pendulums, springs, ropes, sliders, motors, chains."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from helpers_pairwise import pairwise
from joints.helpers_joints import G, at, chain, disc, gaps, joint_world, plank, spin_of
from worlds import MODES, run

from carom import Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.lab.testing import energy
from carom.plugins.joints import Distance, Hinge, Joints, Motor, MousePull, Slider, Weld, Wheel
from carom.plugins.rotation import BoxCollider, Rotation, Spin


def elliptic(k: float) -> float:
    """The complete integral of the first kind, by the arithmetic and geometric mean."""
    a, b = 1.0, math.sqrt(1.0 - k * k)
    while a - b > 1e-15:
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    return math.pi / (2.0 * a)


def period(angles, dt):
    """Of a swing, from where it passes the lowest point to the right."""
    passes = [k + a / (a - b) for k, (a, b) in enumerate(itertools.pairwise(angles)) if a < 0 <= b]
    return float(np.diff(passes).mean()) * dt


def values(world, joints, joint, steps):
    """Of a joint, after each of these steps."""
    found = []
    for _ in range(steps):
        world.step()
        found.append(joints.state(joint).value)
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "bound"), [(60, 3e-4), (120, 1e-4), (240, 3e-5)])
def test_physical_pendulum_has_the_period_of_the_elliptic_integral(rate, bound):
    world, _ = joint_world(dt=1.0 / rate)
    body = disc(world, (math.sin(1.0), -math.cos(1.0)), inertia=0.5)
    world.create_entity(Hinge(None, body, anchor=(0, 0)))
    before, angles = energy(world), []
    for _ in range(10 * rate):
        world.step()
        angles.append(math.atan2(at(world, body).x, -at(world, body).y))
        now = energy(world)
        assert now <= before + 0.3 * G / rate  # within a swing, as any such steps do
    assert period(angles, 1.0 / rate) == pytest.approx(4.0 * math.sqrt(1.5 / G) * elliptic(math.sin(0.5)), rel=bound)
    assert before - now < 0.01 * G
    assert abs(math.hypot(*at(world, body).position) - 1.0) < 2e-3


@pytest.mark.parametrize("mode", MODES)
def test_joints_hold_in_all_modes(mode):
    world, joints = joint_world(collision=mode)
    _, hinges = chain(world, 5, (0.8, 0.6), (0.45, 0.1))
    plank(world, (0.0, -3.0), (0.5, 0.5))
    floor = world.create_entity(Transform((0, -4)), BoxCollider((20.0, 0.5)))
    run(world, 600)
    assert gaps(world, hinges).max() < 0.02
    assert floor in world.contacts.entity_b
    assert sum(joints.state(hinges[0]).impulse) != 0.0


def test_pendulum_without_spin_or_collider_swings_as_a_point():
    world = World(Physics(dimensions=2, gravity=(0, -G)), Joints())
    body = world.create_entity(Transform((math.sin(1.0), -math.cos(1.0))), RigidBody())
    world.create_entity(Distance(None, body))
    angles = []
    for _ in range(600):
        world.step()
        angles.append(math.atan2(at(world, body).x, -at(world, body).y))
    assert period(angles, 1.0 / 60) == pytest.approx(4.0 * math.sqrt(1.0 / G) * elliptic(math.sin(0.5)), rel=3e-4)


def test_chain_of_50_hangs_for_a_minute():
    world, _ = joint_world()
    _, hinges = chain(world, 50, (0, -1), (0.1, 0.5))
    run(world, 3600)
    assert world.kinetic_energy() < 1e-15
    assert gaps(world, hinges).max() < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("substeps", [2, 4, 8])
@pytest.mark.parametrize("ratio", [0.0, 0.1, 0.5, 1.0])
def test_spring_has_its_period_and_decay(substeps, ratio):
    """A body on a spring, and two with one between them: its ways obey the recurrence of a damped oscillator."""
    omega, dt = 4.0 * math.pi, 1.0 / 60
    turn, fades = omega * math.sqrt(1.0 - ratio**2) * dt, math.exp(-ratio * omega * dt)
    for free in (False, True):
        world, joints = joint_world(0, substeps=substeps)
        body = disc(world, (0, -1.3))
        first = disc(world, (0, 0)) if free else None
        spring = world.create_entity(Distance(first, body, length=1.0, frequency=2.0, damping_ratio=ratio))
        x = values(world, joints, spring, 60) - 1.0
        assert x[0] == pytest.approx(0.3 * (1.0 - 0.5 * (omega * dt) ** 2), abs=0.01)
        trace, less = np.linalg.lstsq(np.column_stack((x[1:-1], -x[:-2])), x[2:], rcond=None)[0]
        assert trace == pytest.approx(2.0 * fades * math.cos(turn), rel=1e-6)
        assert less == pytest.approx(fades**2, rel=1e-6)


def highest_energies(world):
    """J, kinetic, in 10 s and in the 10 s after these."""
    highest = []
    for _ in range(2):
        energies = []
        for _ in range(600):
            world.step()
            energies.append(world.kinetic_energy())
        highest.append(max(energies))
    return highest


@pytest.mark.slow
@pytest.mark.parametrize(("springs", "frequency"), [(1, 2.0), (1, 20.0), (8, 5.0), (32, 10.0), (64, 15.0)])
def test_springs_without_damping_give_no_energy(springs, frequency):
    """Where they are stiff, or many at one body, they may lose some."""
    world, _ = joint_world(0)
    body = disc(world, (0.1, 0.05))
    for angle in 2.0 * math.pi * np.arange(springs) / springs:
        end = math.cos(angle), math.sin(angle)
        world.create_entity(Distance(None, body, point_a=end, length=1.0, frequency=frequency))
    early, late = highest_energies(world)
    assert late < 1.02 * early
    assert springs * frequency > 40.0 or late > 0.98 * early


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("arm", [0.0, 0.5, 1.0])
def test_door_on_a_spring_swings_about_its_edge_at_the_frequency_of_the_spring(d, arm):
    joints, pad = Joints(), (0.0,) * (d - 2)
    world = World(Physics(dimensions=d, gravity=0), Rotation(), joints)
    leaf = world.create_entity(
        Transform((arm, 0, *pad)), RigidBody(mass=10.0), Spin(), BoxCollider((0.5, 0.04, 0.3)[:d])
    )
    axis = {"axis": (0, 0, 1)} if d == 3 else {}
    door = world.create_entity(Hinge(None, leaf, anchor=(0, 0, *pad), frequency=1.0, **axis))
    world.step()
    world.component_for_entity(leaf, Spin).apply_impulse((0, 1.0, *pad), at=(arm + 0.5, 0, *pad))
    assert period(values(world, joints, door, 600), 1 / 60) == pytest.approx(1.0, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("frequency", "leaves", "substeps"), pairwise((1.0, 8.0, 20.0, 29.0), (1, 4), (2, 4)))
def test_springs_of_doors_give_no_energy(frequency, leaves, substeps):
    world, _ = joint_world(0, substeps=substeps)
    before, bodies = None, []
    for k in range(leaves):
        collider = BoxCollider((0.5, 0.05), layer=2, mask=1)
        leaf = world.create_entity(Transform((k + 0.5, 0)), RigidBody(mass=30.0 ** (k % 2)), Spin(), collider)
        world.create_entity(Hinge(before, leaf, anchor=(k, 0), frequency=frequency))
        before = leaf
        bodies.append(leaf)
    world.step()
    for k, leaf in enumerate(bodies):
        world.component_for_entity(leaf, RigidBody).apply_impulse((0.1, 0.3 * (-1) ** k))
    early, late = highest_energies(world)
    assert late < 1.05 * early


@pytest.mark.slow
@pytest.mark.parametrize("beside", [0.0, 1.5, 3.0])
def test_slider_on_a_spring_swings_at_its_frequency_wherever_its_axis_is(beside):
    world, joints = joint_world(0)
    a, b = plank(world, (0, 0), (0.5, 0.5)), plank(world, (0.5, beside), (0.5, 0.5))
    slider = world.create_entity(Slider(a, b, direction=(1, 0), frequency=1.0))
    world.component_for_entity(b, RigidBody).apply_impulse((0.5, 0))
    assert period(values(world, joints, slider, 600), 1 / 60) == pytest.approx(1.0, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("d", "kind", "stiff", "beside"),
    pairwise((2, 3), (Slider, Wheel), ((8.0, 2), (8.0, 4), (20.0, 4)), (-0.6, -2.0)),
)
def test_springs_beside_the_centres_of_their_bodies_give_no_energy(d, kind, stiff, beside):
    frequency, substeps = stiff
    pad, place = (0.0,) * (d - 2), (0.7, beside, 0.0)[:d]
    world = World(Physics(dimensions=d, gravity=0), Rotation(), Joints(), settings=Settings(substeps=substeps))
    a, b = (
        world.create_entity(Transform(at), RigidBody(), Spin(), BoxCollider(half[:d]))
        for at, half in (((0, 0, *pad), (0.5, 0.1, 0.2)), (place, (0.3, 0.3, 0.3)))
    )
    held = {"direction": (1, 0, *pad)} if kind is Slider else {"direction": (0, 1, *pad), "anchor": place}
    if kind is Wheel and d == 3:
        held["axis"] = (0, 0, 1)
    world.create_entity(kind(a, b, frequency=frequency, **held))
    world.component_for_entity(a, RigidBody).apply_impulse((0.1, 0.25, *pad))
    world.component_for_entity(b, RigidBody).apply_impulse((0.1, -0.4, *pad))
    early, late = highest_energies(world)
    assert late < 1.05 * early


@pytest.mark.slow
@pytest.mark.parametrize(
    ("frequency", "damping_ratio"), [(3.0, 0.0), (29.0, 1.0), (31.0, 0.0), (100.0, 1.0), (1e4, 0.0), (1e4, 1.0)]
)
def test_springs_of_any_stiffness_gain_no_energy_in_a_chain(frequency, damping_ratio):
    world, joints = joint_world(0)
    bodies = [disc(world, (k, 0)) for k in range(1, 21)]
    for k, body in enumerate(bodies):
        world.component_for_entity(body, RigidBody).linear_velocity = (math.sin(k), math.cos(3 * k))
    spring = {"length": 1.0, "frequency": frequency, "damping_ratio": damping_ratio}
    for a, b in itertools.pairwise([None, *bodies]):
        world.create_entity(Distance(a, b, **spring))
    last = world.create_entity(Distance(bodies[-1], None, point_b=(21.0, 0.0), **spring))
    before = world.kinetic_energy()
    for _ in range(300):
        world.step()
        assert world.kinetic_energy() < 1.001 * before
    if frequency > 30.0:
        assert joints.state(last).value == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [1.0, 20.0])
@pytest.mark.parametrize("most", [None, 50.0])
def test_no_motor_is_stronger_than_limits(speed, most):
    world, joints = joint_world(0)
    door = world.create_entity(Transform((1, 0)), RigidBody(1.0), Spin(inertia=0.3))
    sled = world.create_entity(Transform((0, 9)), RigidBody(1.0), Spin(inertia=0.3))
    driven = {"limits": (-0.1, 1.2), "motor_speed": speed}
    hinge = world.create_entity(Hinge(None, door, anchor=(0, 0), max_torque=most, **driven))
    slider = world.create_entity(Slider(None, sled, direction=(1, 0), max_force=most, **driven))
    for _ in range(120):
        world.step()
        assert joints.state(hinge).value < 1.2 + 1e-6
        assert joints.state(slider).value < 1.2 + 1e-6
    assert joints.state(hinge).value == pytest.approx(1.2)
    assert joints.state(slider).value == pytest.approx(1.2)


def test_rope_never_pushes_and_holds():
    world, joints = joint_world()
    body = disc(world, (0, -0.2))
    rope = world.create_entity(Distance(None, body, length=(0, 1)))
    run(world, 10)
    assert at(world, body).y == pytest.approx(-0.2 - 0.5 * G * 40 * 41 / 240**2)  # it falls freely
    lowest = 0.0
    for _ in range(300):
        world.step()
        lowest = min(lowest, at(world, body).y)
    assert lowest == pytest.approx(-1.0, abs=1e-6)
    assert joints.state(rope).impulse[1] == pytest.approx(G / 60)
    world.component_for_entity(rope, Distance).length = (0, 0.5)  # a crane pulls it up
    run(world, 300)
    assert at(world, body).y == pytest.approx(-0.5, abs=1e-3)


def test_slider_obeys_the_incline_and_stops_at_its_limit():
    slope = -math.radians(30)
    along = np.array((math.cos(slope), math.sin(slope)))
    world, joints = joint_world()
    body = plank(world, (0, 0), angle=slope)
    slider = world.create_entity(Slider(None, body, direction=along, limits=(None, 2.0)))
    run(world, 30)
    assert joints.state(slider).speed == pytest.approx(G * 0.5 * 0.5, rel=1e-5)
    for _ in range(150):
        world.step()
        assert abs(np.dot((-along[1], along[0]), at(world, body).position)) < 1e-3
    assert joints.state(slider).value == pytest.approx(2.0, abs=1e-3)
    assert joints.state(slider).speed == pytest.approx(0.0, abs=1e-9)
    assert at(world, body).rotation == pytest.approx(slope, abs=1e-4)


def test_motor_gives_its_torque_then_its_speed():
    world, joints = joint_world(0)
    wheel = disc(world, (0, 0), 1.0, inertia=2.0)
    hinge = world.create_entity(Hinge(None, wheel, anchor=(0, 0), motor_speed=5.0, max_torque=4.0))
    run(world, 30)
    assert spin_of(world, wheel) == pytest.approx(4.0 / 2.0 * 0.5, rel=1e-12)
    assert joints.state(hinge).torque == pytest.approx(4.0 / 60)
    run(world, 200)
    assert spin_of(world, wheel) == pytest.approx(5.0, rel=1e-12)
    world.component_for_entity(hinge, Hinge).motor_speed = -3.0
    run(world, 600)
    assert spin_of(world, wheel) == pytest.approx(-3.0, rel=1e-12)


@pytest.mark.parametrize(("share", "holds"), [(1.02, True), (0.98, False)])
def test_motor_holds_a_pose_if_its_torque_is_enough(share, holds):
    world, _ = joint_world()
    arm = plank(world, (1, 0), (1.0, 0.1), mass=2.0)
    world.create_entity(Hinge(None, arm, anchor=(0, 0)))
    world.create_entity(Motor(None, arm, angle=0.0, max_torque=share * 2.0 * G))
    run(world, 300)
    assert (abs(at(world, arm).rotation) < 0.01) == holds


@pytest.mark.parametrize(("d", "first", "substeps"), pairwise((2, 3), ("hinge", "motor"), (4, 16)))
def test_a_motor_beside_a_hinge_holds_as_one_that_it_has(d, first, substeps):
    """A small box far from its pin rests, whichever of the two joints was there first, with the torque m g r."""
    gravity, axis = (0, -G, 0)[:d], {} if d == 2 else {"axis": (0, 0, 1)}
    plugins, settings = (Physics(d, gravity=gravity), Rotation(), Joints()), Settings(substeps=substeps)
    with World(*plugins, settings=settings) as world:
        box = world.create_entity(Transform((1, 0, 0)[:d]), RigidBody(), Spin(), BoxCollider(0.1))
        both = Hinge(None, box, anchor=(0,) * d, **axis), Motor(None, box, speed=0.0, **axis)
        ids = [world.create_entity(each) for each in (both if first == "hinge" else both[::-1])]
        motor = ids[first == "hinge"]
        for _ in range(120):
            world.step()
            assert world.kinetic_energy() < 1e-3
            assert np.linalg.norm(np.subtract(*plugins[2].anchors()), axis=1).max() < 0.01
        torque = np.sum(plugins[2].state(motor).torque) / world.settings.dt
        assert torque == pytest.approx(G, rel=1e-3)


@pytest.mark.parametrize(("d", "first", "length"), pairwise((2, 3), ("hinge", "motor"), (1.0, 1.5, 2.5)))
def test_a_motor_beside_a_hinge_of_free_bodies_gives_no_energy(d, first, length):
    """Two boxes far apart that fly as one, whichever of the two joints was there first."""
    axis = {} if d == 2 else {"axis": (0, 0, 1)}
    with World(Physics(d, gravity=(0,) * d), Rotation(), Joints()) as world:
        base = world.create_entity(Transform((0,) * d), RigidBody(mass=5.0), Spin(), BoxCollider(0.3))
        moving = RigidBody(linear_velocity=(0, 0.5, 0)[:d])
        box = world.create_entity(Transform((length, 0, 0)[:d]), moving, Spin(), BoxCollider(0.1))
        both = Hinge(base, box, anchor=(0,) * d, **axis), Motor(base, box, speed=0.0, **axis)
        for joint in both if first == "hinge" else both[::-1]:
            world.create_entity(joint)
        for _ in range(600):
            world.step()
            assert 0.09 < world.kinetic_energy() < 0.125


def test_hinge_stops_at_its_limits():
    world, joints = joint_world()
    leaf = plank(world, (0.5, 0))
    hinge = world.create_entity(Hinge(None, leaf, anchor=(0, 0), limits=(-0.7, 0.7)))
    run(world, 300)
    assert joints.state(hinge).value == pytest.approx(-0.7, abs=2e-3)
    assert world.kinetic_energy() < 1e-20
    assert joints.state(hinge).torque == pytest.approx(0.5 * math.cos(0.7) * G / 60, rel=1e-3)


def test_mouse_lifts_a_body_which_sags_by_its_weight():
    world, _ = joint_world()
    body = disc(world, (0, 0))
    world.create_entity(MousePull(body, grip=(0, 0), target=(2, 1), max_force=100.0))
    run(world, 300)
    np.testing.assert_allclose(at(world, body).position, (2.0, 1.0 - G / (10 * math.pi) ** 2), atol=2e-3)


def test_mouse_lifts_nothing_that_is_too_heavy():
    world, _ = joint_world()
    body = disc(world, (0, 0))
    world.create_entity(MousePull(body, grip=(0, 0), target=(0, 1), max_force=0.5 * G))
    run(world, 60)
    assert at(world, body).y == pytest.approx(-0.25 * G, rel=0.05)


@pytest.mark.parametrize("boxes", [5, 10])
def test_welded_cantilever_stands(boxes):
    world, _ = joint_world()
    body = None
    for k in range(boxes):
        before, body = body, plank(world, (k + 0.5, 0), (0.5, 0.25))
        world.create_entity(Weld(before, body, anchor=(k, 0)))
    assert body is not None
    run(world, 600)
    assert -1e-4 < at(world, body).y < 0.0
    assert world.kinetic_energy() < 1e-3


def test_contacts_and_joints_hold_together():
    """A door lies on a ball: levers."""
    world, joints = joint_world()
    board = plank(world, (0.5, 0), (0.5, 0.1))
    hinge = world.create_entity(Hinge(None, board, anchor=(0, 0)))
    world.create_entity(Transform((0.75, -0.6)), SphereCollider(0.5))
    run(world, 300)
    assert world.kinetic_energy() < 1e-12
    assert joints.state(hinge).impulse[1] == pytest.approx((1.0 - 0.5 / 0.75) * G / 60, rel=0.02)

"""Characters on what moves: platforms, conveyors and crates carry them, feel their weight, and may go away."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_character import FIGURES, JUMP, STEP, G, Stage, each_dimension, each_figure, is_walking, vector
from helpers_pairwise import pairwise

from carom import AABBCollider, PartOf, RigidBody, SphereCollider, Spin, Transform
from carom.plugins.rotation import BoxCollider

pytestmark = pytest.mark.slow  # its kernels take long to compile


@pytest.mark.parametrize(("name", "speed", "axis"), pairwise(tuple(FIGURES), (3.0, 8.0), (0, 1)))
def test_a_lift_that_reverses_carries_it(name, speed, axis):
    """As if glued, up, down and to and fro; it tells whose velocity it has."""
    figure = FIGURES[name]
    stage = Stage(figure, y=0.0)
    lift = stage.mover(0.0, 0.0)
    body = stage.world.component_for_entity(lift, RigidBody)
    place = stage.world.component_for_entity(lift, Transform)

    def drive(time):
        velocity = [0.0] * figure.d
        velocity[axis] = speed if (time + 0.25) % 1.0 < 0.5 else -speed
        body.linear_velocity = velocity

    stage.each(drive)
    stage.run(10)
    gaps = []
    for _ in range(150):
        stage.world.step()
        gaps.append(stage.place.position - place.position)
        assert stage.me.state == "floor"
        assert stage.me.floor_entity == lift
        assert stage.me.floor_velocity == pytest.approx(body.linear_velocity, abs=1e-9)
    assert np.ptp(gaps, axis=0).max() <= 2e-14


@each_dimension
@pytest.mark.parametrize("kinematic", [False, True])
def test_a_platform_put_elsewhere_in_each_step_carries_it(figure, kinematic):
    stage = Stage(figure, y=0.0)
    more = (RigidBody(kind="kinematic"),) if kinematic else ()
    lift = stage.box((-2, -1), (2, 0), *more)
    place = stage.world.component_for_entity(lift, Transform)

    def put(time):
        place.position = stage.at(3 * math.sin(2 * time), -0.5 + math.sin(5 * time))

    stage.each(put)
    stage.run(10)
    gaps = []
    for _ in range(150):
        stage.world.step()
        gaps.append(stage.place.position - place.position)
        assert stage.me.state == "floor"
    assert np.ptp(gaps, axis=0).max() <= 2e-14


@each_dimension
def test_a_platform_that_is_teleported_does_not_carry(figure):
    stage = Stage(figure, y=0.0)
    lift = stage.mover(0.0, 0.0)
    stage.run(5)
    before = stage.place.position.copy()
    stage.world.component_for_entity(lift, Transform).position = stage.at(20.0, -0.5)
    stage.run(1)
    assert stage.place.x == before[0]
    stage.run(5)
    assert stage.me.state == "air"


@each_dimension
def test_it_walks_on_a_lift_as_on_a_floor(figure):
    stage = Stage(figure, x=-1.0, y=0.0)
    lift = stage.mover(0.0, 0.0, linear_velocity=vector(figure.d, 1.0, 3.0))
    stage.run(10)
    track = stage.run(20, stage.walk(3.0))[5:]
    assert np.diff(track.x) == pytest.approx((3.0 + 1.0) * STEP, abs=1e-12)
    assert np.diff(track.y) == pytest.approx(3.0 * STEP, abs=1e-12)
    assert track.velocity[:, 0] == pytest.approx(3.0, abs=1e-12)
    assert stage.me.floor_entity == lift


@each_figure
def test_a_plank_that_tips_to_and_fro_carries_it(figure):
    """By assigned rotations, up to 0.5 rad: on the floor in each step."""
    stage = Stage(figure, x=1.5, y=0.3)
    shape = BoxCollider(vector(figure.d, 3.0, 0.3, 20.0))
    plank = stage.world.create_entity(Transform(vector(figure.d)), RigidBody(kind="kinematic"), shape)
    place = stage.world.component_for_entity(plank, Transform)

    def tip(time):
        angle = 0.5 * math.sin(2 * time)
        place.rotation = angle if figure.d == 2 else (math.cos(angle / 2), 0, 0, math.sin(angle / 2))

    stage.each(tip)
    stage.run(10)
    track = stage.run(200)
    assert is_walking(track.state)
    assert abs(track.x - 1.5).max() < 0.75


def test_a_turntable_takes_it_round():
    """In space, about the vertical: on the circle, at the table's rate."""
    for name in ("capsule 3D", "box 3D"):
        stage = Stage(FIGURES[name], x=2.0, y=0.0)
        shape = BoxCollider((4.0, 0.5, 4.0))
        stage.world.create_entity(Transform((0, -0.5, 0)), RigidBody(kind="kinematic"), Spin((0, 1.2, 0)), shape)
        stage.run(10)
        track = stage.run(120)
        x, z = track.position[:, 0], track.position[:, 2]
        assert np.hypot(x, z) == pytest.approx(np.hypot(x[0], z[0]), abs=1e-9)
        assert np.diff(np.unwrap(np.arctan2(-z, x))) == pytest.approx(1.2 * STEP, abs=1e-9)
        assert np.ptp(track.y) < 1e-9


@each_figure
@pytest.mark.parametrize("turn", [0.004, -0.02, 1.2])
def test_on_a_log_its_feet_go_as_the_log_does(figure, turn):
    """In the step in which it is on top, by R sin(turn), however tall it is; not where that is more than a metre."""
    stage, radius = Stage(figure, y=1.5), 1.5
    spin = Spin(-turn / STEP if figure.d == 2 else (0, 0, -turn / STEP))
    stage.world.create_entity(Transform(vector(figure.d)), RigidBody(kind="kinematic"), spin, SphereCollider(radius))
    track = stage.run(2)
    assert track.x[0] == 0.0
    assert track.x[1] == pytest.approx(radius * math.sin(turn) if abs(turn) < 0.5 else 0.0, abs=1e-9)


@pytest.mark.parametrize("speed", [0.0, 3.0, -3.0])
@pytest.mark.parametrize("name", ["capsule 2D", "sphere 3D"])
def test_on_a_planet_that_turns_it_walks_as_on_one_that_rests(name, speed):
    """With an up that turns: seen from the planet at its speed, with the spin and against it."""
    figure, rate = FIGURES[name], 0.4
    stage = Stage(figure, y=5.0, gravity=0.0)
    stage.me.gravity = G
    spin = Spin(-rate if figure.d == 2 else (0, 0, -rate))
    stage.world.create_entity(Transform(vector(figure.d)), RigidBody(kind="kinematic"), spin, SphereCollider(5.0))

    def act(step):
        up = stage.place.position / np.linalg.norm(stage.place.position)
        stage.me.up = up
        stage.me.move = speed if figure.d == 2 else speed * np.cross(up, (0.0, 0.0, 1.0))
        if figure.d == 2:
            stage.place.rotation = math.atan2(-up[0], up[1])

    track = stage.run(200, act)
    angles = np.unwrap(np.arctan2(track.x, track.y))[50:]
    expected = rate + speed / (5.0 + stage.stands)
    assert np.diff(angles) / STEP == pytest.approx(expected, rel=0.002)
    assert is_walking(track[5:].state)


@each_dimension
def test_a_crate_carries_it(figure):
    """One that glides on ice: the gap to it stays."""
    stage = Stage(figure, y=1.0)
    stage.box((-50, -1), (50, 0), friction=0.0)
    crate = stage.crate(0.0, 0.5, mass=20.0, friction=0.0)
    stage.run(30)
    assert stage.me.floor_entity == crate
    stage.world.component_for_entity(crate, RigidBody).linear_velocity = vector(figure.d, 2.0)
    stage.run(1)
    gaps = []
    for _ in range(60):
        stage.world.step()
        gaps.append(stage.place.position - stage.position_of(crate))
        assert stage.me.state == "floor"
    assert np.ptp(gaps, axis=0).max() <= 2e-14
    assert stage.position_of(crate)[0] == pytest.approx(2.0 * 61 * STEP, abs=0.1)


@each_dimension
def test_a_conveyor_carries_it_and_it_walks_on_it(figure):
    """A still box whose surface runs at 3 m/s, and a lift of which it does."""
    stage = Stage(figure, y=0.0)
    belt = stage.box((-50, -1), (50, 0), surface_velocity=vector(figure.d, 3.0))
    stage.run(5)
    track = stage.run(30)
    assert np.diff(track.x) == pytest.approx(3.0 * STEP, abs=1e-12)
    assert np.ptp(track.y) <= 1e-12
    assert not track.velocity.any()
    assert stage.me.floor_entity == belt
    assert stage.me.floor_velocity == pytest.approx(vector(figure.d, 3.0), abs=1e-9)
    track = stage.run(30, stage.walk(-3.0))[5:]
    assert np.ptp(track.x) < 1e-9
    stage = Stage(figure, y=0.0)
    stage.box(
        (-2, -1), (2, 0), RigidBody(kind="kinematic", linear_velocity=vector(figure.d, 1.0, 2.0)),
        surface_velocity=vector(figure.d, -1.5),
    )  # fmt: skip
    stage.run(5)
    track = stage.run(30)
    assert np.diff(track.x) == pytest.approx(-0.5 * STEP, abs=1e-12)
    assert np.diff(track.y) == pytest.approx(2.0 * STEP, abs=1e-12)


@each_dimension
def test_a_part_of_a_body_is_a_lift_as_well(figure):
    stage = Stage(figure, x=3.0, y=0.0)
    body = stage.world.create_entity(
        Transform(stage.at(0.0, -0.5)), RigidBody(kind="kinematic"), AABBCollider((0.5,) * figure.d)
    )
    part = stage.world.create_entity(PartOf(body, stage.at(3.0, 0.0)), AABBCollider(vector(figure.d, 1.0, 0.5, 1.0)))
    moving, place = (stage.world.component_for_entity(body, kind) for kind in (RigidBody, Transform))

    def drive(time):
        moving.linear_velocity = stage.at(2.0, 3.0 if (time + 0.25) % 1.0 < 0.5 else -3.0)

    stage.each(drive)
    stage.run(10)
    gaps = []
    for _ in range(90):
        stage.world.step()
        gaps.append(stage.place.position - place.position)
    assert np.ptp(gaps, axis=0).max() <= 2e-14
    assert stage.me.floor_entity == part
    assert stage.me.state == "floor"


@each_figure
def test_a_one_way_lift_takes_up_only_what_was_above_it(figure):
    for start, picked_up in ((0.4, False), (-0.3, True)):
        stage = Stage(figure)
        lift = stage.one_way(-2, 2, start, RigidBody(kind="kinematic"))
        stage.run(5)
        stage.world.component_for_entity(lift, RigidBody).linear_velocity = vector(figure.d, 0.0, 2.0)
        track = stage.run(60)
        height = start + 2.0 if picked_up else 0.0
        assert track.y[-1] == pytest.approx(height + stage.stands, abs=1e-9)
        assert track.state[-1] == "floor"
        assert stage.me.floor_entity == (lift if picked_up else stage.floor)


@each_dimension
@pytest.mark.parametrize("rise", [3.0, -3.0])
@pytest.mark.parametrize("leave", ["all", "up", "none"])
def test_jumping_off_adds_the_velocity_of_the_platform(figure, leave, rise):
    """But nothing that goes down: from a lift that sinks a jump is as high as from still ground."""
    stage = Stage(figure, y=0.0, leave=leave, air_acceleration=0.0)
    stage.mover(0.0, 0.0, linear_velocity=vector(figure.d, 2.0, rise))
    assert stage.run(30).state[-1] == "floor"
    start = stage.place.position.copy()
    track = stage.run(12, stage.hold(jump=True))
    t = STEP * np.arange(1, 13)
    vx, vy = (2.0 if leave == "all" else 0.0), (JUMP if leave == "none" else JUMP + max(rise, 0.0))
    assert track.x - start[0] == pytest.approx(vx * t, abs=1e-9)
    assert track.y - start[1] == pytest.approx(vy * t - G * t * t / 2, abs=1e-9)


@each_dimension
@pytest.mark.parametrize("rise", [3.0, -3.0])
def test_walking_off_it_keeps_of_the_platform_what_leave_says(figure, rise):
    for leave, kept in (("all", (2.0, rise)), ("up", (0.0, max(rise, 0.0))), ("none", (0.0, 0.0))):
        stage = Stage(figure, x=1.5, y=0.0, leave=leave, snap=0.0)
        stage.mover(0.0, 0.0, linear_velocity=vector(figure.d, 2.0, rise))
        stage.run(30)
        track = stage.run(60, stage.walk(4.0))
        first = track.state.index("air")
        assert first > 5
        assert track.velocity[first][:2] == pytest.approx((4.0 + kept[0], kept[1]), abs=1e-9)


@each_dimension
def test_its_weight_presses_on_what_it_stands_on(figure):
    """A slab of 10 kg that hovers: 100 N give it 10 m/s^2 down; 0 N nothing, not one bit."""
    for weight in (0.0, 100.0):
        stage = Stage(figure, y=0.0, weight=weight)
        shape = AABBCollider(vector(figure.d, 3.0, 0.5, 3.0))
        slab = stage.world.create_entity(Transform(stage.at(0.0, -0.5)), RigidBody(mass=10.0, gravity_scale=0.0), shape)
        stage.run(20)
        before = stage.velocity_of(slab)[1]
        stage.run(30)
        assert stage.velocity_of(slab)[1] - before == pytest.approx(-weight / 10.0 * 0.5, rel=0.05)
        assert stage.me.state == "floor"
        assert weight or (stage.position_of(slab) == stage.at(0.0, -0.5)).all()


@each_dimension
@pytest.mark.parametrize(("weight", "x"), [(0.0, 1.0), (2.0, 1.0), (2.0, -2.0)])
def test_its_weight_turns_what_it_stands_on_beside_the_middle(figure, weight, x):
    """A slab that hovers and can turn: the weight times its arm, over the inertia of a box, times half a second."""
    stage = Stage(figure, x=x, y=0.0, weight=weight)
    shape, body = BoxCollider(vector(figure.d, 3.0, 0.5, 3.0)), RigidBody(mass=10.0, gravity_scale=0.0)
    slab = stage.world.create_entity(Transform(stage.at(0.0, -0.5)), body, Spin(), shape)
    spin = stage.world.component_for_entity(slab, Spin)
    stage.run(20)
    before = np.array(spin.angular_velocity, ndmin=1)
    stage.run(30)
    gained = np.array(spin.angular_velocity, ndmin=1) - before
    assert gained[-1] == pytest.approx(-weight * x / (10.0 * (3.0**2 + 0.5**2) / 3) * 0.5, rel=0.05)
    assert gained[:-1] == pytest.approx(0.0, abs=1e-12)
    assert stage.me.state == "floor"


@each_dimension
@pytest.mark.parametrize("how", ["deleted", "a sensor", "not seen", "switched off"])
def test_it_falls_from_the_next_step_when_its_floor_is_gone(figure, how):
    stage = Stage(figure, y=0.0)
    floor = stage.box((-5, -1), (5, 0))
    stage.run(5)
    if how == "deleted":
        stage.world.delete_entity(floor)
    elif how == "a sensor":
        stage.world.component_for_entity(floor, AABBCollider).sensor = True
    elif how == "switched off":
        stage.world.component_for_entity(floor, AABBCollider).enabled = False
    else:
        stage.world.component_for_entity(floor, AABBCollider).mask = 0
    track = stage.run(30)
    assert set(track.state) == {"air"}
    assert stage.me.floor_entity == -1
    n = np.arange(30)
    assert -np.diff(track.y) == pytest.approx(G * STEP**2 * (n[1:] + 0.5), abs=1e-9)


@each_dimension
def test_on_a_crate_that_sleeps_it_stands_still(figure):
    stage = Stage(figure, y=1.0, settings={"sleeping": True})
    stage.box((-50, -1), (50, 0))
    crate = stage.crate(0.0, 0.5)
    stage.run(120)
    assert stage.world.component_for_entity(crate, RigidBody).asleep
    still = stage.run(30)
    assert (still.position == still.position[0]).all()
    assert is_walking(still.state)


@each_dimension
def test_a_mask_without_a_floor_lets_it_fall(figure):
    stage = Stage(figure)
    stage.world.component_for_entity(stage.hero, type(figure.shape)).mask = 0
    track = stage.run(30)
    assert set(track.state) == {"air"}
    assert track.y[-1] < -2.0

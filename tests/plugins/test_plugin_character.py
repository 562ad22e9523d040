"""Characters: each rule of docs/plugins/character.md has a known answer, for boxes, capsules and spheres."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_character import (
    FIGURES,
    JUMP,
    SKIN,
    G,
    Stage,
    each_dimension,
    each_figure,
    plugins_of,
    slope,
    vector,
    world_of,
)

from carom import (
    AABBCollider,
    CaromError,
    PartOf,
    RigidBody,
    SphereCollider,
    Spin,
    TileGridCollider,
    Transform,
    World,
    create_chain,
    create_height_field,
)
from carom.framework import StepError
from carom.plugins import Physics
from carom.plugins.character import Character, Ladder
from carom.plugins.rotation import BoxCollider

pytestmark = pytest.mark.slow  # its kernels take long to compile

STEP = 1 / 60
TOP = JUMP**2 / (2 * G)  # m


def walk(stage, speed, after=0):
    """The wish to walk from that step on."""
    return lambda step: stage.move(speed if step >= after else 0.0)


def hold(stage, steps=10**9, **wishes):
    """These wishes for so many steps, then none."""

    def act(step):
        for name, value in wishes.items():
            setattr(stage.me, name, value if step < steps else type(value)(0))

    return act


def is_walking(states):
    return set(states) == {"floor"}


# -- flat ground ----------------------------------------------------------------------------------


@each_figure
def test_it_falls_stands_at_its_skin_and_then_not_one_bit_changes(figure):
    stage = Stage(figure, y=1.0)
    floor = stage.box((-5, -1), (5, 0))
    stage.run(40)
    still = stage.run(30)
    assert still.y == pytest.approx(figure.half + SKIN, abs=1e-9)
    assert (still.position == still.position[0]).all()
    assert is_walking(still.state)
    assert stage.me.floor_entity == floor
    assert stage.me.floor_normal == pytest.approx(vector(figure.d, 0, 1), abs=1e-12)
    assert not np.any(stage.me.velocity)
    assert not np.any(stage.me.floor_velocity)


def seams(stage, kind):
    """A floor of pieces of 1 m, from -6 to 30."""
    x = np.arange(-6.0, 31.0)
    if kind == "boxes":
        for left in x[:-1]:
            stage.box((left, -1), (left + 1, 0))
    elif kind == "tiles":
        stage.world.create_entity(Transform((0, 0)), TileGridCollider(["#" * 36], 1.0, lower=(-6, -1)))
    elif kind == "chain":
        create_chain(stage.world, np.stack((x, 0 * x), 1))
    else:
        create_height_field(stage.world, np.zeros((36, 8)), 1.0, position=(-6, 0, -3.5))


@pytest.mark.parametrize(
    ("name", "ground"),
    [(name, ground) for name in FIGURES
     for ground in (("boxes", "tiles", "chain") if name[-2] == "2" else ("boxes", "field"))],
)  # fmt: skip
def test_seams_change_neither_height_nor_speed(name, ground):
    stage = Stage(FIGURES[name], y=0.0)
    seams(stage, ground)
    stage.run(20)
    track = stage.run(200, walk(stage, 4.0))[10:]
    assert np.ptp(track.y) <= 1e-12
    assert np.diff(track.x) == pytest.approx(4.0 * STEP, abs=1e-12)
    assert is_walking(track.state)
    assert stage.events("character_hit") == []


@each_dimension
def test_it_speeds_up_and_slows_down_by_its_acceleration(figure):
    stage = Stage(figure, acceleration=12.0)
    stage.run(2)
    up = stage.run(20, walk(stage, 4.0))
    assert np.linalg.norm(up.velocity, axis=1) == pytest.approx(np.minimum(0.2 * np.arange(1, 21), 4.0), abs=1e-12)
    down = stage.run(25, walk(stage, 0.0))
    assert np.linalg.norm(down.velocity, axis=1) == pytest.approx(np.maximum(4 - 0.2 * np.arange(1, 26), 0), abs=1e-12)


def test_in_space_it_walks_any_way_as_fast_and_what_is_along_up_is_ignored():
    stage = Stage(FIGURES["capsule 3D"])
    stage.run(2)
    for way in ((3.0, 5.0, 4.0), (-3.0, -2.0, 4.0), (0.0, 9.0, -5.0)):
        flat = np.array((way[0], 0.0, way[2]))

        def act(step, way=way):
            stage.me.move = way

        track = stage.run(60, act)[20:]
        expected = np.tile(flat * STEP, (39, 1))
        assert np.diff(track.position, axis=0) == pytest.approx(expected, abs=1e-12)


# -- jumps ----------------------------------------------------------------------------------------


@each_figure
@pytest.mark.parametrize("rate", [30, 60, 144, 240])
def test_a_jump_is_the_parabola_at_any_rate(figure, rate):
    """Each step is on it, so its height is v^2 / 2g but for the steps' sampling; a held key jumps once."""
    for settings in ({"jump_speed": JUMP}, {"jump_height": TOP}):
        stage = Stage(figure, dt=1 / rate, **settings)
        stage.run(3)
        start = stage.place.y
        track = stage.run(round(0.8 * rate), hold(stage, jump=True))
        t = np.arange(1, len(track.y) + 1) / rate
        flies = t < 0.99 * 2 * JUMP / G
        assert track.y[flies] - start == pytest.approx((JUMP * t - G * t * t / 2)[flies], abs=1e-9)
        assert track.y.max() - start == pytest.approx(TOP, rel=1e-4)
        assert track.y[-1] == pytest.approx(start, abs=1e-9)
        assert track.state[-1] == "floor"


@each_dimension
@pytest.mark.parametrize("rate", [60, 240])
def test_a_jump_is_cut_when_the_key_is_let_go(figure, rate):
    """Of the upward speed 0.4 stays, as soon as a step begins without the key: after 0.1 s and up to a step more."""
    stage = Stage(figure, dt=1 / rate, jump_cut=0.4)
    stage.run(3)
    start, held = stage.place.y, round(0.1 * rate)
    track = stage.run(rate // 2, hold(stage, held, jump=True))

    def top(t):
        return JUMP * t - G * t * t / 2 + (0.4 * (JUMP - G * t)) ** 2 / (2 * G)

    sampling = G / rate**2 / 8
    assert top(0.1 - 1.01 / rate) - sampling <= track.y.max() - start <= top(0.1 + 1.01 / rate)


@each_dimension
def test_coyote_time_is_after_the_floor_and_no_longer(figure):
    """It walks over an edge, and jumps n steps after its last one on the floor."""
    tops = {}
    for n, coyote in ((1, 0.1), (5, 0.1), (8, 0.1), (3, 0.0)):
        stage = Stage(figure, x=-1.0, y=0.0, coyote=coyote)
        stage.box((-5, -1), (0, 0))
        stage.run(2)
        left = 0

        def act(step, stage=stage, n=n):
            nonlocal left
            stage.move(4.0)
            left += stage.me.state == "air"
            stage.me.jump = left >= n

        track = stage.run(60, act)
        tops[n, coyote] = track.y.max() - stage.stands
    assert min(tops[1, 0.1], tops[5, 0.1]) > 0.9
    assert max(tops[8, 0.1], tops[3, 0.0]) < 1e-9


@each_dimension
def test_a_press_before_landing_is_kept_for_the_buffer(figure):
    def landing(act, **values):
        stage = Stage(figure, y=1.5, **values)
        stage.box((-5, -1), (5, 0))
        return stage.run(60, lambda step: act(stage, step))

    alone = landing(lambda stage, step: None)
    lands = alone.state.index("floor")
    for before, buffer, jumps in ((1, 0.1, True), (5, 0.1, True), (8, 0.1, False), (3, 0.0, False)):
        track = landing(
            lambda stage, step, before=before: setattr(stage.me, "jump", step >= lands - before), buffer=buffer
        )
        again = track.y[lands + 2 :].max() - track.y[lands : lands + 2].min()
        assert again == pytest.approx(TOP, abs=0.1) if jumps else again < 1e-9


@each_dimension
def test_air_jumps_are_as_many_as_it_has_and_come_back_on_the_floor(figure):
    stage = Stage(figure, air_jumps=2)
    stage.run(2)
    for _ in range(2):
        track = stage.run(150, lambda step: setattr(stage.me, "jump", step % 18 < 9))[:90]
        assert track.y.max() - stage.stands == pytest.approx(3 * TOP, abs=1e-3)
        stage.me.jump = False
        stage.run(60)
        assert stage.me.state == "floor"


@each_dimension
def test_it_falls_as_gravity_says_and_no_faster_than_max_fall(figure):
    for own, pull in ((None, G), (12.0, 12.0)):
        stage = Stage(figure, y=30.0, gravity=G, max_fall=10.0, coyote=0.0)
        stage.me.gravity = own
        track = stage.run(70)
        speeds = np.minimum(pull * STEP * np.arange(1, 71), 10.0)
        assert -track.velocity[:, 1] == pytest.approx(speeds, abs=1e-9)
        assert -np.diff(track.y)[-5:] == pytest.approx(10.0 * STEP, abs=1e-9)


@each_dimension
def test_in_the_air_it_is_steered_by_air_acceleration(figure):
    stage = Stage(figure, y=30.0, air_acceleration=6.0)
    track = stage.run(30, walk(stage, 2.0))
    assert track.velocity[:, 0] == pytest.approx(np.minimum(0.1 * np.arange(1, 31), 2.0), abs=1e-9)


@each_figure
def test_landing_is_told_once_with_its_speed(figure):
    stage = Stage(figure, y=1.2)
    floor = stage.box((-5, -1), (5, 0))
    stage.run(60)
    ((step, entity, landed_on, speed),) = stage.events("landed")
    assert (entity, landed_on) == (stage.hero, floor)
    assert speed == pytest.approx(math.sqrt(2 * G * 1.2), abs=1.01 * G * STEP)
    assert step == pytest.approx(math.sqrt(2 * 1.2 / G) / STEP, abs=1.5)
    assert stage.events("character_hit") == []


# -- slopes and stairs ----------------------------------------------------------------------------


@each_figure
@pytest.mark.parametrize("angle", [20, 45])
def test_it_walks_slopes_at_a_constant_speed_and_rests_on_them(figure, angle):
    stage = Stage(figure, x=-2.0)
    stage.wedge(slope(angle))
    up = stage.run(75, walk(stage, 4.0))
    on_it = up[60:]
    way = np.array((math.cos(math.radians(angle)), math.sin(math.radians(angle))))
    assert np.diff(on_it.position, axis=0)[:, :2] == pytest.approx(np.tile(4 * STEP * way, (14, 1)), abs=1e-9)
    assert is_walking(up[5:].state)
    stage.run(10, walk(stage, 0.0))
    still = stage.run(30)
    assert (still.position == still.position[0]).all()
    assert stage.me.floor_normal[:2] == pytest.approx((-way[1], way[0]), abs=1e-9)
    down = stage.run(30, walk(stage, -4.0))[8:]
    assert np.diff(down.position, axis=0)[:, :2] == pytest.approx(np.tile(-4 * STEP * way, (21, 1)), abs=1e-9)
    assert is_walking(down.state)


@pytest.mark.parametrize("name", ["capsule 3D", "box 3D", "sphere 3D"])
def test_across_a_slope_it_keeps_its_height(name):
    stage = Stage(FIGURES[name], x=2.0, y=2.5)
    stage.wedge(slope(40))
    stage.run(40)

    def act(step):
        stage.me.move = 0.0, 0.0, 4.0

    track = stage.run(60, act)[10:]
    assert np.ptp(track.position[:, :2], axis=0) == pytest.approx((0, 0), abs=1e-9)
    assert np.diff(track.position[:, 2]) == pytest.approx(4 * STEP, abs=1e-9)


@each_figure
def test_beyond_max_slope_it_is_a_wall_and_it_slides_down(figure):
    """60 degrees are not climbed, nor stepped up, and from 65 it slides, with its wishes against it."""
    stage = Stage(figure, x=-2.0)
    stage.wedge(slope(60))
    track = stage.run(120, walk(stage, 4.0))
    assert track.y.max() < stage.stands + 0.05
    stage = Stage(figure, x=2.0, y=2.5 * math.tan(math.radians(65)))
    stage.box((-50, -1), (50, 0))
    stage.wedge(slope(65))
    track = stage.run(150, walk(stage, 4.0))
    assert "steep" in track.state
    assert "floor" not in track.state[: track.state.index("steep")]
    assert (np.diff(track.y)[2:] < 1e-9).all()
    assert track.y[-1] == pytest.approx(stage.stands, abs=0.02)


@each_figure
def test_downhill_and_over_the_brink_it_stays_on_the_floor(figure):
    """Over a roof of 30 degrees at 6 m/s. Without a snap it flies."""
    for snap, states in ((0.3, {"floor"}), (0.0, {"floor", "air"})):
        stage = Stage(figure, x=-7.0, snap=snap)
        stage.wedge(((-5, 0), (5, 0), (0, 5 * math.tan(math.radians(30)))))
        stage.run(2)
        track = stage.run(170, walk(stage, 6.0))
        assert set(track.state) == states
        assert track.x[-1] > 7.0
        assert track.y.max() > 5 * math.tan(math.radians(30))


@each_figure
def test_stairs_up_and_down_cost_no_time(figure):
    """Eight steps of 0.25 by 0.5 m, up and down: always on the floor, with the speed of the flat to 5 %."""
    stage = Stage(figure, x=-2.0)
    for k in range(8):
        stage.box((1 + 0.5 * k, 0), (20 - 0.5 * k, 0.25 * (k + 1)))
    stage.run(2)
    track = stage.run(420, walk(stage, 4.0))
    assert is_walking(track.state)
    assert track.y.max() == pytest.approx(2.0 + stage.stands, abs=1e-6)
    assert track.x[-1] + 2.0 == pytest.approx(4.0 * 7.0, rel=0.05)


@each_figure
def test_what_is_higher_than_step_height_is_a_wall(figure):
    for step_height, height, passes in ((0.3, 0.35, False), (0.4, 0.35, True), (0.1, 0.15, False)):
        stage = Stage(figure, x=-1.0, step_height=step_height)
        block = stage.box((1, 0), (20, height))
        track = stage.run(120, walk(stage, 4.0))
        assert bool(track.x[-1] > 2.0) is passes
        if not passes and height > 0.3:
            assert stage.me.on_wall
            assert stage.me.wall_entity == block


# -- what carries ---------------------------------------------------------------------------------


@each_figure
@pytest.mark.parametrize("speed", [3.0, 8.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_lift_that_reverses_carries_it(figure, speed, axis):
    """As if glued, up, down and to and fro; it tells whose velocity it has."""
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
    track = stage.run(20, walk(stage, 3.0))[5:]
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
    for name in ("capsule 3D", "box 3D", "sphere 3D"):
        stage = Stage(FIGURES[name], x=2.0, y=0.0)
        shape = BoxCollider((4.0, 0.5, 4.0))
        stage.world.create_entity(Transform((0, -0.5, 0)), RigidBody(kind="kinematic"), Spin((0, 1.2, 0)), shape)
        stage.run(10)
        track = stage.run(120)
        x, z = track.position[:, 0], track.position[:, 2]
        assert np.hypot(x, z) == pytest.approx(np.hypot(x[0], z[0]), abs=1e-9)
        assert np.diff(np.unwrap(np.arctan2(-z, x))) == pytest.approx(1.2 * STEP, abs=1e-9)
        assert np.ptp(track.y) < 1e-9


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


@each_figure
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
    track = stage.run(30, walk(stage, -3.0))[5:]
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


@each_dimension
@pytest.mark.parametrize("leave", ["all", "up", "none"])
def test_jumping_off_adds_the_velocity_of_the_platform(figure, leave):
    stage = Stage(figure, y=0.0, leave=leave, air_acceleration=0.0)
    stage.mover(0.0, 0.0, linear_velocity=vector(figure.d, 2.0, 3.0))
    stage.run(10)
    start = stage.place.position.copy()
    track = stage.run(12, hold(stage, jump=True))
    t = STEP * np.arange(1, 13)
    vx, vy = (2.0 if leave == "all" else 0.0), (JUMP if leave == "none" else JUMP + 3.0)
    assert track.x - start[0] == pytest.approx(vx * t, abs=1e-9)
    assert track.y - start[1] == pytest.approx(vy * t - G * t * t / 2, abs=1e-9)


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


# -- one-way platforms, ladders, walls ------------------------------------------------------------


def one_way(stage, left, right, height, *more):
    """A platform that holds from above only, with its top there."""
    return stage.box((left, height - 0.2), (right, height), *more, one_way=stage.at(0, 1))


@each_figure
def test_a_one_way_platform_is_jumped_through_stood_on_and_dropped_through(figure):
    stage = Stage(figure, x=-3.0)
    platform = one_way(stage, -2, 2, 1.3)
    stage.run(2)
    track = stage.run(60, walk(stage, 3.0))  # under it, and through its end
    assert is_walking(track.state)
    assert np.diff(track.x)[10:] == pytest.approx(3.0 * STEP, abs=1e-12)
    stage.move(0.0)
    track = stage.run(60, hold(stage, 5, jump=True))
    assert track.y.max() - stage.stands == pytest.approx(TOP, rel=1e-4)
    assert track.y[-1] == pytest.approx(1.3 + stage.stands, abs=1e-9)
    assert stage.me.floor_entity == platform
    track = stage.run(60, hold(stage, 3, drop=True))
    assert track.y[-1] == pytest.approx(stage.stands, abs=1e-9)
    track = stage.run(20, hold(stage, drop=True))  # through what is solid it does not
    assert track.y == pytest.approx(stage.stands, abs=1e-9)
    assert stage.events("character_hit") == []


@each_figure
def test_a_one_way_lift_takes_up_only_what_was_above_it(figure):
    for start, picked_up in ((0.4, False), (-0.3, True)):
        stage = Stage(figure)
        lift = one_way(stage, -2, 2, start, RigidBody(kind="kinematic"))
        stage.run(5)
        stage.world.component_for_entity(lift, RigidBody).linear_velocity = vector(figure.d, 0.0, 2.0)
        track = stage.run(60)
        height = start + 2.0 if picked_up else 0.0
        assert track.y[-1] == pytest.approx(height + stage.stands, abs=1e-9)
        assert track.state[-1] == "floor"
        assert stage.me.floor_entity == (lift if picked_up else stage.floor)


@each_dimension
def test_it_climbs_a_ladder_hangs_on_it_and_jumps_off(figure):
    stage = Stage(figure)
    stage.sensor(0.0, 3.0, (0.5, 3.0), Ladder())
    stage.run(2)
    track = stage.run(60, hold(stage, climb=2.0))
    assert track.state[-1] == "climb"
    assert np.diff(track.y)[10:] == pytest.approx(2.0 * STEP, abs=1e-12)
    hangs = stage.run(20, hold(stage, climb=0.0))
    assert set(hangs.state) == {"climb"}
    assert (hangs.position[1:] == hangs.position[1]).all()
    track = stage.run(10, hold(stage, jump=True))
    assert track.state[-1] == "air"
    assert track.velocity[0, 1] > 8.0
    track = stage.run(100, hold(stage, jump=False))  # without a wish to climb it falls past it
    assert track.y[-1] == pytest.approx(stage.stands, abs=1e-9)
    down = stage.run(30, hold(stage, climb=-2.0))
    assert is_walking(down.state)  # on the floor there is no further down


@each_dimension
def test_it_slides_down_walls_slowly_and_jumps_off_them(figure):
    stage = Stage(figure, x=0.55, y=8.0, wall_slide=2.0, wall_jump=6.0, wall_jump_up=8.0, air_acceleration=0.5)
    wall = stage.box((1, -9), (2, 30))
    track = stage.run(60, walk(stage, 1.0))
    assert stage.me.on_wall
    assert stage.me.wall_entity == wall
    assert stage.me.wall_normal == pytest.approx(vector(figure.d, -1.0), abs=1e-9)
    assert -np.diff(track.y)[-10:] == pytest.approx(2.0 * STEP, abs=1e-9)
    assert 0.0 < 1.0 - 0.4 - track.x[-1] < SKIN + 1e-9
    start = stage.place.position.copy()
    track = stage.run(20, hold(stage, jump=True))
    t = STEP * np.arange(1, 21)
    assert track.y - start[1] == pytest.approx(8.0 * t - G * t * t / 2, abs=1e-9)
    assert track.x[0] - start[0] == pytest.approx(-6.0 * STEP, abs=0.02 * STEP)
    plain = Stage(figure, x=0.3, y=8.0, wall_slide=2.0)  # it has none
    plain.box((1, -9), (2, 30))
    track = plain.run(80, lambda step: (plain.move(1.0), setattr(plain.me, "jump", step > 60)))
    assert (np.diff(track.y) < 0).all()


@each_dimension
def test_walls_and_ceilings_are_told_with_their_speed(figure):
    stage = Stage(figure)
    wall = stage.box((2, 0), (3, 9))
    stage.run(2)
    track = stage.run(60, walk(stage, 4.0))
    hits = stage.events("character_hit")
    assert hits[0][1:3] == (stage.hero, wall)
    assert hits[0][3] == pytest.approx(vector(figure.d, -1.0), abs=1e-9)
    assert hits[0][4] == pytest.approx(4.0, abs=1e-9)
    assert len({step for step, *_ in hits}) == len(hits)  # once in a step
    assert track.x[-1] == pytest.approx(2 - 0.4 - SKIN, abs=1e-9)
    assert track.velocity[-1] == pytest.approx([0.0] * figure.d, abs=1e-9)
    stage = Stage(figure)
    lid = stage.box((-3, 2.0), (3, 3))
    stage.run(2)
    track = stage.run(15, hold(stage, jump=True))
    ((_, entity, other, normal, speed),) = stage.events("character_hit")
    assert (entity, other) == (stage.hero, lid)
    assert normal == pytest.approx(vector(figure.d, 0.0, -1.0), abs=1e-9)
    room = 2.0 - 2 * figure.half - 2 * SKIN
    assert speed == pytest.approx(math.sqrt(JUMP**2 - 2 * G * room), abs=1.01 * G * STEP)
    assert track.y.max() == pytest.approx(2.0 - figure.half - SKIN, abs=1e-9)
    assert (track.y >= 2.0 - figure.half - SKIN - 1e-9).sum() <= 2  # it does not stick


# -- what it pushes, what crushes it --------------------------------------------------------------


@each_figure
@pytest.mark.parametrize("mass", [1.0, 2.0, 8.0, 30.0])
def test_a_crate_is_pushed_with_its_force_and_never_faster_than_it_walks(figure, mass):
    """60 N against friction of 0.5: 8 kg stay, others come to its speed. On ice any mass does, by F / m."""
    for friction in (0.5, 0.0):
        stage = Stage(figure)
        stage.world.component_for_entity(stage.floor, AABBCollider).friction = friction
        crate = stage.crate(1.0, 0.5, mass, friction=friction)
        stage.run(10)
        speeds = []
        for _ in range(150):
            stage.move(3.0)
            stage.world.step()
            speeds.append(stage.velocity_of(crate)[0])
        speeds = np.array(speeds)
        assert speeds.max() <= 3.0 + 1e-9
        force = 60.0 - friction * mass * G
        if force > 0.0:
            limit = np.minimum(force / mass * STEP * np.arange(1, 151), 3.0)
            assert (speeds <= limit + 2 * force / mass * STEP).all()
            assert speeds[-1] == pytest.approx(limit[-1], rel=0.1)
        else:
            assert stage.position_of(crate)[0] - 1.0 < 0.01
        gap = stage.position_of(crate)[0] - stage.place.x - 0.9
        assert -1e-6 < gap < 0.2
        assert stage.place.y == pytest.approx(stage.stands, abs=1e-9)


@each_dimension
def test_without_push_force_a_crate_is_a_wall(figure):
    stage = Stage(figure, push_force=0.0)
    crate = stage.crate(2.0, 0.5, friction=0.0)
    stage.run(100, walk(stage, 3.0))
    assert stage.position_of(crate)[0] == pytest.approx(2.0, abs=1e-9)
    assert stage.me.wall_entity == crate


@each_figure
def test_a_crate_on_its_head_rests_there(figure):
    stage = Stage(figure)
    stage.run(2)
    crate = stage.crate(0.0, 3.0, mass=2.0)
    track = stage.run(150)
    assert (track.position == track.position[0]).all()
    top = 2 * figure.half + SKIN
    assert stage.position_of(crate)[1] == pytest.approx(top + 0.5, abs=0.005)
    assert is_walking(track.state)
    assert track.crushed == [-1] * 150


@each_figure
def test_a_press_crushes_it_and_it_stays_out_of_the_floor(figure):
    stage = Stage(figure)
    stage.run(2)
    press = stage.mover(0.0, 4.0, linear_velocity=vector(figure.d, 0.0, -1.0))
    meets = (3.0 - 2 * figure.half) / STEP  # in steps: its lower side is at 3 m
    track = stage.run(220)
    crushed = [step for step, by in enumerate(track.crushed) if by >= 0]
    assert crushed[0] == pytest.approx(meets, abs=3)
    assert set(track.crushed) == {-1, press}
    assert track.y.min() >= figure.half - 1e-6
    ((step, entity, by),) = stage.events("crushed")  # when it begins
    assert (entity, by) == (stage.hero, press)
    assert step - 2 == crushed[0]  # two steps were taken before


def test_in_a_wall_it_is_crushed_in_every_step_as_after_a_restore():
    """What it does follows from where it is: not from whether anything has changed since the last step."""
    world = world_of(2)
    wall = world.create_entity(Transform((0, -1)), AABBCollider(1.0))
    entity = world.create_entity(Transform((0.95, -1)), RigidBody(kind="kinematic"), FIGURES["capsule 2D"].collider(),
                                 Character())  # fmt: skip
    for _ in range(3):
        snapshot = world.snapshot()
        world.step()
        after = world.state_hash()
        assert world.component_for_entity(entity, Character).crushed == wall
        world.restore(snapshot)
        world.step()
        assert world.state_hash() == after
    world.close()


@each_figure
def test_between_a_platform_and_a_wall_it_is_crushed(figure):
    stage = Stage(figure)
    stage.box((3, 0), (4, 5))
    pusher = stage.box((-4.5, 0.1), (-3.5, 1.9), RigidBody(kind="kinematic", linear_velocity=vector(figure.d, 2.0)))
    track = stage.run(220)
    crushed = [step for step, by in enumerate(track.crushed) if by >= 0]
    assert crushed[0] == pytest.approx((3.0 + 3.5 - 0.8) / 2.0 * 60, abs=3)
    assert set(track.crushed) == {-1, pusher}
    assert track.x.max() <= 3.0 - 0.4 + 1e-6
    before = track[: crushed[0]]
    free = before.x < 3.0 - 0.4 - 2 * SKIN
    pushed = free & (before.x > 0.01)
    assert np.diff(before.x[pushed]) == pytest.approx(2.0 * STEP, abs=1e-6)  # and until then pushed along


# -- each other -----------------------------------------------------------------------------------


@each_figure
def test_characters_block_each_other(figure):
    stage = Stage(figure, x=-2.0)
    other = stage.character(2.0, stage.stands)
    you = stage.world.component_for_entity(other, Character)
    place = stage.world.component_for_entity(other, Transform)
    gaps = []

    def act(step):
        stage.move(4.0)
        stage.move(-3.0, you)
        gaps.append(place.x - stage.place.x)

    track = stage.run(120, act)
    assert min(gaps) >= 0.8 - 1e-6
    assert gaps[-1] < 0.8 + 0.05
    assert track.y == pytest.approx(stage.stands, abs=1e-9)
    assert stage.me.wall_entity == other
    assert you.wall_entity == stage.hero
    assert np.ptp(track.x[-20:]) < 1e-6


@each_dimension
def test_characters_pass_each_other_by_their_masks(figure):
    stage = Stage(figure, x=-2.0)
    collider = stage.world.component_for_entity(stage.hero, type(figure.shape))
    collider.layer, collider.mask = 2, ~2
    other = stage.character(2.0, stage.stands, layer=2, mask=~2)
    track = stage.run(90, walk(stage, 4.0))
    assert np.diff(track.x)[10:] == pytest.approx(4.0 * STEP, abs=1e-12)
    assert stage.position_of(other)[0] == 2.0


@each_dimension
def test_who_is_pushable_is_pushed_by_the_force_over_its_mass(figure):
    for pushable, mass in ((False, 1.0), (True, 1.0), (True, 30.0)):
        stage = Stage(figure, x=-2.0)
        other = stage.character(0.0, stage.stands, pushable=pushable, mass=mass)
        place = stage.world.component_for_entity(other, Transform)
        stage.run(5)
        before = place.position.copy()
        track = stage.run(120, walk(stage, 3.0))
        assert place.x - stage.place.x >= 0.8 - 1e-6
        assert np.diff(track.x).max() <= 3.0 * STEP + 1e-9
        if pushable:
            assert place.x > (1.0 if mass < 2 else 0.01)
        else:
            assert (place.position == before).all()


@each_dimension
def test_the_order_of_characters_does_not_matter(figure):
    """Nine that walk into each other, created in three orders: as near as 1e-9 m."""
    rng = np.random.default_rng(4)
    starts = np.array([(1.3 * (k % 3), 0.0, 1.3 * (k // 3)) for k in range(9)])
    if figure.d == 2:
        starts = np.array([(1.1 * k - 4.0, 0.0, 0.0) for k in range(9)])
    wishes = rng.uniform(-4, 4, (9, 4, 3))
    ends = []
    for order in (range(9), reversed(range(9)), rng.permutation(9)):
        stage = Stage(figure, x=40.0)
        made = {int(k): stage.character(*(starts[k] + (0.0, stage.stands, 0.0))) for k in order}
        for step in range(120):
            for k, entity in made.items():
                wish = wishes[k, step // 30]
                stage.world.component_for_entity(entity, Character).move = wish[0] if figure.d == 2 else wish
            stage.world.step()
        ends.append([stage.position_of(made[k]) for k in range(9)])
    assert np.ptp(ends, axis=0).max() <= 1e-9
    gaps = np.linalg.norm(np.array(ends[0])[:, None] - np.array(ends[0])[None], axis=2)
    assert gaps[np.triu_indices(9, 1)].min() >= 0.8 - 1e-6


# -- what it runs through -------------------------------------------------------------------------


@each_figure
@pytest.mark.parametrize("speed", [40.0, 120.0])
def test_a_coin_is_told_in_the_step_that_runs_through_it(figure, speed):
    """0.2 m wide, and at 120 m/s a step of 2 m; also a coin beside the way is none."""
    stage = Stage(figure, x=-10.3, acceleration=1e6)
    coin = stage.sensor(0.0, figure.half, (0.1, 0.1))
    stage.sensor(0.0, 3.0, (0.1, 0.1))
    stage.run(2)
    stage.told.clear()
    xs = [stage.place.x]
    for _ in range(40):
        stage.move(speed)
        first = stage.world.step_count
        stage.world.step()
        xs.append(stage.place.x)
        if stage.place.x + 0.4 > -0.1 and xs[-2] + 0.4 <= -0.1:
            told_in = first
    ((step, entity, other, normal, told),) = stage.events("character_hit")
    assert step == told_in
    assert (entity, other) == (stage.hero, coin)
    assert told == pytest.approx(speed, rel=1e-6)
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    assert np.diff(xs) == pytest.approx(speed * STEP, abs=1e-9)


# -- up -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["capsule 3D", "sphere 3D"])
def test_it_walks_round_a_planet(name):
    """Of 10 m: as far from its middle all the way round, at its speed, and it jumps as high."""
    figure = FIGURES[name]
    stage = Stage(figure, y=10.0, gravity=0.0)
    stage.world.create_entity(Transform((0, 0, 0)), SphereCollider(10.0))
    stage.me.gravity = G

    def act(step):
        up = stage.place.position / np.linalg.norm(stage.place.position)
        stage.me.up = up
        stage.me.move = 4.0 * np.cross(up, (0.0, 0.0, 1.0))
        if figure.half == 0.8:  # a capsule turns with it
            angle = math.atan2(-up[0], up[1])
            stage.place.rotation = math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)

    track = stage.run(300, act)
    radii = np.linalg.norm(track.position, axis=1)
    assert radii[10:] == pytest.approx(10.0 + stage.stands, abs=1e-3)
    assert is_walking(track[5:].state)
    turned = np.unwrap(np.arctan2(track.x, track.y))
    assert turned[-1] - turned[20] == pytest.approx(4.0 * 279 * STEP / (10.0 + stage.stands), rel=0.06)
    up = stage.place.position / np.linalg.norm(stage.place.position)

    def jump(step):
        stage.me.move, stage.me.jump = 0.0, step > 10

    track = stage.run(50, jump)
    assert (track.position @ up).max() - 10.0 - stage.stands == pytest.approx(TOP, abs=0.01)


@pytest.mark.parametrize(("d", "up"), [(2, (1, 0)), (2, (0, -1)), (3, (1, 0, 0)), (3, (0, -1, 0)), (3, (0, 0, 1))])
def test_any_way_may_be_up(d, up):
    """A fall, a walk and a jump in a world on its side: as upright, seen that way."""
    tracks = []
    for way in (vector(d, 0, 1), up):
        axis, up_now = np.flatnonzero(way)[0], np.array(way, float)
        world = world_of(d, gravity=0.0)
        half = np.full(d, 0.4)
        half[axis] = 0.8
        size = np.full(d, 20.0)
        size[axis] = 1.0
        ahead = np.array((up_now[1], -up_now[0])) if d == 2 else np.roll(up_now, 1)  # in 2D to the right of up
        world.create_entity(Transform(-up_now), AABBCollider(size))
        hero = world.create_entity(
            Transform(1.5 * up_now), RigidBody(kind="kinematic"), AABBCollider(half), Character(up=up_now, gravity=G)
        )
        me, place = (world.component_for_entity(hero, kind) for kind in (Character, Transform))
        rows = []
        for step in range(100):
            me.move = (4.0 if step > 30 else 0.0) * (1.0 if d == 2 else ahead)
            me.jump = step > 60
            world.step()
            rows.append((place.position @ up_now, place.position @ ahead))
        tracks.append(np.array(rows))
    assert tracks[1] == pytest.approx(tracks[0], abs=1e-9)
    assert tracks[0][60, 0] == pytest.approx(0.8 + SKIN, abs=1e-9)
    assert tracks[0][-1, 1] > 3.0


# -- snapshots, files, steps ----------------------------------------------------------------------


def crowd(d, count=100):
    """Characters of random wishes on a floor with steps, lifts and crates."""
    figure = FIGURES["capsule 2D" if d == 2 else "capsule 3D"]
    stage, rng = Stage(figure, x=-45.0), np.random.default_rng(d)
    for k in range(6):
        stage.box((5 * k, 0), (5 * k + 1, 0.2))
        stage.mover(5 * k - 20.0, 0.5, (1.0, 0.2), linear_velocity=vector(d, 0.0, 0.5))
        stage.crate(5 * k - 22.5, 0.5)
    heroes = [stage.character(*rng.uniform((-20, 1, -20), (40, 3, 20))) for _ in range(count)]
    return stage, heroes


@pytest.mark.parametrize("d", [2, 3])
def test_going_back_repeats_a_hundred_characters_to_the_bit(d):
    stage, heroes = crowd(d)
    world, rng = stage.world, np.random.default_rng(9)
    for _ in range(20):
        world.step()
    wishes = rng.uniform(-4, 4, (8, 100, 3))

    def play():
        hashes = []
        for step in range(8):
            for k, entity in enumerate(heroes):
                me = world.component_for_entity(entity, Character)
                me.move, me.jump = (wishes[step, k, 0] if d == 2 else wishes[step, k]), wishes[step, k, 1] > 2.0
            world.step()
            hashes.append(world.state_hash())
        return hashes

    kept = world.snapshot()
    first = play()
    world.restore(kept)
    assert play() == first


@each_dimension
def test_a_jump_goes_on_from_a_file_to_the_bit(figure, tmp_path):
    stage = Stage(figure, jump_cut=0.5, air_jumps=1)
    stage.box((-1, 4), (1, 5))
    stage.run(2)
    stage.run(12, lambda step: (stage.move(1.0), setattr(stage.me, "jump", True)))
    assert stage.me.state == "air"
    stage.world.save(tmp_path / "jump")
    hashes = []
    for world in (stage.world, World.load(tmp_path / "jump", *plugins_of(figure.d, G))):
        me = world.component_for_entity(stage.hero, Character)
        for step in range(60):
            me.jump, me.move = step % 20 < 5, 2.0 if figure.d == 2 else (2.0, 0.0, 0.0)
            world.step()
        hashes.append(world.state_hash())
    assert hashes[0] == hashes[1]


@each_figure
@pytest.mark.parametrize("rate", [10, 1000])
def test_long_and_short_steps_keep_the_rules(figure, rate):
    stage = Stage(figure, x=-3.0, y=0.5, dt=1 / rate)
    for k in range(40):
        stage.box((k - 8, -1), (k - 7, 0))
    stage.run(rate)
    still = stage.run(max(rate // 20, 3))
    assert still.y == pytest.approx(stage.stands, abs=1e-9)
    assert (still.position == still.position[0]).all()
    track = stage.run(rate, walk(stage, 4.0))
    part = track[rate // 5 :]
    assert np.diff(part.x) == pytest.approx(4.0 / rate, abs=1e-12)
    assert np.ptp(part.y) <= 1e-12
    stage.run(rate // 2, walk(stage, 0.0))
    start = stage.place.y
    track = stage.run(rate // 2, hold(stage, jump=True))
    assert track.y.max() - start == pytest.approx(TOP, abs=G / rate**2 / 8 + 1e-4)


@each_dimension
def test_a_world_that_fails_in_a_step_goes_on_to_the_bit(figure):
    """A handler that raises rolls the step back, what the characters know as well."""
    hashes = []
    for fails in (True, False):
        stage = Stage(figure, y=0.1)
        stage.box((-5, -1), (5, 0))
        failures = []

        def fail(*what, fails=fails, failures=failures):
            if fails and not failures:
                failures.append(what)
                raise RuntimeError("once")

        stage.world.on("landed", fail)
        for _ in range(40):
            stage.move(1.0)
            try:
                stage.world.step()
            except StepError:
                stage.world.step()
        assert bool(failures) is fails
        hashes.append(stage.world.state_hash())
    assert hashes[0] == hashes[1]


# -- what happens to its floor and its place ------------------------------------------------------


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


@each_figure
def test_put_into_a_wall_it_is_pushed_out_once_or_crushed(figure):
    stage = Stage(figure)
    wall = stage.box((3, 0), (4, 5))
    stage.run(2)
    stage.place.position = stage.at(2.7, stage.stands)
    track = stage.run(3)
    assert track.x == pytest.approx(3 - 0.4 - SKIN, abs=0.02)
    assert track.crushed == [-1] * 3
    stage.box((1.5, 0), (2.4, 5))  # 0.6 m wide
    stage.place.position = stage.at(2.7, stage.stands)
    track = stage.run(3)
    assert track.crushed[0] in (wall, wall + 1, wall + 2)
    assert stage.events("crushed")


@each_dimension
def test_a_mask_without_a_floor_lets_it_fall(figure):
    stage = Stage(figure)
    stage.world.component_for_entity(stage.hero, type(figure.shape)).mask = 0
    track = stage.run(30)
    assert set(track.state) == {"air"}
    assert track.y[-1] < -2.0


@pytest.mark.parametrize("d", [2, 3])
def test_without_a_character_nothing_of_it_runs(d):
    def runs(world):
        world.step()
        return "move_characters" in {each.kernel for each in world.plan().kernels}

    world = world_of(d)
    assert not runs(world)
    hero = world.create_entity(Transform((0.0,) * d), RigidBody(kind="kinematic"), SphereCollider(0.4), Character())
    assert runs(world)
    world.delete_entity(hero)
    assert not runs(world)


# -- mistakes -------------------------------------------------------------------------------------

BODY = {"kind": "kinematic"}
REFUSED = ValueError, CaromError


def made(world, *components):
    """At the call, or at the next step of what cannot be known before."""
    world.create_entity(*components)
    world.step()


@pytest.mark.parametrize("d", [2, 3])
def test_what_cannot_be_a_character_is_refused_with_its_entity(d):
    half = AABBCollider((0.4,) * d)
    place = Transform((0.0,) * d)
    refused = {
        "no collider": (place, RigidBody(**BODY), Character()),
        "two colliders": (place, RigidBody(**BODY), half, SphereCollider(0.4), Character()),
        "static": (place, RigidBody(kind="static"), half.copy(), Character()),
        "no body": (place, half.copy(), Character()),
        "dynamic": (place, RigidBody(), half.copy(), Character()),
        "Spin": (place, RigidBody(**BODY), SphereCollider(0.4), Spin(), Character()),
    }
    for components in refused.values():
        world = world_of(d)
        with pytest.raises(REFUSED, match="Character"):
            made(world, *(each.copy() for each in components))
    world = world_of(d)
    body = world.create_entity(place.copy(), RigidBody(**BODY), half.copy())
    with pytest.raises(REFUSED, match="Character"):
        made(world, PartOf(body, (1.0,) * d), half.copy(), Character())


@pytest.mark.parametrize(
    "name",
    [
        "step_height", "snap", "skin", "acceleration", "air_acceleration", "gravity", "max_fall", "jump_speed",
        "jump_height", "jump_cut", "coyote", "buffer", "air_jumps", "wall_slide", "wall_jump", "wall_jump_up",
        "push_force", "weight", "max_slope",
    ],
)  # fmt: skip
def test_negative_settings_are_refused(name):
    with pytest.raises(ValueError, match=rf"Character\.{name}"):
        Character(**{name: -1})
    me = Character()
    with pytest.raises(ValueError, match=rf"Character\.{name}"):
        setattr(me, name, -1)


@pytest.mark.parametrize(
    ("values", "name"),
    [
        ({"max_slope": 1.6}, "max_slope"), ({"up": (0, 0)}, "up"), ({"leave": "some"}, "leave"),
        ({"move": math.nan}, "move"), ({"jump_cut": 1.5}, "jump_cut"),
    ],
)  # fmt: skip
def test_settings_that_cannot_be_are_refused(values, name):
    with pytest.raises(ValueError, match=name):
        Character(**values)


def test_no_up_and_two_speeds_of_a_jump_are_refused():
    stage = Stage(FIGURES["capsule 3D"])
    with pytest.raises(ValueError, match=r"Character\.up"):
        stage.me.up = 0.0, 0.0, 0.0
    with pytest.raises(ValueError, match="jump_speed or a jump_height"):
        stage.character(0.0, 9.0, jump_speed=9.0, jump_height=1.0)


def test_a_forgotten_plugin_is_named_as_games_write_it():
    with pytest.raises(ValueError, match=r"Character does nothing without its plugin: World\(.*, Characters\(\)\)"):
        World(Physics(2)).create_entity(Transform((0, 0)), Character())

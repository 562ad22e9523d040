"""Characters on the ground: flat, seamed, on slopes and stairs, against walls and lids, with any way up."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_character import (
    FIGURES,
    JUMP,
    SKIN,
    STEP,
    TOP,
    G,
    Stage,
    each_dimension,
    each_figure,
    is_walking,
    slope,
    vector,
    world_of,
)

from carom import (
    AABBCollider,
    RigidBody,
    SphereCollider,
    TileGridCollider,
    Transform,
    create_chain,
    create_height_field,
)
from carom.plugins.character import Character

pytestmark = pytest.mark.slow  # its kernels take long to compile


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
    track = stage.run(200, stage.walk(4.0))[10:]
    assert np.ptp(track.y) <= 1e-12
    assert np.diff(track.x) == pytest.approx(4.0 * STEP, abs=1e-12)
    assert is_walking(track.state)
    assert stage.events("character_hit") == []


@each_dimension
def test_it_speeds_up_and_slows_down_by_its_acceleration(figure):
    stage = Stage(figure, acceleration=12.0)
    stage.run(2)
    up = stage.run(20, stage.walk(4.0))
    assert np.linalg.norm(up.velocity, axis=1) == pytest.approx(np.minimum(0.2 * np.arange(1, 21), 4.0), abs=1e-12)
    down = stage.run(25, stage.walk(0.0))
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


@each_figure
def test_it_walks_slopes_at_a_constant_speed_and_rests_on_them(figure):
    stage = Stage(figure, x=-2.0)
    stage.wedge(slope(45))
    up = stage.run(75, stage.walk(4.0))
    on_it = up[60:]
    way = np.sqrt((0.5, 0.5))
    assert np.diff(on_it.position, axis=0)[:, :2] == pytest.approx(np.tile(4 * STEP * way, (14, 1)), abs=1e-9)
    assert is_walking(up[5:].state)
    stage.run(10, stage.walk(0.0))
    still = stage.run(30)
    assert (still.position == still.position[0]).all()
    assert stage.me.floor_normal[:2] == pytest.approx((-way[1], way[0]), abs=1e-9)
    down = stage.run(30, stage.walk(-4.0))[8:]
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
    track = stage.run(120, stage.walk(4.0))
    assert track.y.max() < stage.stands + 0.05
    stage = Stage(figure, x=2.0, y=2.5 * math.tan(math.radians(65)))
    stage.box((-50, -1), (50, 0))
    stage.wedge(slope(65))
    track = stage.run(150, stage.walk(4.0))
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
        track = stage.run(170, stage.walk(6.0))
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
    track = stage.run(420, stage.walk(4.0))
    assert is_walking(track.state)
    assert track.y.max() == pytest.approx(2.0 + stage.stands, abs=1e-6)
    assert track.x[-1] + 2.0 == pytest.approx(4.0 * 7.0, rel=0.05)


@each_figure
def test_what_it_steps_over_is_no_wall_but_what_stands_on_it_is(figure):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        speed, high = rng.uniform(0.5, 6.0), rng.uniform(0.04, 0.25)
        stage = Stage(figure, x=-0.7, dt=1 / rng.choice((60, 120)))
        stage.box((0, -1), (9, high))
        wall = stage.box((1.5, -1), (2, 5))
        walls = []
        for _ in range(round(4.0 / speed / stage.world.settings.dt)):
            stage.move(speed)
            stage.world.step()
            walls.append((bool(stage.me.on_wall), stage.place.x > 1.05))
        assert stage.place.x == pytest.approx(1.5 - 0.4 - SKIN, abs=1e-9)
        assert all(at_it for on_wall, at_it in walls if on_wall)
        assert walls[-1] == (True, True)
        assert {other for _, _, other, _, _ in stage.events("character_hit")} == {wall}


@each_figure
def test_what_is_higher_than_step_height_is_a_wall(figure):
    for step_height, passes in ((0.3, False), (0.4, True)):
        stage = Stage(figure, x=-1.0, step_height=step_height)
        block = stage.box((1, 0), (20, 0.35))
        track = stage.run(120, stage.walk(4.0))
        assert bool(track.x[-1] > 2.0) is passes
        if not passes:
            assert stage.me.on_wall
            assert stage.me.wall_entity == block


@each_dimension
def test_walls_and_ceilings_are_told_with_their_speed(figure):
    stage = Stage(figure)
    wall = stage.box((2, 0), (3, 9))
    stage.run(2)
    track = stage.run(60, stage.walk(4.0))
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
    track = stage.run(15, stage.hold(jump=True))
    ((_, entity, other, normal, speed),) = stage.events("character_hit")
    assert (entity, other) == (stage.hero, lid)
    assert normal == pytest.approx(vector(figure.d, 0.0, -1.0), abs=1e-9)
    room = 2.0 - 2 * figure.half - 2 * SKIN
    assert speed == pytest.approx(math.sqrt(JUMP**2 - 2 * G * room), abs=1.01 * G * STEP)
    assert track.y.max() == pytest.approx(2.0 - figure.half - SKIN, abs=1e-9)
    assert (track.y >= 2.0 - figure.half - SKIN - 1e-9).sum() <= 2  # it does not stick


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

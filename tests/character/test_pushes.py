"""Characters against others: crates they push, presses that crush them, each other, and coins they run through."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_character import FIGURES, SKIN, STEP, G, Stage, each_dimension, each_figure, is_walking, vector
from helpers_pairwise import pairwise

from carom import AABBCollider, RigidBody, Transform
from carom.plugins.character import Character

pytestmark = pytest.mark.slow  # its kernels take long to compile


@pytest.mark.parametrize(("name", "mass", "friction"), pairwise(tuple(FIGURES), (1.0, 8.0, 30.0), (0.5, 0.0)))
def test_a_crate_is_pushed_with_its_force_and_never_faster_than_it_walks(name, mass, friction):
    """60 N against friction of 0.5: 8 kg stay, others come to its speed. On ice any mass does, by F / m."""
    stage = Stage(FIGURES[name])
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
    stage.run(100, stage.walk(3.0))
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


@each_dimension
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
    track = stage.run(90, stage.walk(4.0))
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
        track = stage.run(120, stage.walk(3.0))
        assert place.x - stage.place.x >= 0.8 - 1e-6
        assert np.diff(track.x).max() <= 3.0 * STEP + 1e-9
        if pushable:
            assert place.x > (1.0 if mass < 2 else 0.01)
        else:
            assert (place.position == before).all()


@each_dimension
def test_the_order_of_characters_does_not_matter(figure):
    """Nine that walk into each other, created in two orders: as near as 1e-9 m."""
    rng = np.random.default_rng(4)
    starts = np.array([(1.3 * (k % 3), 0.0, 1.3 * (k // 3)) for k in range(9)])
    if figure.d == 2:
        starts = np.array([(1.1 * k - 4.0, 0.0, 0.0) for k in range(9)])
    wishes = rng.uniform(-4, 4, (9, 4, 3))
    ends = []
    for order in (range(9), rng.permutation(9)):
        stage = Stage(figure, x=40.0)
        made = {int(k): stage.character(*(starts[k] + (0.0, stage.stands, 0.0))) for k in order}
        for step in range(120):
            for k, entity in made.items() if step % 30 == 0 else ():
                wish = wishes[k, step // 30]
                stage.world.component_for_entity(entity, Character).move = wish[0] if figure.d == 2 else wish
            stage.world.step()
        ends.append([stage.position_of(made[k]) for k in range(9)])
    assert np.ptp(ends, axis=0).max() <= 1e-9
    gaps = np.linalg.norm(np.array(ends[0])[:, None] - np.array(ends[0])[None], axis=2)
    assert gaps[np.triu_indices(9, 1)].min() >= 0.8 - 1e-6


@each_figure
def test_a_coin_is_told_in_the_step_that_runs_through_it(figure):
    """0.2 m wide, and at 120 m/s a step of 2 m; also a coin beside the way is none."""
    speed = 120.0
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

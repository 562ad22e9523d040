"""Characters in the air: jumps, falls and landings, off walls and ladders, and through one-way platforms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_character import JUMP, SKIN, STEP, TOP, G, Stage, each_dimension, each_figure, is_walking, vector

from carom.plugins.character import Ladder

pytestmark = pytest.mark.slow  # its kernels take long to compile


@each_dimension
@pytest.mark.parametrize("rate", [30, 60, 144, 240])
def test_a_jump_is_the_parabola_at_any_rate(figure, rate):
    """Each step is on it, so its height is v^2 / 2g but for the steps' sampling; a held key jumps once."""
    for settings in ({"jump_speed": JUMP}, {"jump_height": TOP}):
        stage = Stage(figure, dt=1 / rate, **settings)
        stage.run(3)
        start = stage.place.y
        track = stage.run(round(0.8 * rate), stage.hold(jump=True))
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
    track = stage.run(rate // 2, stage.hold(held, jump=True))

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
    track = stage.run(30, stage.walk(2.0))
    assert track.velocity[:, 0] == pytest.approx(np.minimum(0.1 * np.arange(1, 31), 2.0), abs=1e-9)


@each_figure
@pytest.mark.parametrize("whole", [True, False])
def test_it_keeps_its_skin_to_a_wall_beside_which_it_jumps(figure, whole):
    """Of one box or of many, at random speeds and heights, on the way up, down and as it lands."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        stage = Stage(figure, x=rng.uniform(-2.0, -0.5), jump_height=rng.uniform(1.0, 3.0))
        for k in range(1 if whole else 9):
            stage.box((0, k), (2, 9 if whole else k + 1))
        stage.move(rng.uniform(0.5, 8.0))
        track = stage.run(180, lambda step, me=stage.me: setattr(me, "jump", step % 60 < 25))
        assert (-0.4 - track.x).min() == pytest.approx(SKIN, abs=1e-8)


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


@each_dimension
@pytest.mark.parametrize("rate", [10, 1000])
def test_long_and_short_steps_keep_the_rules(figure, rate):
    stage = Stage(figure, x=-3.0, y=0.5, dt=1 / rate)
    for k in range(40):
        stage.box((k - 8, -1), (k - 7, 0))
    stage.run(rate // 2)
    still = stage.run(max(rate // 20, 3))
    assert still.y == pytest.approx(stage.stands, abs=1e-9)
    assert (still.position == still.position[0]).all()
    track = stage.run(rate, stage.walk(4.0))
    part = track[rate // 5 :]
    assert np.diff(part.x) == pytest.approx(4.0 / rate, abs=1e-12)
    assert np.ptp(part.y) <= 1e-12
    stage.run(rate // 2, stage.walk(0.0))
    start = stage.place.y
    track = stage.run(rate // 2, stage.hold(jump=True))
    assert track.y.max() - start == pytest.approx(TOP, abs=G / rate**2 / 8 + 1e-4)


@each_figure
def test_a_one_way_platform_is_jumped_through_stood_on_and_dropped_through(figure):
    stage = Stage(figure, x=-3.0)
    platform = stage.one_way(-2, 2, 1.3)
    stage.run(2)
    track = stage.run(60, stage.walk(3.0))  # under it, and through its end
    assert is_walking(track.state)
    assert np.diff(track.x)[10:] == pytest.approx(3.0 * STEP, abs=1e-12)
    stage.move(0.0)
    track = stage.run(60, stage.hold(5, jump=True))
    assert track.y.max() - stage.stands == pytest.approx(TOP, rel=1e-4)
    assert track.y[-1] == pytest.approx(1.3 + stage.stands, abs=1e-9)
    assert stage.me.floor_entity == platform
    track = stage.run(60, stage.hold(3, drop=True))
    assert track.y[-1] == pytest.approx(stage.stands, abs=1e-9)
    track = stage.run(20, stage.hold(drop=True))  # through what is solid it does not
    assert track.y == pytest.approx(stage.stands, abs=1e-9)
    assert stage.events("character_hit") == []


@each_figure
def test_put_on_a_one_way_platform_it_stands_as_on_a_floor(figure):
    """With its feet on it to rounding, or in it by less than its skin; deeper it falls."""
    for above in (0.005, 0.0, -1e-6, -0.9 * SKIN, -3 * SKIN):
        stage = Stage(figure, x=-3.0, y=1.3 - SKIN + above)
        platform = stage.one_way(-5, 5, 1.3)
        track = stage.run(10)
        if above < -SKIN:
            assert track.y[-1] < 1.3 + stage.stands - 0.1
        else:
            assert track.y[-1] == pytest.approx(1.3 + stage.stands, abs=1e-9)
            assert stage.me.floor_entity == platform


@each_figure
@pytest.mark.parametrize("gravity", [0.3, 1.6, G])
def test_however_weak_gravity_is_it_drops_through_a_one_way_platform(figure, gravity):
    stage = Stage(figure, y=1.3, gravity=gravity)
    stage.one_way(-5, 5, 1.3)
    stage.run(5)
    start = stage.place.y
    track = stage.run(60, stage.hold(2, drop=True))
    t = STEP * np.arange(1, 61)
    assert track.y - start == pytest.approx(-gravity * t * t / 2, abs=1e-9)


@each_dimension
def test_it_climbs_a_ladder_hangs_on_it_and_jumps_off(figure):
    stage = Stage(figure)
    stage.sensor(0.0, 3.0, (0.5, 3.0), Ladder())
    stage.run(2)
    track = stage.run(60, stage.hold(climb=2.0))
    assert track.state[-1] == "climb"
    assert np.diff(track.y)[10:] == pytest.approx(2.0 * STEP, abs=1e-12)
    hangs = stage.run(20, stage.hold(climb=0.0))
    assert set(hangs.state) == {"climb"}
    assert (hangs.position[1:] == hangs.position[1]).all()
    track = stage.run(10, stage.hold(jump=True))
    assert track.state[-1] == "air"
    assert track.velocity[0, 1] > 8.0
    track = stage.run(100, stage.hold(jump=False))  # without a wish to climb it falls past it
    assert track.y[-1] == pytest.approx(stage.stands, abs=1e-9)
    down = stage.run(30, stage.hold(climb=-2.0))
    assert is_walking(down.state)  # on the floor there is no further down


@each_dimension
def test_it_slides_down_walls_slowly_and_jumps_off_them(figure):
    stage = Stage(figure, x=0.55, y=8.0, wall_slide=2.0, wall_jump=6.0, wall_jump_up=8.0, air_acceleration=0.5)
    wall = stage.box((1, -9), (2, 30))
    track = stage.run(60, stage.walk(1.0))
    assert stage.me.on_wall
    assert stage.me.wall_entity == wall
    assert stage.me.wall_normal == pytest.approx(vector(figure.d, -1.0), abs=1e-9)
    assert -np.diff(track.y)[-10:] == pytest.approx(2.0 * STEP, abs=1e-9)
    assert track.x[-1] == pytest.approx(1.0 - 0.4 - SKIN, abs=1e-9)
    start = stage.place.position.copy()
    track = stage.run(20, stage.hold(jump=True))
    t = STEP * np.arange(1, 21)
    assert track.y - start[1] == pytest.approx(8.0 * t - G * t * t / 2, abs=1e-9)
    assert track.x[0] - start[0] == pytest.approx(-6.0 * STEP, abs=0.02 * STEP)
    plain = Stage(figure, x=0.3, y=8.0, wall_slide=2.0)  # it has none
    plain.box((1, -9), (2, 30))
    track = plain.run(80, lambda step: (plain.move(1.0), setattr(plain.me, "jump", step > 60)))
    assert (np.diff(track.y) < 0).all()


@each_figure
@pytest.mark.parametrize("rate", [60, 120])
@pytest.mark.parametrize("over", [0.0, 0.5])  # m, from the ledge to the end of the ladder
def test_who_climbs_on_stands_still_at_the_end_of_a_ladder(figure, rate, over):
    """Its foot a skin above that, for as long as it wants up, and when it wants nothing more; from there it walks onto
    a ledge, climbs down, or jumps."""
    stage = Stage(figure, dt=1 / rate)
    stage.box((-6.0, 3.8), (-0.5, 4.0))
    stage.sensor(0.0, 2.0 + over / 2, (0.4, 2.0 + over / 2), Ladder())
    stage.run(rate, stage.hold(climb=7.0))
    track, top = stage.run(rate // 2, stage.hold(climb=7.0)), 4.0 + over + stage.stands
    assert set(track.state) == {"climb"}
    assert track.y == pytest.approx(np.full(len(track.y), top), abs=1e-6)
    assert track.steps().max() < 1e-9
    assert np.abs(track.velocity).max() < 1e-6
    hangs = stage.run(rate // 4, stage.hold(climb=0.0))
    assert set(hangs.state) == {"climb"}
    assert hangs.y == pytest.approx(top, abs=1e-6)
    down = stage.run(rate // 4, stage.hold(climb=-2.0))
    assert set(down.state) == {"climb"}
    assert down.y[-1] == pytest.approx(top - 0.5, abs=1e-6)
    stage.run(rate // 2, stage.hold(climb=3.0))
    leaps = stage.run(rate // 4, stage.hold(climb=3.0, jump=True))
    assert leaps.y.max() > top + 1.0
    again = stage.run(rate, stage.hold(climb=3.0))
    assert again.y[-1] == pytest.approx(top, abs=1e-6)
    off = stage.run(rate, lambda step: (stage.hold(climb=3.0 * (step < 5), jump=False)(0), stage.move(-3.0)))
    assert off.state[-1] == "floor"
    assert off.y[-1] == pytest.approx(4.0 + stage.stands, abs=1e-6)
    assert off.x[-1] == pytest.approx(-3.0, abs=0.3)


@each_figure
@pytest.mark.parametrize("one_way", [False, True])
def test_who_climbs_to_a_floor_that_a_ladder_ends_at_stands_on_it(figure, one_way):
    stage = Stage(figure)
    if one_way:
        stage.one_way(-3.0, 3.0, 4.0)
    else:
        stage.box((-6.0, 3.8), (-0.45, 4.0))
    stage.sensor(0.0, 2.0, (0.4, 2.0), Ladder())
    aside = 0.0 if one_way else -2.0
    track = stage.run(120, lambda step: (stage.hold(climb=4.0)(0), stage.move(aside * (step > 70))))
    assert is_walking(track.state[-30:])
    assert track.y[-1] == pytest.approx(4.0 + stage.stands, abs=1e-6)
    assert np.ptp(track.y[-30:]) < 1e-9

"""Stacks stay in place: towers, heavy bodies on light ones, pyramids, in 2D and 3D.

What test_loads says of heavy bodies on light ones, and test_resting_contacts of impulses, is not said again.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_rest import SLOP, G, depths, energy, heights, overlaps, rows_of, speed, tower
from laws.helpers_laws import seeds
from rotation.helpers_turning import box as turning_box
from worlds import MODES, ball, both_dimensions, box, floor, make_world, run

from carom import Physics, Settings, World
from carom.components import AABBCollider, Transform
from carom.plugins.rotation import Rotation
from carom.scenes import pyramid


def test_more_substeps_give_stiffer_contacts():
    """Five boxes overlap by less than the slop with any number of substeps, and by less the more there are."""
    deepest = []
    for substeps in (1, 2, 4, 8, 32):
        world = make_world(gravity=G, substeps=substeps)
        floor(world)
        ids = tower(world, 5)
        run(world, 600)
        assert speed(world) < 1e-6
        deepest.append(overlaps(world, ids).max())
    assert max(deepest) < SLOP
    assert deepest[2] > 3 * deepest[3] > 40 * deepest[4]


@pytest.mark.parametrize("seed", seeds(6, 60))
def test_towers_do_not_hop_as_steps_get_shorter(seed):
    """Ten at 1/60 s sag. Then once a step up to 100 times as short, or for good, or steps of any length from 1/20 to
    1/500 s: what comes up again gets no higher than without any sag."""
    random, dt = np.random.default_rng(seed), 1 / 60
    plugins, kind = ([Rotation()], {"maker": turning_box, "half": (0.5, 0.5)}) if seed % 2 else ([], {})
    with World(Physics(2, gravity=(0.0, -G)), *plugins, settings=Settings(collision=MODES[seed // 2 % 3])) as world:
        floor(world)
        ids = tower(world, 10, **kind)
        run(world, 120)
        short = dt / 10 ** random.uniform(0, 2)
        for k in range(120):
            any_step = 1 / random.uniform(20, 500) if k < 60 else dt
            step = (short if k == 0 else dt, short, any_step)[seed % 3]
            world.settings = world.settings.replace(dt=step)
            world.step()
            assert heights(world, ids)[-1] < 9.5


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("times", [2, 5, 10])
def test_one_long_step_lets_no_tower_sink(times, turns):
    """Of ten, which the next steps bear as before: no more than .01 of a box."""
    plugins, kind = ([Rotation()], {"maker": turning_box, "half": (0.5, 0.5)}) if turns else ([], {})
    with World(Physics(2, gravity=(0.0, -G)), *plugins) as world:
        floor(world)
        ids = tower(world, 10, **kind)
        run(world, 120)
        world.settings = world.settings.replace(dt=times / 60)
        world.step()
        world.settings = world.settings.replace(dt=1 / 60)
        for _ in range(60):
            world.step()
            assert overlaps(world, ids).max() < 0.01


@pytest.mark.parametrize("mode", ["discrete", "continuous", "event_driven"])
@pytest.mark.parametrize(("e", "deepest"), [(0.0, 0.07), (0.5, 0.016), (0.9, 0.015)])
@both_dimensions
def test_fifteen_boxes_fall_on_each_other(d, e, deepest, mode):
    """0.1 apart at the start: energy does not grow, overlaps within the measured ones, all at rest after 5 s."""
    world = make_world(d, gravity=G, collision=mode)
    floor(world)
    ids = tower(world, 15, bottom=0.55, pitch=1.1, restitution=e)
    start = energy(world)
    for _ in range(300):
        world.step()
        assert overlaps(world, ids).max() < (deepest if mode == "discrete" else 0.07)
        assert energy(world) <= start * (1 + 1e-12)
    assert speed(world) < 1e-9


@pytest.mark.parametrize("origin", [(0.0, 0.0), (4e4, -2.5e4), (1e5, -8e4), (9e5, -8e5)])
def test_published_stacks_near_and_far(origin):
    """A8, VerticalStack: 15 unit boxes at y = 0.55 + 1.1 i, x = +-0.01; CircleStack: 10 circles r = 1 at y = 4 + 3 i.

    They must stand, without sideways motion, also far from the origin: each overlap below the slop,
    up to ten roundings of the position per substep, 600 steps.
    """
    x, y = origin
    world = make_world(gravity=10.0)
    world.create_entity(Transform((x, y - 0.5)), AABBCollider((50, 0.5), friction=0.6))
    boxes = [box(world, (x - 0.01 + 0.02 * (i % 2), y + 0.55 + 1.1 * i), friction=0.6) for i in range(15)]
    balls = [ball(world, (x + 20.0, y + 4 + 3 * i), radius=1.0) for i in range(10)]
    places = world.bodies.position[rows_of(world, boxes + balls), 0].copy()
    run(world, 600)
    assert (world.bodies.position[rows_of(world, boxes + balls), 0] == places).all()
    assert speed(world) < 1e-8
    rounding = 2400 * np.spacing(max(abs(x), abs(y), 1.0))
    for ids, pitch, first in ((boxes, 1, 0.5), (balls, 2, 1.0)):
        sunk = first + pitch * np.arange(len(ids)) - (heights(world, ids) - y)
        assert (np.diff(sunk, prepend=0.0) > -rounding).all()
        assert (np.diff(sunk, prepend=0.0) < SLOP * pitch + rounding).all()


@both_dimensions
@pytest.mark.parametrize("mode", ["discrete", "continuous", "event_driven"])
def test_a_wide_ground_is_as_good_as_a_narrow_one(mode, d):
    """A10: three unit boxes stand for any half-width of the ground, up to 1e6: the same bits."""
    answers = []
    for half in (1.0, 1e2, 1e4, 1e6):
        world = make_world(d, gravity=G, collision=mode)
        world.create_entity(Transform((0, -0.5, 0)[:d]), AABBCollider((half, 0.5, half)[:d]))
        ids = tower(world, 3)
        run(world, 300)
        answers.append(heights(world, ids).tolist())
        assert overlaps(world, ids).max() < SLOP
    assert all(answer == answers[0] for answer in answers)


@pytest.mark.parametrize("count", [20, 30])
def test_a_column_that_sways_comes_to_rest(count):
    """Friction that is kept from substep to substep of h seconds is a spring without a damper, (w h)^2 = c mu with
    mu = 2 - 2 cos(pi / (2 n + 1)), and each substep takes energy as an implicit step does: the sway fades by w^2 h / 2
    each second. c is the passes of a substep, 3.5 in the mean; those that go beyond what stops a row make it more."""
    with make_world(gravity=G) as world:
        floor(world, friction=0.4)
        for k in range(count):
            ball(world, (0.0, 0.5 + 0.999 * k), radius=0.5, friction=0.4)
        run(world, 300)
        mode = np.sin(np.pi * (np.arange(count) + 1) / (2 * count + 1))
        world.bodies.dynamic.linear_velocity[:, 0] += 1e-4 * mode
        run(world, 30)
        sway = []
        for _ in range(120):
            world.step()
            sway.append(world.bodies.dynamic.linear_velocity[:, 0] @ mode)
    sway, h = np.array(sway), 1 / 60 / world.settings.substeps
    now_and_before = np.stack((sway[1:-1], sway[:-2]), axis=1)
    (p, q), *_ = np.linalg.lstsq(now_and_before, sway[2:])
    root = 60 * np.log(np.roots((1, -p, -q)).astype(complex))[0]
    assert -root.real == pytest.approx(abs(root) ** 2 * h / 2, rel=0.03)
    assert (abs(root) * h) ** 2 > 5.0 * (2 - 2 * math.cos(math.pi / (2 * count + 1)))


# -- unequal masses ------------------------------------------------------------------------------


@pytest.mark.parametrize("density", [100.0, 200.0, 300.0])
def test_a_heavy_box_on_top_of_a_pyramid(density):
    """A8, HighMassRatio1: ten rows of boxes of side 2, the top one 100 to 300 times as dense. They stand, for 10 s.

    At no time does a box overlap another by more than three quarters of a per cent of its size, less if the load is.
    """
    world = make_world(gravity=10.0)
    floor(world, friction=0.6)
    for x, y in pyramid.initial_positions(10) * 2.0:
        box(world, (x, y), half=1.0, mass=4.0 * (density if y > 18 else 1.0), friction=0.6)
    start = world.bodies.dynamic.position.copy()
    deepest = 0.0
    for _ in range(600):
        world.step()
        deepest = max(deepest, depths(world).max(initial=0.0))
    assert deepest < 2.0 * 0.0075 * density / 300
    moved = world.bodies.dynamic.position - start
    assert (moved[:, 0] == 0.0).all()
    assert speed(world) < 1e-9


@both_dimensions
def test_removing_the_load_shoots_no_body_up(d):
    """A8, WarmStartEnergy: three circles, densities 1, 1, 100; the top one is removed after 120 steps.

    The impulses that carried it are stored; the others must stay: upward speed up to 0.02.
    """
    world = make_world(d, gravity=10.0)
    floor(world)
    ids = tower(world, 3, maker=ball, masses=np.array((1.0, 1.0, 100.0)) * math.pi / 4)
    run(world, 120)
    world.delete_entity(ids[2])
    for _ in range(240):
        world.step()
        assert world.bodies.dynamic.linear_velocity[:, 1].max() < 0.02
    assert speed(world) < 1e-9


# -- pyramids ------------------------------------------------------------------------------------


@pytest.mark.parametrize("friction", [None, 0.6])
def test_boxes_in_each_other_part_gently(friction):
    """A8, OverlapRecovery: a pyramid of four rows at 75 % spacing: no box faster than 1 m/s, no overlap left."""
    world = make_world(gravity=10.0)
    floor(world, friction=friction)
    for x, y in pyramid.initial_positions(4) * 0.75:
        box(world, (x, y), friction=friction)
    for _ in range(600):
        world.step()
        assert speed(world) < 1.0
    assert depths(world).max() < SLOP
    if friction:
        assert speed(world) < 1e-9  # without friction the rows continue to slide apart


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.6, 0.0])
def test_a_pyramid_of_fifty_rows_stands_without_drift(friction):
    """5 s. The boxes of a row touch without force between them: no sideways push, so no friction is needed."""
    with pyramid.build(friction=friction) as world:
        start = pyramid.initial_positions(50)
        run(world, 150)
        middle = world.bodies.dynamic.position.copy()
        run(world, 150)
        position = world.bodies.dynamic.position
        assert np.abs(position[:, 0] - start[:, 0]).max() < 1e-3
        assert np.abs(position - middle).max() < 1e-3
        assert (start - position)[:, 1].max() < 0.5
        assert depths(world).max() < 0.02
        assert speed(world) < 1e-3

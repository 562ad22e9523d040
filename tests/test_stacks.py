"""Stacks stay in place: towers, heavy bodies on light ones, pyramids, in 2D and 3D.

Overlap at rest is known: each contact is compressed like its spring under the load, see ``soft_overlap``.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from helpers_rest import SLOP, G, depths, energy, heights, overlaps, rows_of, soft_overlap, speed, tower
from worlds import ball, both_dimensions, box, floor, make_world, run

from carom.components import AABBCollider, Transform
from carom.scenes import pyramid
from carom.systems.contacts.resting import OWN_SAG
from carom.systems.contacts.solving.rigid import MOST_SAG
from carom.systems.contacts.solving.softness import SAG

makers = pytest.mark.parametrize("maker", [box, ball])


# -- towers --------------------------------------------------------------------------------------

COUNTS = (2, 5, 10, 20, 40)


@both_dimensions
@makers
def test_towers_stand(d, maker):
    """B18, default settings: no drift, penetration up to the slop + 25 % for ten, speed below 1e-6 after 5 s.

    Each contact carries g dt times the mass above it, and is compressed like its spring: both to the 1e-9 of the
    solver's convergence. While settling, a tower of 40 overlaps 1.3 times as much, one of ten or less no more than
    that.
    """
    world = make_world(d, gravity=G)
    ground = floor(world)
    towers = [tower(world, n, x=4.0 * n, maker=maker) for n in COUNTS]
    deepest = np.zeros(len(COUNTS))
    for step in range(600):
        world.step()
        deepest = np.maximum(deepest, [overlaps(world, ids).max() for ids in towers])
        if step == 299:
            assert speed(world) < 1e-6
            settled = [heights(world, ids) for ids in towers]
    assert deepest[COUNTS.index(10)] < 1.25 * SLOP
    contact = {(c.entity_a, c.entity_b): c.normal_impulse for ids in towers for e in ids for c in world.contacts.of(e)}
    for n, ids, peak, before in zip(COUNTS, towers, deepest, settled, strict=True):
        position = world.bodies.position[rows_of(world, ids)]
        assert (position[:, 0] == 4.0 * n).all()
        assert (position[:, 2:] == 0.0).all()
        load = n - np.arange(n)
        expected = soft_overlap(load, np.where(load == n, 1.0, 0.5), world.settings)
        np.testing.assert_allclose(overlaps(world, ids), expected, rtol=0, atol=1e-8)
        np.testing.assert_allclose(heights(world, ids), before, rtol=0, atol=1e-6)
        assert peak < (1.001 if n <= 10 else 1.3) * expected.max()
        pairs = [(ground, ids[0]), *itertools.pairwise(ids)]
        impulses = [contact.get(pair) or contact[pair[::-1]] for pair in pairs]
        np.testing.assert_allclose(impulses, G * world.settings.dt * load, rtol=0, atol=1e-9)


@pytest.mark.parametrize("substeps", [1, 2, 8, 32])
def test_more_substeps_give_stiffer_contacts(substeps):
    """The spring's frequency follows the rate of the substeps: the overlap falls with their square. Contacts that would
    sag too much under the weight of one body alone, or under their load, are rigid: with one substep all of these."""
    world = make_world(gravity=G, substeps=substeps)
    floor(world)
    ids = tower(world, 5)
    run(world, 600)
    soft = soft_overlap([5, 4, 3, 2, 1], [1.0, 0.5, 0.5, 0.5, 0.5], world.settings)
    own = SAG * G * (world.settings.dt / substeps) ** 2  # of one body on what cannot be moved
    rigid = (own > OWN_SAG) | (soft > MOST_SAG)
    assert rigid.all() == rigid.any() == (substeps == 1)
    expected = np.where(rigid, 0.0, soft)
    np.testing.assert_allclose(overlaps(world, ids), expected, rtol=1e-3, atol=1e-8)  # settling time grows with 1/w
    assert speed(world) < 1e-6


@pytest.mark.parametrize(("e", "deepest"), [(0.0, 0.07), (0.5, 0.016), (0.9, 0.015)])
@both_dimensions
def test_fifteen_boxes_fall_on_each_other(d, e, deepest):
    """0.1 apart at the start: energy does not grow, overlaps within the measured ones, all at rest after 5 s."""
    world = make_world(d, gravity=G)
    floor(world)
    ids = tower(world, 15, bottom=0.55, pitch=1.1, restitution=e)
    start = energy(world)
    for _ in range(300):
        world.step()
        assert overlaps(world, ids).max() < deepest
        assert energy(world) < start
    assert speed(world) < 2e-11


@pytest.mark.parametrize("origin", [(0.0, 0.0), (4e4, -2.5e4), (1e5, -8e4), (9e5, -8e5)])
def test_published_stacks_near_and_far(origin):
    """A8, VerticalStack: 15 unit boxes at y = 0.55 + 1.1 i, x = +-0.01; CircleStack: 10 circles r = 1 at y = 4 + 3 i.

    They must stand, without sideways motion, also far from the origin: heights equal to those near it up to ten
    roundings of the position per substep, 600 steps.
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
    load = 15 - np.arange(15)
    sunk = soft_overlap(load, np.where(load == 15, 1.0, 0.5), world.settings, 10.0).cumsum()
    rounding = 2400 * np.spacing(max(abs(x), abs(y), 1.0))
    np.testing.assert_allclose(heights(world, boxes) - y, 0.5 + np.arange(15) - sunk, rtol=0, atol=1e-8 + rounding)
    load = 10 - np.arange(10)
    sunk = soft_overlap(load, np.where(load == 10, 1.0, 0.5), world.settings, 10.0).cumsum()
    np.testing.assert_allclose(heights(world, balls) - y, 1 + 2 * np.arange(10) - sunk, rtol=0, atol=1e-8 + rounding)


@both_dimensions
def test_a_wide_ground_is_as_good_as_a_narrow_one(d):
    """A10: three unit boxes stand for any half-width of the ground, up to 1e6: the same bits."""
    answers = []
    for half in (1.0, 1e2, 1e4, 1e6):
        world = make_world(d, gravity=G)
        world.create_entity(Transform((0, -0.5, 0)[:d]), AABBCollider((half, 0.5, half)[:d]))
        ids = tower(world, 3)
        run(world, 300)
        answers.append(heights(world, ids).tolist())
        assert overlaps(world, ids).max() < SLOP
    assert all(answer == answers[0] for answer in answers)


# -- unequal masses ------------------------------------------------------------------------------


@both_dimensions
@pytest.mark.parametrize("substeps", [4, 8, 32])
def test_heavy_on_light(d, substeps):
    """B19, 10 s, ratios 10 to 1e12: both contacts of the light body are solved together, so nothing sinks at all.

    Rounding: impulses of 1e12 kg that must cancel on 1 kg.
    """
    ratios = (10.0, 1e2, 1e4, 1e6, 1e9, 1e12)
    world = make_world(d, gravity=G, substeps=substeps)
    floor(world)
    towers = [tower(world, 2, x=5.0 * k, masses=(1.0, ratio)) for k, ratio in enumerate(ratios)]
    for _ in range(600):
        world.step()
        assert max(np.abs(overlaps(world, ids)).max() for ids in towers) < 1e-9
    assert speed(world) < 1e-9


@pytest.mark.parametrize(("substeps", "limits"), [(4, (0.018, 0.22)), (32, (2.4e-4, 0.0034))])
def test_heavy_on_several_light_ones(substeps, limits):
    """Three boxes below one of 100 or 1000 times their mass: a documented limit, because the 2x2 block does not apply.

    At a ratio of 100 the contact at rest is compressed like its spring; in the transient a quarter more.
    """
    world = make_world(gravity=G, substeps=substeps)
    floor(world)
    towers = [tower(world, 4, x=5.0 * k, masses=(1.0, 1.0, 1.0, r)) for k, r in enumerate((100.0, 1000.0))]
    deepest = np.zeros(2)
    for _ in range(600):
        world.step()
        deepest = np.maximum(deepest, [overlaps(world, ids).max() for ids in towers])
    assert (deepest < limits).all(), deepest
    expected = soft_overlap([103, 102, 101, 100], [1, 0.5, 0.5, 100 / 101], world.settings)
    np.testing.assert_allclose(overlaps(world, towers[0]), expected, rtol=1e-3, atol=1e-7)


@pytest.mark.parametrize("density", [100.0, 200.0, 300.0])
def test_a_heavy_box_on_top_of_a_pyramid(density):
    """A8, HighMassRatio1: ten rows of boxes of side 2, the top one 100 to 300 times as dense. They stand, for 10 s.

    Two boxes carry the top one: at 300 their contacts are compressed by soft_overlap(600, 4 300 / 301) = 0.6 % of a
    box.
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

"""Impacts at their true time, with the step completed: A9, B9, B10, C9, kinematic walls, the threshold."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from helpers_modes import MODES, along, bullet, each_mode, mode_world, positions, strikes, velocities
from helpers_pairwise import pairwise
from worlds import EPS, ball, both_dimensions, box, make_world, position, run, velocity

from carom.components import Transform

DT, G = 1 / 60, 9.81
RATIOS = [10.0**k for k in (0, 3, -3, 6, -6, 9, -9, 12, -12)]
makers = pytest.mark.parametrize("maker", [ball, box])
every_mode = pytest.mark.parametrize("mode", ["discrete", *MODES])


@pytest.mark.slow
@both_dimensions
@every_mode
@makers
def test_b9_two_bodies(mode, d, maker):
    """v1' = v1 - (1+e) m2/(m1+m2) w, v2' = v2 + (1+e) m1/(m1+m2) w: to 4 eps of the speeds, and the momentum."""
    world, slow = mode_world(mode, d), 0.02 if mode == "discrete" else 1.0
    v1, v2, apart, end = 100.0 * slow, -50.0 * slow, 1.0 + 2.0 * slow, 3 * DT
    pairs, toi = [], 2 / 150
    for lane, (e, ratio) in enumerate(itertools.product((0.0, 0.5, 1.0, 1.5), RATIOS)):
        a = maker(world, along(d, -0.5 * apart, 4.0 * lane), v1, restitution=e)
        pairs.append((a, maker(world, along(d, 0.5 * apart, 4.0 * lane), v2, mass=ratio, restitution=e), e, ratio))
    run(world, 3)
    for a, b, e, ratio in pairs:
        m1, m2, w = Fraction(1), Fraction(ratio), Fraction(v1) - Fraction(v2)
        share = (1 + Fraction(e)) * w / (m1 + m2)
        expected = Fraction(v1) - share * m2, Fraction(v2) + share * m1
        for entity, start, before, after in ((a, -0.5 * apart, v1, expected[0]), (b, 0.5 * apart, v2, expected[1])):
            assert abs(Fraction(velocity(world, entity)[0]) - after) <= 4 * EPS * (abs(v1) + abs(v2)), (e, ratio)
            assert (velocity(world, entity)[1:] == 0).all()
            place = start + before * toi + float(after) * (end - toi)
            assert position(world, entity)[0] == pytest.approx(place, abs=1e-13)  # some eps of ten metres
        total = Fraction(velocity(world, a)[0]) + m2 * Fraction(velocity(world, b)[0])
        assert abs(total - (Fraction(v1) + m2 * Fraction(v2))) <= 4 * EPS * (abs(v1) + ratio * abs(v2))


# p1, toi, normal, then (e, m2, v1', v2'): rational answers, the other body at rest at the origin, radii sum to 1
OBLIQUE = {
    2: ((-3, 0.6), 2.2, (0.8, -0.6), ((1.0, 1, (0.36, 0.48), (0.64, -0.48)), (0.5, 3, (0.28, 0.54), (0.24, -0.18)))),
    3: (
        (-3, 3 / 7, 6 / 7), 3 - 2 / 7, (2 / 7, -3 / 7, -6 / 7),
        ((1.0, 1, (45 / 49, 6 / 49, 12 / 49), (4 / 49, -6 / 49, -12 / 49)),),
    ),
}  # fmt: skip


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize(
    ("mode", "dt", "radius"),
    [*pairwise(MODES, (1 / 60, 1 / 3, 1.0, 5.0), (0.5, 0.2)), *pairwise(("discrete",), (1 / 240, 1 / 3), (0.5, 0.2))],
)
def test_b10_oblique_impact(mode, d, dt, radius):
    """Over 16 phases of the step: time, normal, point, final state to the rounding of lanes up to 600 m away."""
    start, toi, normal, cases = OBLIQUE[d]
    for e, m2, v1, v2 in cases:
        world = mode_world(mode, d, dt=dt)
        lanes = 40.0 * np.arange(16)[:, None] * np.eye(d)[1]
        shifts = np.arange(16) / 16 * dt
        first = [
            bullet(world, np.subtract(start, along(d, shift)) + lane, 1.0, radius=radius, restitution=e)
            for shift, lane in zip(shifts, lanes, strict=True)
        ]
        second = [ball(world, lane, radius=1 - radius, mass=m2) for lane in lanes]
        steps = math.ceil(toi / dt) + 2
        hits = strikes(world, steps)
        order = np.argsort(hits.entity_a)
        assert hits.entity_a[order].tolist() == first
        assert hits.entity_b[order].tolist() == second
        where = np.array(start) + along(d, toi)
        np.testing.assert_allclose(hits.time[order], toi + shifts, atol=1e-12)
        np.testing.assert_allclose(hits.normal[order], np.tile(normal, (16, 1)), atol=1e-12)
        touch = np.tile(where + radius * np.array(normal), (16, 1))
        np.testing.assert_allclose(hits.point[order] - lanes, touch, atol=1e-12)
        after = (steps * dt - toi - shifts)[:, None]
        for entities, origin, new in ((first, where, v1), (second, np.zeros(d), v2)):
            np.testing.assert_allclose(velocities(world, entities), np.tile(new, (16, 1)), atol=1e-12)
            np.testing.assert_allclose(positions(world, entities), lanes + origin + np.array(new) * after, atol=5e-12)


@pytest.mark.parametrize("start", [(-50.0, 0.0), (-1.0, 0.0)], ids=["apart", "inside"])
@each_mode
def test_a_wall_that_the_game_has_moved_is_met_where_it_stands(mode, start):
    """In the very step after the write, also by what begins inside it and would be through it at the end."""
    with make_world(2, dt=DT, collision=mode) as world:
        wall = ball(world, (900.0, 0.0), radius=3.0, kind="static", restitution=1.0)
        bullet_ = ball(world, start, velocity=(6000.0, 0.0), radius=0.5, restitution=1.0)
        for x in (0.0, 0.9):  # so that there is a response in the step before, too
            ball(world, (x, 900.0), radius=0.5)
        world.step()
        world.component_for_entity(bullet_, Transform).position = start
        world.component_for_entity(wall, Transform).position = (0.0, 0.0)
        world.step()
        assert len(world.contacts.impacts) == 1
        assert np.allclose(velocity(world, bullet_), (-6000.0, 0.0))


@both_dimensions
@every_mode
@pytest.mark.parametrize(("share", "bounces"), [(0.99, False), (1.01, True)])
def test_threshold(mode, d, share, bounces):
    """Above the threshold full restitution; below it the body stops at the wall and does not tunnel."""
    fast = 5.0 if mode == "discrete" else 100.0
    world, speed = mode_world(mode, d, restitution_threshold=fast), share * fast
    box(world, 0.0, half=along(d, 0.05, 5.0, 5.0), kind="static")
    mover = ball(world, -0.15 - 0.0085 * fast, speed, radius=0.1, restitution=0.8)
    run(world, 2)
    left = 2 * DT - 0.0085 * fast / speed
    assert velocity(world, mover)[0] == pytest.approx(-0.8 * speed if bounces else 0.0, abs=1e-12)
    place = -0.15 - 0.8 * speed * left if bounces else -0.15
    assert position(world, mover)[0] == pytest.approx(place, abs=1e-12 if bounces else 0.005 * 0.2)

"""Known answers of mechanics: rough impacts, billiards, a leaning card, a crate on a floor with seams."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_pairwise import pairwise
from rotation.helpers_turning import G, ball, box, motion, part, pose, turning_world, wall
from worlds import MODES, run

from carom import Settings, scenes
from carom.components import Transform
from carom.plugins.rotation import Spin
from carom.scenes.impacts.billiards import RADIUS
from carom.scenes.turning import billiards_spin


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("e", [0.5, 1.0])
@pytest.mark.parametrize("mu", [0.0, 1e9])
def test_a_rough_rod_sticks_with_its_end_and_rebounds_by_stronges_law(mu, e, mode):
    """A friction without bound first stops the slip, by s / t; then the end sticks, while the speed along the normal
    grows by k = n - c^2 / t per impulse, and restitution gives e^2 of its work back: J = (1 + e) u' / k. n, t, c: what
    impulses along and across the normal do to the two speeds of the end. A smooth one has J = (1 + e) u / n alone."""
    half, angle, v = np.array((0.5, 0.05)), 0.5, np.array((1.0, -3.0))
    c, s = math.cos(angle), math.sin(angle)
    corners = np.array([(c * x - s * y, s * x + c * y) for x in (-half[0], half[0]) for y in (-half[1], half[1])])
    x, y = corners[np.argmin(corners[:, 1])]
    inertia = (half**2).sum() / 3
    n, t, both = 1 + x * x / inertia, 1 + y * y / inertia, -x * y / inertia
    with turning_world(collision=mode) as world:
        wall(world, (0, -1), (20, 1), restitution=e, friction=mu)
        entity = box(world, (0, -y + 0.02), half, v, rotation=angle, restitution=e, friction=mu)
        world.step()
        velocity, w = motion(world, entity)
    first, sticks = (-v[0] / t, both / t) if mu > 0.0 else (0.0, 0.0)
    along = -(1 + e) * (v[1] + both * first) / (n - both * sticks)
    across = first - sticks * along
    assert velocity == pytest.approx((v[0] + across, v[1] + along), rel=1e-6)
    assert w == pytest.approx((x * along - y * across) / inertia, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("cut", [0.1, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("english", [0.0, 3.0, -3.0])
def test_friction_throws_the_struck_ball_off_the_line_of_centres(cut, english):
    """By an angle of tangent min(mu, q / 7), q the slip over the approach; with English the cue ball spins upright, in
    speeds over radii. Smooth, elastic balls would leave along that line. Where slip ends, 1/7 of it goes to the struck
    ball: of two solid balls."""
    r, v, mu = 0.5, 4.0, 0.06
    with turning_world(3, 0, collision="event_driven") as world:
        centre = 2 * r * np.array((math.cos(cut), 0, math.sin(cut)))  # of the struck ball when they meet at the origin
        entities = [
            ball(world, place, (speed, 0, 0), (0, spin, 0), r, restitution=1.0, friction=mu)
            for place, speed, spin in (((-0.05, 0, 0), v, english * v / r), (centre, 0.0, 0.0))
        ]
        run(world, 3)
        (cue, w), (struck, u) = (motion(world, entity) for entity in entities)
    n, along = centre / (2 * r), np.array((-math.sin(cut), 0, math.cos(cut)))
    slip = -v * math.sin(cut) - english * v  # of the cue ball's surface, along
    thrown = math.copysign(min(mu * v * math.cos(cut), abs(slip) / 7), slip)
    assert struck == pytest.approx(v * math.cos(cut) * n + thrown * along, abs=1e-9)
    assert cue == pytest.approx(np.array((v, 0, 0)) - struck, abs=1e-9)
    assert w[1] - english * v / r == pytest.approx(u[1], abs=1e-9)  # both get the same twist


@pytest.mark.parametrize("settings", [billiards_spin.SETTINGS, Settings(dt=1 / 1920, collision="event_driven")])
def test_follow_stop_and_draw_end_where_slip_and_rolling_lead(settings):
    """After the impact a cue ball of spin w stands: it slips with mu g until it rolls with u = 2/7 r w, after u / mu g,
    and is u (T - u / (2 mu g)) on; the struck one gains 5/7 of the speed v in its frame, from above. To a step's way:
    contacts are told at steps. A step of 1/1920 s is too short for a ball to sink in where it meets the next one."""
    speed, mu, seconds = billiards_spin.SPEED, billiards_spin.FRICTION, 1.0
    with scenes.get("billiards_spin").build(settings) as world:
        entities = [entity for entity, _ in world.get_component(Spin)]
        run(world, round(seconds / world.settings.dt))
        places = np.array([part(world, entity, Transform).position[0] for entity in entities])
        step = speed * world.settings.dt
    after = seconds - billiards_spin.GAP / speed
    for k, spin in enumerate(billiards_spin.SPINS.values()):
        rolls, loss = -2 / 7 * spin * speed, 2 / 7 * speed
        expected = billiards_spin.GAP + rolls * (after - abs(rolls) / (2 * mu * G))
        assert places[2 * k] == pytest.approx(expected, abs=2 * step)
        expected = 2 * RADIUS + billiards_spin.GAP + 5 / 7 * speed * after + loss * loss / (2 * mu * G)
        assert places[2 * k + 1] == pytest.approx(expected, abs=2 * step)


@pytest.mark.parametrize(
    ("spin", "mu", "mode"), pairwise(((0, 0, -1), (0, 0, 1), (0, 1, 0)), (0.0, 0.06), MODES)  # follow, draw, throw
)
def test_a_rack_of_fifteen_keeps_momentum_and_angular_momentum(spin, mu, mode):
    """Balls that touch, and an elastic cue ball off the middle. Energy stays if they are smooth; else it only falls."""
    r, v = 0.5, 6.0
    rows = [(math.sqrt(3) * r * row, 0, (2 * k - row) * r) for row in range(5) for k in range(row + 1)]
    with turning_world(3, 0, collision=mode, max_impacts_per_step=64) as world:
        for place in rows:
            ball(world, place, restitution=1.0, friction=mu)
        ball(world, (-1.3, 0, 0.11), (v, 0, 0), np.multiply(spin, v / r), restitution=1.0, friction=mu)
        bodies = world.bodies

        def totals():
            x, u, w = bodies.position, bodies.linear_velocity, bodies.spin.angular_velocity
            inertia = 0.4 * r * r
            energy = 0.5 * (u**2).sum() + 0.5 * inertia * (w**2).sum()
            return energy, u.sum(0), (np.cross(x, u) + inertia * w).sum(0)

        first = last = totals()
        for _ in range(60):
            world.step()
            now = totals()
            assert now[0] <= last[0] * (1 + 1e-12)
            last = now
        assert world.stats().counters["impacts"] >= 15
        assert (np.linalg.norm(bodies.linear_velocity, axis=1) > 0.01).sum() > 10
    assert np.allclose(last[1], first[1], atol=1e-12 * v)
    assert np.allclose(last[2], first[2], atol=1e-11 * v)
    assert last[0] == pytest.approx(first[0], rel=1e-12) if mu == 0.0 else last[0] < 0.95 * first[0]


@pytest.mark.parametrize(("mu", "mode"), [*zip((0.2, 0.4, 0.6), MODES, strict=True)])
def test_a_card_that_leans_on_a_wall_slides_where_friction_ends(mu, mode):
    """With the same friction at both ends, at tan a = (2 mu + q (1 + mu^2)) / (1 - mu^2) from the wall, q the thickness
    over the length: .99 of it stands within a mm for 3 s, with 16 substeps, and 1.04 falls."""
    half = np.array((0.01, 0.5))
    most = (2 * mu + half[0] / half[1] * (1 + mu * mu)) / (1 - mu * mu)
    for times in (0.99, 1.04):
        angle = math.atan(times * most)
        c, s = math.cos(angle), math.sin(angle)
        with turning_world(2, G, collision=mode, substeps=16, on_fault="ignore") as world:
            wall(world, (0, -1), (9, 1), friction=mu)
            wall(world, (-1, 0), (1, 9), friction=mu)
            place = np.array((half[0] * c + half[1] * s, half[1] * c + half[0] * s))
            entity = box(world, place, half, rotation=angle, friction=mu)
            run(world, 180)
            way = np.abs(pose(world, entity)[:2] - place).max()
        assert way < 1e-3 if times < 1 else way > 0.1


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("speed", [1.0, 9.0])
def test_a_smooth_crate_slides_over_the_seams_of_a_floor_without_turning(speed, mode):
    with turning_world(2, G, collision=mode) as world:
        for k in range(40):
            wall(world, (k, -0.5), (0.5, 0.5), friction=0.0)
        entity = box(world, (1, 0.25), (0.25, 0.25), (speed, 0))
        for _ in range(240):
            world.step()
            assert abs(motion(world, entity)[1]) < 1e-3
        assert motion(world, entity)[0] == pytest.approx((speed, 0), abs=1e-5)

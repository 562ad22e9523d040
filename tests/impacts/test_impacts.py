"""Impacts of the discrete mode: B11, B12, and two defects: sticking together, sending both backwards."""

from __future__ import annotations

import math

import numpy as np
import pytest
from worlds import EPS, MODES, Conserved, ball, both_dimensions, box, floor, make_world, position, run, velocity

DT = 1 / 60
LAG = {"explicit_euler": 0.5, "semi_implicit_euler": -0.5}  # they keep v^2/2 + g y + lag g dt v in free fall
INTEGRATORS = ["explicit_euler", "semi_implicit_euler", "velocity_verlet", "rk4", "yoshida4"]
makers = pytest.mark.parametrize("maker", [ball, box])
integrators = pytest.mark.parametrize("integrator", INTEGRATORS)


@makers
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_stuck_pair(maker, e):
    """Slow bodies overlap for many frames: they bounce once and separate, without a reversal in every frame."""
    world = make_world()
    a, b = maker(world, -0.35, 0.1, restitution=e), maker(world, 0.35, -0.1, restitution=e)  # 0.3 deep: 90 frames
    kept, gaps, speeds = Conserved(world), [], []
    for _ in range(200):
        world.step()
        gaps.append(position(world, b)[0] - position(world, a)[0])
        speeds.append(velocity(world, b)[0] - velocity(world, a)[0])
    # Restitution: relative speed after = e times before, from the first frame on, never reversed again.
    np.testing.assert_allclose(speeds, 0.2 * e, atol=1e-15)
    assert (np.diff(gaps) >= 0).all()
    assert gaps[-1] >= (0.7 + 0.2 * e * 200 * DT if e else 0.99) - 1e-12  # e = 0: pushed out up to the slop
    kept.check()


def test_kinematic_bodies_pass_through_each_other_and_through_walls():
    """Neither reacts: contacts are reported, without response."""
    world = make_world()
    a, b = ball(world, -1, 1, kind="kinematic"), ball(world, 1, -1, kind="kinematic")
    wall = box(world, 0, kind="static")
    run(world, 90)
    for entity, speed in ((a, 1), (b, -1), (wall, 0)):
        assert velocity(world, entity)[0] == speed
    assert position(world, a)[0] == pytest.approx(0.5, abs=1e-13)
    assert len(world.contacts.of(wall)) == 2


@both_dimensions
@integrators
def test_impact_time_on_the_path_of_the_integrator(d, integrator):
    """sqrt(2 h / g) where the path is the parabola; with Euler to O(dt): half a step of lag, less than one of chord."""
    world = make_world(d, gravity=9.81, integrator=integrator)
    floor(world)
    ball(world, (0, 4.9 + 0.5, 0)[:d], restitution=1.0)
    impacts = []
    world.on("impact", impacts.append)
    run(world, 75)
    (hit,) = impacts
    found, exact = hit.step * DT + hit.time_of_impact, math.sqrt(2 * 4.9 / 9.81)
    assert found == pytest.approx(exact, abs=1e-12 if "euler" not in integrator else DT)
    np.testing.assert_allclose(hit.point[1], 0, atol=1e-13)
    assert abs(hit.normal[1]) == 1


@pytest.mark.slow
@pytest.mark.parametrize(("integrator", "maker"), list(zip(INTEGRATORS, (ball, box, ball, box, ball), strict=True)))
def test_bouncing_ball_comes_to_rest(maker, integrator):
    """Impacts end at T0 (1+e)/(1-e) (Zeno), less 2 * 2 dt / (1-e) below the threshold; then rest, without sinking."""
    h, g = np.repeat(np.linspace(0.1, 8.0, 25), 10), 9.81
    e = np.tile(np.arange(10) / 10, 25)
    world = make_world(gravity=g, integrator=integrator)
    floor(world)
    balls = [maker(world, (1.5 * k, h[k] + 0.5), restitution=e[k]) for k in range(len(h))]
    over = np.sqrt(2 * h / g) * (1 + e) / (1 - e)
    rows = [world.bodies.row_of(b) for b in balls]
    rest, lowest = np.zeros(len(balls)), 0.0
    for step in range(1, int(over.max() / DT) + 60):
        world.step()
        heights = world.bodies.position[rows, 1] - 0.5
        lowest = min(lowest, heights.min())
        rest[(np.abs(world.bodies.linear_velocity[rows]) > 1e-9).any(axis=1)] = step * DT  # it moved: not at rest
        if step % 60 == 0:
            before = heights
    assert lowest > -0.005  # the slop
    left_out = (5 if integrator in LAG else 4) / (1 - e) * DT
    assert (rest >= over - left_out - 2 * DT).all()
    assert (rest <= over + 2 * DT).all()
    np.testing.assert_allclose(heights, before, rtol=0, atol=1e-12)  # no drift
    assert (np.abs(heights) < 0.005).all()


def test_a_floor_takes_any_number_of_impacts():
    """The cap on impacts is per moving body: 200 balls bounce on one floor within one step."""
    world = make_world(gravity=9.81)
    floor(world)
    balls = [ball(world, (1.5 * k, 0.55), (0, -10), restitution=0.5) for k in range(200)]
    world.step()
    assert len(world.contacts.impacts) == 200
    assert world.stats().counters["capped_impacts"] == 0
    assert all(velocity(world, b)[1] > 4.5 for b in balls)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("integrator", "rate"), [*((name, 60) for name in INTEGRATORS), *((name, 240) for name in (*LAG, "yoshida4"))]
)
def test_no_energy_drift_of_a_bouncing_ball(integrator, rate):
    """The energy that the method keeps in flight does not drift: 1e-10 on parabolas, Euler's cycle within 2 %."""
    g, dt = 9.81, 1 / rate
    heights = np.array([4.9, 3.1, 2.7, 6.3, 8.8])
    world = make_world(gravity=g, dt=dt, integrator=integrator)
    floor(world)
    balls = [ball(world, (2.0 * k, h + 0.5), restitution=1.0) for k, h in enumerate(heights)]
    rows = [world.bodies.row_of(b) for b in balls]
    lag = LAG.get(integrator, 0.0)
    energies, hits = [], 0
    seconds = 60 if rate == 60 else 25
    for _ in range(seconds * rate):
        world.step()
        hits += len(world.contacts.impacts)
        v = world.bodies.linear_velocity[rows, 1]
        energies.append((v * v / 2 + g * (world.bodies.position[rows, 1] - 0.5) + lag * g * dt * v) / (g * heights))
    energies = np.array(energies)
    expected = (seconds / (2 * np.sqrt(2 * heights / g))).sum()
    assert hits == pytest.approx(expected, abs=len(balls) * 1.5)
    if lag == 0:
        np.testing.assert_allclose(energies, 1, atol=1e-10)
        return
    tenth = len(energies) // 10
    drift = energies[-tenth:].mean(axis=0) - energies[:tenth].mean(axis=0)
    assert np.abs(drift).max() < 0.02
    impact_speed = np.sqrt(2 * g * heights)
    assert (np.abs(energies - 1).max(axis=0) < 2 * impact_speed * dt / heights).all()


@pytest.mark.parametrize(
    ("rule", "mixed"), [("max", 0.9), ("min", 0.4), ("average", 0.65), ("multiply", 0.36), ("geometric_mean", 0.6)]
)
def test_restitution_mixing(rule, mixed):
    """Relative speed after = mixed(e1, e2) times before, whichever has which."""
    for e1, e2 in ((0.4, 0.9), (0.9, 0.4)):
        world = make_world(**({} if rule == "max" else {"restitution_mixing": rule}))  # the default
        a, b = ball(world, -0.51, 1.0, restitution=e1), ball(world, 0.51, -1.0, restitution=e2)
        run(world, 3)
        assert velocity(world, b)[0] - velocity(world, a)[0] == pytest.approx(2 * mixed, abs=8 * EPS)


@pytest.mark.parametrize(("factor", "bounces"), [(1.9, False), (2.1, True)])
def test_default_threshold_is_twice_gravitys_share(factor, bounces):
    """2 |a| dt: in a contact at rest gravity alone creates an approach of |a| dt in every step."""
    world = make_world(gravity=9.81)
    floor(world)
    share = 9.81 * DT
    a = ball(world, (0.0, 0.5), (0.0, -(factor - 1) * share), restitution=1.0)  # the step adds g dt once
    world.step()
    assert len(world.contacts.impacts) == bounces
    assert (velocity(world, a)[1] > 0) == bounces


def test_a_ball_whose_step_ends_in_touch_bounces_all_the_same():
    """30 steps of 5/60 lead from x = 0 to a touch at exactly 2.5 up to rounding: the bounce is in the next step."""
    world = make_world()
    box(world, (3.0, 4.0), half=(0.0, 2.0), kind="static", restitution=1.0)
    for number in range(40):
        ball(world, (-10.0 * number, 400.0 + number), 0.0)  # others change the rounding, not the result
    mover = ball(world, (0.0, 4.0), (5.0, 0.0))
    run(world, 40)
    assert velocity(world, mover)[0] == pytest.approx(-5.0, rel=1e-12)
    assert position(world, mover)[0] == pytest.approx(5.0 - 40 * 5 / 60, rel=1e-12)


@both_dimensions
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("closing", [1e-18, 1e-12, 1e-6])
def test_a_flat_floor_changes_no_speed_along_it(closing, mode, d):
    """However slowly what slides on it comes nearer: v = v0 + g t along it. 1e-13 m at 1e-18 m/s take a day."""
    world = make_world(d, collision=mode, gravity=(7, -0.05, 0)[:d], integrator="velocity_verlet")
    floor(world)
    slider = ball(world, (0, 0.5, 0)[:d], (-1, -closing, 0)[:d], restitution=0.4)
    for k in range(1, 4):
        world.step()
        np.testing.assert_allclose(velocity(world, slider), (-1 + 7 * k * DT, 0, 0)[:d], atol=1e-3)
        assert velocity(world, slider)[0] == pytest.approx(-1 + 7 * k * DT, abs=1e-14)


@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "velocity_verlet"])
def test_a_static_body_does_not_inherit_the_motion_of_a_deleted_one(integrator):
    """A body is deleted and a static one gets its row: an elastic ball still bounces off it at full speed."""
    world = make_world(integrator=integrator)
    mover = ball(world, 0.0, 1.0, restitution=1.0)
    gone = ball(world, (0.0, 50.0), (-100.0, 0.0), restitution=1.0)
    ball(world, 1.03, kind="static", restitution=1.0)
    world.step()
    world.delete_entity(gone)
    world.step()
    assert velocity(world, mover)[0] == pytest.approx(-1.0, rel=1e-12)

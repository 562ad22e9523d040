"""Section C of the accuracy list at true impact times: ends of the range, barely touching, equal bits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_modes import MODES, along, bullet, each_mode, each_sweep, mode_world, positions, strikes, velocities
from helpers_pairwise import pairwise
from worlds import EPS, Conserved, ball, box, floor, make_world, mostly_2d, position, run, velocity

from carom.components import RigidBody, Transform

DT, G = 1 / 60, 9.81
every_mode = pytest.mark.parametrize("mode", ["discrete", *MODES])


@mostly_2d
@each_sweep
def test_c4_sizes_from_1e_minus_9_to_1e9(mode, d):
    """A speck of 1e-9 onto a moon of 1e9 within a step, and two specks far from it: time and exchange to 1e-9."""
    world = mode_world(mode, d)
    moon = bullet(world, along(d, 0.0, -1e9), 0.0, radius=1e9, mass=1e27, restitution=1.0)
    speck = bullet(world, along(d, 0.0, 2000.0), along(d, 0.0, -2.4e5), radius=1e-9, mass=1e-27)
    hits = strikes(world, 1)
    assert (hits.entity_a.tolist(), hits.entity_b.tolist()) == ([moon], [speck])
    assert hits.time[0] == pytest.approx(2000 / 2.4e5, rel=1e-9)
    assert velocity(world, speck)[1] == pytest.approx(2.4e5, rel=1e-9)
    assert abs(velocity(world, moon)[1]) < 1e-40
    assert position(world, speck)[1] == pytest.approx(2000.0, rel=1e-9)

    world = mode_world(mode, d)
    ball(world, along(d, 0.0, -2e9), radius=1e9, kind="static")
    a = bullet(world, 0.0, 1e-6, radius=1e-9, mass=2.0, restitution=1.0)
    b = bullet(world, 1e-8, -1e-6, radius=1e-9, mass=1.0)
    hits = strikes(world, 1)
    assert hits.time[0] == pytest.approx(8e-9 / 2e-6, rel=1e-9)
    np.testing.assert_allclose(velocities(world, [a, b])[:, 0], [-1e-6 / 3, 5e-6 / 3], rtol=1e-9)


@pytest.mark.slow
@mostly_2d
@each_mode
@pytest.mark.parametrize("offset", [0.0, 1e5, 1e7, 1e9, 1e12, 1e15])
def test_c6_head_on_far_from_the_origin(mode, d, offset):
    """One metre per step, an ulp of 1e15 is 0.125: an exact exchange, positions to an ulp per step and impact."""
    world = mode_world(mode, d, dt=1 / 64)
    place = np.full(d, offset)
    a = ball(world, place - along(d, 3.5), 64.0, restitution=1.0)
    b = ball(world, place + along(d, 3.5), -64.0, restitution=1.0)
    hits = strikes(world, 8)
    assert len(hits) == 1
    np.testing.assert_array_equal(velocities(world, [a, b]), [along(d, -64.0), along(d, 64.0)])
    ulp = np.spacing(offset + 10.0)
    assert hits.time[0] == pytest.approx(3 / 64, abs=4 * ulp / 64)
    expected = place[0] + np.array((-3.5 + 3 - 5, 3.5 - 3 + 5))
    np.testing.assert_allclose(positions(world, [a, b])[:, 0], expected, rtol=0, atol=10 * ulp)


@pytest.mark.slow
@each_mode
@pytest.mark.parametrize("integrator", ["velocity_verlet", "rk4"])
@pytest.mark.parametrize(("dt", "steps"), [(1e-9, 100), (1e-6, 100), (0.25, 80), (1.0, 20), (10.0, 2)])
def test_c7_steps_from_1e_minus_9_to_10(mode, integrator, dt, steps):
    """B1 with a floor, e = 1, threshold 0: the arc, folded at the floor by its period 2 u / g, at any step."""
    world = mode_world(mode, gravity=G, dt=dt, integrator=integrator, restitution_threshold=0.0)
    floor(world)
    thrown = ball(world, (0.0, 0.1 + 3.0), (1.0, 4.0), radius=0.1, restitution=1.0)
    run(world, steps)
    u = math.sqrt(4.0**2 + 2 * G * 3.0)
    since = (4.0 + u) / G  # from the throw to the first impact
    late = (steps * dt + (2 * u / G - since)) % (2 * u / G)  # equivalent time for a start at the floor
    assert velocity(world, thrown)[1] == pytest.approx(u - G * late, abs=1e-10)
    assert position(world, thrown)[1] - 0.1 == pytest.approx(u * late - G * late**2 / 2, abs=1e-10)
    assert position(world, thrown)[0] == pytest.approx(steps * dt, rel=1e-13)


@mostly_2d
@pytest.mark.parametrize(
    ("mode", "first", "second", "speed", "sign"),
    pairwise(("discrete", *MODES), (ball, box), (ball, box), (1.0, 1000.0), (0.0, 1.0, -1.0)),
)
def test_c14_touching_exactly(mode, d, first, second, speed, sign):
    """At rest or separating no impulse, approaching one impact at the start of the step, without repetition."""
    world, impacts = mode_world(mode, d), int(sign < 0.0)
    speed = 1.0 if mode == "discrete" else speed
    a = first(world, 0.0, restitution=1.0)
    b = second(world, 1.0, sign * speed, restitution=1.0)
    kept = Conserved(world)
    hits = strikes(world, 10)
    assert hits.time.tolist() == [0.0] * impacts
    assert velocity(world, b)[0] - velocity(world, a)[0] == abs(sign * speed)
    assert (world.contacts.normal_impulse == 0).all()
    kept.check()


@mostly_2d
@each_mode
@pytest.mark.parametrize("beside", [-1e-6, -1e-9, -1e-12, -1e-16, 1e-16, 1e-12, 1e-9])
def test_c15_grazing(mode, d, beside):
    """b = sigma (1 + beside): deflection 2 acos(b / sigma); within 1e-12 hit and miss are right, a hit is a touch."""
    world = mode_world(mode, d)
    ball(world, along(d), kind="static", restitution=1.0)
    impact_parameter = 1.0 + beside
    mover = bullet(world, along(d, -3.0, impact_parameter), 300.0, radius=0.5, restitution=1.0)
    hits = strikes(world, 1)
    v = velocity(world, mover)
    assert np.hypot(*v[:2]) == pytest.approx(300.0, rel=4 * EPS)
    turn = math.atan2(v[1], v[0])
    expected = 2 * math.acos(min(impact_parameter, 1.0))
    if beside <= -1e-12:
        assert len(hits) == 1
        assert turn == pytest.approx(expected, rel=1e-12 + 20 * EPS / abs(beside))
    else:
        assert abs(turn) < 2e-6 if abs(beside) < 1e-9 else turn == 0
    if len(hits):
        centre = np.array(along(d, -3.0 + 300 * hits.time[0], impact_parameter))
        assert np.linalg.norm(centre) == pytest.approx(1.0, abs=1e-9)


def brawl(mode, *, length=1.0, time=1.0, mass=1.0):
    """(positions, velocities, impacts) of 40 bodies between thin walls, in other units."""
    world = mode_world(mode, 2, np.array((0.0, -G)) * length / time**2, dt=DT * time)
    walls = [((0.1, -0.5), (50.0, 0.5), 0.2), *(((x, 5.0), (0.05, 50.0), 0.9) for x in (-9.0, 9.0))]
    for centre, half, e in walls:
        box(world, np.multiply(centre, length), half=np.multiply(half, length), kind="static", restitution=e)
    rng, entities = np.random.default_rng(9), []
    for k in range(40):
        place, speed = np.array((rng.uniform(-6, 6), 0.6 + 0.5 * k)), rng.normal(size=2)
        speed *= 200.0 if k % 4 == 0 and mode != "discrete" else 1.0
        weight, e, size = rng.uniform(0.5, 2), (0.0, 0.5, 1.0)[k % 3], rng.uniform(0.1, 0.4, 2) * length
        shape = {"radius": size[0]} if k % 2 else {"half": size}
        make = ball if k % 2 else box
        entities.append(make(world, place * length, speed * length / time, mass=weight * mass, restitution=e, **shape))
    hits = strikes(world, 40)
    return positions(world, entities), velocities(world, entities), hits


@pytest.mark.slow
@every_mode
@pytest.mark.parametrize(
    ("length", "time", "mass"),
    [(2.0**20, 1, 1), (2.0**-20, 1, 1), (1, 2.0**-9, 1), (1, 1, 2.0**40), (2.0**-30, 2.0**7, 2.0**-50)],
)
def test_c24_other_units(mode, length, time, mass):
    """Lengths, times and masses in powers of two: bitwise the scaled state and impacts: no tolerance is absolute."""
    x, v, hits = brawl(mode)
    assert len(hits) > (8 if mode == "discrete" else 80)
    found = brawl(mode, length=length, time=time, mass=mass)
    np.testing.assert_array_equal(found[0], x * length)
    np.testing.assert_array_equal(found[1], v * length / time)
    np.testing.assert_array_equal(found[2].time, hits.time * time)
    np.testing.assert_array_equal(found[2].impulse, hits.impulse * mass * length / time)


@every_mode
def test_empty_and_lonely_worlds(mode):
    """C25: no bodies, none that impacts can move, one, and one without a collider."""
    world = make_world(gravity=G, collision=mode)
    run(world, 3)
    cart = ball(world, (0.0, 50.0), 600.0, kind="kinematic")
    run(world, 3)
    assert position(world, cart)[0] == pytest.approx(30.0, rel=1e-14)
    one = ball(world, (0.0, 5.0))
    bare = world.create_entity(Transform((0.0, 5.0)), RigidBody())
    run(world, 3)
    assert velocity(world, one)[1] == velocity(world, bare)[1] == pytest.approx(-G * 3 / 60)
    assert len(world.contacts) == len(world.contacts.impacts) == 0

"""Dry friction: at most mu times the normal force, against the sliding; below that no sliding."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_rest import G, tower
from worlds import Conserved, ball, both_dimensions, box, floor, make_world, position, run, velocity

from carom.components import AABBCollider, RigidBody, Transform

DT = 1 / 60
makers = pytest.mark.parametrize("maker", [box, ball])


def along(d, value):
    """In 3D along a diagonal of the floor: (0.6, 0.8)."""
    return (value, 0.0) if d == 2 else (0.6 * value, 0.0, 0.8 * value)


@both_dimensions
@makers
@pytest.mark.parametrize("mu", [0.2, 0.6])
def test_sliding_slows_by_mu_g_and_stops(d, maker, mu):
    """v = v0 - mu g t to rounding, then exactly 0; the way is v0^2 / (2 mu g), up to the v0 dt of sampling."""
    world = make_world(d, gravity=G)
    floor(world, friction=mu)
    body = maker(world, (0, 0.5, 0)[:d], along(d, 4.0))
    for step in range(1, 151):
        world.step()
        expected = along(d, max(0.0, 4.0 - mu * G * step * DT))
        np.testing.assert_allclose(velocity(world, body), expected, rtol=0, atol=1e-12)
    way = position(world, body) - (0, position(world, body)[1], 0)[:d]
    np.testing.assert_allclose(way, along(d, 16 / (2 * mu * G)), rtol=0, atol=0.25 * 4.0 * DT)


@pytest.mark.parametrize(
    ("d", "direction"), [(2, (1, 0)), (3, (1, 0, 0)), (3, (0.6, 0, 0.8)), (3, (0.5**0.5, 0, 0.5**0.5))]
)
@pytest.mark.parametrize("force", [39.0, 150.0])
def test_a_pushed_box(d, direction, force):
    """A4: M = 10, mu = 0.4: a = (F - mu M g) / M along any direction (the cone is round); 39 N do not move it."""
    world = make_world(d, gravity=G)
    floor(world, friction=0.4)
    pushed = RigidBody(10.0, constant_force=np.multiply(direction, force))
    body = world.create_entity(Transform((0, 0.5, 0)[:d]), pushed, AABBCollider((0.5,) * d, friction=0.4))
    run(world, 10)
    before = velocity(world, body)
    run(world, 60)
    expected = max(0.0, force - 0.4 * 10 * G) / 10 * np.array(direction)
    np.testing.assert_allclose(velocity(world, body) - before, expected, rtol=0, atol=1e-9)
    if force < 0.4 * 10 * G:
        assert np.abs(np.delete(position(world, body), 1)).max() < 1e-4  # it stays where it is


@pytest.mark.parametrize(
    ("first", "second", "rule", "mixed"),
    [
        (0.9, 0.4, "geometric_mean", 0.6), (0.9, 0.4, "average", 0.65), (0.9, 0.4, "min", 0.4), (0.9, 0.4, "max", 0.9),
        (0.9, 0.4, "multiply", 0.36), (None, 0.4, "multiply", 0.16), (0.4, None, "min", 0.4), (None, None, "max", 0.0),
        (0.0, None, "max", 0.0),
    ],
)  # fmt: skip
def test_mixing(first, second, rule, mixed):
    """None uses the other body's value, then the rule applies (multiply: its square); 0 if both are None."""
    world = make_world(gravity=G, friction_mixing=rule)
    floor(world, friction=first)
    body = box(world, (0, 0.5), (5.0, 0), friction=second)
    run(world, 30)
    assert velocity(world, body)[0] == pytest.approx(5.0 - mixed * G * 30 * DT, abs=1e-9)


@both_dimensions
@pytest.mark.parametrize("e", [0.5, 1.0])
@pytest.mark.parametrize("mu", [0.1, 0.3, 0.5, 2.0])
def test_a_bounce_with_friction(d, mu, e):
    """The tangential impulse stops the sliding or is mu (1 + e) m u, whichever is less."""
    world = make_world(d)
    floor(world, friction=mu)
    start = np.array(along(d, 3.0))
    start[1] = -4.0
    body = ball(world, (0, 1.0, 0)[:d], start, restitution=e)
    run(world, 60)
    expected = np.array(along(d, max(0.0, 3.0 - mu * (1 + e) * 4.0)))
    expected[1] = e * 4.0
    np.testing.assert_allclose(velocity(world, body), expected, rtol=0, atol=1e-12)


def test_between_two_bodies_it_keeps_momentum():
    """A box slides on a plank on a smooth floor: mu m g in both directions, until both move together."""
    world = make_world(gravity=G)
    floor(world, friction=0.0)  # None would use the plank's value
    plank = box(world, (0, 0.5), half=(5, 0.5), mass=3.0, friction=0.3)
    crate = box(world, (-3, 1.5), (4.0, 0), friction=0.3)
    kept = Conserved(world)
    for step in range(1, 121):
        world.step()
        slows = min(0.3 * G * step * DT, 3.0)  # common speed 1, so the crate loses 3
        np.testing.assert_allclose(velocity(world, crate)[0], 4.0 - slows, rtol=0, atol=1e-5)  # as the weight settles
        np.testing.assert_allclose(velocity(world, plank)[0], slows / 3, rtol=0, atol=1e-5)
        assert world.momentum()[0] == pytest.approx(4.0, abs=1e-12)
    assert world.kinetic_energy() < kept.energy


@both_dimensions
def test_a_belt_carries(d):
    """A kinematic floor at 2 m/s accelerates a box on it with mu g, up to its own speed."""
    world = make_world(d, gravity=G)
    box(world, (0, -0.5, 0)[:d], along(d, 2.0), half=(50, 0.5, 50)[:d], kind="kinematic", friction=0.5)
    body = box(world, (0, 0.5, 0)[:d])
    for step in range(1, 121):
        world.step()
        expected = along(d, min(2.0, 0.5 * G * step * DT))
        np.testing.assert_allclose(velocity(world, body), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("speed", [(0, 1.0), (0, -1.0), (3.0, 2.0), (0, 30.0)])
def test_a_platform_lifts_and_lowers(speed):
    """Two boxes on it stay in place, up to the compliance of the contact."""
    world = make_world(gravity=G)
    platform = box(world, (0, -0.5), speed, half=(5, 0.5), kind="kinematic", friction=0.9)
    ids = [box(world, (0, y), speed, friction=0.9) for y in (0.5, 1.5)]
    for _ in range(240):
        world.step()
        for k, entity in enumerate(ids, 1):
            offset = position(world, entity) - position(world, platform)
            np.testing.assert_allclose(offset, (0, k), rtol=0, atol=3e-4)
    np.testing.assert_allclose([velocity(world, e) for e in ids], [speed] * 2, rtol=0, atol=1e-9)


def test_a_kinematic_box_pushes_a_row():
    """Five boxes with mu = 0.5 in front of it: all move at its speed."""
    world = make_world(gravity=G)
    floor(world, friction=0.5)
    pusher = box(world, (-3, 0.5), 2.0, kind="kinematic")
    ids = [box(world, (float(k), 0.5)) for k in range(5)]
    run(world, 300)
    np.testing.assert_allclose([velocity(world, e) for e in ids], [(2.0, 0.0)] * 5, rtol=0, atol=1e-9)
    gaps = np.diff([position(world, e)[0] for e in (pusher, *ids)])
    np.testing.assert_allclose(gaps, 1.0, rtol=0, atol=1e-3)


# -- seams ---------------------------------------------------------------------------------------


@both_dimensions
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_boxes_slide_over_seams(d, e):
    """A frictionless floor of single tiles: same velocity, no impact."""
    world = make_world(d, gravity=G)
    rows = (0.0,) if d == 2 else (-0.7, 0.3, 1.3)
    for x in range(45):
        for z in rows:
            box(world, (x, -0.5, z)[:d], kind="static")
    ids = [box(world, (2 + 6 * k, 0.4, 0)[:d], v, half=0.4, restitution=e) for k, v in enumerate((1.0, 3.0, 6.0))]
    run(world, 240)
    for entity, speed in zip(ids, (1.0, 3.0, 6.0), strict=True):
        np.testing.assert_allclose(velocity(world, entity), (speed, 0, 0)[:d], rtol=0, atol=1e-12)
    assert not len(world.contacts.impacts)


@pytest.mark.parametrize("e", [0.0, 0.5])
def test_a_box_falls_along_a_wall_of_tiles(e):
    """It is pressed against the wall, and falls with g."""
    world = make_world(gravity=(5.0, -G))
    for y in range(45):
        box(world, (0.5, -float(y)), kind="static")
    body = box(world, (-0.4, 0.0), half=0.4, restitution=e)
    run(world, 120)
    np.testing.assert_allclose(velocity(world, body), (0.0, -2 * G), rtol=0, atol=1e-9)


def test_friction_holds_a_tower_on_a_shaken_floor():
    """A floor oscillates with at most half of mu g: the tower moves with it."""
    world = make_world(gravity=G)
    ground = box(world, (0, -0.5), half=(20, 0.5), kind="kinematic", friction=0.6)
    ids = tower(world, 3, friction=0.6)
    body = world.component_for_entity(ground, RigidBody)
    for step in range(300):
        body.linear_velocity = (0.3 * G / 5 * np.sin(5 * step * DT), 0)
        world.step()
        apart = [position(world, e)[0] - position(world, ground)[0] for e in ids]
        assert np.abs(apart).max() < 0.01

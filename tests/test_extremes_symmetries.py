"""Section C of the accuracy list: the same scene repeated, permuted, mirrored, seen in motion, in other units."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_extremes import DT
from worlds import ball, box, make_world, run

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform

# -- symmetries ----------------------------------------------------------------------------------


def brawl(gravity=9.81, turn=lambda v: v, length=1.0, time=1.0, mass=1.0, shuffle=False):
    """40 balls and boxes of several e and mass that bounce and rest on a floor and each other; their states after 1 s.

    turn: a symmetry of the plane; length, time, mass: units; shuffle: another history of the same ids.
    """
    world = make_world(gravity=turn(np.array([0.0, -gravity * length / time**2])), dt=DT * time)
    rng = np.random.default_rng(9)
    half = np.abs(turn(np.array([50.0, 0.5]))) * length
    world.create_entity(Transform(turn(np.array([0.1, -0.5])) * length), AABBCollider(half, restitution=0.2))
    entities, parts = [], []
    for k in range(40):
        place, speed = np.array([rng.uniform(-4, 4), 0.6 + 0.5 * k]), rng.normal(size=2)
        weight, e, size = rng.uniform(0.5, 2), (0.0, 0.5, 1.0)[k % 3], rng.uniform(0.2, 0.5, 2)
        if k % 2:
            collider = SphereCollider(size[0] * length, restitution=e)
        else:
            collider = AABBCollider(np.abs(turn(size)) * length, restitution=e)
        body = RigidBody(weight * mass, turn(speed) * length / time)
        parts.append((Transform(turn(place) * length), body, collider))
        entities.append(world.create_entity(*(parts[-1] if not shuffle else ())))
    if shuffle:
        for k in rng.permutation(40):
            for part in parts[k]:
                world.add_component(entities[k], part)
            assert world.bodies.row_of(entities[k]) >= 0  # adopted one by one, in this order
        for k in rng.permutation(40)[:15]:
            world.remove_component(entities[k], RigidBody)
            assert world.bodies.row_of(entities[k]) >= 0  # among the static ones for a while
            world.add_component(entities[k], parts[k][1].copy())
    run(world, 60)
    rows = [world.bodies.row_of(entity) for entity in entities]
    impacts = world.stats().counters["impacts"]
    return world.bodies.position[rows].copy(), world.bodies.linear_velocity[rows].copy(), impacts


def test_c22_repeated_and_permuted():
    """The same bits when repeated, and when the same ids were created in another order."""
    x, v, impacts = brawl()
    assert impacts > 30
    for shuffle in (False, True):
        again = brawl(shuffle=shuffle)
        np.testing.assert_array_equal(again[0], x)
        np.testing.assert_array_equal(again[1], v)


@pytest.mark.parametrize(
    "turn",
    [lambda v: v[::-1].copy(), lambda v: v * [-1, 1], lambda v: v * [1, -1]],
    ids=["swap", "mirror x", "mirror y"],
)
def test_c22_mirrored(turn):
    """2D axes swapped or mirrored: the same bits, mirrored."""
    x, v, *_ = brawl()
    found = brawl(turn=turn)
    np.testing.assert_array_equal(found[0], np.array([turn(row) for row in x]))
    np.testing.assert_array_equal(found[1], np.array([turn(row) for row in v]))


def test_c23_galilean():
    """A velocity added to all: relative motion is the same to 1e-9 (rounding of 1e3 m, amplified by 50 impacts)."""

    def cluster(drift):
        world = make_world()
        rng = np.random.default_rng(9)
        for k in range(36):
            place = 1.6 * np.array([k % 6, k // 6]) + rng.uniform(-0.1, 0.1, 2)
            speed = rng.normal(size=2) - 0.3 * (place - 4.0)
            (box, ball)[k % 2](world, place, speed + drift, restitution=1.0, mass=rng.uniform(0.5, 2.0))
        run(world, 60)
        assert world.stats().counters["impacts"] > 50
        return world.bodies.position - drift * 60 * DT, world.bodies.linear_velocity - drift

    for still, drifting in zip(cluster(np.zeros(2)), cluster(np.array([1e3, -7e2])), strict=True):
        np.testing.assert_allclose(drifting, still, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("length", "time", "mass"),
    [(2.0**20, 1, 1), (2.0**-20, 1, 1), (1, 2.0**-9, 1), (1, 1, 2.0**40), (2.0**-30, 2.0**7, 2.0**-50)],
)
def test_c24_other_units(length, time, mass):
    """Lengths, times and masses in powers of two: bitwise the scaled state, because no tolerance is absolute."""
    x, v, *_ = brawl()
    found = brawl(length=length, time=time, mass=mass)
    np.testing.assert_array_equal(found[0], x * length)
    np.testing.assert_array_equal(found[1], v * length / time)

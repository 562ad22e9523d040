"""Impulses of contacts at rest are those of the complementarity problem of statics, as a library solves it.

Without friction, e = 0, islands of up to 30 contacts. Where these impulses are the only ones that hold, each contact
has its own; elsewhere those of each body hold it.
"""

from __future__ import annotations

import numpy as np
import pytest
from oracles.resting_contacts import solve, touches
from worlds import ball, both_dimensions, box, floor, make_world, run

G = 9.81
AGREED = 1e-6  # of the weight of all bodies in a step: contacts are soft, and their impulses settle


def check(world, walls, bodies, determinate=True):
    """``walls``: (entity, half extents); ``bodies``: (entity, radius or half extents, mass)."""
    place = {entity: world.bodies.position[world.bodies.row_of(entity)].copy() for entity, *_ in (*walls, *bodies)}
    entities = list(place)
    inverse = np.array([0.0] * len(walls) + [1.0 / mass for *_, mass in bodies])
    gained = np.zeros((len(entities), world.dimensions))
    gained[len(walls) :, 1] = -G * world.settings.dt
    contacts = touches([(place[entity], half) for entity, half, *_ in (*walls, *bodies)])
    contacts = [contact for contact in contacts if inverse[contact[0]] + inverse[contact[1]] > 0.0]
    assert len(bodies) <= len(contacts) <= 30
    expected, left, only = solve(contacts, inverse, gained)
    weight = G * world.settings.dt * sum(mass for *_, mass in bodies)
    assert np.abs(left[len(walls) :]).max() < AGREED * G * world.settings.dt  # nothing falls, as the library sees it
    found, held = np.zeros(len(contacts)), np.zeros_like(gained)
    rows = world.contacts
    known = {(a, b): p for a, b, p in zip(rows.entity_a, rows.entity_b, rows.normal_impulse, strict=True)}
    for k, (a, b, normal) in enumerate(contacts):
        one, two = entities[a], entities[b]
        found[k] = known.pop((min(one, two), max(one, two)), 0.0)
        held[a] -= inverse[a] * found[k] * normal
        held[b] += inverse[b] * found[k] * normal
    assert not any(known.values())
    assert (found >= 0.0).all()
    masses = np.array([mass for *_, mass in bodies])
    net = masses[:, None] * (held + gained)[len(walls) :]
    np.testing.assert_allclose(net, 0.0, rtol=0, atol=AGREED * weight)
    assert only == determinate
    if only:
        np.testing.assert_allclose(found, expected, rtol=0, atol=AGREED * weight)


@both_dimensions
@pytest.mark.parametrize("maker", [ball, box])
@pytest.mark.parametrize("masses", [(1,) * 25, (3, 1, 0.5, 2, 7), (1, 100), (1, 1, 1, 30)])
def test_stacks(d, maker, masses):
    world = make_world(d, G)
    walls = [(floor(world), np.array((50.0, 0.5, 50.0)[:d]))]
    half = 0.5 if maker is ball else np.full(d, 0.5)
    place = [(0.0, 0.5 + k, 0.0)[:d] for k in range(len(masses))]
    bodies = [(maker(world, at, mass=mass), half, mass) for at, mass in zip(place, masses, strict=True)]
    run(world, 900)
    assert (np.delete(world.bodies.dynamic.position, 1, axis=1) == 0.0).all()
    check(world, walls, bodies)
    world.close()


def test_a_pyramid_of_boxes():
    """Two contacts below each box and more ways than one to share its load."""
    world = make_world(2, G)
    walls, bodies = [(floor(world), np.array((50.0, 0.5)))], []
    for row in range(5):
        for k in range(5 - row):
            at = (1.02 * (k + 0.5 * row), 0.5 + row)
            bodies.append((box(world, at), np.full(2, 0.5), 1.0))
    run(world, 900)
    check(world, walls, bodies, determinate=False)
    world.close()


def bin_of(world, wide, high):
    """A floor at height 0 and walls at 0 and ``wide`` along each axis that is not vertical: (entity, half extents)."""
    d, made = world.dimensions, []
    half = np.full(d, 0.5 * wide + 1.0)
    half[1] = 0.5
    made.append((box(world, np.where(np.arange(d) == 1, -0.5, 0.5 * wide), half=half, kind="static"), half))
    for axis in (0, 2)[: d - 1]:
        for side in (-0.5, wide + 0.5):
            place, half = np.full(d, 0.5 * wide), np.full(d, 0.5 * wide + 1.0)
            place[1], half[1], place[axis], half[axis] = 0.5 * high, 0.5 * high, side, 0.5
            made.append((box(world, place, half=half, kind="static"), half))
    return made


@pytest.mark.parametrize("seed", range(1, 7))
@both_dimensions
def test_balls_in_a_bin(d, seed):
    """Of different sizes and masses: no contact more than it takes, so each impulse is the only one."""
    random = np.random.default_rng(seed)
    world = make_world(d, G)
    walls, bodies = bin_of(world, 2.2, 12.0), []
    for k in range(10 if d == 2 else 6):
        radius, mass = random.uniform(0.3, 0.6), 10.0 ** random.uniform(-0.5, 0.5)
        at = random.uniform(0.65, 1.55, d)
        at[1] = 0.7 + 1.25 * k
        bodies.append((ball(world, at, radius=radius, mass=mass), radius, mass))
    run(world, 1800)
    assert np.abs(world.bodies.dynamic.linear_velocity).max() < 1e-6
    check(world, walls, bodies)
    world.close()

"""Layers in the broad phase: what they keep apart is not searched, and nothing that they let meet is lost."""

import numpy as np
import pytest

from carom import Physics, RigidBody, Settings, SphereCollider, Transform, World

RADIUS = 0.1
WALL, DEBRIS, PLAYER, ENEMY = 1, 2, 4, 8
KINDS = {  # (layer, mask) of what moves
    "debris alone": [(DEBRIS, WALL)],
    "layers of their own": [(WALL, DEBRIS)],
    "debris of two kinds": [(DEBRIS, WALL), (ENEMY, WALL | PLAYER)],
    "debris and few others": [(DEBRIS, WALL | PLAYER)] * 30 + [(PLAYER, -1), (ENEMY, PLAYER | WALL)],
    "masks in one direction": [(DEBRIS, WALL | ENEMY), (ENEMY, WALL)],
    "many kinds": [(1 << k, 1 << (k + 1) % 12 | 1 << (k - 1) % 12 | 1) for k in range(12)],
    "all": [(DEBRIS, -1)],
}


def touching(place, layer, mask, moving):
    """The pairs of rows that overlap and that layers let meet, one of them moving, by looking at each."""
    found = set()
    for i in range(moving):
        near = np.linalg.norm(place - place[i], axis=1) < 2 * RADIUS
        meet = (layer & mask[i] != 0) & (mask & layer[i] != 0)
        found |= {(i, k) for k in np.flatnonzero(near & meet) if k > i}
    return found


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("kinds", KINDS.values(), ids=KINDS)
@pytest.mark.parametrize(("moving", "static", "extent"), [(60, 20, 2), (300, 20, 3), (300, 400, 3), (600, 90, 0.1)])
def test_all_that_layers_let_meet_is_found(kinds, moving, static, extent, d):
    """Few, many, crowded in one place: as by looking at every pair."""
    random = np.random.default_rng(moving + static + len(kinds))
    world = World(Physics(dimensions=d), settings=Settings(dt=1e-6))
    place = random.uniform(-extent, extent, (moving + static, d))
    chosen = np.array([kinds[k % len(kinds)] if k < moving else (WALL, -1) for k in range(moving + static)])
    chosen[:moving] = random.permutation(chosen[:moving])
    ids = []
    for k in range(moving + static):
        layer, mask = chosen[k].tolist()
        ball = SphereCollider(RADIUS, mask=mask, sensor=True, **({"layer": layer} if layer != WALL else {}))
        ids.append(world.create_entity(Transform(place[k]), *([RigidBody()] if k < moving else []), ball))
    row = {entity: k for k, entity in enumerate(ids)}
    world.step()
    found = {tuple(sorted((row[c.entity_a], row[c.entity_b]))) for c in world.contacts}
    assert found == touching(place, chosen[:, 0], chosen[:, 1], moving)


@pytest.mark.parametrize("others", [0, 1])
def test_a_crowd_of_debris_that_meets_walls_alone_is_no_crowd(others):
    """6,000 in one place are 18 million pairs; a wall and a player that meets them are 6,000 each."""
    random = np.random.default_rng(others)
    world = World(Physics(dimensions=2, gravity=(0.0, -10.0)))
    world.create_entity(Transform((0.0, -5.0)), SphereCollider(4.5, layer=WALL))
    for k in range(others):
        world.create_entity(Transform((float(k), 3.0)), RigidBody(), SphereCollider(0.5, layer=PLAYER))
    for place in random.normal(0.0, 0.1, (6000, 2)):
        ball = SphereCollider(RADIUS, layer=DEBRIS, mask=WALL | PLAYER)
        world.create_entity(Transform(place), RigidBody(linear_velocity=10.0 * place), ball)
    for _ in range(20):
        world.step()
    assert not world.faults
    assert world.stats().counters["candidates"] / 20 <= (1 + others) * 6000

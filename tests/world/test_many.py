"""Verbs for many entities at once do what the verbs for one do, in each."""

from __future__ import annotations

import numpy as np
import pytest
from worlds import ball, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform


def crowd():
    """Bodies of all kinds, made in bulk, in small batches and one by one, and an entity that is no body."""
    world = make_world(2)
    ids = []
    for count in (40, *[4] * 10):
        many = Transform.many(np.arange(2.0 * count).reshape(count, 2) + 100 * len(ids)), SphereCollider.many(0.1)
        ids += world.create_entities(count, *many, *([RigidBody.many()] if len(ids) % 8 else []))
    ids += [ball(world, (-10.0 * k, -99), kind=kind) for k, kind in enumerate(("dynamic", "kinematic", "static") * 5)]
    return world, ids, world.create_entity()


def test_rows_of_many_are_the_rows_of_each():
    world, ids, other = crowd()
    asked = np.random.default_rng(0).permutation(ids)
    bodies = world.bodies
    assert bodies.rows_of(asked).tolist() == [bodies.row_of(entity) for entity in asked.tolist()]
    assert (bodies.entity[bodies.rows_of(asked)] == asked).all()
    assert bodies.rows_of([]).tolist() == []
    with pytest.raises(KeyError, match=str(other)):
        bodies.rows_of([ids[3], other])
    for wrong in (ids[0], [1.5], [ids[:2]]):
        with pytest.raises(TypeError, match="ids of entities"):
            bodies.rows_of(wrong)


@pytest.mark.parametrize("seed", range(5))
def test_deleting_many_leaves_what_deleting_each_leaves(seed):
    (one, ids, other), (many, *_) = crowd(), crowd()
    gone = np.random.default_rng(seed).permutation([*ids, other])[: 20 * (seed + 1)]
    for entity in gone.tolist():
        one.delete_entity(entity)
    many.delete_entities(gone)
    for world in (one, many):
        world.create_entity(Transform((0, 50)), RigidBody(), AABBCollider((1, 1)))
        world.step()
    assert many.get_entities() == one.get_entities()
    assert many.state_hash() == one.state_hash()


def test_one_that_does_not_exist_keeps_all():
    world, ids, _ = crowd()
    with pytest.raises(KeyError, match="999999"):
        world.delete_entities([*ids, 999999])
    world.step()
    assert len(world.bodies) == len(ids)

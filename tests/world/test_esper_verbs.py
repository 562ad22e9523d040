"""The verbs of a World against those of the esper that is installed."""

from __future__ import annotations

import inspect

import esper
import numpy as np
import pytest
from worlds import ball, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import System, World
from carom.systems import Response

LEFT_OUT = {
    "clear_cache": "esper's own affair", "clear_database": "with world: esper.clear_database()",
    "clear_dead_entities": "each step does it", "delete_world": "world.close()",
    "list_worlds": "no matter of one world", "process": "world.step(), world.advance()",
    "process_times": "world.stats()", "remove_handler": "world.off()",
    "set_handler": "world.on(), which holds handlers strongly", "switch_world": "with world:",
    "timed_process": "world.step(), and world.stats() for the times",
}  # fmt: skip


def public_functions():
    return {name: value for name, value in vars(esper).items() if inspect.isfunction(value) and name[0] != "_"}


def test_a_world_has_every_verb_of_esper_or_says_why_not():
    verbs = public_functions()
    missing = {name for name in verbs if not hasattr(World, name)}
    assert missing <= LEFT_OUT.keys(), f"new in esper: {missing - LEFT_OUT.keys()}"
    assert not {name for name in LEFT_OUT if hasattr(World, name)}
    for name in verbs.keys() - missing:
        theirs = list(inspect.signature(verbs[name]).parameters.values())
        ours = list(inspect.signature(getattr(World, name)).parameters.values())[1:]
        assert len(ours) == len(theirs), name
        assert [p.kind for p in ours] == [p.kind for p in theirs], name
        assert [p.default for p in ours] == [p.default for p in theirs], name


def test_newer_verbs_do_what_esper_does():
    world = make_world(2)
    first, second = ball(world, (0, 0)), ball(world, (9, 0))
    batch = world.create_entities(2, Transform.many((5, 5)), RigidBody.many())
    assert world.get_entities() == [first, second, *batch]
    world.delete_entity(second)
    with world:
        assert sorted(entity for entity in esper.get_entities() if esper.entity_exists(entity)) == world.get_entities()
    collider = world.component_for_entity(first, SphereCollider)
    assert world.try_remove_component(first, SphereCollider) is collider
    assert world.try_remove_component(first, SphereCollider) is None
    assert world.try_remove_component(12345, RigidBody) is None
    with world:  # esper's own, on an entity that has no objects yet
        esper.try_remove_component(batch[0], RigidBody)
        esper.try_remove_component(batch[1], SphereCollider)
    world.step()
    assert world.bodies.entity.tolist() == [first, batch[1]]
    assert world.get_entities() == [first, *batch]

    class Counts(System):
        def process(self, dt):
            pass

    assert world.get_processor(Counts) is None
    counts = Counts()
    world.add_system(counts)
    assert world.get_processor(Counts) is counts
    assert isinstance(world.get_processor(Response), Response)
    world.close()
    with pytest.raises(Exception, match="is closed"):
        world.get_entities()


# -- verbs for many at once do what those for one do ------------------------------------------------


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


@pytest.mark.parametrize("steps", [0, 1])
@pytest.mark.parametrize("missing", [3, 999999])
def test_one_that_does_not_exist_keeps_all(missing, steps):
    world, ids, _ = crowd()
    world.step()
    world.delete_entity(ids[3], immediate=True)
    for _ in range(steps):
        world.step()
    before = len(world.get_entities())
    missing = ids[3] if missing == 3 else missing
    with pytest.raises(KeyError, match=str(missing)):
        world.delete_entities([*ids[4:], missing])
    world.step()
    assert len(world.get_entities()) == before

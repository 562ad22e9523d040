"""Entities created in bulk have no Python objects before somebody asks, and are like any other to users."""

from __future__ import annotations

import esper
import numpy as np
import pytest
from data.helpers_adoption import matches_esper
from data.helpers_calls import calls_of
from worlds import make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component
from carom.framework.data import esper_bridge

pytestmark = pytest.mark.usefixtures("invariants")

@pytest.fixture
def handles(monkeypatch):
    """Counts the handles that are made."""
    made = []
    bind = Component._bind
    monkeypatch.setattr(Component, "_bind", lambda self, *args: (made.append(type(self)), bind(self, *args))[1])
    return made


def crowd(adopted, count=12):
    """Balls in a row, created in bulk, and their ids."""
    world = make_world()
    places = np.stack((3.0 * np.arange(count), np.zeros(count)), axis=1)
    ids = world.create_entities(
        count, Transform.many(places), RigidBody.many(np.arange(1.0, count + 1)), SphereCollider.many(0.5)
    )
    if adopted:
        world.step()
    return world, ids


def test_bodies_nobody_looks_at_have_no_handles(handles):
    world, ids = crowd(False, 500)
    other = world.create_entity(Transform((0.0, 50.0)), RigidBody())
    for _ in range(3):
        world.step()
    world.query_point((0.0, 0.0))
    world.state_hash()
    world.restore(world.snapshot())
    assert world.entity_exists(ids[3])
    assert len(world.bodies) == 501
    assert world.has_components(ids[5], Transform, SphereCollider)
    assert not world.has_component(ids[5], AABBCollider)
    for entity in ids[::2]:
        world.delete_entity(entity)
    world.step()
    assert len(world.bodies) == 251
    assert handles == []
    assert world.component_for_entity(ids[1], RigidBody).mass == 2.0
    assert handles == [Transform, RigidBody, SphereCollider]
    assert world.component_for_entity(other, RigidBody).mass == 1.0
    assert handles == [Transform, RigidBody, SphereCollider]


@pytest.mark.parametrize("adopted", [False, True], ids=["fresh", "adopted"])
def test_a_handle_is_the_same_each_time_and_shares_the_columns(adopted):
    world, ids = crowd(adopted)
    one = world.component_for_entity(ids[4], Transform)
    assert one is world.component_for_entity(ids[4], Transform) is world.try_component(ids[4], Transform)
    assert one.entity == (ids[4] if adopted else None)
    one.position[1] = 7.0
    one.x = 12.5
    assert world.component_for_entity(ids[5], Transform).position.tolist() == [15.0, 0.0]
    assert world.bodies.position[4].tolist() == [12.5, 7.0]
    world.bodies.position[4] = 1.0
    assert one.position.tolist() == [1.0, 1.0]
    assert one.entity == ids[4]
    assert matches_esper(world)


def test_esper_gets_plain_containers_back():
    world, _ = crowd(True)
    with world:
        esper_bridge.unwatch()
        assert type(esper._entities) is dict
        assert len(esper._entities) == 12
        assert all(type(members) is set and len(members) == 12 for members in esper._components.values())


def test_a_look_and_a_deletion_do_as_much_work_however_many_creations_in_bulk_live():
    def work(calls):
        world = make_world()
        for number in range(calls):
            world.create_entities(2, Transform.many([(3.0 * number, 0), (3.0 * number, 3)]), SphereCollider.many(0.5))
        world.step()
        victim, other = world.create_entity(Transform((-9, 0)), SphereCollider(0.5)), world.bodies.entity.item(0)
        world.step()

        def look_and_delete():
            assert world.has_component(other, SphereCollider)
            world.delete_entity(victim)
            world._pipeline.contents.clear_dead()

        return calls_of(look_and_delete)

    assert work(300) <= work(3) + 3

"""Entities created in bulk have no Python objects before somebody asks, and are like any other to users."""

from __future__ import annotations

import esper
import numpy as np
import pytest
from data.helpers_adoption import Charge, matches_esper
from data.helpers_calls import calls_of
from worlds import make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import CaromError, Component, MissingComponentError
from carom.framework.data import esper_bridge

pytestmark = pytest.mark.usefixtures("invariants")

COUNT = 12


class Tag:
    """A component that is not carom's."""


@pytest.fixture
def handles(monkeypatch):
    """Counts the handles that are made."""
    made = []
    bind = Component._bind
    monkeypatch.setattr(Component, "_bind", lambda self, *args: (made.append(type(self)), bind(self, *args))[1])
    return made


def crowd(adopted, count=COUNT):
    """Balls in a row, created in bulk, and their ids."""
    world = make_world()
    places = np.stack((3.0 * np.arange(count), np.zeros(count)), axis=1)
    ids = world.create_entities(
        count, Transform.many(places), RigidBody.many(np.arange(1.0, count + 1)), SphereCollider.many(0.5)
    )
    if adopted:
        world.step()
    return world, ids


either = pytest.mark.parametrize("adopted", [False, True], ids=["fresh", "adopted"])


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


@either
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


@either
def test_all_of_espers_verbs_see_them(adopted):
    world, ids = crowd(adopted)
    with world:
        assert list(esper.get_entities()) == list(ids)
        assert all(esper.entity_exists(e) for e in ids)
        assert not esper.entity_exists(ids[-1] + 1)
        assert not esper.entity_exists("1")
        assert esper.has_components(ids[0], Transform, RigidBody)
        assert not esper.has_component(ids[0], AABBCollider)
        assert [type(c) for c in esper.components_for_entity(ids[1])] == [Transform, RigidBody, SphereCollider]
        assert list(esper.get_entities()) == list(ids)
        assert sorted(e for e, _ in esper.get_component(RigidBody)) == list(ids)
        assert sorted(e for e, _ in esper.get_components(Transform, SphereCollider)) == list(ids)
        assert esper.get_component(AABBCollider) == []
        with pytest.raises(KeyError):
            esper.component_for_entity(ids[-1] + 1, Transform)
    assert matches_esper(world)


@either
@pytest.mark.parametrize("immediate", [False, True])
@pytest.mark.parametrize("plain", [False, True], ids=["facade", "plain esper"])
def test_they_are_deleted(adopted, immediate, plain):
    world, ids = crowd(adopted)
    body = world.component_for_entity(ids[2], RigidBody)
    with world:
        for entity in ids[2:5]:
            (esper if plain else world).delete_entity(entity, immediate=immediate)
        assert not any(world.entity_exists(e) for e in ids[2:5])
        esper.process(world.settings.dt) if plain else world.step()
    assert world.bodies.entity.tolist() == [*ids[:2], *ids[5:]]
    assert (body.entity, body.mass) == (None, 3.0)
    assert len(world.get_component(RigidBody)) == COUNT - 3
    assert matches_esper(world)
    for entity in (*ids[:2], *ids[5:]):
        world.delete_entity(entity)
    world.step()
    assert len(world.bodies) == 0
    assert world.get_component(Transform) == []


@either
def test_components_come_and_go_as_with_any_entity(adopted):
    world, ids = crowd(adopted)
    world.add_component(ids[0], Charge(4.0))
    world.add_component(ids[1], Tag())
    world.add_component(ids[2], RigidBody(mass=9.0))
    removed = world.remove_component(ids[3], SphereCollider)
    world.remove_component(ids[4], RigidBody)
    world.remove_component(ids[4], SphereCollider)
    world.step()
    assert world.bodies.charge.value[0] == 4.0
    assert world.component_for_entity(ids[2], RigidBody).mass == world.bodies.mass[2] == 9.0
    assert (removed.entity, removed.radius) == (None, 0.5)
    assert ids[4] not in world.bodies.entity
    assert [e for e, _ in world.get_components(Tag, RigidBody)] == [ids[1]]
    assert matches_esper(world)
    world.add_component(ids[4], AABBCollider((1.0, 1.0)))
    world.add_component(ids[3], removed)
    world.step()
    assert world.bodies.static.entity.tolist() == [ids[4]]
    assert matches_esper(world)


def test_a_batch_without_a_transform_is_refused_until_it_is_mended():
    world, ids = crowd(True)
    more = world.create_entities(2, RigidBody.many())
    for _ in range(2):
        with pytest.raises(MissingComponentError, match=f"entity {more[0]} has RigidBody but no Transform"):
            world.step()
    world.add_component(more[0], Transform((50.0, 0.0)))
    with pytest.raises(MissingComponentError, match=f"entity {more[1]} has RigidBody but no Transform"):
        world.step()
    world.delete_entity(more[1], immediate=True)
    world.step()
    assert world.bodies.entity.tolist() == [*ids, more[0]]
    assert matches_esper(world)


@either
def test_cleared_and_closed_worlds_let_them_go(adopted):
    world, ids = crowd(adopted)
    kept = world.component_for_entity(ids[5], RigidBody)
    with world:
        esper.clear_database()
        assert list(esper.get_entities()) == []
    again = world.create_entities(3, Transform.many(0.0), RigidBody.many(mass=[5.0, 6.0, 7.0]))
    assert list(again) == [1, 2, 3]
    world.step()
    assert world.bodies.mass.tolist() == [5.0, 6.0, 7.0]
    assert (kept.entity, kept.mass) == (None, 6.0)
    assert matches_esper(world)
    last = world.component_for_entity(again[1], RigidBody)
    world.close()
    assert (last.entity, last.mass) == (None, 6.0)
    with pytest.raises(CaromError, match="is closed"):
        world.entity_exists(1)


def test_esper_gets_plain_containers_back():
    world, _ = crowd(True)
    with world:
        esper_bridge.unwatch()
        assert type(esper._entities) is dict
        assert len(esper._entities) == COUNT
        assert all(type(members) is set and len(members) == COUNT for members in esper._components.values())


def test_any_order_of_changes_gives_what_single_entities_give():
    """The same moves with bodies created in bulk and one by one: the same bits."""
    hashes = []
    for bulk in (True, False):
        rng, world, ids = np.random.default_rng(3), make_world(gravity=9.81), []
        world.create_entity(Transform((0.0, -2.0)), AABBCollider((50.0, 0.5)))
        for step in range(40):
            places = rng.uniform(-5, 5, (6, 2)) + np.array([0.0, 6.0])
            kinds = rng.choice(["dynamic", "static", "kinematic"], 6, p=[0.8, 0.1, 0.1]).tolist()
            if bulk:
                ids += world.create_entities(
                    6, Transform.many(places), RigidBody.many(kind=kinds), SphereCollider.many(0.3, restitution=0.5)
                )
            else:
                ids += [
                    world.create_entity(Transform(p), RigidBody(kind=k), SphereCollider(0.3, restitution=0.5))
                    for p, k in zip(places, kinds, strict=True)
                ]
            for _ in range(4):
                world.delete_entity(ids.pop(int(rng.integers(len(ids)))), immediate=bool(rng.integers(2)))
            chosen = ids[int(rng.integers(len(ids)))]
            if step % 5 == 1:
                world.component_for_entity(chosen, RigidBody).kind = "static"
            if step % 5 == 2 and world.has_component(chosen, SphereCollider):
                world.remove_component(chosen, SphereCollider)
            if step % 5 == 3:
                world.component_for_entity(chosen, Transform).position = (0.0, 20.0)
            world.step()
            hashes.append((world.state_hash(), len(world.contacts)))
        assert matches_esper(world)
    assert hashes[:40] == hashes[40:]


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

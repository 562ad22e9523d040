"""The verbs of a world, equal to esper's, and the traps of esper that it avoids."""

from __future__ import annotations

import gc
import itertools

import esper
import pytest
from world import helpers_world
from world.helpers_world import Counter, Name
from worlds import ball, make_world

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import World

pytestmark = pytest.mark.plain

esper_is_left_as_it_was = helpers_world.esper_is_left_as_it_was  # a fixture, around every test


class Tag:
    pass


def test_the_verbs_mean_what_esper_means():
    world = World()
    name, tag = Name("a"), Tag()
    e = world.create_entity(name)
    empty = world.create_entity()
    assert world.entity_exists(e)
    assert world.entity_exists(empty)
    assert not world.entity_exists(99)
    assert world.component_for_entity(e, Name) is name
    assert world.components_for_entity(e) == (name,)
    assert world.has_component(e, Name)
    assert not world.has_component(e, Tag)
    assert world.try_component(e, Tag) is None
    assert world.try_component(99, Tag) is None
    world.add_component(e, tag)
    assert world.has_components(e, Name, Tag)
    assert world.try_components(e, Name, Tag) == (name, tag)
    assert world.try_components(empty, Name, Tag) is None
    assert world.get_component(Tag) == [(e, tag)]
    assert world.get_components(Name, Tag) == [(e, (name, tag))]
    assert world.get_components(Name, Counter) == []
    replacement = Name("b")
    world.add_component(e, replacement)
    assert world.component_for_entity(e, Name) is replacement
    assert world.remove_component(e, Name) is replacement
    assert not world.has_component(e, Name)
    world.add_component(e, Counter(), type_alias=Name)
    assert isinstance(world.component_for_entity(e, Name), Counter)


@pytest.mark.parametrize("use", [
    lambda w: w.delete_entity(99), lambda w: w.delete_entity(99, immediate=True),
    lambda w: w.component_for_entity(99, Name), lambda w: w.component_for_entity(1, Tag),
    lambda w: w.components_for_entity(99), lambda w: w.has_component(99, Name), lambda w: w.has_components(99, Name),
    lambda w: w.add_component(99, Name()), lambda w: w.remove_component(99, Name), lambda w: w.remove_component(1, Tag),
    lambda w: w.remove_processor(Counter), lambda w: w.remove_system(Counter()),
])  # fmt: skip
def test_unknown_things_are_key_errors_and_the_world_goes_on(use):
    world = World()
    world.create_entity(Name())
    with pytest.raises(KeyError):
        use(world)
    world.step()
    assert len(world.get_component(Name)) == 1
    assert world.step_count == 1


def test_deletion_is_deferred_to_the_next_step_or_immediate():
    world = World()
    a, b = world.create_entity(Name()), world.create_entity(Name())
    world.delete_entity(a)
    assert not world.entity_exists(a)
    assert world.component_for_entity(a, Name)  # still there to be looked at, as in esper
    world.delete_entity(b, immediate=True)
    with pytest.raises(KeyError):
        world.component_for_entity(b, Name)
    world.step()
    with pytest.raises(KeyError):
        world.component_for_entity(a, Name)


def test_entities_may_be_deleted_while_iterating():
    world = make_world()
    for x in range(10):
        ball(world, 3.0 * x)
    for e, (transform, _) in world.get_components(Transform, RigidBody):
        world.delete_entity(e, immediate=transform.x > 12)
    world.step()
    assert len(world.bodies) == 0


def test_deleting_and_then_deleting_at_once():
    world = make_world()
    e = ball(world, 0.0)
    world.delete_entity(e)
    world.delete_entity(e, immediate=True)
    world.step()
    world.step()
    assert len(world.bodies) == 0


@pytest.mark.parametrize("twice", [True, False], ids=["deleted twice", "unknown"])
def test_the_same_with_plain_calls_does_not_stop_the_facade(twice):
    world = make_world()
    e = ball(world, 0.0)
    with world:
        esper.delete_entity(e if twice else 99)
        if twice:
            esper.delete_entity(e, immediate=True)
    world.step()
    assert len(world.bodies) == (0 if twice else 1)


def test_handlers_are_held_strongly_and_called_in_order():
    world, log = World(), []
    world.events.define("hit")
    for label in "abc":
        world.on("hit", lambda label=label: log.append(label))
    gc.collect()
    world.dispatch_event("hit")
    assert log == ["a", "b", "c"]

    class Listener:
        def heard(self):
            log.append("method")

    world.on("hit", Listener().heard)
    gc.collect()
    log.clear()
    world.dispatch_event("hit")
    assert log == ["a", "b", "c", "method"]


def test_handlers_may_be_removed_while_an_event_is_on_its_way():
    world, log = World(), []
    world.events.define("hit")

    def once():
        log.append("once")
        world.off("hit", once)
        world.off("hit", later)

    def later():
        log.append("later")

    world.on("hit", once)
    world.on("hit", later)
    world.on("hit", lambda: log.append("last"))
    world.dispatch_event("hit")
    assert log == ["once", "last"]
    world.dispatch_event("hit")
    assert log == ["once", "last", "last"]
    with pytest.raises(KeyError):
        world.off("hit", once)
    with pytest.raises(TypeError):
        world.on("hit", None)


def test_handlers_of_esper_get_the_same_events_and_may_remove_themselves():
    world, log = make_world(), []

    def first(contact):
        log.append(("esper", contact.entity_a, contact.entity_b))
        esper.remove_handler("contact_begin", first)

    with world:
        esper.set_handler("contact_begin", first)
    world.on("contact_begin", lambda c: log.append(("carom", c.entity_a, c.entity_b)))
    ball(world, 0.0)
    ball(world, 0.5)
    world.step()
    assert sorted(log) == [("carom", 1, 2), ("esper", 1, 2)]
    other = World()
    other.dispatch_event("contact_begin", None)  # another world's handlers are not called
    assert len(log) == 2


def test_a_handler_is_not_called_after_another_one_removed_it_from_esper():
    world, log = World(), []

    def a():
        log.append("a")
        esper.remove_handler("hit", b)

    def b():
        log.append("b")
        esper.remove_handler("hit", a)

    with world:
        esper.set_handler("hit", a)
        esper.set_handler("hit", b)
    world.dispatch_event("hit")
    assert len(log) == 1


def test_ids_are_espers_own_count():
    world = make_world()
    ids = [world.create_entity() for _ in range(2)]
    bulk = world.create_entities(3, Transform.many((0, 0)), SphereCollider.many(1.0))
    with world:
        ids.append(esper.create_entity())
    assert ids + list(bulk) == [1, 2, 6, 3, 4, 5]
    assert list(itertools.chain(world.create_entities(0, RigidBody.many()), [world.create_entity()])) == [7]

"""The verbs of a world, equal to esper's, and the traps of esper that it avoids."""

from __future__ import annotations

import gc
import inspect
import itertools

import esper
import numpy as np
import pytest
from world import helpers_world
from world.helpers_world import Counter, Name
from worlds import ball, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import World

pytestmark = pytest.mark.plain

esper_is_left_as_it_was = helpers_world.esper_is_left_as_it_was  # a fixture, around every test


class Tag:
    pass


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


def names(answer):
    """Components by their types, so that answers of several worlds can be compared."""
    if isinstance(answer, (tuple, list)):
        return [names(one) for one in answer]
    return answer if answer is None or isinstance(answer, (int, bool)) else type(answer).__name__


def fill(verbs, many=None):
    """Two entities of the game, an empty one, a body; two more bodies, in bulk where that is possible."""
    verbs.create_entity(Name("a"))
    verbs.create_entity(Name("b"), Tag())
    verbs.create_entity()
    verbs.create_entity(Transform((0, 0)), RigidBody(), SphereCollider(0.5))
    if many:
        many(2, Transform.many([(5, 5), (9, 5)]), RigidBody.many())
    else:
        for x in (5, 9):
            verbs.create_entity(Transform((x, 5)), RigidBody())


BODY = Transform, RigidBody
EACH = (1, 2, 3, 4, 5, 6, 99)
ASKED = {  # verbs with all that they answer, in an order in which the former change what the latter see
    "entity_exists": lambda v: [v.entity_exists(e) for e in EACH],
    "get_entities": lambda v: sorted(v.get_entities()),
    "get_component": lambda v: [sorted(names(v.get_component(c))) for c in (Name, Tag, RigidBody, AABBCollider)],
    "get_components": lambda v: [sorted(names(v.get_components(*c))) for c in (BODY, (Name, Tag), (Tag, RigidBody))],
    "has_component": lambda v: [v.has_component(e, c) for e in EACH[:-1] for c in (Name, RigidBody)],
    "has_components": lambda v: [v.has_components(e, *c) for e in EACH[:-1] for c in (BODY, (Name, Tag))],
    "components_for_entity": lambda v: [v.components_for_entity(e) for e in EACH[:-1]],
    "component_for_entity": lambda v: [v.component_for_entity(e, RigidBody) for e in (4, 5)],
    "try_component": lambda v: [v.try_component(e, RigidBody) for e in EACH],
    "try_components": lambda v: [v.try_components(e, *c) for e in EACH for c in (BODY, (Name, Tag))],
    "add_component": lambda v: [v.add_component(e, c) for e, c in ((1, Name("c")), (3, Tag()), (5, SphereCollider(1)))],
    "an alias": lambda v: [v.add_component(1, Counter(), type_alias=Tag), v.component_for_entity(1, Tag)],
    "remove_component": lambda v: [v.remove_component(e, c) for e, c in ((1, Name), (2, Tag), (6, RigidBody))],
    "try_remove_component": lambda v: [v.try_remove_component(e, RigidBody) for e in (4, 4, 1)],
    "delete_entity": lambda v: [v.delete_entity(e, immediate=e > 1) for e in (1, 2, 5)],
    "what is left": lambda v: [v.entity_exists(e) for e in EACH],
    "to be deleted": lambda v: v.components_for_entity(1),
    **{
        f"{verb} of {e}": lambda v, verb=verb, e=e, more=more: getattr(v, verb)(e, *more)
        for verb, more in (
            ("component_for_entity", (Name,)), ("components_for_entity", ()), ("has_component", (Name,)),
            ("has_components", (Name,)), ("remove_component", (Name,)), ("add_component", (Name(),)),
        ) for e in (99, 5) if e == 99 or verb not in ("has_component", "has_components", "add_component")
    },
}  # fmt: skip


def answers(verbs):
    found = {}
    for what, ask in ASKED.items():
        try:
            found[what] = names(ask(verbs))
        except KeyError:
            found[what] = "KeyError"
    return found


@pytest.mark.parametrize("bulk", [False, True], ids=["one by one", "in bulk"])
def test_a_world_and_esper_in_its_context_answer_as_esper_does(bulk):
    esper.switch_world("without carom")
    fill(esper)
    expected = answers(esper)
    esper.switch_world("default")
    assert {"KeyError"} < {str(answer) for answer in expected.values()}
    for plain in (False, True):
        world = make_world()
        with world:
            fill(esper if plain else world, world.create_entities if bulk else None)
            assert answers(esper if plain else world) == expected
            esper.process(world.settings.dt) if plain else world.step()
            assert world.get_entities() == sorted(esper.get_entities()) == [3, 4, 6]
        assert world.bodies.entity.tolist() == [4]


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


def test_entities_may_be_deleted_while_iterating():
    world = make_world()
    for x in range(10):
        ball(world, 3.0 * x)
    for e, (transform, _) in world.get_components(Transform, RigidBody):
        world.delete_entity(e, immediate=transform.x > 12)
    world.step()
    assert len(world.bodies) == 0


@pytest.mark.parametrize("entity", ["deleted twice", "deleted, then at once", "unknown to esper"])
def test_a_deletion_that_says_too_much_does_not_stop_the_world(entity):
    world = make_world()
    e = ball(world, 0.0)
    with world:
        verbs = esper if entity == "deleted twice" else world
        esper.delete_entity(99) if entity == "unknown to esper" else verbs.delete_entity(e)
        if entity != "unknown to esper":
            verbs.delete_entity(e, immediate=True)
    world.step()
    world.step()
    assert len(world.bodies) == (1 if entity == "unknown to esper" else 0)


@pytest.mark.slow
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


def test_ids_are_espers_own_count():
    world = make_world()
    ids = [world.create_entity() for _ in range(2)]
    bulk = world.create_entities(3, Transform.many((0, 0)), SphereCollider.many(1.0))
    with world:
        ids.append(esper.create_entity())
    assert ids + list(bulk) == [1, 2, 6, 3, 4, 5]
    assert list(itertools.chain(world.create_entities(0, RigidBody.many()), [world.create_entity()])) == [7]


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


@pytest.mark.compiled
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

"""World as an esper context: names, nesting, closing, the verbs, and the traps of esper that are not there."""

from __future__ import annotations

import gc
import itertools

import esper
import numpy as np
import pytest
from worlds import ball, make_world

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import CaromError, NoPhysicsError, Settings, System, World
from carom.plugins import Physics

NO_PHYSICS = "no physics in this world: World(Physics(...))"


class Name:
    def __init__(self, text=""):
        self.text = text


class Tag:
    pass


@pytest.fixture(autouse=True)
def esper_is_left_as_it_was():
    before = set(esper.list_worlds())
    yield
    assert esper.current_world == "default"
    for name in set(esper.list_worlds()) - before:
        esper.delete_world(name)
    assert not list(esper.get_entities()), "the default context was touched"


# -- contexts ------------------------------------------------------------------------------------


def test_names_are_unique_by_default_and_may_be_given():
    first, second, named = World(), World(), World(name="level 1")
    assert len({first.name, second.name, named.name}) == 3
    assert {first.name, second.name, "level 1"} <= set(esper.list_worlds())
    with pytest.raises(ValueError, match="level 1"):
        World(name="level 1")


def test_a_world_is_the_current_context_inside_with_and_only_there():
    world, other = World(), World()
    with world as entered:
        assert entered is world
        assert esper.current_world == world.name
        with other, world:
            assert esper.current_world == world.name
            with world:
                esper.create_entity(Name())
            assert esper.current_world == world.name
        assert esper.current_world == world.name
    assert esper.current_world == "default"
    assert len(world.get_component(Name)) == 1
    assert other.get_component(Name) == []


def test_the_context_is_left_when_the_block_raises():
    world = World()
    with pytest.raises(ZeroDivisionError), world:
        _ = 1 / 0
    assert esper.current_world == "default"


def test_verbs_do_not_change_the_current_context():
    world, other = make_world(), World()
    with other:
        ball(world, 0.0)
        world.step()
        assert esper.current_world == other.name
        with pytest.raises(KeyError):
            world.component_for_entity(99, Name)
        assert esper.current_world == other.name


def test_the_default_context_can_be_taken_over_and_is_given_back():
    esper.create_entity(Name("from before"))
    world = World(Physics(dimensions=2), name="default")
    try:
        assert [name.text for _, name in world.get_component(Name)] == ["from before"]
        with pytest.raises(ValueError, match="default"):
            World(name="default")
        e = esper.create_entity(Transform((1.0, 2.0)), RigidBody(linear_velocity=(60.0, 0.0)))
        esper.process(world.settings.dt)
        assert world.component_for_entity(e, Transform).x == 2.0
    finally:
        world.close()
    assert "default" in esper.list_worlds()
    esper.create_entity(Transform((0.0, 0.0)))  # plain esper again
    esper.process("anything")
    esper.clear_database()


def test_bodies_that_were_there_before_the_world_are_adopted():
    e = esper.create_entity(Transform((0.0, 0.0)), RigidBody(linear_velocity=(6.0, 0.0)))
    world = World(Physics(dimensions=2), settings=Settings(dt=0.5), name="default")
    try:
        world.step()
        assert world.bodies.position.tolist() == [[3.0, 0.0]]
        assert world.bodies.entity.tolist() == [e]
    finally:
        world.close()


def test_closing_gives_the_context_back_and_ends_the_world():
    world = make_world()
    e = ball(world, 1.0, 2.0)
    world.step()
    transform = world.component_for_entity(e, Transform)
    place = transform.position.copy()
    world.close()
    world.close()
    assert world.closed
    assert world.name not in esper.list_worlds()
    np.testing.assert_array_equal(transform.position, place)  # the game may still look at what it had
    for use in (
        world.step,
        lambda: world.advance(1.0),
        lambda: world.create_entity(Name()),
        lambda: world.entity_exists(e),
        lambda: world.get_component(Transform),
        lambda: world.delete_entity(e),
        lambda: world.bodies,
        lambda: world.dispatch_event("x"),
        lambda: world.add_system(Counter()),
        lambda: world.__enter__(),
    ):
        with pytest.raises(CaromError, match="closed"):
            use()
    assert world.name not in esper.list_worlds(), "a verb has brought the context back"


def test_a_world_cannot_be_closed_from_within():
    world = make_world()
    with world, pytest.raises(CaromError, match="inside its own with block"):
        world.close()

    class Closer(System):
        def process(self, dt):
            self.world.close()

    world.add_system(Closer())
    with pytest.raises(CaromError, match="between steps"):
        world.step()
    world.close()


def test_a_world_that_cannot_be_made_leaves_no_context_behind():
    before = esper.list_worlds()
    with pytest.raises(ValueError, match="gravity"):
        World(Physics(dimensions=2, gravity=(1.0, 2.0, 3.0)))
    with pytest.raises(ValueError, match="integrator"):
        World(Physics(dimensions=2), settings=Settings(integrator="leapfrog"))
    with pytest.raises(TypeError, match="settings"):
        World(Settings())
    assert esper.list_worlds() == before


def test_several_worlds_side_by_side_do_not_disturb_each_other():
    def alone(velocity):
        world = make_world(gravity=9.81)
        ball(world, (0.0, 1.0), velocity)
        for _ in range(20):
            world.step()
        return world.state_hash()

    expected = [alone(1.0), alone(2.0)]
    worlds = [make_world(gravity=9.81) for _ in range(2)]
    for world, velocity in zip(worlds, (1.0, 2.0), strict=True):
        assert ball(world, (0.0, 1.0), velocity) == 1  # each counts its own entities
    for _ in range(20):
        for world in worlds:
            world.step()
    assert [world.state_hash() for world in worlds] == expected


def test_a_system_may_step_another_world():
    inner, outer = make_world(), make_world()
    ball(inner, 0.0, 60.0)
    e = ball(outer, 0.0, 60.0)

    class Inner(System):
        def process(self, dt):
            inner.step()

    outer.add_system(Inner())
    outer.step()
    outer.step()
    assert inner.step_count == outer.step_count == 2
    assert outer.component_for_entity(e, Transform).x == inner.component_for_entity(1, Transform).x == 2.0


# -- without physics -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "use",
    [
        lambda w: w.bodies,
        lambda w: w.contacts,
        lambda w: w.gravity,
        lambda w: setattr(w, "gravity", (0, 0)),
        lambda w: w.kinetic_energy(),
        lambda w: w.potential_energy(),
        lambda w: w.momentum(),
        lambda w: w.snapshot(),
        lambda w: w.state_hash(),
        lambda w: w.query_point((0, 0)),
        lambda w: w.prepare(),
        lambda w: w.create_entities(3),
    ],
)
def test_what_needs_physics_says_so(use):
    with pytest.raises(NoPhysicsError) as caught:
        use(World())
    assert str(caught.value) == NO_PHYSICS
    assert isinstance(caught.value, AttributeError)  # hasattr(world, "bodies") is a fair question


def test_a_world_without_physics_still_steps_its_processors():
    world = World(settings=Settings(dt=0.25))
    counter = Counter()
    world.add_system(counter)
    world.create_entity(Name())
    world.step()
    assert world.advance(0.6) == 2
    assert (counter.count, world.step_count, world.time) == (3, 3, 0.75)


class Counter(System):
    count = 0

    def process(self, dt):
        self.count += 1


# -- the verbs -----------------------------------------------------------------------------------


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


@pytest.mark.parametrize(
    "use",
    [
        lambda w: w.delete_entity(99),
        lambda w: w.delete_entity(99, immediate=True),
        lambda w: w.component_for_entity(99, Name),
        lambda w: w.component_for_entity(1, Tag),
        lambda w: w.components_for_entity(99),
        lambda w: w.has_component(99, Name),
        lambda w: w.has_components(99, Name),
        lambda w: w.add_component(99, Name()),
        lambda w: w.remove_component(99, Name),
        lambda w: w.remove_component(1, Tag),
        lambda w: w.remove_processor(Counter),
        lambda w: w.remove_system(Counter()),
    ],
)
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


# -- traps of esper ------------------------------------------------------------------------------


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


class Plain(esper.Processor):
    def __init__(self, log, label):
        self.log, self.label = log, label

    def process(self, dt):
        self.log.append(self.label)


def test_two_processors_of_one_type_can_be_removed_one_by_one():
    world, log = World(), []
    first, second = Plain(log, 1), Plain(log, 2)
    world.add_processor(first)
    world.add_processor(second)
    world.step()
    assert log == [1, 2]
    world.remove_processor(Plain)  # the last one added, as in esper
    world.step()
    assert log == [1, 2, 1]
    with world:
        assert esper.get_processor(Plain) is first
    world.remove_processor(first)
    world.step()
    assert log == [1, 2, 1]
    with world:
        assert esper.get_processor(Plain) is None


def test_handlers_are_held_strongly_and_called_in_order():
    world, log = World(), []
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


# -- time ----------------------------------------------------------------------------------------


def test_settings_are_replaced_between_steps_and_time_goes_on():
    world = make_world(dt=0.5)
    world.step()
    world.settings = world.settings.replace(dt=0.25)
    world.step()
    assert (world.time, world.step_count) == (0.75, 2)
    with pytest.raises(TypeError):
        world.settings = None

    class Meddler(System):
        def process(self, dt):
            self.world.settings = Settings()

    meddler = Meddler()
    world.add_system(meddler)
    with pytest.raises(CaromError, match="between steps"):
        world.step()
    assert world.settings.dt == 0.25


@pytest.mark.parametrize("seconds", [-1.0, float("nan"), float("inf"), "1", None])
def test_advance_takes_a_time(seconds):
    world = World()
    with pytest.raises(ValueError, match="seconds"):
        world.advance(seconds)
    assert world.advance(np.float32(0.0)) == 0


def test_plain_process_wants_the_fixed_step_and_names_advance():
    world = make_world()
    with world:
        for wrong in ((), (1 / 30,), (1 / 60, 1)):
            with pytest.raises(ValueError, match=r"world\.advance"):
                esper.process(*wrong)
        assert world.step_count == 0
        esper.process(world.settings.dt)
        esper.timed_process(world.settings.dt)
        esper.process(dt=world.settings.dt)
    assert world.step_count == 3


@pytest.mark.parametrize("inner", ["facade", "advance", "plain"])
def test_a_step_inside_a_step_is_refused(inner):
    world = make_world()

    class Again(System):
        def process(self, dt):
            {"facade": world.step, "advance": lambda: world.advance(1.0), "plain": lambda: esper.process(dt)}[inner]()

    again = Again()
    world.add_system(again)
    with pytest.raises(CaromError, match="inside"):
        world.step()
    world.remove_system(again)
    world.step()
    assert world.step_count == 1
    assert world.alpha == 0.0


def test_an_empty_world_and_a_single_body_step():  # ACCURACY C25
    world = make_world()
    world.step()
    assert len(world.bodies) == len(world.contacts) == 0
    assert world.momentum().tolist() == [0.0, 0.0]
    ball(world, 0.0, 60.0)
    world.step()
    assert world.bodies.position.tolist() == [[1.0, 0.0]]


def test_faults_hold_the_last_hundred():
    world = World()
    for index in range(150):
        world.report_fault(str(index))
    assert world.faults == [str(i) for i in range(50, 150)]


def test_ids_are_espers_own_count():
    world = make_world()
    ids = [world.create_entity() for _ in range(2)]
    bulk = world.create_entities(3, Transform.many((0, 0)), SphereCollider.many(1.0))
    with world:
        ids.append(esper.create_entity())
    assert ids + list(bulk) == [1, 2, 6, 3, 4, 5]
    assert list(itertools.chain(world.create_entities(0, RigidBody.many()), [world.create_entity()])) == [7]

"""Worlds as esper's contexts, their steps and time, also without physics."""

from __future__ import annotations

import gc

import esper
import numpy as np
import pytest
from world import helpers_world
from world.helpers_world import Counter, Name
from worlds import ball, make_world

from carom.components import AABBCollider, RigidBody, Transform
from carom.framework import CaromError, NoPhysicsError, Settings, System, World
from carom.plugins import Physics
from carom.plugins.character import Character, Characters
from carom.plugins.paths import Path, Paths
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.plugins.timers import Timer, Timers
from carom.plugins.zones import Wind, Zones

pytestmark = pytest.mark.plain
esper_is_left_as_it_was = helpers_world.esper_is_left_as_it_was  # a fixture, around every test


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
    before = esper.create_entity(Transform((0.0, 0.0)), RigidBody(linear_velocity=(6.0, 0.0)))
    world = World(Physics(dimensions=2), name="default")
    try:
        assert [name.text for _, name in world.get_component(Name)] == ["from before"]
        with pytest.raises(ValueError, match="default"):
            World(name="default")
        e = esper.create_entity(Transform((1.0, 2.0)), RigidBody(linear_velocity=(60.0, 0.0)))
        esper.process(world.settings.dt)
        assert world.component_for_entity(e, Transform).x == 2.0
        assert world.component_for_entity(before, Transform).x == 0.1
        assert world.bodies.entity.tolist() == [before, e]
    finally:
        world.close()
    assert "default" in esper.list_worlds()
    esper.create_entity(Transform((0.0, 0.0)))  # plain esper again
    esper.process("anything")
    esper.clear_database()


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
    np.testing.assert_array_equal(transform.position, place)  # handles stay readable
    for use in (
        world.step, lambda: world.advance(1.0), lambda: world.create_entity(Name()), lambda: world.entity_exists(e),
        lambda: world.get_component(Transform), lambda: world.delete_entity(e), lambda: world.bodies,
        lambda: world.dispatch_event("x"), lambda: world.add_system(Counter()), lambda: world.__enter__(),
    ):  # fmt: skip
        with pytest.raises(CaromError, match="closed"):
            use()
    assert world.name not in esper.list_worlds(), "a verb has brought the context back"


def test_a_world_cannot_be_closed_from_within():
    world = make_world()
    with world, pytest.raises(CaromError, match="inside its own with block"):
        world.close()
    world.close()


@pytest.mark.slow
def test_a_world_that_cannot_be_made_leaves_no_context_behind():
    gc.collect()  # worlds of other tests leave now, not meanwhile
    before = esper.list_worlds()
    with pytest.raises(ValueError, match="gravity"):
        World(Physics(dimensions=2, gravity=(1.0, 2.0, 3.0)))
    with pytest.raises(ValueError, match="integrator"):
        World(Physics(dimensions=2), settings=Settings(integrator="leapfrog"))
    with pytest.raises(TypeError, match="settings"):
        World(Settings())
    assert esper.list_worlds() == before


@pytest.mark.compiled
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
        assert ball(world, (0.0, 1.0), velocity) == 1  # each world counts its own entities
    for _ in range(20):
        for world in worlds:
            world.step()
    assert [world.state_hash() for world in worlds] == expected


@pytest.mark.slow
@pytest.mark.compiled
def test_one_rotation_zones_timers_paths_characters_serve_two_worlds_at_once():
    """Stepped in turn, worlds that differ go the same way as each with plugins of its own; so they do after each has
    gone back, and when what one of them has is refused the other steps on."""

    def plugins():
        return Physics(2, gravity=(0, -10)), Rotation(), Zones(), Timers(), Paths(), Characters()

    def filled(world, k):
        world.gravity = (0, -10 - k)
        world.create_entity(Transform((0, -1)), AABBCollider((50, 1), friction=0.8))
        for x in range(4 + k):
            shape = BoxCollider((0.4, 0.3), friction=0.5, restitution=0.2 * k)
            world.create_entity(Transform((1.5 * x, 2 + x), 0.3 * x), RigidBody(linear_velocity=(k, 0)), Spin(k), shape)
        world.create_entity(Transform((2, 2)), AABBCollider((3, 2), sensor=True), Wind((4 - k, 1)))
        lift = Transform((-4, 0.5)), RigidBody(kind="kinematic"), AABBCollider((1, 0.2), friction=1.0)
        world.create_entity(*lift, Path([(-4, 0.5), (-4, 3 + k)], 1.0))
        body = RigidBody(kind="kinematic"), AABBCollider((0.3, 0.5))
        world.create_entity(Transform((-9 + 2 * k, 3)), *body, Character(move=1.0 + k))
        world.create_entity(Timer(0.2 + 0.05 * k, repeat=True))
        log = []
        for name in ("timer", "landed"):
            world.on(name, lambda *args, name=name: log.append((name, world.step_count, args[0])))
        return log

    def futures(worlds):
        logs, hashes = [filled(world, k) for k, world in enumerate(worlds)], []
        snapshots = [world.snapshot() for world in worlds]
        for _ in range(2):
            for _ in range(90):
                for world in worlds:
                    world.step()
            hashes += [world.state_hash() for world in worlds]
            for world, snapshot in zip(worlds, snapshots, strict=True):
                world.restore(snapshot)
        assert hashes[:2] == hashes[2:]
        assert {name for log in logs for name, *_ in log} == {"timer", "landed"}
        worlds[0].remove_component(worlds[0].get_component(Character)[0][0], AABBCollider)
        for _ in range(2):
            with pytest.raises(ValueError, match="Character takes one collider"):
                worlds[0].step()
            worlds[1].step()
        return hashes, logs, worlds[1].state_hash()

    shared = plugins()
    assert futures([World(*shared), World(*shared)]) == futures([World(*plugins()), World(*plugins())])


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


NO_PHYSICS = "no physics in this world: World(Physics(...))"


@pytest.mark.parametrize("use", [
    lambda w: w.bodies, lambda w: w.contacts, lambda w: w.gravity, lambda w: setattr(w, "gravity", (0, 0)),
    lambda w: w.kinetic_energy(), lambda w: w.potential_energy(), lambda w: w.momentum(), lambda w: w.snapshot(),
    lambda w: w.state_hash(), lambda w: w.query_point((0, 0)), lambda w: w.prepare(), lambda w: w.create_entities(3),
])  # fmt: skip
def test_what_needs_physics_says_so(use):
    with pytest.raises(NoPhysicsError) as caught:
        use(World())
    assert str(caught.value) == NO_PHYSICS
    assert isinstance(caught.value, AttributeError)  # so that hasattr(world, "bodies") works


def test_a_world_without_physics_still_steps_its_processors():
    world = World(settings=Settings(dt=0.25))
    counter = Counter()
    world.add_system(counter)
    world.create_entity(Name())
    world.step()
    assert world.advance(0.6) == 2
    assert (counter.count, world.step_count, world.time) == (3, 3, 0.75)


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


def test_faults_hold_the_last_hundred():
    world = World()
    for index in range(150):
        world.report_fault(str(index))
    assert world.faults == [str(i) for i in range(50, 150)]

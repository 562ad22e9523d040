"""esper's components against the table: changes in the middle of a step, and many of them."""

from __future__ import annotations

import esper
import numpy as np
import pytest
from data import helpers_adoption
from data.helpers_adoption import Charge, matches_esper
from data.helpers_calls import calls_of
from worlds import ball, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, System

world = helpers_adoption.world  # a fixture


class Once(System):
    """Does something in the middle of the first step."""

    def __init__(self, action):
        self.action = action

    def process(self, dt):
        action, self.action = self.action, None
        if action is not None:
            action()


@pytest.mark.slow
@pytest.mark.parametrize("immediate", [False, True])
@pytest.mark.parametrize("where", ["START", "INTEGRATION", "BROAD", "NARROW", "RESPONSE", "END"])
def test_entities_may_be_deleted_in_any_phase(world, where, immediate):
    from carom.framework import Phase

    ids = [ball(world, 0.9 * x, restitution=1.0) for x in range(6)]
    once = type("Delete", (Once,), {"phase": Phase[where]})
    world.add_system(once(lambda: [world.delete_entity(e, immediate=immediate) for e in ids[::2]]))
    world.step()
    assert all(a not in ids[::2] for a, b, _ in world.contacts.pairs(SphereCollider, SphereCollider))
    world.step()
    assert world.bodies.entity.tolist() == ids[1::2]
    assert len(world.contacts) == 0
    assert len(world.contacts.end) == 5
    world.step()
    assert matches_esper(world)


def test_entities_created_inside_a_step_join_at_the_next(world):
    ball(world, 0.0)
    made = []

    def create():
        made.append(ball(world, 5.0, 60.0))
        made.append(world.create_entities(2, Transform.many([[9, 9], [19, 9]]), SphereCollider.many(1.0))[0])
        assert len(world.bodies) == 1
        assert world.component_for_entity(made[0], Transform).x == 5.0

    world.add_system(Once(create))
    world.step()
    assert world.component_for_entity(made[0], Transform).x == 5.0
    assert world.bodies.entity.tolist() == [1, 2, 3, 4]
    world.step()
    assert world.component_for_entity(made[0], Transform).x == 6.0


@pytest.mark.parametrize(("kind", "speed", "places"), [("dynamic", 120.0, [1.0, 3.0]), ("static", 60.0, [1.0, 1.0])])
def test_components_changed_inside_a_step_count_from_the_next(world, kind, speed, places):
    e = ball(world, 0.0, 60.0)

    def change():
        if kind == "static":
            world.component_for_entity(e, RigidBody).kind = kind
        else:
            world.add_component(e, RigidBody(linear_velocity=(speed, 0.0)))

    world.add_system(Once(change))
    for place in places:
        world.step()
        assert world.bodies.position[0, 0] == place
    assert matches_esper(world)


@pytest.mark.slow
@pytest.mark.usefixtures("invariants")
def test_any_sequence_of_changes_leads_to_what_esper_has():
    """Random operations, with plain esper, through the facade and in bulk, looked at in some rounds."""
    rng = np.random.default_rng(7)
    world = make_world()
    make = {
        Transform: lambda: Transform(rng.normal(size=2) * 100),
        RigidBody: lambda: RigidBody(rng.random() + 0.1, kind=kind_of()),
        SphereCollider: lambda: SphereCollider(2 + rng.random()),  # holds the box, if one has both
        AABBCollider: lambda: AABBCollider(rng.random(2), layer=2),
        Charge: lambda: Charge(rng.normal()),
    }
    types = list(make)
    alive: list[int] = []
    spare: list[Component] = []  # handles that have been used before

    def kind_of():
        return ("dynamic", "kinematic", "static")[rng.integers(3)]

    def create(verbs):
        chosen = [Transform, *(c for c in types[1:] if rng.random() < 0.5)]
        alive.append(verbs.create_entity(*[make[c]() for c in chosen]))

    def create_many(verbs):
        n = int(rng.integers(1, 5))
        places = Transform.many(rng.normal(size=(n, 2)) * 100)
        mass, kinds = rng.random(n) + 0.1, [kind_of() for _ in range(n)]
        bodies = RigidBody.many(mass=mass, kind=kinds), SphereCollider.many(2 + rng.random(n))
        alive.extend(world.create_entities(n, places, *bodies[int(rng.integers(2)) :]))

    def change(verbs):
        latest = min(int(rng.geometric(0.2)), len(alive))
        e = int(rng.choice(alive) if rng.integers(2) else alive[-latest])
        component = types[int(rng.integers(1, len(types)))]
        action = int(rng.integers(5))
        if action == 0:
            alive.remove(e)
            verbs.delete_entity(e, immediate=bool(rng.integers(2)))
        elif action == 1 and world.has_component(e, component):
            spare.append(verbs.remove_component(e, component))
        elif action == 2:
            verbs.add_component(e, make[component]())
        elif action == 3:
            again = [h for h in spare if type(h) is component]
            if again:
                spare.remove(again[0])
                verbs.add_component(e, again[0])
        elif world.has_component(e, RigidBody):
            world.component_for_entity(e, RigidBody).kind = kind_of()

    for number in range(60):
        with world:
            for _ in range(int(rng.integers(1, 12))):
                verbs = (esper, world)[int(rng.integers(2))]
                (create, create_many, change, change, change, change)[int(rng.integers(6)) if alive else 1](verbs)
            esper.process(world.settings.dt) if rng.integers(2) else world.step()
        assert sorted(world.get_entities()) == sorted(alive)
        if number % 3 == 2:  # which makes objects of all that came in bulk
            assert matches_esper(world)


@pytest.mark.slow
def test_what_comes_and_goes_costs_the_same_among_any_number():
    """The table is reordered once for all changes of a step, without Python for each body."""
    rng = np.random.default_rng(3)

    def spawn(world, n):
        return world.create_entities(
            n, Transform.many(rng.random((n, 2)) * 1000), RigidBody.many(), SphereCollider.many(0.2)
        )

    calls = {}
    for many in (200, 800):
        world = make_world()
        alive = list(spawn(world, many))
        for changes in (20, 100, 100, 20):  # what is made once is made in the first two
            for e in alive[:changes]:
                world.delete_entity(e)
            alive = [*alive[changes:], *spawn(world, changes)]
            calls[many, changes] = calls_of(world.step)
            assert world.bodies.entity.tolist() == alive
        assert matches_esper(world)
    assert calls[800, 100] < calls[200, 100] + 200  # searches make room or not
    assert calls[800, 100] < calls[800, 20] + 4 * 80


def test_nothing_changed_costs_next_to_nothing_whatever_the_size():
    calls = []
    for many in (200, 20_000):
        world = make_world()
        world.create_entities(many, Transform.many(0.0), RigidBody.many())
        world.bodies  # noqa: B018
        prefab = RigidBody()  # held by the game and never adopted: must not trigger a check
        calls.append(calls_of(world._pipeline.synchronize))
        assert prefab.entity is None
    assert calls[0] == calls[1] < 20

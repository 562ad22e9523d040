"""What esper knows and what the table knows: components replaced, removed, added again; ids used again; churn."""

from __future__ import annotations

import itertools
import time

import esper
import numpy as np
import pytest
from worlds import ball, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, MissingComponentError, System, column


class Charge(Component):
    value = column(default=1.0)


class Health:
    """No component of carom's."""


def matches_esper(world):
    """Every body's row says what the components say that esper has, and nothing else is in the table."""
    bodies = world.bodies
    expected = [
        e
        for e, _ in world.get_component(Transform)
        if any(world.has_component(e, c) for c in (RigidBody, SphereCollider, AABBCollider))
    ]
    assert sorted(bodies.entity.tolist()) == sorted(expected)
    for e in expected:
        row = bodies.row_of(e)
        components = {type(c): c for c in world.components_for_entity(e) if isinstance(c, Component)}
        for component in (Transform, RigidBody, SphereCollider, AABBCollider, Charge):
            assert bodies.has(component)[row] == (component in components)
        for component, handle in components.items():
            assert handle.entity == e
            for name in component.columns:
                in_row = getattr(bodies, component.prefix + name)[row]
                got = getattr(handle, name)
                if isinstance(got, str):
                    got = component.columns[name].choices.index(got)
                np.testing.assert_array_equal(in_row, np.nan if got is None else got)
        kind = components[RigidBody].kind if RigidBody in components else "static"
        assert e in getattr(bodies, kind).entity
    return True


@pytest.fixture
def world():
    return make_world()


# -- components come, go, are replaced -----------------------------------------------------------


@pytest.mark.parametrize("plain", [False, True], ids=["facade", "plain esper"])
def test_components_are_replaced_removed_and_added_again(world, plain):
    verbs = esper if plain else world
    add, remove = verbs.add_component, verbs.remove_component
    e = ball(world, 0.0, mass=2.0)
    ball(world, 9.0)
    world.step()
    with world:
        old = world.component_for_entity(e, RigidBody)
        add(e, RigidBody(mass=5.0))
        world.step()
        assert world.bodies.mass.tolist() == [5.0, 1.0]
        assert (old.mass, old.entity) == (2.0, None)
        assert remove(e, SphereCollider).radius == 0.5
        world.step()
        assert world.query_point((0, 0)) == []
        add(e, SphereCollider(3.0))
        world.step()
        assert world.query_point((-2.5, 0)) == [e]
        assert matches_esper(world)
        remove(e, SphereCollider)
        remove(e, RigidBody)
        world.step()
        assert len(world.bodies) == 1
        add(e, old)
        world.step()
        assert (world.bodies.mass.tolist(), old.entity) == ([2.0, 1.0], e)
        assert matches_esper(world)


def test_a_component_may_be_replaced_by_one_that_has_been_adopted_before(world):
    """Swapped, moved, or taken from another entity: no new handle shows that anything happened."""
    a, b, c = (ball(world, 5.0 * x, mass=x + 1.0) for x in range(3))
    world.step()
    first, second = world.component_for_entity(a, RigidBody), world.component_for_entity(b, RigidBody)
    world.add_component(a, second)
    world.add_component(b, first)
    world.step()
    assert world.bodies.mass.tolist() == [2.0, 1.0, 3.0]
    assert (first.entity, second.entity) == (b, a)
    moved = world.remove_component(c, RigidBody)
    world.add_component(a, moved)
    world.step()
    assert world.component_for_entity(a, RigidBody) is moved
    assert world.bodies.dynamic.mass.tolist() == [3.0, 1.0]
    assert (second.entity, second.mass) == (None, 2.0)
    assert matches_esper(world)


def test_removed_and_added_again_between_two_steps_is_no_change(world):
    e = ball(world, 0.0, 6.0)
    world.step()
    transform = world.remove_component(e, Transform)
    world.add_component(e, transform)
    world.step()
    assert transform.x == pytest.approx(0.2)
    assert matches_esper(world)


def test_ids_used_again_after_clear_database_are_new_bodies(world):
    ended = []
    world.on("contact_end", lambda contact: ended.append((contact.entity_a, contact.entity_b)))
    old = [ball(world, 0.0), ball(world, 0.8)]
    world.step()
    handle = world.component_for_entity(old[0], Transform)
    place = handle.position.copy()
    with world:
        esper.clear_database()
    new = [ball(world, 40.0, mass=7.0), ball(world, 50.0)]
    assert new == old
    world.step()
    assert world.bodies.position[:, 0].tolist() == [40.0, 50.0]
    assert world.bodies.mass.tolist() == [7.0, 1.0]
    assert handle.entity is None
    np.testing.assert_array_equal(handle.position, place)
    assert ended == [(1, 2)]
    assert matches_esper(world)


def test_ids_used_again_in_bulk_are_new_bodies(world):
    world.create_entities(3, Transform.many(0.0), RigidBody.many(mass=1.0))
    world.step()
    with world:
        esper.clear_database()
    world.create_entities(3, Transform.many(5.0), RigidBody.many(mass=2.0))
    world.step()
    assert world.bodies.mass.tolist() == [2.0] * 3
    assert world.bodies.position.tolist() == [[5.0, 5.0]] * 3


def test_a_cleared_world_is_empty(world):
    ball(world, 0.0)
    world.step()
    with world:
        esper.clear_database()
    world.step()
    assert len(world.bodies) == 0


@pytest.mark.parametrize("component", [RigidBody, lambda: SphereCollider(1.0)], ids=["RigidBody", "SphereCollider"])
@pytest.mark.parametrize("plain", [False, True], ids=["facade", "plain esper"])
def test_a_body_without_transform_is_an_error_that_names_the_entity_until_it_is_mended(world, component, plain):
    other = ball(world, 0.0, 60.0)
    world.step()
    before = world.state_hash()
    with world:
        e = esper.create_entity(component())
        message = rf"entity {e} has {type(component()).__name__} but no Transform"
        for _ in range(2):
            with pytest.raises(MissingComponentError, match=message):
                esper.process(world.settings.dt) if plain else world.step()
        assert world.step_count == 1
    world.add_component(e, Transform((50.0, 0.0)))
    world.step()
    assert world.step_count == 2
    assert world.component_for_entity(other, Transform).x == 2.0
    world.remove_component(e, Transform)
    with pytest.raises(MissingComponentError, match=message):
        world.step()
    world.delete_entity(e)
    with world:
        esper.clear_dead_entities()
    world.step()
    assert before != world.state_hash()
    assert matches_esper(world)


def test_nothing_is_disturbed_by_what_cannot_be_taken_in(world):
    """What was right among the changes is taken in once the rest is mended."""
    ball(world, 0.0)
    before = world.state_hash()
    with world:
        good = esper.create_entity(Transform((9, 9)), RigidBody(mass=4.0))
        bad = esper.create_entity(Transform((1, 2, 3)), RigidBody())
    for _ in range(2):
        with pytest.raises(ValueError, match=f"entity {bad}: Transform"):
            world.step()
    world.remove_component(bad, RigidBody)
    world.remove_component(bad, Transform)
    assert world.bodies.entity.tolist() == [1, good]
    assert world.bodies.mass.tolist() == [1.0, 4.0]
    world.delete_entity(good, immediate=True)
    assert world.state_hash() == before


def test_a_component_under_another_type_is_refused(world):
    e = ball(world, 0.0)
    with pytest.raises(TypeError, match="final"):
        world.add_component(e, SphereCollider(1.0), type_alias=AABBCollider)
    with world:
        esper.add_component(e, SphereCollider(1.0), type_alias=AABBCollider)
    with pytest.raises(ValueError, match=f"entity {e} has a SphereCollider under the type AABBCollider"):
        world.step()
    world.remove_component(e, AABBCollider)
    world.step()


# -- kinds ---------------------------------------------------------------------------------------


def test_the_kind_changes_at_run_time():
    world = make_world(gravity=10.0, dt=0.5)
    e, other = ball(world, (0.0, 0.0), (1.0, 0.0)), ball(world, (50.0, 0.0))
    world.step()
    body = world.component_for_entity(e, RigidBody)
    for kind in ("static", "kinematic", "dynamic", "static", "dynamic", "kinematic"):
        body.kind = kind
        assert world.bodies.kinematic.entity.tolist() == ([e] if kind == "kinematic" else [])
        world.step()
        assert matches_esper(world)
        assert body.kind == kind
    assert world.component_for_entity(other, Transform).y < -50  # undisturbed, it has fallen all the time
    body.linear_velocity = (2.0, 0.0)
    place = world.component_for_entity(e, Transform).position.copy()
    world.step()
    np.testing.assert_array_equal(world.component_for_entity(e, Transform).position, place + np.array([1.0, 0.0]))


@pytest.mark.parametrize("old", ["dynamic", "kinematic", "static"])
@pytest.mark.parametrize("new", ["dynamic", "kinematic", "static"])
def test_a_replaced_body_has_the_kind_of_the_new_one(world, old, new):
    e = ball(world, 0.0, kind=old)
    ball(world, 9.0)
    world.step()
    world.add_component(e, RigidBody(kind=new))
    world.step()
    assert matches_esper(world)
    assert world.bodies.static.entity.tolist() == ([e] if new == "static" else [])


def test_a_collider_alone_is_static_and_changes_with_its_body(world):
    e = world.create_entity(Transform((0, 0)), SphereCollider(1.0))
    assert world.bodies.static.entity.tolist() == [e]
    world.add_component(e, RigidBody(linear_velocity=(60.0, 0.0)))
    world.step()
    assert world.bodies.dynamic.entity.tolist() == [e]
    assert world.component_for_entity(e, Transform).x == 1.0
    world.remove_component(e, RigidBody)
    world.step()
    assert world.bodies.static.entity.tolist() == [e]
    assert world.bodies.linear_velocity.tolist() == [[0.0, 0.0]]


def test_a_kind_set_before_adoption_or_inside_a_step_counts(world):
    class Freeze(System):
        def process(self, dt):
            for _, body in self.world.get_component(RigidBody):
                body.kind = "static"

    e = ball(world, 0.0, 60.0)
    world.component_for_entity(e, RigidBody).kind = "kinematic"
    assert world.bodies.kinematic.entity.tolist() == [e]
    freeze = Freeze()
    world.add_system(freeze)
    world.step()
    world.step()
    assert world.component_for_entity(e, Transform).x == 1.0
    assert matches_esper(world)


# -- custom components ---------------------------------------------------------------------------


def test_custom_components_need_no_body_and_join_it_when_it_comes(world):
    ball(world, 0.0)
    lone = world.create_entity(Charge(3.0), Transform((1, 1)))
    world.step()
    charge = world.component_for_entity(lone, Charge)
    assert (charge.entity, charge.value, len(world.bodies)) == (None, 3.0, 1)
    charge.value = 4.0
    world.add_component(lone, RigidBody())
    world.step()
    assert (charge.entity, world.bodies.charge.value.tolist()) == (
        lone,
        [1.0, 4.0],
    )  # a row without one holds the default
    world.remove_component(lone, RigidBody)
    world.step()
    assert (charge.entity, charge.value) == (None, 4.0)
    world.remove_component(lone, Charge)
    world.add_component(lone, RigidBody())
    world.step()
    assert matches_esper(world)


def test_components_of_others_are_none_of_the_tables_business(world):
    e = ball(world, 0.0)
    world.step()
    version = world.physics.table.version
    world.add_component(e, Health())
    world.remove_component(e, Health)
    empty = world.create_entity(Health())
    world.delete_entity(empty)
    world.step()
    assert world.physics.table.version == version


# -- inside a step -------------------------------------------------------------------------------


class Once(System):
    """Does something in the middle of the first step."""

    def __init__(self, action):
        self.action = action

    def process(self, dt):
        action, self.action = self.action, None
        if action is not None:
            action()


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


@pytest.mark.parametrize("immediate", [False, True])
def test_entities_may_be_deleted_by_an_event_handler(world, immediate):
    """ACCURACY C25: no contact of what is gone, and an end for every begin."""
    ids = [ball(world, 0.9 * x) for x in range(5)]
    log = []

    def hit(contact):
        log.append(("begin", contact.entity_a, contact.entity_b))
        for e in (contact.entity_a, contact.entity_b):
            if world.entity_exists(e):
                world.delete_entity(e, immediate=immediate)

    world.on("contact_begin", hit)
    world.on("contact_end", lambda c: log.append(("end", c.entity_a, c.entity_b)))
    for _ in range(3):
        world.step()
    pairs = list(itertools.pairwise(ids))
    assert log == [("begin", *pair) for pair in pairs] + [("end", *pair) for pair in pairs]
    assert len(world.bodies) == 0


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


def test_a_body_created_inside_another_parts_from_it(world):
    """ACCURACY C25."""
    ball(world, 0.0)
    world.step()
    ball(world, 0.1)
    for _ in range(600):
        world.step()
    gap = np.linalg.norm(world.bodies.position[0] - world.bodies.position[1])
    assert 0.97 < gap < 1.05
    assert np.isfinite(world.bodies.position).all()


def test_components_changed_inside_a_step_count_from_the_next(world):
    e = ball(world, 0.0, 60.0)

    def change():
        world.add_component(e, RigidBody(linear_velocity=(120.0, 0.0)))

    world.add_system(Once(change))
    world.step()
    assert world.bodies.position[0, 0] == 1.0
    world.step()
    assert world.bodies.position[0, 0] == 3.0
    assert matches_esper(world)


# -- many changes --------------------------------------------------------------------------------


def test_any_sequence_of_changes_leads_to_what_esper_has():
    """Random operations, plain and through the facade, with a look at every row after each round."""
    rng = np.random.default_rng(7)
    world = make_world()
    make = {
        Transform: lambda: Transform(rng.normal(size=2) * 100),
        RigidBody: lambda: RigidBody(rng.random() + 0.1, kind=("dynamic", "kinematic", "static")[rng.integers(3)]),
        SphereCollider: lambda: SphereCollider(2 + rng.random()),  # holds the box, if one has both
        AABBCollider: lambda: AABBCollider(rng.random(2), layer=2),
        Charge: lambda: Charge(rng.normal()),
    }
    types = list(make)
    alive: list[int] = []
    spare: list[Component] = []  # handles that have been in use before
    for _ in range(60):
        for _ in range(int(rng.integers(1, 12))):
            action = rng.integers(6)
            if action <= 1 or not alive:
                chosen = [Transform, *(c for c in types[1:] if rng.random() < 0.5)]
                parts = [make[c]() for c in chosen]
                if action == 0:
                    alive.append(world.create_entity(*parts))
                else:
                    with world:
                        alive.append(esper.create_entity(*parts))
                continue
            e = int(rng.choice(alive))
            component = types[int(rng.integers(1, len(types)))]
            if action == 2:
                alive.remove(e)
                world.delete_entity(e, immediate=bool(rng.integers(2)))
            elif action == 3 and world.has_component(e, component):
                spare.append(world.remove_component(e, component))
            elif action == 4:
                world.add_component(e, make[component]())
            elif action == 5:
                again = [h for h in spare if type(h) is component]
                if again:
                    spare.remove(again[0])
                    world.add_component(e, again[0])
        world.step()
        assert matches_esper(world)


@pytest.mark.slow
def test_a_thousand_come_and_go_per_step_among_ten_thousand():
    """The step stays in proportion to what changes: the table is put in order once, whatever the number."""
    world = make_world()
    rng = np.random.default_rng(3)

    def spawn(n):
        return world.create_entities(
            n, Transform.many(rng.random((n, 2)) * 1000), RigidBody.many(), SphereCollider.many(0.2)
        )

    alive = list(spawn(10_000))
    world.step()
    seconds = []
    for _ in range(10):
        for e in alive[:1000]:
            world.delete_entity(e)
        alive = [*alive[1000:], *spawn(1000)]
        started = time.process_time()
        world.step()
        seconds.append(time.process_time() - started)
        assert world.bodies.entity.tolist() == alive
    assert matches_esper(world)
    assert np.median(seconds) < 0.1


def test_nothing_changed_costs_next_to_nothing_whatever_the_size():
    """The median of short runs, so that a busy machine does not fail it: about 2 us."""
    world = make_world()
    world.create_entities(20_000, Transform.many(0.0), RigidBody.many())
    world.bodies  # noqa: B018
    prefab = RigidBody()  # held by the game and never adopted: no reason to look at anything
    synchronize = world._pipeline.synchronize
    runs = []
    for _ in range(20):
        started = time.perf_counter()
        for _ in range(100):
            synchronize()
        runs.append((time.perf_counter() - started) / 100)
    assert np.median(runs) < 20e-6
    assert prefab.entity is None

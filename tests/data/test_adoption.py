"""esper's components against the table: components replaced, removed, added again; ids reused; kinds."""

from __future__ import annotations

import esper
import numpy as np
import pytest
from data import helpers_adoption
from data.helpers_adoption import Charge, matches_esper
from worlds import ball, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import MissingComponentError

pytestmark = [pytest.mark.plain, pytest.mark.usefixtures("invariants")]

world = helpers_adoption.world  # a fixture


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
    """Swapped, moved, or taken from another entity: no new handle indicates the change."""
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


@pytest.mark.parametrize("bulk", [False, True], ids=["one by one", "in bulk"])
def test_ids_used_again_after_clear_database_are_new_bodies(world, bulk):
    ended = []
    world.on("contact_end", lambda contact: ended.append((contact.entity_a, contact.entity_b)))

    def pair(xs, masses):
        if not bulk:
            return [ball(world, x, mass=mass) for x, mass in zip(xs, masses, strict=True)]
        places = Transform.many([(x, 0.0) for x in xs])
        return list(world.create_entities(2, places, RigidBody.many(mass=masses), SphereCollider.many(0.5)))

    old = pair((0.0, 0.8), (1.0, 1.0))
    world.step()
    handle = world.component_for_entity(old[0], Transform)
    place = handle.position.copy()
    with world:
        esper.clear_database()
        assert list(esper.get_entities()) == []
    assert pair((40.0, 50.0), (7.0, 1.0)) == old
    world.step()
    assert world.bodies.position[:, 0].tolist() == [40.0, 50.0]
    assert world.bodies.mass.tolist() == [7.0, 1.0]
    assert handle.entity is None
    np.testing.assert_array_equal(handle.position, place)
    assert ended == [(1, 2)]
    assert matches_esper(world)


@pytest.mark.parametrize("how", ["facade", "plain esper", "in bulk"])
def test_a_body_without_transform_is_an_error_that_names_the_entity_until_it_is_mended(world, how):
    other = ball(world, 0.0, 60.0)
    world.step()
    bad = []

    def refused(component):
        with world, pytest.raises(MissingComponentError, match=f"entity {bad[0]} has {component} but no Transform"):
            esper.process(world.settings.dt) if how == "plain esper" else world.step()
        assert world.step_count == 1

    with world:
        if how == "in bulk":
            bad += world.create_entities(2, RigidBody.many())
        else:
            bad += [esper.create_entity(RigidBody()), world.create_entity(SphereCollider(1.0))]
    refused("RigidBody")
    refused("RigidBody")
    world.add_component(bad.pop(0), Transform((50.0, 0.0)))
    refused("RigidBody" if how == "in bulk" else "SphereCollider")
    world.delete_entity(bad[0], immediate=True)
    world.step()
    assert world.component_for_entity(other, Transform).x == 2.0
    assert len(world.bodies) == 2
    assert matches_esper(world)


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

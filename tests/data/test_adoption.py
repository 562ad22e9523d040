"""esper's components against the table: components replaced, removed, added again; ids reused; kinds."""

from __future__ import annotations

import esper
import numpy as np
import pytest
from data import helpers_adoption
from data.helpers_adoption import Charge, matches_esper
from worlds import ball, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import MissingComponentError, System

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
    """Valid changes are adopted once the others are corrected."""
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

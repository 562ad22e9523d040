"""Component classes, their columns by name, and components as handles: before adoption, bound, after deletion."""

from __future__ import annotations

import copy

import esper
import numpy as np
import pytest
from data.helpers_components import Charge, Everything, full
from worlds import ball, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import CaromError, Component, ForceSystem, NoPhysicsError, Phase, System, World, column
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.capsule import plugin as capsule

pytestmark = pytest.mark.plain


@pytest.mark.parametrize("base", [Transform, RigidBody, SphereCollider, AABBCollider, Charge])
def test_component_classes_are_final(base):
    with pytest.raises(TypeError, match=f"{base.__name__} is final"):
        type("Derived", (base,), {})


def test_constructors_say_what_they_take():
    with pytest.raises(TypeError, match="needs a value for 'plain'"):
        Everything()
    with pytest.raises(TypeError, match=r"has no field 'colour'; it has plain, count"):
        Everything(1, colour=3)
    with pytest.raises(TypeError, match="twice"):
        Everything(1, plain=2)
    with pytest.raises(TypeError, match="takes 1 values"):
        Charge(1.0, 2.0)
    with pytest.raises(TypeError, match="copy"):
        type("Bad", (Component,), {"copy": column(0.0)})
    for wrong in ({"item": "matrix"}, {"dtype": str}):
        with pytest.raises(ValueError, match="column"):
            column(0.0, **wrong)


def test_classes_without_slots_may_keep_more_than_columns():
    class Player(Component):
        score = column(0, dtype=int)

        def __init__(self, name):
            super().__init__()
            self.name = name

    world = make_world()
    e = world.create_entity(Transform((0, 0)), RigidBody(), Player("Ada"))
    world.step()
    player = world.component_for_entity(e, Player)
    player.score += 1
    assert (player.name, world.bodies.player.score.tolist(), player.copy().name) == ("Ada", [1], "Ada")


def test_names_that_would_hide_others_are_refused_and_nothing_is_disturbed():
    world = make_world()
    e = ball(world, 0.0)
    world.step()
    for name in ("Charge", "Force", "Static", "Position"):
        clash = type(name, (Component,), {"value": column(0.0)})
        if name == "Charge":
            world.add_component(e, Charge(1.0))
            world.step()
        world.add_component(e, clash())
        with pytest.raises(ValueError, match=name):
            world.step()
        world.remove_component(e, clash)
        world.step()
    assert world.bodies.charge.value.tolist() == [1.0]


def test_columns_of_ones_own_have_a_namespace():
    world = make_world()
    charged, plain = ball(world, 0.0), ball(world, 5.0)
    world.add_component(charged, Charge(2.5))
    bodies = world.bodies
    assert bodies.charge.value.tolist() == [2.5, 0.0]
    assert bodies.has(Charge).tolist() == [True, False]
    assert bodies.dynamic.charge.value.tolist() == [2.5, 0.0]
    assert bodies.row_of(plain) == 1
    with pytest.raises(AttributeError, match="no column 'colour'"):
        _ = bodies.colour
    with pytest.raises(AttributeError, match="charge"):
        _ = bodies.charge.colour
    assert "charge" in dir(bodies)
    assert not bodies.has(Everything).any()


def test_assigning_to_a_column_writes_into_it():
    world = make_world()
    e = ball(world, 0.0)
    world.add_component(e, Charge(2.0))
    bodies = world.bodies
    bodies.linear_velocity = (1.0, 2.0)
    bodies.mass += 1.0
    bodies.charge.value *= 3.0
    assert world.component_for_entity(e, RigidBody).linear_velocity.tolist() == [1.0, 2.0]
    assert world.component_for_entity(e, RigidBody).mass == 2.0
    assert world.component_for_entity(e, Charge).value == 6.0
    for x in range(100):  # the array has been reallocated: ``bodies`` must not hold the old one
        ball(world, x + 5.0)
    assert len(world.bodies.mass) == len(bodies.mass) == 101
    with pytest.raises(AttributeError):
        bodies.speed = 1.0
    with pytest.raises(AttributeError):
        bodies.charge = 1.0
    for name in ("entity", "kind"):
        with pytest.raises(ValueError, match="read-only"):
            setattr(bodies, name, 0)


def test_the_kinds_are_contiguous_slices():
    world = make_world()
    kinds = ["static", "dynamic", "kinematic", "dynamic", "static", "kinematic"]
    ids = [ball(world, 3.0 * x, kind=kind) for x, kind in enumerate(kinds)]
    bodies = world.bodies
    for kind in ("dynamic", "kinematic", "static"):
        part = getattr(bodies, kind)
        assert part.entity.tolist() == [e for e, k in zip(ids, kinds, strict=True) if k == kind]
        assert len(part) == 2
        assert np.shares_memory(part.mass, bodies.mass)
        assert part.mass.flags.c_contiguous


def test_unbound_components_hold_what_they_were_given():
    transform = Transform((1, 2), rotation=0.5)
    body = RigidBody(2, (3, 4), constant_force=(0, -1), gravity_scale=0, linear_damping=0.1, kind="kinematic")
    sphere = SphereCollider(0.5, offset=(0.1, 0), restitution=0.8, friction=0.3, sensor=True, layer=2, mask=6, group=-3)
    assert transform.position.tolist() == [1.0, 2.0]
    assert (transform.x, transform.y, transform.rotation, transform.entity) == (1.0, 2.0, 0.5, None)
    with pytest.raises(IndexError):
        _ = transform.z
    assert (body.mass, body.gravity_scale, body.linear_damping, body.kind) == (2.0, 0.0, 0.1, "kinematic")
    assert (body.linear_velocity.tolist(), body.max_linear_speed) == ([3.0, 4.0], None)
    assert (sphere.radius, sphere.restitution, sphere.friction, sphere.sensor) == (0.5, 0.8, 0.3, True)
    assert (sphere.layer, sphere.mask, sphere.group) == (2, 6, -3)
    assert (SphereCollider(1).mask, SphereCollider(1).group) == (-1, 0)
    assert SphereCollider(1).friction is None
    transform.y = 7
    body.mass = 3.5
    assert (transform.position.tolist(), body.mass) == ([1.0, 7.0], 3.5)
    assert repr(transform) == "Transform(position=[1.0, 7.0], rotation=0.5)"


def test_what_is_given_is_copied():
    place = np.array([1.0, 2.0])
    transform = Transform(place)
    place[:] = 9.0
    assert transform.position.tolist() == [1.0, 2.0]


def test_adoption_keeps_the_values_and_binds_the_handle():
    for d in (2, 3):
        world, e, everything = full(d)
        assert everything is world.component_for_entity(e, Everything)
        assert everything.entity == e
        got = {name: getattr(everything, name) for name in Everything.columns}
        assert got.pop("push").tolist() == [1.0, 2.0, 3.0][:d]
        facing = got.pop("facing")
        assert facing == 0.0 if d == 2 else facing.tolist() == [1.0, 0.0, 0.0, 0.0]
        assert got == {
            "plain": 5.0, "count": 3, "on": False, "size": 1.0, "level": 0.0, "limit": None, "mode": "idle",
        }  # fmt: skip


def test_setters_write_through_to_the_columns():
    world, _, everything = full()
    everything.count, everything.on, everything.mode = 7, True, "busy"
    everything.limit, everything.push = 2.5, (3, 4)
    columns = world.bodies.everything
    assert columns.count.tolist() == [7]
    assert columns.count.dtype == np.int64
    assert columns.on.tolist() == [True]
    assert columns.limit.tolist() == [2.5]
    assert columns.push.tolist() == [[3.0, 4.0]]
    assert (everything.count, everything.on, everything.mode) == (7, True, "busy")
    everything.limit = None
    assert everything.limit is None
    assert np.isnan(columns.limit[0])


def test_vectors_are_views_of_the_row_both_ways():
    world = make_world()
    e = ball(world, 0.0)
    transform = world.component_for_entity(e, Transform)
    column_of_all = world.bodies.position
    transform.position[0] = 3.0
    assert column_of_all[0, 0] == 3.0
    column_of_all[0, 1] = 4.0
    assert (transform.x, transform.y) == (3.0, 4.0)
    transform.x = 5.0
    assert column_of_all.tolist() == [[5.0, 4.0]]


def test_one_number_stands_for_a_whole_vector():
    world = make_world(3)
    e = world.create_entity(Transform((2, 2, 2)), RigidBody(linear_velocity=1.5))
    assert world.component_for_entity(e, RigidBody).linear_velocity.tolist() == [1.5, 1.5, 1.5]
    assert world.bodies.linear_velocity.tolist() == [[1.5, 1.5, 1.5]]


def test_static_bodies_are_read_only_but_for_assignment():
    world = make_world()
    e = world.create_entity(Transform((0, 0)), SphereCollider(1.0))
    transform = world.bodies and world.component_for_entity(e, Transform)
    with pytest.raises(ValueError, match="read-only"):
        transform.position[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        world.bodies.static.position[0, 0] = 1.0
    transform.position = (3, 4)
    assert world.bodies.static.position.tolist() == [[3.0, 4.0]]
    assert world.query_point((3.0, 4.5)) == [e]
    assert world.query_point((0.0, 0.0)) == []


@pytest.mark.compiled
def test_handles_stay_valid_through_growth_and_the_deletion_of_others():
    world = make_world()
    rng = np.random.default_rng(1)
    handles: dict[int, Transform] = {}
    for _ in range(30):
        for x in range(int(rng.integers(1, 30))):
            kind = ("dynamic", "kinematic", "static")[int(rng.integers(3))]
            e = ball(world, (100.0 * len(handles) + x, 5.0), kind=kind)
            handles[e] = world.component_for_entity(e, Transform)
            handles[e].y = e
        for e in rng.permutation(list(handles))[: int(rng.integers(0, 15))].tolist():
            del handles[e]
            world.delete_entity(e, immediate=bool(e % 2))
        world.step()
        assert sorted(world.bodies.entity.tolist()) == sorted(handles)
        for e, handle in handles.items():
            assert handle.entity == e
            assert handle.y == e
            assert handle.position.tolist() == world.bodies.position[world.bodies.row_of(e)].tolist()
    assert len(handles) > 64  # the tables have grown


def test_handles_of_deleted_entities_keep_their_last_values():
    world = make_world(dt=1.0)
    e, other = ball(world, (0.0, 1.0), (2.0, 0.0)), ball(world, (50.0, 0.0))
    world.step()
    transform, body = world.component_for_entity(e, Transform), world.component_for_entity(e, RigidBody)
    world.delete_entity(e)
    world.step()
    assert transform.entity is None
    assert transform.position.tolist() == [2.0, 1.0]
    assert (body.mass, body.kind) == (1.0, "dynamic")
    transform.x = -1.0  # unbound by now: no other body moves
    assert transform.x == -1.0
    assert world.bodies.position.tolist() == [[50.0, 0.0]]
    assert world.bodies.entity.tolist() == [other]
    again = world.create_entity(transform, body, SphereCollider(0.5))
    world.step()
    assert transform.entity == again
    assert transform.position.tolist() == [1.0, 1.0]


def test_copies_are_unbound_and_share_nothing():
    world, e, everything = full()
    for twin in (everything.copy(), copy.copy(everything), copy.deepcopy(everything)):
        assert twin.entity is None
        assert repr(twin) == repr(everything)
        twin.push[0] = 99.0
        twin.plain = 98.0
        assert (everything.push[0], everything.plain) == (1.0, 5.0)
    body = world.component_for_entity(e, RigidBody)
    body.apply_force((1.0, 0.0))
    assert body.copy().applied_force.tolist() == [1.0, 0.0]


@pytest.mark.parametrize("adopted_before", [False, True])
def test_a_prefab_used_twice_is_an_error_that_says_copy(adopted_before):
    world = make_world()
    body = RigidBody()
    first = world.create_entity(Transform((0, 0)), body)
    if adopted_before:
        world.step()
    second = world.create_entity(Transform((1, 0)), body)
    with pytest.raises(ValueError, match=rf"RigidBody .*{first} and {second}.*copy\(\)"):
        world.step()
    world.add_component(second, body.copy())
    world.step()
    assert len(world.bodies) == 2


def test_a_component_of_another_world_is_an_error_that_says_copy():
    here, there = make_world(), make_world()
    ball(here, 0.0)
    there.step()
    e = ball(there, 0.0)
    there.step()
    stolen = there.component_for_entity(e, RigidBody)
    here.create_entity(Transform((5, 5)), stolen)
    with pytest.raises(ValueError, match=r"another world.*copy\(\)"):
        here.step()
    assert stolen.entity == e
    assert there.bodies.entity.tolist() == [e]
    there.close()  # then it can be used
    here.step()
    assert len(here.bodies) == 2


class Bullet(Component):
    expires: float = column(default=3.0)


@pytest.mark.parametrize("how", ["register", "prepare", "a body", "a batch"])
def test_columns_are_there_from_the_moment_the_world_knows_the_component(how):
    world = make_world(2)
    with pytest.raises(AttributeError, match=r"no column 'bullet'.*world\.register"):
        _ = world.bodies.bullet
    if how in ("register", "prepare"):
        getattr(world, how)(Bullet)
        assert world.bodies.bullet.expires.shape == (0,)
    bullet = ball(world, (0, 0))
    other = ball(world, (9, 0))
    if how == "a batch":
        world.create_entities(1, Transform.many((5, 5)), SphereCollider.many(1.0), Bullet.many(7.0))
    else:
        world.add_component(bullet, Bullet(7.0))
    assert sorted(world.bodies.bullet.expires.tolist())[-1] == 7.0
    assert world.bodies.has(Bullet).sum() == 1
    if how != "a batch":
        assert world.bodies.bullet.expires[world.bodies.row_of(other)] == 3.0


def test_a_system_reads_columns_before_the_first_body_has_them():
    """A force system is called once a body has what it requires."""
    seen = []

    class Ages(System):
        phase = Phase.START

        def process(self, dt):
            seen.append(self.world.bodies.bullet.expires.tolist())

    class Pull(ForceSystem):
        requires = (Bullet,)

        def add_forces(self, bodies, time):
            bodies.force[:, 0] += bodies.bullet.expires

    world = make_world(2)
    world.register(Bullet)
    world.add_system(Ages())
    world.add_system(Pull())
    world.step()
    world.add_component(ball(world, (0, 0)), Bullet(1.0))
    world.step()
    assert seen == [[], [1.0]]
    assert world.momentum()[0] == pytest.approx(world.settings.dt)


def test_registering_changes_no_bit():
    """A component and a collider that nobody has: the same hash after the same steps, before and after others come."""
    worlds = [make_world(2, gravity=-9.81) for _ in range(2)]
    for world in worlds:
        world.add_plugin(capsule)
    worlds[1].register(Bullet, CapsuleCollider)
    for world in worlds:
        ball(world, (0, 0), kind="static")
        ball(world, (0.3, 2.0))
        for k in range(60):
            if k == 30:
                world.add_component(ball(world, (0.1, 5.0)), Bullet())
            world.step()
    assert worlds[0].state_hash() == worlds[1].state_hash()


def test_what_cannot_be_registered_is_refused():
    class Mass(Component):
        prefix_taken: float = column(default=0.0)

    world = make_world(2)
    with pytest.raises(TypeError, match="register takes component types"):
        world.register(Bullet())
    with pytest.raises(ValueError, match="bodies have mass already"):
        world.register(Mass)
    with pytest.raises(NoPhysicsError):
        World().register(Bullet)
    errors = []

    class Registers(System):
        def process(self, dt):
            with pytest.raises(CaromError) as caught:
                self.world.register(Bullet)
            errors.append(str(caught.value))

    world.add_system(Registers())
    with world:
        esper.process(world.settings.dt)
    assert errors == ["components can be registered between steps only, not inside one"]
    with pytest.raises(AttributeError, match="did you mean 'linear_velocity'"):
        _ = world.bodies.linear_velocty

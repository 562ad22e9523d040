"""Components as handles: values before adoption, rows after it, checks on every way in, columns by name."""

from __future__ import annotations

import copy
import math
import re
import time

import esper
import numpy as np
import pytest
from worlds import ball, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, System, column

NAN, INF = math.nan, math.inf


class Charge(Component):
    value = column(default=0.0)


class Everything(Component):
    """Every option that a column has."""

    plain = column()
    count = column(3, dtype=int)
    on = column(False, dtype=bool)
    size = column(1.0, positive=True)
    level = column(0.0, minimum=-2.0)
    limit = column(None, optional=True, minimum=0.0)
    mode = column("idle", choices=("idle", "busy", "gone"))
    push = column(0.0, item="vector")
    facing = column(0.0, item="rotation")


def full(d=2):
    """A world with one body that has everything."""
    world = make_world(d)
    e = ball(world, 0.0)
    world.add_component(e, Everything(5.0, push=(1.0, 2.0, 3.0)[:d]))
    assert len(world.bodies) == 1
    return world, e, world.component_for_entity(e, Everything)


# -- values --------------------------------------------------------------------------------------


def test_unbound_components_hold_what_they_were_given():
    transform = Transform((1, 2), rotation=0.5)
    body = RigidBody(2, (3, 4), constant_force=(0, -1), gravity_scale=0, linear_damping=0.1, kind="kinematic")
    sphere = SphereCollider(0.5, offset=(0.1, 0), restitution=0.8, friction=0.3, sensor=True, layer=2, mask=6)
    assert transform.position.tolist() == [1.0, 2.0]
    assert (transform.x, transform.y, transform.rotation, transform.entity) == (1.0, 2.0, 0.5, None)
    with pytest.raises(IndexError):
        _ = transform.z
    assert (body.mass, body.gravity_scale, body.linear_damping, body.kind) == (2.0, 0.0, 0.1, "kinematic")
    assert (body.linear_velocity.tolist(), body.max_linear_speed) == ([3.0, 4.0], None)
    assert (sphere.radius, sphere.restitution, sphere.friction, sphere.sensor) == (0.5, 0.8, 0.3, True)
    assert (sphere.layer, sphere.mask, SphereCollider(1).mask) == (2, 6, -1)
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


def test_x_y_z_in_three_dimensions():
    world = make_world(3)
    e = world.create_entity(Transform((1, 2, 3)), RigidBody())
    world.step()
    transform = world.component_for_entity(e, Transform)
    transform.z = 9
    assert (transform.x, transform.y, transform.z) == (1.0, 2.0, 9.0)
    assert world.bodies.position.tolist() == [[1.0, 2.0, 9.0]]


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


def test_assigning_a_position_is_a_teleport():
    world = make_world(dt=1.0)
    e = ball(world, 0.0, 2.0)
    world.step()
    world.advance(0.5)
    transform = world.component_for_entity(e, Transform)
    assert transform.interpolated_position.tolist() == [1.0, 0.0]
    transform.position = (10.0, 0.0)
    assert transform.interpolated_position.tolist() == [10.0, 0.0]


# -- handles last --------------------------------------------------------------------------------


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
    transform.x = -1.0  # its own by now: nobody else moves
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


def test_a_prefab_is_copied_for_each_entity():
    world = make_world()
    prefab = RigidBody(mass=3.0, linear_velocity=(1.0, 0.0))
    for x in range(3):
        world.create_entity(Transform((x, 0)), prefab.copy())
    world.step()
    assert world.bodies.mass.tolist() == [3.0, 3.0, 3.0]
    assert prefab.entity is None


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
    there.close()  # then it is free
    here.step()
    assert len(here.bodies) == 2


# -- classes -------------------------------------------------------------------------------------


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


def test_misspelt_fields_of_built_in_components_are_errors():
    with pytest.raises(AttributeError):
        RigidBody().linear_velocty = (1, 2)
    with pytest.raises(TypeError):
        RigidBody(masss=1)


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


# -- columns by name -----------------------------------------------------------------------------


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
    for x in range(100):  # another array by now: nothing old may have stuck to ``bodies``
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


# -- wrong values --------------------------------------------------------------------------------

WRONG = [
    (lambda v: Transform(v), "Transform.position", [(1, 2, 3, 4), (1,), ((1, 2), (3, 4)), "ab", None, {}]),
    (lambda v: Transform(v), "Transform.position", [(NAN, 0), (0, INF), (True, 2.0), (1 + 2j, 0), (10**400, 0)]),
    (lambda v: Transform((0, 0), v), "Transform.rotation", [NAN, INF, (1, 2), (0, 0, 0, 0), "north"]),
    (lambda v: RigidBody(v), "RigidBody.mass", [0, -1, NAN, INF, -INF, 1e-320, 1e-310]),
    (lambda v: RigidBody(v), "RigidBody.mass", [True, "1", None, (1, 2), 10**400]),
    (lambda v: RigidBody(1, v), "RigidBody.linear_velocity", [(NAN, 0), (0, -INF), (1, 2, 3, 4), "fast", True]),
    (lambda v: RigidBody(constant_force=v), "RigidBody.constant_force", [(NAN, 0), INF]),
    (lambda v: RigidBody(gravity_scale=v), "RigidBody.gravity_scale", [NAN, INF, True, (1, 2)]),
    (lambda v: RigidBody(linear_damping=v), "RigidBody.linear_damping", [-1e-300, NAN, INF]),
    (lambda v: RigidBody(max_linear_speed=v), "RigidBody.max_linear_speed", [-1.0, NAN, INF, "none", False]),
    (lambda v: RigidBody(kind=v), "RigidBody.kind", ["ghost", None, 0, ["dynamic"], np.array([1, 2])]),
    (lambda v: SphereCollider(v), "SphereCollider.radius", [-1, -1e-300, NAN, INF, True, None, (1, 2)]),
    (lambda v: SphereCollider(1, restitution=v), "SphereCollider.restitution", [-0.1, NAN, INF, True]),
    (lambda v: SphereCollider(1, friction=v), "SphereCollider.friction", [-0.1, NAN, INF]),
    (lambda v: SphereCollider(1, sensor=v), "SphereCollider.sensor", [1, 0, "yes", None]),
    (lambda v: SphereCollider(1, layer=v), "SphereCollider.layer", [1.0, True, "1", 2**63, None]),
    (lambda v: SphereCollider(1, mask=v), "SphereCollider.mask", [0.5, 2**64 - 1]),
    (lambda v: AABBCollider(v), "AABBCollider.half_extents", [(1, -1), (NAN, 1), (1, 2, 3, 4), -1.0, "big"]),
    (lambda v: AABBCollider(1, offset=v), "AABBCollider.offset", [(INF, 0), (1, 2, 3, 4)]),
    (lambda v: Everything(1, size=v), "Everything.size", [0.0, -1.0, NAN]),
    (lambda v: Everything(1, level=v), "Everything.level", [-2.5, NAN]),
    (lambda v: Everything(1, mode=v), "Everything.mode", ["asleep"]),
    (lambda v: Everything(1, count=v), "Everything.count", [1.5, NAN, True]),
    (lambda v: Everything(1, on=v), "Everything.on", [1]),
]
CASES = [(make, field, value) for make, field, values in WRONG for value in values]


@pytest.mark.parametrize(("make", "field", "value"), CASES, ids=[f"{f}={str(v)[:20]}" for _, f, v in CASES])
def test_wrong_values_are_refused_by_the_constructor(make, field, value):
    """ACCURACY C8 to C13."""
    with pytest.raises(ValueError, match=re.escape(field)) as caught:
        make(value)
    assert "got" in str(caught.value)


@pytest.mark.parametrize(("make", "field", "value"), CASES, ids=[f"{f}={str(v)[:20]}" for _, f, v in CASES])
def test_wrong_values_are_refused_by_the_setter_which_names_the_entity(make, field, value):
    owner, name = field.split(".")
    world = make_world()
    e = world.create_entity(
        Transform((1, 2)), RigidBody(), SphereCollider(2.0), AABBCollider((1, 1)), Everything(1)
    )  # fmt: skip
    world.bodies  # noqa: B018
    before = world.state_hash()
    handle = next(c for c in world.components_for_entity(e) if type(c).__name__ == owner)
    with pytest.raises(ValueError, match=rf"entity {e}: {re.escape(field)}"):
        setattr(handle, name, value)
    assert world.state_hash() == before


def test_the_message_quotes_the_value():
    with pytest.raises(ValueError, match=r"RigidBody\.mass must be positive, got -2$"):
        RigidBody(mass=-2)
    with pytest.raises(ValueError, match=r"Transform\.position must be finite, got \(nan, 1\)"):
        Transform((NAN, 1))


def test_extreme_values_that_are_right_are_taken():
    assert RigidBody(mass=6e-309).mass == 6e-309  # 1/m is finite
    assert RigidBody(mass=1e300).mass == 1e300
    assert SphereCollider(0).radius == 0.0
    assert SphereCollider(1e-310).radius == 1e-310
    assert SphereCollider(1, restitution=1.5).restitution == 1.5
    assert AABBCollider((0, 1)).half_extents.tolist() == [0.0, 1.0]
    assert Transform(np.array([1, 2], np.int32)).position.dtype == float
    assert SphereCollider(1, layer=np.int16(4), mask=-1).layer == 4
    assert Transform((0, 0, 0), (0, 0, 3e-200, 4e-200)).rotation.tolist() == pytest.approx([0, 0, 0.6, 0.8], rel=1e-15)


def test_from_bounds():
    box = AABBCollider.from_bounds((-1, 0), (3, 1), restitution=0.5)
    assert (box.half_extents.tolist(), box.offset.tolist(), box.restitution) == ([2.0, 0.5], [1.0, 0.5], 0.5)
    for lower, upper in (((0, 0), (1, -1)), ((NAN, 0), (1, 1)), ((0, 0, 0), (1, 1)), ((0, 0), (INF, 1)), ("a", "b")):
        with pytest.raises(ValueError, match="AABBCollider"):
            AABBCollider.from_bounds(lower, upper)


@pytest.mark.parametrize(
    "component",
    [
        lambda: Transform((1, 2, 3)),
        lambda: RigidBody(linear_velocity=(1, 2, 3)),
        lambda: SphereCollider(1, offset=(1, 2, 3)),
        lambda: AABBCollider((1, 2, 3)),
        lambda: Transform((1, 2), rotation=(1, 0, 0, 0)),
    ],
)
def test_the_wrong_dimension_is_refused_at_the_call_or_at_the_next_step(component):
    world = make_world(2)
    survivor = ball(world, 0.0)
    name = type(component()).__name__
    with pytest.raises(ValueError, match=name):
        world.create_entity(component())
    with pytest.raises(ValueError, match=rf"entity {survivor}: {name}"):
        world.add_component(survivor, component())
    before = world.state_hash()
    with world:  # plain esper cannot know: then the step says which entity
        e = esper.create_entity(Transform((0, 0)), RigidBody())
        esper.add_component(e, component())
    with pytest.raises(ValueError, match=rf"entity {e}: {name}"):
        world.step()
    with world, pytest.raises(ValueError, match=rf"entity {e}: {name}"):
        esper.process(world.settings.dt)
    assert world.step_count == 0
    world.delete_entity(e, immediate=True)
    assert world.state_hash() == before
    world.step()


def test_a_rotation_in_three_dimensions_is_a_quaternion():
    world = make_world(3)
    with pytest.raises(ValueError, match=r"Transform\.rotation must be a quaternion"):
        world.create_entity(Transform((0, 0, 0), rotation=0.5))
    e = world.create_entity(Transform((0, 0, 0), rotation=(2, 0, 0, 0)), RigidBody())
    world.step()
    assert world.component_for_entity(e, Transform).rotation.tolist() == [1.0, 0.0, 0.0, 0.0]


def test_a_component_from_a_world_of_other_dimensions_is_refused():
    flat, deep = make_world(2), make_world(3)
    e = ball(flat, 0.0)
    flat.step()
    body = flat.component_for_entity(e, RigidBody)
    flat.delete_entity(e)
    flat.step()
    with pytest.raises(ValueError, match=r"RigidBody\.linear_velocity must have 3 components"):
        deep.create_entity(Transform((0, 0, 0)), body)


@pytest.mark.parametrize("call", ["apply_force", "apply_impulse"])
@pytest.mark.parametrize("value", [(NAN, 0), (INF, 0), (1, 2, 3), ((1, 2), (3, 4)), "hard", None])
def test_forces_and_impulses_are_checked(call, value):
    world = make_world()
    e = ball(world, 0.0)
    before = world.state_hash()
    with pytest.raises(ValueError, match=call.removeprefix("apply_")):
        getattr(world.component_for_entity(e, RigidBody), call)(value)
    assert world.state_hash() == before


# -- many ----------------------------------------------------------------------------------------


def test_many_broadcasts_and_gives_consecutive_ids():
    world = make_world()
    positions = np.arange(8.0).reshape(4, 2)
    ids = world.create_entities(
        4,
        Transform.many(positions, rotation=0.25),
        RigidBody.many(mass=[1, 2, 3, 4], linear_velocity=(1, 2), kind=["dynamic", "static", "dynamic", "kinematic"]),
        SphereCollider.many(radius=0.5, restitution=np.linspace(0, 1, 4), friction=[None, 0.5, None, 0.1], layer=2),
        Everything.many(plain=np.arange(4), mode="busy", limit=None),
    )
    assert list(ids) == [1, 2, 3, 4]
    positions[:] = -1.0  # theirs are copies
    for e in ids:
        transform, body = world.component_for_entity(e, Transform), world.component_for_entity(e, RigidBody)
        sphere, everything = world.component_for_entity(e, SphereCollider), world.component_for_entity(e, Everything)
        for _ in range(2):  # before adoption and after it
            assert transform.position.tolist() == [2.0 * e - 2, 2.0 * e - 1]
            assert (transform.rotation, body.mass, sphere.radius, sphere.layer) == (0.25, float(e), 0.5, 2)
            assert body.kind == ["dynamic", "static", "dynamic", "kinematic"][e - 1]
            assert sphere.friction == [None, 0.5, None, 0.1][e - 1]
            assert (everything.plain, everything.mode, everything.limit, everything.count) == (e - 1, "busy", None, 3)
            assert len(world.bodies) == 4


def test_many_in_three_dimensions():
    world = make_world(3)
    turns = [(1, 0, 0, 0), (0, 0, 0, 2)]
    world.create_entities(2, Transform.many(np.zeros((2, 3)), rotation=turns), AABBCollider.many(1.0, offset=(1, 2, 3)))
    assert world.bodies.rotation.tolist() == [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    world.create_entities(2, Transform.many(0.0), AABBCollider.many([[1, 2, 3], [4, 5, 6]]))
    assert world.bodies.rotation.tolist()[2:] == [[1.0, 0.0, 0.0, 0.0]] * 2


@pytest.mark.parametrize(
    ("many", "message"),
    [
        (lambda: RigidBody.many(mass=[1, 2, 0]), r"RigidBody\.mass must be positive \(row 2\), got 0"),
        (lambda: RigidBody.many(mass=-1.0), r"RigidBody\.mass must be positive, got -1"),
        (lambda: RigidBody.many(mass=[1, 1e-320, 1]), r"RigidBody\.mass .*\(row 1\)"),
        (lambda: RigidBody.many(mass=[1, 2]), r"RigidBody\.mass .*shape \(3,\)"),
        (lambda: RigidBody.many(mass=[True, True, True]), r"RigidBody\.mass"),
        (lambda: RigidBody.many(mass=[1, True, 2]), r"RigidBody\.mass"),
        (lambda: RigidBody.many(kind=["static", "dynamic", "gas"]), r"RigidBody\.kind .*\(row 2\), got 'gas'"),
        (lambda: RigidBody.many(max_linear_speed=[1, None, NAN]), r"RigidBody\.max_linear_speed .*\(row 2\)"),
        (lambda: RigidBody.many(max_linear_speed=[1, None, -2]), r"RigidBody\.max_linear_speed .*\(row 2\), got -2"),
        (lambda: RigidBody.many(linear_velocity=[[0, 0], [0, INF], [0, 0]]), r"velocity must be finite \(row 1\)"),
        (lambda: Transform.many(np.zeros((3, 3))), r"Transform\.position .*shape \(3, 2\)"),
        (lambda: SphereCollider.many(radius=[1, 2, -3]), r"SphereCollider\.radius .*\(row 2\), got -3"),
        (lambda: SphereCollider.many(1.0, sensor=[0, 1, 0]), r"SphereCollider\.sensor"),
        (lambda: SphereCollider.many(1.0, layer=[1.5, 1, 1]), r"SphereCollider\.layer"),
    ],
)
def test_errors_of_many_name_field_and_row_and_create_nothing(many, message):
    world = make_world()
    ball(world, 0.0)
    before = world.state_hash()
    with pytest.raises(ValueError, match=message):
        world.create_entities(3, SphereCollider.many(1.0) if "Sphere" not in message else RigidBody.many(), many())
    assert world.create_entity() == 2
    assert world.state_hash() == before


def test_a_zero_quaternion_among_many_is_named():
    world = make_world(3)
    with pytest.raises(ValueError, match=r"zero quaternion \(row 1\)"):
        world.create_entities(2, Transform.many(0.0, rotation=[(1, 0, 0, 0), (0, 0, 0, 0)]))


def test_what_many_and_create_entities_refuse():
    world = make_world()
    with pytest.raises(TypeError, match="needs a value for 'radius'"):
        SphereCollider.many()
    with pytest.raises(TypeError, match="colour"):
        SphereCollider.many(1.0, colour=2)
    with pytest.raises(TypeError, match="twice"):
        SphereCollider.many(1.0, radius=2)
    with pytest.raises(TypeError, match="many"):
        world.create_entities(2, Transform((0, 0)))
    with pytest.raises(ValueError, match="one component of each type"):
        world.create_entities(2, Charge.many(1.0), Charge.many(2.0))
    for count in (-1, 1.5, True, "2"):
        with pytest.raises(ValueError, match="count"):
            world.create_entities(count, Charge.many())
    assert list(world.create_entities(np.int64(2), Charge.many())) == [1, 2]


def test_a_hundred_thousand_entities_at_once():
    """Seconds would mean a loop over numpy rows or a garbage collection per thousand objects."""
    n = 100_000
    rng = np.random.default_rng(0)
    position, radius = rng.random((n, 2)), rng.random(n)
    world = make_world()
    started = time.process_time()
    ids = world.create_entities(n, Transform.many(position), RigidBody.many(mass=1.0), SphereCollider.many(radius))
    count = len(world.bodies)
    seconds = time.process_time() - started
    assert count == n
    np.testing.assert_array_equal(world.bodies.position, position)
    assert world.component_for_entity(ids[-1], SphereCollider).radius == radius[-1]
    assert seconds < 1.5  # about 0.35 s
    world.close()


def test_force_systems_cannot_lose_what_they_write_into_copies():
    from carom.framework import ForceSystem

    class Field(ForceSystem):
        requires = (Charge,)

        def add_forces(self, bodies, time):
            bodies.force += 2.0 * bodies.charge.value[:, None]
            with pytest.raises(ValueError, match="read-only"):
                bodies.charge.value[:] = 0.0

    world = make_world(dt=1.0)
    charged, _plain = ball(world, 0.0), ball(world, 5.0)
    world.add_component(charged, Charge(1.5))
    world.add_system(Field())
    world.step()
    assert world.bodies.linear_velocity.tolist() == [[3.0, 3.0], [0.0, 0.0]]


def test_handles_are_read_and_written_inside_a_system():
    class Push(System):
        def process(self, dt):
            for _, (transform, body) in self.world.get_components(Transform, RigidBody):
                body.linear_velocity = (transform.x, 0.0)

    world = make_world(dt=1.0)
    ball(world, 1.0)
    world.add_system(Push())
    for _ in range(3):
        world.step()
    assert world.bodies.position.tolist() == [[4.0, 0.0]]


# -- mistakes that would be lost in silence ------------------------------------------------------


def test_classes_and_lists_are_no_components():
    world = make_world()
    with pytest.raises(TypeError, match=r"RigidBody\(\.\.\.\), got the class itself"):
        world.create_entity(Transform((0, 0)), RigidBody)
    with pytest.raises(TypeError, match="one by one"):
        world.create_entity([Transform((0, 0)), RigidBody()])
    assert len(world.bodies) == 0


def test_a_bare_number_is_no_position():
    """Transform(3, 7) would mean position (3, 3) and a rotation of 7 rad."""
    with pytest.raises(ValueError, match=r"Transform\.position must be 2 or 3 numbers, got 3"):
        Transform(3, 7)  # type: ignore[arg-type]


def test_misspelt_fields_of_own_components_are_refused():
    class Fuel(Component):
        litres = column(1.0)

    fuel = Fuel()
    with pytest.raises(AttributeError, match="Fuel has no field 'liters': did you mean 'litres'"):
        fuel.liters = 3.0
    fuel.litres = 3.0
    assert fuel.litres == 3.0


def test_vectors_are_whole_as_soon_as_the_entity_exists():
    """A default of 0 stands for (0, 0) from the call on, so that a spawned body can be changed at once."""
    world = make_world()
    entity = world.create_entity(Transform((0, 0)), RigidBody())
    rigid = world.component_for_entity(entity, RigidBody)
    rigid.linear_velocity += (1, 0)
    rigid.linear_velocity[1] = 2
    world.step()
    assert rigid.linear_velocity.tolist() == [1, 2]

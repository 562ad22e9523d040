"""Wrong component values are refused where they are given; many components at once."""

from __future__ import annotations

import re

import esper
import numpy as np
import pytest
from data.helpers_calls import calls_of
from data.helpers_components import INF, NAN, Charge, Everything
from worlds import ball, make_world

from carom import Component, column
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform

pytestmark = pytest.mark.plain
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
    (lambda v: SphereCollider(1, group=v), "SphereCollider.group", [0.5, "doll", None, True, 2**63]),
    (lambda v: AABBCollider(v), "AABBCollider.half_extents", [(1, -1), (NAN, 1), (1, 2, 3, 4), -1.0, "big"]),
    (lambda v: AABBCollider(1, offset=v), "AABBCollider.offset", [(INF, 0), (1, 2, 3, 4)]),
    (lambda v: Everything(1, size=v), "Everything.size", [0.0, -1.0, NAN]),
    (lambda v: Everything(1, level=v), "Everything.level", [-2.5, NAN]),
    (lambda v: Everything(1, mode=v), "Everything.mode", ["asleep"]),
    (lambda v: Everything(1, count=v), "Everything.count", [1.5, NAN, True]),
    (lambda v: Everything(1, on=v), "Everything.on", [1]),
]
CASES = [(make, field, value) for make, field, values in WRONG for value in values]


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize(("make", "field", "value"), CASES, ids=[f"{f}={str(v)[:20]}" for _, f, v in CASES])
def test_wrong_values_are_refused_by_constructor_and_setter_which_names_the_entity(make, field, value):
    with pytest.raises(ValueError, match=re.escape(field)) as caught:
        make(value)
    assert "got" in str(caught.value)
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


@pytest.mark.compiled
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
    with world:  # plain esper cannot check it: the next step names the entity
        e = esper.create_entity(Transform((0, 0)), RigidBody())
        esper.add_component(e, component())
        good = esper.create_entity(Transform((9, 9)), RigidBody(mass=4.0))
    with pytest.raises(ValueError, match=rf"entity {e}: {name}"):
        world.step()
    with world, pytest.raises(ValueError, match=rf"entity {e}: {name}"):
        esper.process(world.settings.dt)
    assert world.step_count == 0
    world.delete_entity(e, immediate=True)
    assert world.bodies.mass.tolist() == [1.0, 4.0]
    world.delete_entity(good, immediate=True)
    assert world.state_hash() == before
    world.step()


@pytest.mark.parametrize("call", ["apply_force", "apply_impulse"])
@pytest.mark.parametrize("value", [(NAN, 0), (INF, 0), (1, 2, 3), ((1, 2), (3, 4)), "hard", None])
def test_forces_and_impulses_are_checked(call, value):
    world = make_world()
    e = ball(world, 0.0)
    before = world.state_hash()
    with pytest.raises(ValueError, match=call.removeprefix("apply_")):
        getattr(world.component_for_entity(e, RigidBody), call)(value)
    assert world.state_hash() == before


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


MANY = [  # dimensions, what is given for three entities, and what the error says
    (2, lambda: RigidBody.many(mass=[1, 2, 0]), r"RigidBody\.mass must be positive \(row 2\), got 0"),
    (2, lambda: RigidBody.many(mass=-1.0), r"RigidBody\.mass must be positive, got -1"),
    (2, lambda: RigidBody.many(mass=[1, 1e-320, 1]), r"RigidBody\.mass .*\(row 1\)"),
    (2, lambda: RigidBody.many(mass=[1, 2]), r"RigidBody\.mass .*shape \(3,\)"),
    (2, lambda: RigidBody.many(mass=[1, True, 2]), r"RigidBody\.mass"),
    (2, lambda: RigidBody.many(kind=["static", "dynamic", "gas"]), r"RigidBody\.kind .*\(row 2\), got 'gas'"),
    (2, lambda: RigidBody.many(max_linear_speed=[1, None, NAN]), r"RigidBody\.max_linear_speed .*\(row 2\)"),
    (2, lambda: RigidBody.many(max_linear_speed=[1, None, -2]), r"RigidBody\.max_linear_speed .*\(row 2\), got -2"),
    (2, lambda: RigidBody.many(linear_velocity=[[0, 0], [0, INF], [0, 0]]), r"velocity must be finite \(row 1\)"),
    (2, lambda: Transform.many(np.zeros((3, 3))), r"Transform\.position .*shape \(3, 2\)"),
    (3, lambda: Transform.many(0.0, rotation=[(1, 0, 0, 0), (0, 0, 0, 0), (1, 0, 0, 0)]), r"zero quaternion \(row 1\)"),
    (2, lambda: SphereCollider.many(radius=[1, 2, -3]), r"SphereCollider\.radius .*\(row 2\), got -3"),
    (2, lambda: SphereCollider.many(1.0, sensor=[0, 1, 0]), r"SphereCollider\.sensor"),
    (2, lambda: SphereCollider.many(1.0, layer=[1.5, 1, 1]), r"SphereCollider\.layer"),
    (2, lambda: SphereCollider.many(), "needs a value for 'radius'"),
    (2, lambda: SphereCollider.many(1.0, colour=2), "colour"),
    (2, lambda: SphereCollider.many(1.0, radius=2), "twice"),
    (2, lambda: Transform((0, 0)), "many"),
]
ONE = [
    (2, lambda: Transform((0, 0)), lambda: RigidBody, r"RigidBody\(\.\.\.\), got the class itself"),
    (2, lambda: [Transform((0, 0)), RigidBody()], RigidBody, "one by one"),
    (2, lambda: Transform((0, 0)), lambda: None, "one by one, got None"),
    (2, lambda: SphereCollider(1.0, layer=1 << 63), RigidBody, r"layer must be from -2\*\*63 to 2\*\*63 - 1"),
    (2, lambda: Transform(3, 7), RigidBody, r"Transform\.position must be 2 or 3 numbers, got 3"),  # not (3, 3), 7 rad
    (3, lambda: Transform((0, 0, 0), rotation=0.5), RigidBody, r"Transform\.rotation must be a quaternion"),
    (2, lambda: RigidBody(mass=-2), RigidBody, r"RigidBody\.mass must be positive, got -2$"),
    (2, lambda: Transform((NAN, 1)), RigidBody, r"Transform\.position must be finite, got \(nan, 1\)"),
    # of a value too long for a message its beginning is shown: this one has four million characters
    (2, lambda: Transform(np.ones((100_000, 2))), RigidBody,
     r"Transform.position must be one vector, got \[\[1.0, 1.0\], .{150,200} \.\.\.$"),
]  # fmt: skip


@pytest.mark.parametrize(("d", "many", "message"), MANY, ids=[message for *_, message in MANY])
def test_errors_of_many_name_field_and_row_and_create_nothing(d, many, message):
    world = make_world(d)
    ball(world, 0.0)
    before = world.state_hash()
    with pytest.raises((ValueError, TypeError), match=message):
        world.create_entities(3, Charge.many(1.0), many())
    assert world.create_entity() == 2
    assert world.state_hash() == before


@pytest.mark.slow
@pytest.mark.parametrize(("d", "one", "other", "message"), ONE, ids=[message for *_, message in ONE])
def test_errors_of_one_say_what_was_meant_and_create_nothing(d, one, other, message):
    world = make_world(d)
    with pytest.raises((ValueError, TypeError), match=message):
        world.create_entity(one(), other())
    assert world.create_entity() == 1
    assert len(world.bodies) == 0


def test_what_no_component_and_no_body_has_is_said():
    class Unfilled(Component):
        level = column(3.0)

        def __init__(self, level):
            self.level = level

    world = make_world()
    one = ball(world, 0.0)
    with pytest.raises(AttributeError, match=r"Unfilled\.__init__ must call super\(\)\.__init__ first"):
        Unfilled(2.0)
    for find in (lambda: world.bodies.row_of(77), lambda: world.bodies.rows_of([one, 77])):
        with pytest.raises(KeyError, match="entity 77 is no body of this world"):
            find()


def test_how_many_and_of_what():
    world = make_world()
    with pytest.raises(ValueError, match="one component of each type"):
        world.create_entities(2, Charge.many(1.0), Charge.many(2.0))
    for count in (-1, 1.5, True, "2"):
        with pytest.raises(ValueError, match="count"):
            world.create_entities(count, Charge.many())
    assert list(world.create_entities(np.int64(2), Charge.many())) == [1, 2]


def test_vectors_and_turns_are_whole_as_soon_as_the_entity_exists():
    """A default of 0 stands for (0, 0) from the call on, so that a spawned body can be changed at once."""
    world = make_world()
    entity = world.create_entity(Transform((0, 0)), RigidBody())
    rigid = world.component_for_entity(entity, RigidBody)
    rigid.linear_velocity += (1, 0)
    rigid.linear_velocity[1] = 2
    world.step()
    assert rigid.linear_velocity.tolist() == [1, 2]
    world = make_world(3)
    turns, boxes = [(1, 0, 0, 0), (0, 0, 0, 2)], AABBCollider.many(1.0, offset=(1, 2, 3))
    world.create_entities(2, Transform.many(np.zeros((2, 3)), rotation=turns), boxes)
    world.create_entities(2, Transform.many(0.0), AABBCollider.many([[1, 2, 3], [4, 5, 6]]))
    world.create_entity(Transform((0, 0, 0), rotation=(2, 0, 0, 0)), AABBCollider(1.0))
    unit = [1.0, 0.0, 0.0, 0.0]
    assert world.bodies.rotation.tolist() == [unit, [0.0, 0.0, 0.0, 1.0], unit, unit, unit]


def test_a_hundred_thousand_entities_at_once():
    """None of them costs a call."""
    rng, calls = np.random.default_rng(0), []
    for n in (10, 10_000, 100_000):  # the first finds what is known from then on
        position, radius = rng.random((n, 2)), rng.random(n)
        world = make_world()

        def create(world=world, n=n, position=position, radius=radius):
            world.create_entities(n, Transform.many(position), RigidBody.many(mass=1.0), SphereCollider.many(radius))
            assert len(world.bodies) == n

        calls.append(calls_of(create))
        np.testing.assert_array_equal(world.bodies.position, position)
        assert world.component_for_entity(n, SphereCollider).radius == radius[-1]
        world.close()
    assert calls[2] == calls[1]


@pytest.mark.parametrize("stepped", [False, True])
def test_a_value_of_other_dimensions_is_refused_where_it_is_set(stepped):
    """Before the first step too, when the world has no row of it yet; what was there stays."""
    with make_world(2) as world:
        transform, body = Transform((1, 2)), RigidBody()
        world.create_entity(transform, body)
        if stepped:
            world.step()
        for component, field, value in ((transform, "position", (1, 2, 3)), (body, "linear_velocity", np.zeros(3))):
            with pytest.raises(ValueError, match=rf"{type(component).__name__}\.{field} must have 2 components"):
                setattr(component, field, value)
        with pytest.raises(ValueError, match=r"Transform\.rotation must be an angle in this 2D world"):
            transform.rotation = (1, 0, 0, 0)
        world.step()
        assert transform.position.tolist() == [1.0, 2.0]


@pytest.mark.parametrize("bulk", [False, True])
def test_two_classes_of_one_name_are_refused_with_a_step_between_and_without(bulk):
    """Their columns would be one: each body would read what the other has."""
    one, other = (type("Health", (Component,), {"points": column(1.0), "__module__": of}) for of in ("player", "foe"))
    for step_between in (False, True):
        world = make_world(2)
        for kind in (one, other):
            if bulk:
                world.create_entities(2, Transform.many([(0, 0), (3, 0)]), RigidBody.many(), kind.many(points=[2, 3]))
            else:
                world.create_entity(Transform((0, 0)), RigidBody(), kind(2.0))
            if step_between and kind is one:
                world.step()
        with pytest.raises(ValueError, match=r"two component types are named Health: .*player.*foe"):
            world.step()


@pytest.mark.parametrize("d", [2, 3])
def test_a_new_body_knows_its_dimensions_after_a_field_is_set(d):
    """Spawn, set a field, kick, before the first step: vectors are whole, and what is set in place holds."""
    world = make_world(d)
    transform, body = Transform(np.ones(d)), RigidBody()
    world.create_entity(transform, body)
    body.mass = 3.0
    body.linear_velocity += 2.0
    body.linear_velocity[0] = 5.0
    transform.position = np.zeros(d)
    assert np.shape(transform.rotation) == (() if d == 2 else (4,))
    world.step()
    assert body.linear_velocity.tolist() == [5.0, *[2.0] * (d - 1)]

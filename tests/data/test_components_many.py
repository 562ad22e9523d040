"""Many components at once: broadcasting, consecutive ids, errors that name field and row."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_calls import calls_of
from helpers_components import INF, NAN, Charge, Everything
from worlds import ball, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform

pytestmark = pytest.mark.plain


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
    """None of them costs a call."""
    rng, calls = np.random.default_rng(0), []
    for n in (1_000, 100_000):
        position, radius = rng.random((n, 2)), rng.random(n)
        world = make_world()

        def create(world=world, n=n, position=position, radius=radius):
            world.create_entities(n, Transform.many(position), RigidBody.many(mass=1.0), SphereCollider.many(radius))
            assert len(world.bodies) == n

        calls.append(calls_of(create))
        np.testing.assert_array_equal(world.bodies.position, position)
        assert world.component_for_entity(n, SphereCollider).radius == radius[-1]
        world.close()
    assert calls[1] == calls[0]

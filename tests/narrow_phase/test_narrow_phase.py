"""The narrow phase against the plain oracle: every pair of shapes in 2D and 3D, at any position."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from oracles import narrow_naive
from worlds import EPS, ball, both_dimensions, box, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Phase, StepError, System

lengths = st.one_of(st.sampled_from([0.0, 0.25, 0.5, 1.0, 2.0]), st.floats(1e-3, 3))
coordinates = st.one_of(st.integers(-4, 4).map(lambda k: k / 2), st.floats(-3, 3))


def vectors(d, elements=coordinates):
    return st.tuples(*[elements] * d).map(np.array)


@st.composite
def bodies(draw, d, shape):
    """A shape somewhere, off its Transform and turned: (position, offset, rotation, size)."""
    position, offset = draw(vectors(d)), draw(st.one_of(st.just(np.zeros(d)), vectors(d)))
    if d == 2:
        rotation = draw(st.one_of(st.just(0.0), st.floats(-4, 4)))
    else:
        rotation = draw(st.one_of(st.just(0.0), st.tuples(*[st.floats(-1, 1)] * 4)))
        assume(np.ndim(rotation) == 0 or np.linalg.norm(rotation) > 0.1)
    return shape, position, offset, rotation, draw(lengths if shape == "sphere" else vectors(d, lengths))


def components(body):
    shape, position, offset, rotation, size = body
    collider = SphereCollider(size, offset=offset) if shape == "sphere" else AABBCollider(size, offset=offset)
    return Transform(position, rotation), RigidBody(), collider


def in_world(body):
    """The shape as placed by the oracle: the offset turns with the body, a box is enlarged."""
    shape, position, offset, rotation, size = body
    centre = position + narrow_naive.rotation_matrix(rotation, len(position)) @ offset
    return centre, size if shape == "sphere" else narrow_naive.stretched(size, rotation)


def expected(a, b):
    """(depth, normal, point) of the oracle, from a to b."""
    if (a[0], b[0]) == ("box", "sphere"):
        depth, normal, point = expected(b, a)
        return depth, None if normal is None else -normal, point
    meet = getattr(narrow_naive, f"{a[0]}_{b[0]}")
    return meet(*in_world(a), *in_world(b))


def contacts_of(bodies):
    d = len(bodies[0][1])
    world = make_world(d)
    for body in bodies:
        world.create_entity(*components(body))
    world.run(Phase.NARROW)
    return world.contacts


@both_dimensions
@pytest.mark.parametrize("first", ["sphere", "box"])
@pytest.mark.parametrize("second", ["sphere", "box"])
@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_any_pair_equals_the_oracle(d, first, second, data):
    """hit, depth, unit normal towards the larger id, point; within 100 eps of a touch hit and miss are right."""
    a, b = data.draw(bodies(d, first)), data.draw(bodies(d, second))
    depth, normal, point = expected(a, b)
    found = contacts_of([a, b])
    tolerance = 100 * EPS * 20
    if abs(depth) > tolerance:
        assert len(found) == (depth > 0)
    if not len(found):
        return
    assert found.entity_a[0] < found.entity_b[0]
    assert found.depth[0] == pytest.approx(depth, abs=tolerance)
    assert np.linalg.norm(found.normal[0]) == pytest.approx(1, abs=4 * EPS)
    apart = np.linalg.norm(in_world(a)[0] - in_world(b)[0])
    if normal is not None and apart > 1e-3 and (first == second or abs(depth - radius_of(a, b)) > 1e-3):
        np.testing.assert_allclose(found.normal[0], normal, atol=1e-9)
        np.testing.assert_allclose(found.point[0], point, atol=1e-9)


def radius_of(a, b):
    """At a depth of the sphere's radius its centre is on the surface and the normal ill defined."""
    return next(body[4] for body in (a, b) if body[0] == "sphere")


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize("first", [ball, box])
@pytest.mark.parametrize("second", [ball, box])
@pytest.mark.parametrize("scale", [1.0, 2.0**-40, 2.0**40])
def test_touching_exactly_counts(d, first, second, scale):
    """Half sizes are powers of two: at the exact distance a contact of depth 0, one ulp farther none."""
    for factor, hits in ((1.0, 1), (1 + EPS, 0), (1 - EPS / 2, 1)):
        world = make_world(d)
        sizes = [{"radius" if maker is ball else "half": 0.5 * scale} for maker in (first, second)]
        first(world, 0.0, **sizes[0])
        second(world, scale * factor, **sizes[1])
        world.run(Phase.NARROW)
        assert len(world.contacts) == hits
        if factor == 1.0:
            assert world.contacts.depth[0] == 0
            np.testing.assert_array_equal(world.contacts.normal[0], np.eye(d)[0])
            np.testing.assert_array_equal(world.contacts.point[0], 0.5 * scale * np.eye(d)[0])


@both_dimensions
def test_points_and_empty_boxes(d):
    """Radius 0 is a point, zero extents a point, a line or a sheet: they touch what they lie on or in."""
    thin = tuple(np.eye(d)[0])  # from -1 to 1 along x
    for make, hit in (
        (lambda w: (ball(w, 0.5, radius=0), box(w, 0.0)), True),  # a point on a face
        (lambda w: (ball(w, 0.5 * (1 + 2 * EPS), radius=0), box(w, 0.0)), False),
        (lambda w: (ball(w, 0.1, radius=0), ball(w, 0.1, radius=0)), True),  # a point on a point
        (lambda w: (ball(w, 0.1, radius=0), ball(w, 0.1 + 1e-16, radius=0)), False),
        (lambda w: (ball(w, 0.7, radius=0), box(w, 0.0, half=thin)), True),  # a point on a line
        (lambda w: (ball(w, (0.7, 1e-300, 0)[:d], radius=0), box(w, 0.0, half=thin)), False),
        (lambda w: (box(w, 0.0, half=thin), box(w, 0.3, half=tuple(np.eye(d)[1]))), True),  # two lines cross
        (lambda w: (box(w, 0.0, half=0.0), box(w, 0.0, half=0.0)), True),
    ):
        world = make_world(d)
        make(world)
        world.run(Phase.NARROW)
        assert len(world.contacts) == hit


def test_rotation_is_read_again_in_every_step():
    """Turned between steps, a body's box and offset follow at once, and return at once."""
    world = make_world()
    turning = box(world, 0.0, half=(1, 0.1), offset=(1, 0), kind="kinematic")
    right, up = ball(world, (1.9, 0.0), radius=0.05), ball(world, (0.0, 1.9), radius=0.05)
    for angle, expected_partner in ((0.0, right), (math.pi / 2, up), (0.0, right), (math.pi / 2, up)):
        world.component_for_entity(turning, Transform).rotation = angle
        world.run(Phase.NARROW)
        assert world.contacts.entity_b.tolist() == [expected_partner]


@pytest.mark.slow
@pytest.mark.parametrize("maker", [ball, box])
@pytest.mark.parametrize(
    ("one", "two", "meet"),
    [
        ({}, {}, True),
        ({"layer": 1, "mask": 2}, {"layer": 2, "mask": 1}, True),
        ({"layer": 1, "mask": 2}, {"layer": 2, "mask": 4}, False),  # only one accepts
        ({"layer": 1, "mask": 4}, {"layer": 2, "mask": 1}, False),
        ({"mask": 0}, {}, False),
        ({"layer": 6, "mask": 2}, {"layer": 2, "mask": 4}, True),
        ({"layer": 1 << 62, "mask": -1}, {"layer": 1, "mask": 1 << 62}, True),
        ({"group": 3}, {"group": 3}, False),
        ({"group": -(2**63 - 1)}, {"group": -(2**63 - 1)}, False),
        ({"group": 3}, {"group": 4}, True),
        ({"group": 3}, {}, True),
        ({"group": 3, "mask": 2}, {"group": 4}, False),
    ],
)
def test_layers_masks_and_groups(maker, one, two, meet):
    """Two colliders meet if each one's layer has a bit in the other's mask, and they are not of one group; else they
    pass through each other."""
    world = make_world()
    a, b = maker(world, -1, 1.0, restitution=1.0, **one), maker(world, 1, -1.0, restitution=1.0, **two)
    seen = 0
    for _ in range(120):
        world.step()
        seen += len(world.contacts)
    assert (seen > 0) == meet
    speed = world.bodies.linear_velocity[world.bodies.row_of(a), 0]
    assert speed == (-1 if meet else 1)
    assert world.bodies.linear_velocity[world.bodies.row_of(b), 0] == -speed


@pytest.mark.parametrize("copied", [False, True])
def test_contacts_read_late_are_those_of_their_step(copied):
    """Created when first read, although rows have moved and steps have begun since; also those of a snapshot."""
    world = make_world()
    gone = ball(world, (9.0, 0.0))
    a, b = ball(world, (0.0, 0.0)), ball(world, (0.9, 0.0))
    world.remove_system(next(system for system in world.systems if system.name == "Response"))
    world.step()
    if copied:
        world.restore(world.snapshot())
    world.delete_entity(gone)
    world.bodies.linear_velocity[:] = (0.0, 1.0)
    contacts = world.contacts
    assert (contacts.entity_a.tolist(), contacts.entity_b.tolist(), contacts.step.tolist()) == ([a], [b], [0])
    np.testing.assert_allclose(contacts.depth, 0.1, atol=EPS)
    np.testing.assert_allclose(contacts.point, [[0.45, 0.0]], atol=EPS)
    with pytest.raises(AttributeError, match="no column 'speed'; they have entity_a, entity_b"):
        _ = contacts.speed


def test_unread_contacts_outlast_the_start_of_a_step_that_fails():
    class Failing(System):
        phase = Phase.NARROW

        def process(self, dt):
            raise RuntimeError("no")

    world = make_world()
    a, b = ball(world, (0.0, 0.0)), ball(world, (0.9, 0.0))
    world.run(Phase.NARROW)
    world.add_system(Failing())
    world.bodies.position[1] = (0.8, 0.0)
    with pytest.raises(StepError, match="no"):
        world.step()
    assert (world.contacts.entity_a.tolist(), world.contacts.entity_b.tolist()) == ([a], [b])
    np.testing.assert_allclose(world.contacts.depth, 0.1, atol=EPS)

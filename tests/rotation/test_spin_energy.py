"""The energy of spins: over columns, what the bodies say one by one."""

from __future__ import annotations

import numpy as np
import pytest
from data.helpers_calls import calls_of
from rotation.helpers_turning import part, turning_world

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import CaromError
from carom.plugins import capsule, convex_hull, convex_polygon
from carom.plugins.parts import PartOf, Parts
from carom.plugins.rotation import BoxCollider, Spin

pytestmark = pytest.mark.plain


def space(d):
    return turning_world(d, 0, capsule.plugin, (convex_polygon if d == 2 else convex_hull).plugin, Parts())


def some_shape(random, d, kind, off=1.0):
    offset = off * random.uniform(-1, 1, d)
    if kind == 0:
        return SphereCollider(random.uniform(0.2, 0.8), offset=offset)
    if kind == 1:
        return BoxCollider(random.uniform(0.2, 0.9, d), offset=offset)
    if kind == 2:
        return capsule.CapsuleCollider(*random.uniform(0.2, 0.9, 2), offset=offset)
    if d == 3:
        return convex_hull.ConvexHullCollider(random.uniform(-0.9, 0.9, (9, 3)), offset=offset)
    angles = np.sort(random.uniform(0, 2 * np.pi, 5))
    corners = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    return convex_polygon.ConvexPolygonCollider(corners, corner_radius=random.choice((0.0, 0.2)), offset=offset)


def energy_one_by_one(world, entities):
    total = 0.0
    for entity in entities:
        body, spin = part(world, entity, RigidBody), part(world, entity, Spin)
        axes = spin._axes() if world.dimensions == 3 else np.eye(1)
        w = axes.T @ np.atleast_1d(spin.angular_velocity)
        total += 0.5 * (body.mass * np.sum(body.linear_velocity**2) + w @ np.reshape(spin.moments, axes.shape) @ w)
    return total


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_the_kinetic_energy_is_the_sum_of_squares_over_2(seed, d):
    """Of bodies with an inertia of their own, that of a shape, of parts, and of a collider that they have lost."""
    random = np.random.default_rng(seed)
    with space(d) as world:
        bodies = []
        for k in range(24):
            turn = random.uniform(-3, 3) if d == 2 else random.normal(size=4)
            turn = turn if d == 2 else turn / np.linalg.norm(turn)
            spin = random.normal(size=d) if d == 3 else random.normal()
            own = None if k % 3 else random.uniform(1.0, 1.5, 3 if d == 3 else None)
            body = RigidBody(random.uniform(0.5, 5), random.normal(size=d))
            place = random.uniform(-9, 9, d) + 30.0 * k
            bodies.append(world.create_entity(Transform(place, turn), body, Spin(spin if k % 5 else 0.0 * spin, own)))
            if own is None or k % 2:
                world.add_component(bodies[-1], some_shape(random, d, k % 4))
            for _ in range(random.integers(0, 3) if own is None else 0):
                where = PartOf(bodies[-1], random.normal(size=d), turn, mass=random.choice((0.0, 1.0, 3.0)))
                world.create_entity(where, some_shape(random, d, random.integers(4), 0.0))
        world.step()
        assert world.kinetic_energy() == pytest.approx(energy_one_by_one(world, bodies), rel=1e-12)
        for entity in bodies[1::7]:
            for collider in (SphereCollider, BoxCollider, capsule.CapsuleCollider):
                if world.has_component(entity, collider):
                    world.remove_component(entity, collider)
        for entity in bodies[2::7]:  # other shapes than those that were asked for before
            if world.has_component(entity, SphereCollider):
                part(world, entity, SphereCollider).radius *= 1.5
            part(world, entity, RigidBody).mass *= 2.0
        world.step()
        assert world.kinetic_energy() == pytest.approx(energy_one_by_one(world, bodies), rel=1e-12)


@pytest.mark.parametrize("d", [2, 3])
def test_a_hundred_bodies_that_spin_take_no_more_python_than_ten(d):
    calls = []
    for n in (10, 100):
        random = np.random.default_rng(n)
        with space(d) as world:
            for k in range(n):
                spin = Spin(1.0 if d == 2 else (1.0, 2.0, 3.0))
                world.create_entity(Transform((9.0 * k, 0, 0)[:d]), RigidBody(), spin, some_shape(random, d, 3))
            world.step()
            world.kinetic_energy()
            calls.append(calls_of(world.kinetic_energy))
    assert calls[0] == calls[1]


def test_where_only_a_flipper_spins_the_energy_is_that_of_the_balls():
    with space(2) as world:
        world.create_entity(Transform((0, 0)), RigidBody(kind="kinematic"), SphereCollider(0.5), Spin(1.0))
        assert world.kinetic_energy() == 0.0
        world.create_entity(Transform((5, 0)), RigidBody(2.0, (3.0, 0.0)), SphereCollider(0.5))
        assert world.kinetic_energy() == 9.0


def test_a_body_whose_inertia_nothing_tells_is_named():
    with space(2) as world:
        entity = world.create_entity(Transform((0, 0)), RigidBody(), Spin(1.0))
        with pytest.raises(CaromError, match=f"entity {entity}: Spin.inertia is None"):
            world.kinetic_energy()

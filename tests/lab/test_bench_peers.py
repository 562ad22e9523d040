"""The same bodies in carom and in pymunk, and the same measure of quality for both."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carom import scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import World
from carom.lab.bench.against_pymunk import CaromWorld, Quality
from carom.lab.bench.suite import SUITE
from carom.lab.engines import pymunk_space as peer_pymunk
from carom.lab.engines.pymunk_space import NotPlainError, PymunkSpace, moving_and_fixed
from carom.plugins import Physics, capsule, convex_polygon
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.scenes.walls import enclose


def plane(gravity=(0.0, 0.0)) -> World:
    return World(Physics(dimensions=2, gravity=gravity))


# -- the same bodies in both engines ----------------------------------------------------------------------------


def test_every_subject_translates():
    """Number, positions, velocities, turns, moments and kinetic energy of the bodies are those of the scene, in both
    engines; what has no Spin does not turn."""
    for subject in SUITE:
        size = 5 if subject.size_option == "rows" else 40
        world = scenes.get(subject.scene).build(None, 3, **subject.build_options(size))  # type: ignore[call-arg]
        own, peer = CaromWorld(world), PymunkSpace(world)
        for ours, theirs in zip((*own.state(), *own.turns()), (*peer.state(), *peer.turns()), strict=True):
            np.testing.assert_array_equal(ours, theirs)
        twice = (body.mass * abs(body.velocity) ** 2 for body in peer.bodies)
        spinning = (body.moment * body.angular_velocity**2 for body in peer.bodies if body.angular_velocity)
        assert 0.5 * (sum(twice) + sum(spinning)) == pytest.approx(world.kinetic_energy())
        assert len(peer.space.shapes) == sum(int(part.shaped.sum()) for part in moving_and_fixed(world))
        moments = {
            entity: world.component_for_entity(entity, Spin).moments if spins else math.inf
            for entity, spins in zip(world.bodies.entity.tolist(), world.bodies.has(Spin), strict=True)
        }
        bodies = np.sort(world.bodies.dynamic.entity).tolist()
        assert [body.moment for body in peer.bodies] == [moments[entity] for entity in bodies]
        own.world.close()


@pytest.mark.parametrize("index", peer_pymunk.INDEXES)
def test_a_disc_and_a_box_fall_and_bounce_alike(index):
    """Dropped from 3 m with restitution 1, both engines bring them back near 3 m after 2 sqrt(2 h / g) = 1.4 s.

    pymunk finds the contact up to a step late (v dt = 0.12 m) and moves with the old velocity, carom with the new one
    (g t dt / 2 = 0.1 m at 1.4 s): they can differ by half a metre at most.
    """
    world = plane((0.0, -9.81))
    world.create_entity(Transform((0, -0.5)), AABBCollider((20, 0.5), restitution=1.0))
    world.create_entity(Transform((0, 3.5)), RigidBody(mass=2.0), SphereCollider(0.5, restitution=1.0))
    world.create_entity(Transform((4, 3.25)), RigidBody(mass=0.1), AABBCollider((1.0, 0.25), restitution=1.0))
    own, peer = CaromWorld(world), PymunkSpace(world, index)
    lowest = np.full(2, np.inf)
    for _ in range(84):  # 1.4 s
        own.step(1)
        peer.step(1)
        lowest = np.minimum(lowest, peer.state()[0][:, 1])
        np.testing.assert_allclose(own.state()[0], peer.state()[0], atol=0.5)
    assert np.all(lowest < [0.75, 0.5])
    np.testing.assert_allclose(peer.state()[0], [(0, 3.5), (4, 3.25)], atol=0.3)
    own.world.close()


def test_what_turns_turns_alike():
    """A box turned by .3 and one of each other kind fall into a corner of a drum that turns for a second, which holds
    them: pymunk's bodies have the mass, the shapes and the angles of carom's."""
    plugins = Physics(dimensions=2, gravity=(0.0, -9.81)), Rotation(), capsule.plugin, convex_polygon.plugin
    world = World(*plugins)
    for x, y in ((1, 0), (0, -1)):
        half = (0.5, 4) if x else (4, 0.5)
        wall = BoxCollider(half, offset=(4 * x, 4 * y), friction=0.5)
        world.create_entity(Transform((0, 0)), RigidBody(kind="kinematic"), Spin(-0.5), wall)
    shapes = BoxCollider((0.5, 0.25)), CapsuleCollider(0.25, 0.5), ConvexPolygonCollider.regular(5, 0.5), None
    for k, shape in enumerate(shapes):
        shape = shape or SphereCollider(0.5)
        shape.friction = 0.5
        world.create_entity(Transform((1.2 * k - 2, -2.5), rotation=0.3), RigidBody(), Spin(), shape)
    own, peer = CaromWorld(world), PymunkSpace(world)
    own.step(60)
    peer.step(60)
    np.testing.assert_allclose(own.state()[0], peer.state()[0], atol=0.25)
    np.testing.assert_allclose(own.turns()[0], peer.turns()[0], atol=0.3)
    np.testing.assert_allclose(own.turns()[0][-2:], -0.5, rtol=0, atol=1e-9)
    world.close()


def test_friction_means_the_same_in_both_engines():
    """Sliding at 3 m/s on a floor of 0.4 under a body of 0.9: mu = sqrt(0.36) = 0.6, so 3^2 / (2 mu g) = 0.76 m."""
    world = plane((0.0, -9.81))
    world.create_entity(Transform((0, -0.5)), AABBCollider((20, 0.5), friction=0.4))
    world.create_entity(Transform((0, 0.5)), RigidBody(linear_velocity=(3, 0)), AABBCollider((0.5, 0.5), friction=0.9))
    peer = PymunkSpace(world)
    peer.step(90)
    assert peer.state()[0][0, 0] == pytest.approx(9 / (2 * 0.6 * 9.81), rel=0.05)  # a step at 3 m/s is 0.05 m
    assert np.abs(peer.state()[1]).max() < 1e-6
    world.close()


def test_without_friction_of_its_own_a_floor_takes_the_partners():
    world = plane((0.0, -9.81))
    world.create_entity(Transform((0, -0.5)), AABBCollider((20, 0.5)))
    world.create_entity(Transform((0, 0.5)), RigidBody(), AABBCollider((0.5, 0.5), friction=0.6))
    floor, box = sorted(PymunkSpace(world).space.shapes, key=lambda shape: shape.body.body_type, reverse=True)
    assert floor.friction * box.friction == pytest.approx(0.6)
    world.close()


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        ("sensors", (RigidBody(), SphereCollider(0.5, sensor=True))),
        ("two colliders", (RigidBody(), SphereCollider(0.75), AABBCollider((0.5, 0.5)))),
        ("damping", (RigidBody(linear_damping=0.1), SphereCollider(0.5))),
        ("constant forces", (RigidBody(constant_force=(0, 1)),)),
        ("gravity scale", (RigidBody(gravity_scale=2),)),
        ("limits of speed", (RigidBody(max_linear_speed=3),)),
        ("kinematic", (RigidBody(kind="kinematic"), SphereCollider(0.5))),
        ("offsets", (RigidBody(), SphereCollider(0.5, offset=(0.1, 0)))),
        ("restitutions", (SphereCollider(0.5, restitution=0.9),)),
    ],
)
def test_what_does_not_translate_is_refused(words, parts):
    world = plane()
    world.create_entity(Transform((0, 0)), RigidBody(), SphereCollider(0.5))
    world.create_entity(Transform((5, 5)), *parts)
    with pytest.raises(NotPlainError, match=words):
        PymunkSpace(world)
    world.close()


@pytest.mark.parametrize(("mask", "group", "apart"), [(1, 0, False), (2, 0, True), (-1, 1, True), (-1, -4, False)])
def test_layers_masks_and_groups_are_those_of_carom(mask, group, apart):
    world = plane()
    for x, layer in ((0.0, 1), (0.5, 2)):
        filters = {"layer": layer, "mask": mask | layer // 2, "group": group * layer if group > 0 else group}
        world.create_entity(Transform((x, 0)), RigidBody(), SphereCollider(0.5, **filters))
    space = PymunkSpace(world)
    space.step(30)
    (one, _), (other, _) = space.state()[0]
    assert (other - one > 0.6) == apart
    world.close()


def test_a_turned_box_and_space_are_refused():
    world = plane()
    world.create_entity(Transform((0, 0), rotation=0.5), RigidBody(), AABBCollider((1, 1)))
    with pytest.raises(NotPlainError, match="turned"):
        PymunkSpace(world)
    world.close()
    world = World(Physics(dimensions=3))
    with pytest.raises(NotPlainError, match="3 dimensions"):
        PymunkSpace(world)
    world.close()


# -- the same measure for both ----------------------------------------------------------------------------------


def test_quality_counts_what_left_and_how_far_it_went():
    """Three discs in a box of 10: one stays, one leaves through the wall, one is not finite any more."""
    world = plane()
    enclose(world, (0, 0), (10, 10))
    places = Transform.many([(1, 1), (5, 5), (8, 8)])
    world.create_entities(3, places, RigidBody.many(mass=2.0), SphereCollider.many(0.5))
    seen = Quality(world)
    after = np.array([(1.5, 0.75), (50.0, 5.0), (math.nan, 0.0)])
    seen.begin()
    seen.sample(np.array([(1.5, 1), (5, 5), (8, 8)]), np.zeros(3))
    seen.sample(np.array([(1.5, 0.25), (5, 5), (8, 8)]), np.zeros(3))  # 0.25 in the floor: a quarter of a diameter
    seen.sample(after, np.zeros(3))
    figures = seen.figures(after, np.array([(3.0, 0.0), (0.0, 0.0), (0.0, 0.0)]), np.zeros(3))
    assert figures["escaped"] == 2
    assert figures["kinetic_end"] == pytest.approx(9.0)
    assert figures["overlap_max"] == pytest.approx(0.25)
    assert figures["overlap_mean"] == pytest.approx(0.25 / 3)
    assert (figures["drift"], figures["sink"], figures["creep"]) == (45.0, 0.25, 45.0)
    world.close()


def test_quality_sees_how_bodies_are_turned_and_that_they_spin():
    """Two boxes of side 2 side by side, .1 apart; one turns by 45 degrees, with its corner then in the other."""
    world = World(Physics(dimensions=2), Rotation())
    for x in (0.0, 2.1):
        world.create_entity(Transform((x, 0)), RigidBody(mass=3.0), Spin(), BoxCollider((1, 1)))
    seen = Quality(world)
    places = np.array([(0.0, 0.0), (2.1, 0.0)])
    seen.sample(places, np.zeros(2))
    assert seen.overlap_most == 0.0
    seen.sample(places, np.array([0.0, math.pi / 4]))
    figures = seen.figures(places, np.zeros((2, 2)), np.array([0.0, 2.0]))
    assert figures["overlap_max"] == pytest.approx((math.sqrt(2) - 1.1) / 2)
    assert figures["kinetic_end"] == pytest.approx(0.5 * (3.0 * 4 / 6) * 2.0**2)  # m side^2 / 6
    world.close()

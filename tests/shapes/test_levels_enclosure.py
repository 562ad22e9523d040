"""Geometry levels: which must enclose which, and the checks of plugin shapes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_levels import COUNTERS, levelled, pairs
from worlds import ball, both_dimensions, box, make_world, run

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.components.colliders import Collider
from carom.framework import Plugin, Settings, World, column
from carom.framework.errors import UnhandledPairError
from carom.framework.vectors import divided
from carom.plugins import Physics


@both_dimensions
@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9])
def test_a_sphere_must_hold_the_corners_of_the_box(d, scale):
    """To a millionth of its radius, at any offset of the two; 1e-5 short is an error that states the difference."""
    half, gap = np.array([0.3, 0.4, 1.2])[:d] * scale, np.array([0.1, -0.2, 0.3])[:d] * scale
    for offset in (np.zeros(d), gap):
        reach = np.linalg.norm(half + np.abs(offset))
        for factor, fits in ((1.0, True), (1 - 0.5e-6, True), (1 - 1e-5, False), (0.5, False)):
            world = make_world(d)
            entity = world.create_entity(
                Transform((0.0,) * d), SphereCollider(factor * reach, offset=-offset), AABBCollider(half)
            )
            if fits:
                world.step()
                continue
            with pytest.raises(ValueError, match=rf"entity {entity}: its SphereCollider is the cheaper level") as error:
                world.step()
            assert f"AABBCollider, which sticks out by {(1 - factor) * reach:.4g}:" in str(error.value)


def test_what_does_not_fit_is_reported_again_until_it_does():
    """Nothing is adopted before; a larger sphere, or none, corrects it."""
    world = make_world()
    ball(world, 9.0)
    first = levelled(world, 0.0, radius=0.7)
    second = levelled(world, 3.0, radius=0.6)
    for _ in range(2):
        with pytest.raises(ValueError, match=rf"entity {first}: .*\(1 more entities likewise\)"):
            world.step()
        with pytest.raises(ValueError, match=r"sticks out by 0\.007107"):
            len(world.bodies)
    assert world.step_count == 0
    world.remove_component(first, SphereCollider)
    with pytest.raises(ValueError, match=rf"entity {second}: .*second entity for a shape of its own$"):
        world.step()
    world.component_for_entity(second, SphereCollider).radius = 0.8
    world.step()
    assert len(world.bodies) == 3


def test_a_collider_that_comes_later_is_checked_against_those_that_are_there():
    world = make_world()
    entity = box(world, 0.0)
    world.step()
    world.add_component(entity, SphereCollider(0.6))
    with pytest.raises(ValueError, match=rf"entity {entity}: .*sticks out by 0.1071"):
        world.step()
    world.add_component(entity, SphereCollider(0.75))
    world.step()
    world.add_component(entity, AABBCollider((0.7, 0.7)))
    with pytest.raises(ValueError, match=rf"entity {entity}: .*sticks out by 0.2399"):
        world.step()
    world.remove_component(entity, SphereCollider)
    world.step()


def test_it_is_checked_once():
    """Later changes by the game are not checked, like rotations of bodies."""
    world = make_world()
    entity = levelled(world, 0.0, rotation=0.6)
    world.step()
    world.component_for_entity(entity, SphereCollider).radius = 0.1
    run(world, 3)
    ball(world, 9.0)
    run(world, 3)


@both_dimensions
def test_many_at_once_are_checked_at_once(d):
    """10,000 entities in bulk; of two that do not fit, the first is named."""
    n = 10_000
    world = make_world(d)
    places = np.arange(n * d, dtype=float).reshape(n, d)
    radii = np.full(n, 1.01 * math.sqrt(d))
    radii[[777, 4000]] = 1.0
    ids = world.create_entities(
        n, Transform.many(places), SphereCollider.many(radius=radii), AABBCollider.many(half_extents=1.0)
    )
    sticks_out = f"{math.sqrt(d) - 1:.4g}"
    with pytest.raises(ValueError, match=rf"entity {ids[777]}: .*sticks out by {sticks_out}: .*\(1 more entities"):
        world.step()
    for k in (777, 4000):
        world.component_for_entity(ids[k], SphereCollider).radius = 2.0
    world.step()


def test_sensor_and_solid_do_not_mix():
    world = make_world()
    entity = levelled(world, 0.0, sphere={"sensor": True})
    message = f"entity {entity}: its SphereCollider is a sensor and its AABBCollider is solid.*use a second entity"
    with pytest.raises(ValueError, match=message):
        world.step()
    world.component_for_entity(entity, SphereCollider).sensor = False
    world.step()
    world.component_for_entity(entity, AABBCollider).sensor = True
    message = f"entity {entity}: its AABBCollider is a sensor and its SphereCollider is solid"
    for _ in range(2):
        with pytest.raises(ValueError, match=message):
            world.step()
    assert world.step_count == 1
    world.component_for_entity(entity, SphereCollider).sensor = True
    world.step()
    assert world.step_count == 2


class DiscCollider(Collider):
    """A sphere by another name, with a higher cost."""

    dimensions = (2,)
    reach = column(minimum=0.0)

    @staticmethod
    def bounds(shape, dimensions):
        return shape.reach, shape.reach


def disc_disc(a, b, d):
    depth = a.reach + b.reach - math.hypot(d[0], d[1])
    normal = divided(d, math.hypot(d[0], d[1])) if d != (0.0, 0.0) else (1.0, 0.0)
    return depth >= 0.0, depth, normal, d


def sphere_disc(a, b, d):
    depth = a.radius + b.reach - math.hypot(d[0], d[1])
    normal = divided(d, math.hypot(d[0], d[1])) if d != (0.0, 0.0) else (1.0, 0.0)
    return depth >= 0.0, depth, normal, d


def box_disc(a, b, d):
    x = max(abs(d[0]) - a.half_extents[0], 0.0)
    y = max(abs(d[1]) - a.half_extents[1], 0.0)
    depth = b.reach - math.hypot(x, y)
    return depth >= 0.0, depth, (1.0, 0.0), d


def disc_world(cost=5.0):
    plugin = Plugin("discs")
    plugin.shape(cost=cost)(DiscCollider)
    plugin.pair(DiscCollider, DiscCollider)(disc_disc)
    plugin.pair(SphereCollider, DiscCollider)(sphere_disc)
    plugin.pair(AABBCollider, DiscCollider)(box_disc)
    return World(Physics(dimensions=2), plugin, settings=Settings())


def nested(world, place, *, radius=1.5, half=1.0, reach=0.9):
    """A disc in a box in a sphere."""
    return world.create_entity(
        Transform(place), RigidBody(kind="kinematic"), AABBCollider((half, half)), DiscCollider(reach),
        SphereCollider(radius),
    )  # fmt: skip


def test_three_levels_of_which_one_is_a_plugins():
    """Cases where each of them decides; the middle level of three is tested against the last of two."""
    world = disc_world()
    a, b = nested(world, (0, 0)), nested(world, (9, 9))
    two = world.create_entity(Transform((-9, 9)), RigidBody(), AABBCollider((1, 1)), SphereCollider(1.5))
    for other, place, hits, counts in (
        (b, (2.3, 2.0), 0, (1, 0, 0)),  # beyond the spheres, 3.05 apart
        (b, (2.1, 2.0), 0, (1, 1, 1)),  # within the spheres, beyond the boxes
        (b, (1.9, 1.9), 0, (1, 1, 1)),  # the boxes overlap, the discs are 2.7 apart
        (b, (1.2, 1.2), 1, (1, 1, 0)),
        (two, (1.0, 2.1), 0, (1, 1, 1)),  # the boxes are apart
        (two, (1.8, 1.8), 0, (1, 1, 1)),  # the boxes overlap; from the box to the disc's centre 1.13
        (two, (1.2, 1.2), 1, (1, 1, 0)),
    ):
        world.component_for_entity(other, Transform).position = place
        world.reset_stats()
        world.step()
        assert pairs(world) == [(a, other)][:hits], place
        assert tuple(world.stats().counters[name] for name in COUNTERS) == counts, place
        world.component_for_entity(other, Transform).position = (9, 9) if other == b else (-9, 9)


def test_shapes_of_others_are_checked_by_the_boxes_around_them():
    for sizes, out in (
        ({"reach": 1.1}, "AABBCollider is the cheaper level and must enclose its DiscCollider.*out by 0.1:"),
        ({"radius": 1.4}, "SphereCollider is the cheaper level and must enclose its AABBCollider"),
    ):
        world = disc_world()
        nested(world, (0, 0), **sizes)
        with pytest.raises(ValueError, match=out):
            world.step()
    world = disc_world(cost=1.0)  # as cheap as a sphere, and first by name
    world.create_entity(Transform((0, 0)), DiscCollider(1.0), SphereCollider(1.1))
    with pytest.raises(ValueError, match=r"DiscCollider is the cheaper level .* SphereCollider, .* out by 0\.1:"):
        world.step()


def test_an_unregistered_collider_is_named():
    world = make_world()
    world.create_entity(Transform((0, 0)), DiscCollider(1.0))
    with pytest.raises(UnhandledPairError, match="DiscCollider is a collider that no plugin"):
        world.step()

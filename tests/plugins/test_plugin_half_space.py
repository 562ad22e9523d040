"""Half-spaces: the pair against the definition, unbounded ground in small and large worlds, in 2D and 3D."""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np
import pytest
from helpers_axes import axes_at
from worlds import both_dimensions, mostly_2d

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.framework.compilation import inlined, kernel
from carom.framework.vectors import row, store
from carom.plugins import Physics, half_space
from carom.plugins.half_space import HalfSpaceCollider

G = 10.0
HalfSpace = namedtuple("HalfSpace", "normal axes")
Box = namedtuple("Box", "half_extents radius")  # a rounded one
convex = next(pair for (_, other), pair in half_space.plugin.pairs.items() if other is not HalfSpaceCollider).function
box_support = inlined(AABBCollider.support)


@inlined
def box_rounding(shape):
    return shape.radius


@kernel
def meet_all(normal, axes, half, radius, offsets, hits, depths, normals, points, like):
    for i in range(len(offsets)):
        one, two = HalfSpace(row(normal, i, like), axes_at(axes, i, like)), Box(row(half, i, like), radius[i])
        hits[i], depths[i], n, p = convex(one, two, row(offsets, i, like), box_support, box_rounding)
        store(normals, i, n)
        store(points, i, p)


def check(normal, axes, half, radius, offsets, tolerance=1e-14):
    """Depth: that of the lowest corner below the plane; the point: halfway between that corner and the plane."""
    n, d = offsets.shape
    hits, depths, normals, points = np.zeros(n, bool), np.zeros(n), np.zeros((n, d)), np.zeros((n, d))
    meet_all(normal, axes, half, radius, offsets, hits, depths, normals, points, (0.0,) * d)
    units = np.einsum("nkj,nj->nk", axes, normal / np.abs(normal).max(1, keepdims=True))
    units /= np.linalg.norm(units, axis=1, keepdims=True)
    corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * d), -1).reshape(-1, d)
    heights = np.einsum("ncd,nd->nc", offsets[:, None] + corners * half[:, None], units).min(1) - radius
    size = np.abs(offsets).max(1) + half.max(1) + radius + 1e-300
    assert (abs(depths + heights) / size).max() < tolerance
    assert np.array_equal(hits, depths >= 0)
    assert abs(normals - units).max() < 1e-14
    assert (abs(np.einsum("nd,nd->n", points, units) + depths / 2) / size).max() < tolerance
    assert (abs(points - offsets) <= half + radius[:, None] + abs(depths)[:, None] + 1e-9 * size[:, None]).all()
    return depths, points


@mostly_2d
def test_ten_thousand_random_poses(d):
    rng, n = np.random.default_rng(d), 10_000
    axes = np.ascontiguousarray(np.linalg.qr(rng.normal(size=(n, d, d)))[0])
    normal = rng.normal(size=(n, d)) * 10 ** rng.uniform(-3, 3, (n, 1))
    depths, _ = check(
        normal, axes, 10 ** rng.uniform(-2, 1, (n, d)), 10 ** rng.uniform(-2, 1, n), 10 * rng.normal(size=(n, d)))
    assert 0.3 < (depths > 0).mean() < 0.9


@mostly_2d
def test_extremes(d):
    """Sizes and lengths of normals from 1e-9 to 1e9, coincident centres, 1e12 away, points."""
    poses = [
        (scale, half * size, radius * size, offset * size)
        for size in (1e-9, 1.0, 1e9) for scale in (1e-9, 1e9) for half in (0.0, 1.0, 1e-12) for radius in (0.0, 1.0)
        for offset in (0.0, 1.0, -1e12, 1e-12)
    ]  # fmt: skip
    scales, halves, radii, offsets = map(np.array, zip(*poses, strict=True))
    ones, axes = np.ones((len(poses), d)), np.array([np.eye(d)] * len(poses))
    check(scales[:, None] * ones, axes, halves[:, None] * ones, radii, offsets[:, None] * ones)


@mostly_2d
def test_the_point_is_in_the_middle_of_a_face_that_lies_on_it(d):
    """For a box on level ground, for any rounding."""
    up, half, place = np.eye(d)[[1]], np.full((1, d), 2.0), np.full((1, d), 1.9)
    _, points = check(up, np.eye(d)[None], half, np.zeros(1), place)
    assert points[0] == pytest.approx([1.9, -0.05, *[1.9] * (d - 2)])


def at(d, *place):
    return tuple(map(float, (*place, 0, 0, 0)[:d]))


def turn(d, angle):
    """A rotation in the plane of x and y."""
    return angle if d == 2 else (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))


def make_world(d, ground=None, angle=0.0, body=(), **settings):
    """Ground below y = 0, and a box and a ball far up, so that all tests share compiled code."""
    options = {"integrator": "velocity_verlet"} | settings
    world = World(Physics(dimensions=d, gravity=at(d, 0, -G)), half_space.plugin, settings=Settings(**options))
    ground = HalfSpaceCollider(at(d, 0, 1), friction=1.0) if ground is None else ground
    world.create_entity(Transform(at(d), turn(d, angle)), ground, *body)
    world.create_entity(Transform(at(d, 0, 1e6)), AABBCollider(0.5))
    world.create_entity(Transform(at(d, 0, 2e6)), SphereCollider(0.5))
    return world


def place_of(world, entity):
    return np.array(world.component_for_entity(entity, Transform).position)


def velocity_of(world, entity):
    return np.array(world.component_for_entity(entity, RigidBody).linear_velocity)


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize("away", [0.0, 1e6])
def test_bounces_at_the_right_height_wherever_it_is(d, away):
    """From 2 m to e^2 2 m; verlet's flight is exact, impacts are at their time: sampling may miss 2e-3."""
    world, e = make_world(d), 0.5
    colliders = SphereCollider(0.5, restitution=e), AABBCollider(0.5, restitution=e), SphereCollider(0, restitution=e)
    entities = [
        world.create_entity(Transform(at(d, away + 5 * k, 2 + low)), RigidBody(), collider)
        for k, (collider, low) in enumerate(zip(colliders, (0.5, 0.5, 0.0), strict=True))
    ]
    fall, rise = math.sqrt(2 * 2 / G), math.sqrt(2 * 2 * e**2 / G)
    heights = []
    while world.time < fall + 2 * rise - 1 / 60:
        world.step()
        if world.time > fall:
            heights.append([place_of(world, entity)[1] for entity in entities])
    assert np.max(heights, 0) - (0.5, 0.5, 0.0) == pytest.approx([2 * e**2] * 3, abs=2e-3)
    assert len(world.contacts.of(1)) == 0  # a point in the air touches nothing
    world.close()


@mostly_2d
def test_bodies_rest_on_it_as_on_a_box(d):
    """The same heights as on a box of any size; a point has no size, so its slop is that of the box."""
    colliders = SphereCollider(0.5), AABBCollider(0.5), SphereCollider(0), AABBCollider(at(d, 2, 0.25, 1))
    lows = np.array((0.5, 0.5, 0.0, 0.25))
    heights = []
    for ground in (None, AABBCollider(at(d, 100, 1, 100), offset=at(d, 0, -1), friction=1.0)):
        world = make_world(d, ground)
        entities = [
            world.create_entity(Transform(at(d, 5 * k, 0.3 + low)), RigidBody(), collider)
            for k, (collider, low) in enumerate(zip(colliders, lows, strict=True))
        ]
        for _ in range(240):
            world.step()
        heights.append([place_of(world, entity)[1] for entity in entities])
        assert [len(world.contacts.of(entity)) for entity in entities] == [1] * 4
        world.close()
    heights = np.array(heights)
    assert np.abs(heights[0] - heights[1])[lows > 0].max() < 1e-12
    assert np.abs(heights[0] - lows).max() < 0.0025


@mostly_2d
def test_a_slope_made_by_the_transform(d):
    """Frictionless at 30 degrees: v = g sin 30 t; with friction 1 it stays."""
    angle, down = math.pi / 6, np.array((-math.cos(math.pi / 6), -0.5))
    for friction, speed in ((0.0, 5.0), (1.0, 0.0)):
        world = make_world(d, HalfSpaceCollider(at(d, 0, 5), friction=friction), angle)
        place = Transform(at(d, 0.5 * down[1], -0.5 * down[0]))
        slider = world.create_entity(place, RigidBody(), SphereCollider(0.5, friction=friction))
        start = place_of(world, slider)
        for _ in range(60):
            world.step()
        assert velocity_of(world, slider)[:2] @ down == pytest.approx(speed, abs=0.02)
        height = (place_of(world, slider) - start)[:2] @ (down[1], -down[0])
        assert abs(height) < 0.0025
        world.close()


@pytest.mark.slow
@both_dimensions
def test_a_rising_one_lifts_what_is_on_it(d):
    """In one tree with moving bodies, among few and among many; half-spaces do not meet each other."""
    for count in (3, 300):
        rises = RigidBody(kind="kinematic", linear_velocity=at(d, 0, 1))
        world = make_world(d, body=(rises,))
        world.create_entity(
            Transform(at(d, 0, -20)), HalfSpaceCollider(at(d, 1, 1)), RigidBody(kind="kinematic"))
        places = np.zeros((count, d))
        places[:, 0], places[:, 1] = np.arange(count) * 1.5, 0.5
        world.create_entities(count, Transform.many(places), RigidBody.many(), SphereCollider.many(radius=0.5))
        for _ in range(60):
            world.step()
        dynamic = world.bodies.dynamic
        assert dynamic.position[:, 1] == pytest.approx(np.full(count, 1.5), abs=0.005)
        assert dynamic.linear_velocity[:, 1] == pytest.approx(np.ones(count), abs=1e-3)
        assert len(world.contacts) == count
        world.close()


@mostly_2d
def test_queries_and_casts_find_it_everywhere(d):
    world = make_world(d)
    for where in (0.0, -5e7):
        assert world.query_point(at(d, where, -1e-3)) == [1]
        assert world.query_point(at(d, where, 1e-3)) == []
        assert world.query_sphere(at(d, where, 1), 1.5) == [1]
        assert world.query_aabb(at(d, where, 1, -1), at(d, where + 1, 2, 1)) == []
        hit = world.ray_cast(at(d, where, 8), at(d, 1, -1))[0]
        assert hit.entity == 1
        assert hit.distance == pytest.approx(8 * math.sqrt(2))
        assert np.allclose(hit.normal, at(d, 0, 1))
        assert world.ray_cast(at(d, where, 8), at(d, 1, 0)) == []
        assert world.query_nearest(at(d, where, 7)).distance == pytest.approx(7)
        fallen = world.shape_cast(AABBCollider(0.5), at(d, where, 8), at(d, 0, -20))[0]
        assert (fallen.entity, fallen.distance) == (1, pytest.approx(7.5))
    world.close()


@pytest.mark.parametrize("normal", [(0, 0), 0, (0.0, 0.0, 0.0), (math.nan, 1), "up"])
def test_a_normal_without_direction_is_refused(normal):
    with pytest.raises(ValueError, match=r"HalfSpaceCollider\.normal"):
        HalfSpaceCollider(normal)
    ground = HalfSpaceCollider((0, 1))
    with pytest.raises(ValueError, match=r"HalfSpaceCollider\.normal"):
        ground.normal = normal


def test_the_row_of_a_normal_without_direction_is_named():
    world = make_world(2)
    with pytest.raises(ValueError, match=r"normal must not be zero \(row 1\)"):
        world.create_entities(2, Transform.many((0, 0)), HalfSpaceCollider.many([(0, 1), (0, 0)]))
    world.close()

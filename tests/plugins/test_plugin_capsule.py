"""Capsules: pairs against an independent oracle, and their behaviour in worlds, in 2D and 3D."""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np
import pytest
from helpers_axes import axes_at
from oracles import convex_brute
from worlds import both_dimensions, mostly_2d

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.framework.compilation import kernel
from carom.framework.vectors import row, store
from carom.plugins import Physics, capsule
from carom.plugins.capsule import CapsuleCollider, capsule_capsule, capsule_sphere

pytestmark = pytest.mark.slow  # its shapes take long to compile

G = 10.0
Capsule = namedtuple("Capsule", "radius half_height axes")
Sphere = namedtuple("Sphere", "radius")
Met = namedtuple("Met", "hit depth normal point")
capsules = capsule.plugin.pairs[CapsuleCollider, CapsuleCollider].function
spheres = capsule.plugin.pairs[CapsuleCollider, SphereCollider].function


@kernel
def meet_all(sizes, axes_a, axes_b, offsets, hits, depths, normals, points, like):
    """sizes (n, 4): radius and half height of the first, of the second; a half height below 0 makes it a sphere."""
    for i in range(len(offsets)):
        one = Capsule(sizes[i, 0], sizes[i, 1], axes_at(axes_a, i, like))
        d = row(offsets, i, like)
        if sizes[i, 3] < 0.0:
            hits[i], depths[i], normal, point = spheres(one, Sphere(sizes[i, 2]), d)
        else:
            two = Capsule(sizes[i, 2], sizes[i, 3], axes_at(axes_b, i, like))
            hits[i], depths[i], normal, point = capsules(one, two, d)
        store(normals, i, normal)
        store(points, i, point)


def meet(sizes, axes_a, axes_b, offsets):
    n, d = offsets.shape
    met = Met(np.zeros(n, bool), np.zeros(n), np.zeros((n, d)), np.zeros((n, d)))
    meet_all(sizes, axes_a, axes_b, offsets, *met, (0.0,) * d)
    assert np.isfinite(met.depth).all()
    assert np.isfinite(met.point).all()
    assert abs(np.linalg.norm(met.normal, axis=1) - 1).max() < 1e-12
    assert (met.hit == (met.depth >= 0)).all()
    return met


def rotations(rng, n, d):
    return np.ascontiguousarray(np.linalg.qr(rng.normal(size=(n, d, d)))[0])


def cores(half, axes, centre=0.0):
    """The ends of the segments, (n, 2, d)."""
    way = np.maximum(half, 0.0)[:, None] * axes[:, :, 1]
    return np.stack((centre - way, centre + way), 1)


def to_segment(points, ends):
    """Distances of points from segments."""
    way = ends[:, 1] - ends[:, 0]
    square = (way**2).sum(1)
    along = ((points - ends[:, 0]) * way).sum(1) / np.where(square > 0, square, 1)
    return np.linalg.norm(points - ends[:, 0] - np.clip(along, 0, 1)[:, None] * way, axis=1)


def overlap(a, b):
    """Overlap of the cores; in 3D two segments overlap in a point at most."""
    return convex_brute.meet(a, b)[0] if a.shape[2] == 2 else -convex_brute.separation(a, b)[0]


@mostly_2d
@pytest.mark.parametrize("other", ["capsule", pytest.param("sphere", marks=pytest.mark.slow)])
def test_ten_thousand_random_poses(d, other):
    rng, n = np.random.default_rng(d), 10_000
    sizes = 10.0 ** rng.uniform(-1, 0.5, (n, 4))
    axes_a, axes_b, offsets = rotations(rng, n, d), rotations(rng, n, d), 2 * rng.normal(size=(n, d))
    if other == "sphere":
        sizes[:, 3] = -1.0
    met = meet(sizes, axes_a, axes_b, offsets)
    reach = sizes[:, 0] + sizes[:, 2]
    a, b = cores(sizes[:, 1], axes_a), cores(sizes[:, 3], axes_b, offsets)
    expected = reach - to_segment(offsets, a) if other == "sphere" else reach + overlap(a, b)
    assert 0.2 < met.hit.mean() < 0.95
    np.testing.assert_allclose(met.depth, expected, rtol=0, atol=1e-12)
    # after a translation by the depth along the normal they just touch
    moved = b + (met.depth[:, None] * met.normal)[:, None]
    gap = to_segment(moved[:, 0], a) if other == "sphere" else -overlap(a, moved)
    np.testing.assert_allclose(gap, reach, rtol=0, atol=1e-7)  # nearly parallel normals: limit of the oracle
    # the point is in the middle of the overlap, or of the gap; where segments cross, near there
    crossing = 0.5 * abs(sizes[:, 0] - sizes[:, 2]) * (met.depth > reach)
    for ends, radius in ((a, sizes[:, 0]), (b, sizes[:, 2])):
        assert (to_segment(met.point, ends) <= np.maximum(abs(radius - 0.5 * met.depth), crossing) + 1e-9).all()


@mostly_2d
@pytest.mark.parametrize("size", [1.0, *(pytest.param(size, marks=pytest.mark.slow) for size in (1e-9, 1e9))])
@pytest.mark.parametrize("ratio", [1.0, 1e-12])
def test_extremes(d, size, ratio):
    """Coincident, in line, across, parallel, far away; with no radius, no height, and another 1e12 times smaller."""
    offsets = np.array([(0, 0, 0), (0, 1, 0), (1, 0, 0), (0, 3, 0), (1e12, 0, 0), (1e-12, 1e-12, 0), (0, -1, 0)])
    turns = [np.eye(d), np.eye(d)[:, [1, 0, *range(2, d)]], rotations(np.random.default_rng(1), 1, d)[0]]
    poses = [
        (np.array([r, h, r2, h2]), offset[:d], turn)
        for r in (0.0, 0.5) for h in (0.0, 1.0) for r2 in (0.0, 0.5) for h2 in (0.0, 1.0, -1.0)
        for offset in offsets for turn in turns
    ]  # fmt: skip
    sizes = np.array([pose[0] for pose in poses]) * size * np.array([1, 1, ratio, ratio])
    offsets = np.array([pose[1] for pose in poses]) * size
    axes_a, axes_b = np.array([np.eye(d)] * len(poses)), np.array([pose[2] for pose in poses])
    met = meet(sizes, axes_a, axes_b, offsets)
    a, b = cores(sizes[:, 1], axes_a), cores(sizes[:, 3], axes_b, offsets)
    distance = convex_brute.separation(a, b)[0]
    reach = sizes[:, 0] + sizes[:, 2]
    crossing = distance <= 1e-12 * size
    if d == 2:
        through = convex_brute.penetration(a, b)[0]
        crossing |= np.isfinite(through) & (through > 1e-12 * size)
    scale = np.abs(offsets).max(1) + size
    assert (abs(met.depth - reach + distance) / scale)[~crossing].max() < 1e-14
    assert ((met.depth - reach) / size)[crossing].min() > -2e-12


def test_crossing_segments_in_the_plane_part_by_the_shorter_way():
    """A plus of two capsules of half height 1 and 2, moved by 0.2: the short one leaves along the long one's side."""
    upright, lying = ((1.0, 0.0), (0.0, 1.0)), ((0.0, -1.0), (1.0, 0.0))
    hit, depth, normal, _ = capsule_capsule(Capsule(0.5, 2.0, upright), Capsule(0.25, 1.0, lying), (0.2, 0.0))
    assert hit
    assert depth == pytest.approx(0.75 + 0.8)
    assert normal == pytest.approx((1.0, 0.0))


def test_a_sphere_on_the_axis_leaves_sideways():
    hit, depth, normal, point = capsule_sphere(Capsule(0.5, 2.0, np.eye(3)), Sphere(0.25), (0.0, 1.0, 0.0))
    assert hit
    assert depth == 0.75
    assert normal[1] == 0.0
    assert point == pytest.approx((0.125 * normal[0], 1.0, 0.125 * normal[2]))


def make_world(d, others=True, **settings):
    """A world with a floor, its top at 0, and a distant sphere: all three shapes, so that all tests share code."""
    options = {"integrator": "velocity_verlet"} | settings
    world = World(Physics(dimensions=d, gravity=at(d, 0, -G)), capsule.plugin, settings=Settings(**options))
    if others:
        world.create_entity(Transform(at(d, 0, -1)), AABBCollider(at(d, 50, 1, 50), friction=1.0))
        world.create_entity(Transform(at(d, 1e4, 0)), SphereCollider(1.0))
    return world


def at(d, *place):
    return tuple(map(float, (*place, 0, 0, 0)[:d]))


def turn(d, angle):
    """A rotation in the plane of x and y."""
    return angle if d == 2 else (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))


def drop(world, d, x, y, angle=0.0, velocity=0.0, **collider):
    return world.create_entity(
        Transform(at(d, x, y), turn(d, angle)), RigidBody(linear_velocity=velocity),
        CapsuleCollider(0.25, 0.5, **collider))  # fmt: skip


def place_of(world, entity):
    return np.array(world.component_for_entity(entity, Transform).position)


@mostly_2d
def test_rests_on_boxes_spheres_and_capsules(d):
    """Each overlaps the body below by at most the slop, 0.005 of its size 0.5."""
    world = make_world(d)
    lying = math.pi / 2
    floor = drop(world, d, 0, 0.26, lying)
    on_sphere_at = 5.0
    world.create_entity(Transform(at(d, on_sphere_at, 0.5)), SphereCollider(0.5))
    on_sphere = drop(world, d, on_sphere_at, 1.76)
    world.create_entity(Transform(at(d, 10, 0.25), turn(d, lying)), CapsuleCollider(0.25, 0.5))
    on_capsule = drop(world, d, 10.2, 0.76, lying)
    upright = drop(world, d, 15, 0.76)
    on_upright = drop(world, d, 15, 2.27)
    box = world.create_entity(Transform(at(d, 20, 1.02)), RigidBody(), AABBCollider(0.25))
    world.create_entity(Transform(at(d, 20, 0.25), turn(d, lying)), CapsuleCollider(0.5, 0.5))
    for _ in range(240):
        world.step()
    heights = [place_of(world, entity)[1] for entity in (floor, on_sphere, on_capsule, upright, on_upright, box)]
    assert np.abs(np.array(heights) - (0.25, 1.75, 0.75, 0.75, 2.25, 1.0)).max() < 0.005
    assert np.abs(world.bodies.dynamic.linear_velocity).max() < 1e-3
    world.close()


@both_dimensions
def test_queries_and_casts_find_it(d):
    world = make_world(d)
    place = np.array(at(d, 0, 100))
    leaning = world.create_entity(Transform(place, turn(d, -math.pi / 4)), CapsuleCollider(0.5, 2.0))
    axis = np.array(at(d, 1, 1)) / math.sqrt(2)
    assert world.query_point(place + 2.4 * axis) == [leaning]
    assert world.query_point(place + 2.6 * axis) == []
    assert world.query_point(place + at(d, 1.5, -1.5)) == []  # in its box, not in it
    assert world.query_sphere(place + at(d, 1.0, -1.0), math.sqrt(2) - 0.4) == [leaning]
    assert world.query_sphere(place + at(d, 1.0, -1.0), math.sqrt(2) - 0.6) == []
    hit = world.ray_cast(place + at(d, 1, 10), at(d, 0, -1))[0]
    assert hit.entity == leaning
    assert hit.distance == pytest.approx(9 - 0.5 * math.sqrt(2))
    assert hit.normal[:2] == pytest.approx((-math.sqrt(0.5), math.sqrt(0.5)))
    end = world.ray_cast(place + 10 * axis, -axis)[0]
    assert end.distance == pytest.approx(7.5)
    swept = world.shape_cast(CapsuleCollider(0.25, 1.0), place + at(d, 0.5, 10), at(d, 0, -20))[0]
    assert swept.entity == leaning
    # its lower end, at x = 0.5, comes to within 0.75 of the line
    assert swept.distance == pytest.approx(9.5 - 0.75 * math.sqrt(2) - 1.0)
    world.close()


@pytest.mark.parametrize("arguments", [(-0.1, 1.0), (0.1, -1.0), (math.nan, 1.0), ("x", 1.0)])
def test_wrong_sizes_are_named(arguments):
    with pytest.raises(ValueError, match=r"CapsuleCollider\.(radius|half_height)"):
        CapsuleCollider(*arguments)

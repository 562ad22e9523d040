"""Rays and moving shapes against brute force over all bodies, and against closed forms (B13, B14, C15)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_pairwise import pairwise
from queries.helpers_queries import GRAZE, directions, scene
from worlds import ball, both_dimensions, box, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform


def check_cast(hits, many, i, bodies, cast, tolerance):
    """All hits of one cast against the oracle's, and what row i of a batch has against the nearest.

    cast: start, direction, length, half extents and whether it is a sphere.
    """
    way, least = bodies.cast(*cast)
    clear = np.abs(least) > GRAZE
    expected = set(bodies.entity[(way < np.inf) & clear].tolist())
    unsure = set(bodies.entity[~clear].tolist())
    found = [hit.entity for hit in hits]
    assert len(set(found)) == len(found)
    assert expected - unsure <= set(found) <= expected | unsure
    assert [(hit.distance, hit.entity) for hit in hits] == sorted((hit.distance, hit.entity) for hit in hits)
    for hit in hits:
        index = int(np.flatnonzero(bodies.entity == hit.entity)[0])
        if clear[index]:
            # the distance is as uncertain as the gap, divided by the slope with which it closes
            slack = tolerance * (1.0 + 1.0 / math.sqrt(abs(least[index])))
            assert hit.distance == pytest.approx(way[index], abs=slack)
            assert np.linalg.norm(hit.normal) == pytest.approx(1.0, abs=1e-12)
            assert hit.distance == 0.0 or hit.normal @ cast[1] < 0.0
    first = hits[0] if hits else None
    nearest = (first.entity, first.distance, first.fraction) if first else (-1, math.inf, 1.0)
    assert (many.entity[i], many.distance[i], many.fraction[i]) == nearest
    if first:
        np.testing.assert_array_equal(many.normal[i], first.normal)
        np.testing.assert_array_equal(many.point[i], first.point)


@pytest.mark.slow
@pytest.mark.parametrize(("d", "n", "sizes"), pairwise((2, 3), (60, 800), ("even", "power", "clusters")))
def test_casts_through_many_bodies(d, n, sizes):
    """Of a point, of spheres and boxes, some without extent."""
    world, bodies, side = scene(d, n, seed=n + d, sizes=sizes)
    rng = np.random.default_rng(7)
    m = 12
    starts = (rng.random((m, d)) * 1.4 - 0.2) * side
    starts[:3] = bodies.centre[:3] + 0.01
    ways = directions(rng, m, d)
    lengths = rng.random(m) * 1.5 * side
    radii, halves = rng.random(m) * 0.5, rng.random((m, d)) * 0.5
    radii[:2], halves[1:3], halves[3:5, 0] = 0.0, 0.0, 0.0
    moves = lengths[:, None] * ways
    rays = world.ray_casts(starts, ways, lengths)
    spheres = world.shape_casts(SphereCollider.many(radius=radii), starts, moves)
    boxes = world.shape_casts(AABBCollider.many(half_extents=halves), starts, moves)
    tolerance = 1e-13 * (1e6 if sizes == "clusters" else side)
    for i in range(m):
        for many, hits, half, round_one in (
            (rays, world.ray_cast(starts[i], ways[i], lengths[i]), np.zeros(d), True),
            (spheres, world.shape_cast(SphereCollider(radii[i]), starts[i], moves[i]), np.full(d, radii[i]), True),
            (boxes, world.shape_cast(AABBCollider(halves[i]), starts[i], moves[i]), halves[i], False),
        ):
            check_cast(hits, many, i, bodies, (starts[i], ways[i], lengths[i], half, round_one), tolerance)


@pytest.mark.parametrize("scale", [1e-150, 1e-9, 1e9, 1e150])
@both_dimensions
def test_casts_at_extreme_sizes(d, scale):
    """Powers of ten, so the results differ from those at size 1 by rounding alone."""
    world = make_world(d)
    ball(world, (3 * scale, 0.25 * scale, 0)[:d], radius=scale)
    box(world, (6 * scale, 0.0, 0)[:d], half=scale, kind="static")
    start, way = np.zeros(d), np.eye(d)[0]
    first, second = world.ray_cast(start, way)
    assert first.distance == pytest.approx(scale * (3 - math.sqrt(1 - 0.0625)), rel=1e-14)
    assert second.distance == pytest.approx(5 * scale, rel=1e-14)
    (hit,) = world.shape_cast(AABBCollider(np.full(d, scale)), start, 4 * scale * way, only_nearest=True)
    assert hit.distance == pytest.approx(scale, rel=1e-14)
    assert world.query_nearest(start).distance == pytest.approx(scale * (math.hypot(3, 0.25) - 1), rel=1e-14)


@both_dimensions
def test_starts_inside(d):
    """At distance 0, with the normal of the nearest way out."""
    world = make_world(d)
    inside = box(world, 0, half=1.0, kind="static")
    start = np.zeros(d)
    start[0] = 0.9
    way = np.eye(d)[1]
    (hit,) = world.ray_cast(start, way)
    assert (hit.entity, hit.distance, hit.fraction) == (inside, 0.0, 0.0)
    np.testing.assert_array_equal(hit.normal, np.eye(d)[0])
    np.testing.assert_array_equal(hit.point, start)
    (hit,) = world.shape_cast(SphereCollider(0.5), start + 0.3 * np.eye(d)[0], np.zeros(d))
    assert (hit.distance, hit.fraction) == (0.0, 0.0)
    np.testing.assert_array_equal(hit.normal, np.eye(d)[0])
    assert world.shape_cast(SphereCollider(0.1), start + 0.3 * np.eye(d)[0], np.zeros(d)) == []
    assert world.query_nearest(start).distance == pytest.approx(-0.1, abs=1e-15)


@both_dimensions
def test_shape_offset_and_adopted_shapes(d):
    world = make_world(d)
    wall = box(world, 10, half=1.0, kind="static")
    ahead = 2 * np.eye(d)[0]
    for shape in (SphereCollider(0.5, offset=ahead), AABBCollider(np.full(d, 0.5), offset=ahead), AABBCollider(0.5)):
        (hit,) = world.shape_cast(shape, np.zeros(d), 20 * np.eye(d)[0])
        expected = 8.5 if np.any(shape.offset == 0) and np.ndim(shape.offset) == 0 else 6.5
        assert (hit.entity, hit.distance) == (wall, expected)
    player = ball(world, 0, radius=0.25)
    own = world.component_for_entity(player, SphereCollider)
    (hit,) = world.shape_cast(own, np.zeros(d), 20 * np.eye(d)[0], exclude=player)
    assert (hit.entity, hit.distance) == (wall, 8.75)
    offsets = SphereCollider.many(radius=[0.5, 0.5], offset=[ahead, 0 * ahead])
    hits = world.shape_casts(offsets, np.zeros((2, d)), 20 * np.eye(d)[0], excludes=player)
    np.testing.assert_array_equal(hits.distance, [6.5, 8.5])


def test_turned_boxes_are_met_as_they_stand():
    world = make_world()
    box(world, (5, 0), half=1.0, rotation=math.pi / 4, kind="static", offset=(1.0, 0.0))
    (hit,) = world.ray_cast((0, 0), (1, 0))
    assert hit.distance == pytest.approx(5 + math.sqrt(0.5) - math.sqrt(2), rel=1e-14)  # the offset turns as well


@pytest.mark.plain
def test_wrong_shapes():
    world = make_world()
    for shape in (RigidBody(), 0.5, SphereCollider, SphereCollider.many(radius=1.0)):
        with pytest.raises(TypeError, match=r"shape_cast: shape must be a collider of this world \(AABBCollider, Sph"):
            world.shape_cast(shape, (0, 0), (1, 0))
    with pytest.raises(TypeError, match="shape_casts: shape"):
        world.shape_casts(Transform.many(position=(0, 0)), [(0, 0)], (1, 0))

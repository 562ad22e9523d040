"""Pairs of boxes that turn, and of balls with them, against the search that serves any two convex shapes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rotation.helpers_pair import Pair, matrix, product, rotation

from carom.components import AABBCollider, SphereCollider
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.rotation import BoxCollider

pytestmark = pytest.mark.plain
WAYS = 12  # of each pair


def ways(random, d, extent):
    """Overlapping, touching nearly, and apart."""
    for k in range(WAYS):
        way = random.normal(size=d)
        yield way / np.linalg.norm(way) * extent * (0.3, 1.2, 1.6, 2.5)[k % 4]


def same(one, other, size):
    """Depth and point to rounding; the normal as well as it is known where the distance is short."""
    assert one[0] == pytest.approx(other[0], abs=1e-12 * size)
    assert np.allclose(one[2], other[2], atol=1e-11 * size, rtol=0)
    assert np.allclose(one[1], other[1], atol=1e-12 + 1e-14 * size / max(abs(one[0]), 1e-300))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_boxes_in_a_plane_meet_as_polygons_do(seed):
    """A polygon has no pair of its own: it meets by its farthest points alone. Parallel boxes too, and of any size."""
    random = np.random.default_rng(seed)
    size = (1.0, 1e-6, 1e6)[seed % 3]
    half, other = random.uniform(0.3, 1.0, (2, 2)) * size
    angles = random.uniform(0, 2 * math.pi, 2) if seed < 3 else np.array((0.5, 0.5 + math.pi / 2 * (seed - 3)))
    polygon, other_polygon = (ConvexPolygonCollider.box(extents) for extents in (half, other))
    with (
        Pair(BoxCollider(half), BoxCollider(other), 2, angles) as boxes,
        Pair(polygon, other_polygon, 2, angles) as polygons,
        Pair(AABBCollider(half), BoxCollider(other), 2, (None, angles[1])) as level,
        Pair(polygon, other_polygon, 2, (0.0, angles[1])) as level_polygon,
    ):
        for way in ways(random, 2, size):
            same(boxes.met(way), polygons.met(way), size)
            same(level.met(way), level_polygon.met(way), size)


@pytest.mark.compiled
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_a_ball_meets_a_turned_box_as_a_capsule_of_no_height_does(seed, d):
    """Which meets it by its farthest points; with its centre inside too."""
    random = np.random.default_rng(seed)
    size = (1.0, 1e-6, 1e6)[seed]
    half, turn = random.uniform(0.3, 1.0, d) * size, 0.7 if d == 2 else rotation(*random.normal(size=3))
    box, r = BoxCollider(half), random.uniform(0.1, 0.6) * size
    with (
        Pair(SphereCollider(r), box, d, (None, turn)) as ball,
        Pair(CapsuleCollider(r, 0.0), box, d, (None, turn)) as capsule,
    ):
        for way in ways(random, d, size):
            same(ball.met(way), capsule.met(way), size)


def separation(half, axes, other, other_axes, way, normal):
    """The gap between two boxes along a direction, from their farthest points."""
    return way @ normal - abs(axes.T @ normal) @ half - abs(other_axes.T @ normal) @ other


@pytest.mark.compiled
@pytest.mark.parametrize("seed", range(8))
def test_boxes_in_space_meet_at_their_distance(seed):
    """No direction parts them by more than the distance of two of their points: the normal and the point show that.
    Overlapping they part soonest across a face of one, or edges of both. Parallel ones too, and of any size."""
    random = np.random.default_rng(seed)
    size = (1.0, 1e-6, 1e6, 1.0)[seed % 4]
    half, other = random.uniform(0.2, 1.0, (2, 3)) * size
    turn = rotation(*random.normal(size=3))
    between = random.normal(size=3) if seed < 5 else (0.0, 0.0, (0.0, 0.7, 1e-5)[seed - 5])
    turns = (turn, product(turn, rotation(*between)))
    one, two = (matrix(turn) for turn in turns)
    edges = (np.cross(a, b) for a in one.T for b in two.T)
    normals = [*one.T, *two.T, *(edge / np.linalg.norm(edge) for edge in edges if np.linalg.norm(edge) > 1e-9)]
    with Pair(BoxCollider(half), BoxCollider(other), 3, turns) as boxes:
        for way in (way * stretch for stretch in (1.0, 1.2) for way in ways(random, 3, size)):
            depth, normal, point = boxes.met(way)
            widest = max(separation(half, one, other, two, way, side * n) for n in normals for side in (1, -1))
            assert separation(half, one, other, two, way, normal) == pytest.approx(-depth, abs=1e-11 * size)
            assert -depth >= widest - 1e-11 * size
            if depth > 0:
                assert -depth == pytest.approx(widest, abs=1e-9 * size)
            on_one, on_two = point + 0.5 * depth * normal, point - 0.5 * depth * normal - way
            assert np.all(abs(one.T @ on_one) <= half + 1e-9 * size)
            assert np.all(abs(two.T @ on_two) <= other + 2e-6 * size)

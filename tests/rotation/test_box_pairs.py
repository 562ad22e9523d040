"""Pairs of boxes that turn, and of balls with them, against the search that serves any two convex shapes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rotation.helpers_pair import Pair, rotation

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

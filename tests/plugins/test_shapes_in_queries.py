"""Queries, rays and casts meet every convex shape where it is: in any place, however it is turned, and turned again."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from carom.components import AABBCollider, SphereCollider, Transform
from carom.framework import World
from carom.plugins import Physics, capsule, convex_hull, convex_polygon
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_hull import ConvexHullCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.systems.shapes.quaternions import axes_of

pytestmark = pytest.mark.slow  # its shapes take long to compile

CORNERS = np.array(((-1.0, -0.6, -0.5), (1.1, -0.4, 0.1), (0.4, 0.9, -0.2), (-0.7, 0.5, 0.3), (0.1, 0.2, 0.8)))
KITE = np.array(((-1.0, -0.4), (0.6, -0.6), (0.9, 0.5)))
SIGNS = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, 8).T
SHAPES = {  # by name and dimension: the collider, the corners of its core, how far it reaches beyond that
    ("ball", 2): (SphereCollider(0.7), np.zeros((1, 2)), 0.7),
    ("ball", 3): (SphereCollider(0.7), np.zeros((1, 3)), 0.7),
    ("box", 2): (AABBCollider((0.6, 0.4)), (SIGNS * (0.6, 0.4, 0.5))[:, :2], 0.0),
    ("box", 3): (AABBCollider((0.6, 0.4, 0.5)), SIGNS * (0.6, 0.4, 0.5), 0.0),
    ("capsule", 2): (CapsuleCollider(0.3, 0.8), np.array(((0.0, 0.8), (0.0, -0.8))), 0.3),
    ("capsule", 3): (CapsuleCollider(0.3, 0.8), np.array(((0.0, 0.8, 0.0), (0.0, -0.8, 0.0))), 0.3),
    ("polygon", 2): (ConvexPolygonCollider(KITE), KITE, 0.0),
    ("rounded polygon", 2): (ConvexPolygonCollider(KITE, corner_radius=0.2), KITE, 0.2),
    ("hull", 3): (ConvexHullCollider(CORNERS), CORNERS, 0.0),
}
FAR = 6.0
NEAR = 1e-6


def gap(points, corners, reach):
    """(n,) to what reaches so far beyond the hull of its corners; in the hull, minus that reach: least squares, by
    scipy."""
    near = corners - corners[0]
    sums = np.concatenate((near.T, np.full((1, len(near)), 1e4)))  # weights from 0 whose sum is 1
    return np.array([nnls(sums, (*point, 1e4))[1] for point in points - corners[0]]) - reach


@pytest.mark.parametrize(("name", "d"), SHAPES)
def test_queries_and_casts_meet_a_shape_where_it_is(name, d):
    collider, core, reach = SHAPES[name, d]
    rng, place = np.random.default_rng(d), np.array((3.0, -40.0, 7.0))[:d]
    plugins = capsule.plugin, convex_polygon.plugin, convex_hull.plugin
    with World(Physics(dimensions=d), *plugins) as world:
        entity = world.create_entity(Transform(place), collider.copy())
        for turned in (False, True):
            rotation = np.array([-0.9]) if d == 2 else np.array([(0.4, -0.8, 0.3, 0.9)])
            corners = place + core
            if turned and name == "box":
                break  # it does not turn
            if turned:
                world.component_for_entity(entity, Transform).rotation = rotation[0] if d == 3 else -0.9
                world.refresh_queries()
                corners = place + core @ axes_of(rotation, d)[0].T
            points = place + rng.uniform(-2.0, 2.0, (150, d))
            away = gap(points, corners, reach)
            nearest = world.query_nearests(points).distance
            np.testing.assert_allclose(nearest[away > 0], away[away > 0], rtol=0, atol=NEAR)
            found = np.diff(world.query_spheres(points, 0.3).offsets) == 1
            assert (found == (away <= 0.3))[np.abs(away - 0.3) > NEAR].all()
            inside = [world.query_point(point) == [entity] for point in points]
            assert (np.array(inside) == (away < NEAR)).all()
            way = place + rng.normal(size=points.shape) - points
            way *= FAR / np.linalg.norm(way, axis=1, keepdims=True)
            around = (corners[:, None] + 0.2 * SIGNS[:, :d]).reshape(-1, d)  # where a box of 0.2 touches
            for hull, beyond, hits in (
                (corners, reach, world.ray_casts(points, way, FAR)),
                (corners, reach + 0.25, world.shape_casts(SphereCollider(0.25), points, way)),
                (around, reach, world.shape_casts(AABBCollider(0.2), points, way)),
            ):
                outside, met = gap(points, hull, beyond) > NEAR, hits.entity == entity
                part = np.where(met, hits.distance / FAR, 1.0)[:, None]
                before = [gap(points + share * part * way, hull, beyond) for share in np.linspace(0.0, 1.0, 20)]
                assert np.min(before, axis=0)[outside].min() > -NEAR
                met &= outside
                assert 5 < met.sum() < outside.sum()
                assert np.abs(before[-1][met]).max() < NEAR
                out = (points + part * way + 0.01 * hits.normal)[met]
                np.testing.assert_allclose(gap(out, hull, beyond), 0.01, rtol=0, atol=NEAR)

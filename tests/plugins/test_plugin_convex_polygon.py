"""Convex polygons: refused input, sliding; pairs are in test_shipped_pairs, queries in test_shapes_in_queries."""

from __future__ import annotations

import math

import numpy as np
import pytest
from worlds import run

from carom.components import RigidBody, Transform
from carom.framework import World
from carom.plugins import Physics, convex_polygon
from carom.plugins.convex_polygon import ConvexPolygonCollider

pytestmark = pytest.mark.slow  # its scenes compile for long

SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))


@pytest.mark.parametrize(
    ("vertices", "rule"),
    [
        (((0, 0), (1, 0)), "must have 3"),
        (((0, 0), (1, 0), (1, 0), (0, 1)), "same corner twice in a row"),
        (((1, 0), (0, 1), (0, 0), (1, 0)), "same corner twice in a row"),
        (((0, 0), (1, 0), (2, 0), (0, 1)), "three corners on a line"),
        (((0, 0), (1, 1), (2, 2)), "three corners on a line"),
        (((0, 0), (2, 0), (1, 0), (0, 1)), "three corners on a line"),
        (((5, 5), (5, 5), (5, 5)), "one point"),
        (((0, 0), (4, 0), (1, 1), (0, 4)), r"must be convex \(it is not at corner"),
        (((0, 0), (1, 1), (1, 0), (0, 1)), "must be convex"),
        ([(math.cos(k * 4 * math.pi / 5), math.sin(k * 4 * math.pi / 5)) for k in range(5)], "cross each other"),
        (((0, 0), (1, 0), (0, math.nan)), "finite"),
        (((0, 0, 0), (1, 0, 0), (0, 1, 0)), r"shape \(n, 2\)"),
        (((0, 0), (1, 0), (0,)), "numbers"),
        ("triangle", "numbers"),
        (7, r"shape \(n, 2\)"),
    ],
)
def test_what_is_no_convex_polygon_is_refused(vertices, rule):
    with pytest.raises(ValueError, match=f"ConvexPolygonCollider.vertices .*{rule}"):
        ConvexPolygonCollider(vertices)


@pytest.mark.parametrize("size", [1e-200, 1e-9, 1.0, 1e150])
def test_either_order_is_taken_at_any_size(size):
    square = np.array(SQUARE, float) * size
    for corners in (square, square[::-1], np.roll(square, 1, axis=0)):
        kept = ConvexPolygonCollider(corners).vertices / size
        area = (kept[:, 0] * np.roll(kept[:, 1], -1) - kept[:, 1] * np.roll(kept[:, 0], -1)).sum() / 2
        assert area == pytest.approx(1.0)


def test_boxes_and_regular_polygons():
    np.testing.assert_array_equal(ConvexPolygonCollider.box((2, 1)).vertices, ((-2, -1), (2, -1), (2, 1), (-2, 1)))
    hexagon = ConvexPolygonCollider.regular(6, 2.0, corner_radius=0.1)
    np.testing.assert_allclose(np.hypot(*hexagon.vertices.T), 2.0)
    assert hexagon.corner_radius == 0.1
    assert len(ConvexPolygonCollider.regular(1000, 1e-6).vertices) == 1000
    for wrong in (0, (1, 0), (1, 2, 3), math.nan):
        with pytest.raises(ValueError, match="box: half_extents must be positive"):
            ConvexPolygonCollider.box(wrong)
    for n, radius in ((2, 1), (2.5, 1), (3, 0), (3, math.inf)):
        with pytest.raises(ValueError, match=r"regular\.(n|radius) must be "):
            ConvexPolygonCollider.regular(n, radius)
    with pytest.raises(ValueError, match="corner_radius"):
        ConvexPolygonCollider(SQUARE, corner_radius=-1)


def make_world(gravity=(0, -10)):
    return World(Physics(dimensions=2, gravity=gravity), convex_polygon.plugin)


def test_it_slides_down_a_slope_as_fast_as_physics_says():
    """g (sin a - mu cos a) along the slope, for a box turned like it."""
    angle, friction = math.radians(30), 0.2
    world = make_world()
    along, up = np.array((math.cos(angle), math.sin(angle))), np.array((-math.sin(angle), math.cos(angle)))
    world.create_entity(
        Transform((0, 0), rotation=angle), ConvexPolygonCollider.box((100, 1), friction=friction)
    )
    box = world.create_entity(Transform(up * 1.25 + along * 20, rotation=angle), RigidBody(),
                              ConvexPolygonCollider.box((0.5, 0.25), friction=friction))  # fmt: skip
    run(world, 60)
    body = world.component_for_entity(box, RigidBody)
    expected = 10 * (math.sin(angle) - friction * math.cos(angle))
    assert -body.linear_velocity @ along == pytest.approx(expected, rel=0.01)
    assert abs(body.linear_velocity @ up) < 1e-6
    assert world.component_for_entity(box, Transform).position @ up == pytest.approx(1.25, abs=1e-3)


def test_new_corners_count_from_the_next_step_on():
    world = make_world(gravity=(0, 0))
    polygon = world.create_entity(Transform((0, 0)), ConvexPolygonCollider.box(1.0))
    world.step()
    assert world.query_point((1.5, 0)) == []
    world.component_for_entity(polygon, ConvexPolygonCollider).vertices = ((-2, -2), (2, -2), (2, 2), (-2, 2))
    world.step()
    assert world.query_point((1.5, 0)) == [polygon]
    copy = world.component_for_entity(polygon, ConvexPolygonCollider).copy()
    np.testing.assert_array_equal(copy.vertices[0], (-2, -2))

"""Outlines as convex pieces: they are the outline, and what is none is refused."""

from __future__ import annotations

import builtins
import math

import numpy as np
import pytest

from carom import ConvexPolygonCollider
from carom.plugins.parts import parts_from_outline

pytest.importorskip("mapbox_earcut")
pytestmark = pytest.mark.plain
ANGLE = ((0, 0), (2, 0), (2, 1), (1, 1), (1, 3), (0, 3))


@pytest.mark.slow
@pytest.mark.compiled
def test_pieces_of_random_outlines_are_convex_and_have_its_area():
    random = np.random.default_rng(2)
    for _ in range(60):
        angles = np.sort(random.uniform(0.0, 2 * math.pi, random.integers(5, 20)))
        if np.diff(np.append(angles, angles[0] + 2 * math.pi)).max() > 3.0:
            continue
        radii = random.uniform(0.3, 1.0, len(angles))
        points = np.stack((radii * np.cos(angles), radii * np.sin(angles)), axis=1)
        x, y = points.T
        area = 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()
        outline = parts_from_outline(points[::-1] if random.random() < 0.5 else points)
        assert outline.area == pytest.approx(area, rel=1e-12)
        assert sum(piece.share for piece in outline.pieces) == pytest.approx(1.0)
        assert sum(piece.share * piece.position for piece in outline.pieces) == pytest.approx(0.0, abs=1e-14)
        corners = {(round(x, 9), round(y, 9)) for x, y in points}
        for piece in outline.pieces:
            ConvexPolygonCollider(piece.vertices)  # convex, or it would be refused
            own = {(round(x, 9), round(y, 9)) for x, y in piece.vertices + piece.position + outline.centre}
            assert own <= corners


def test_an_angle_is_two_boxes():
    outline = parts_from_outline(ANGLE)
    assert [len(piece.vertices) for piece in outline.pieces] == [4, 4]
    assert outline.centre == pytest.approx((0.75, 1.25))


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (((0, 0), (2, 2), (2, 0), (0, 2)), "edges 0 and 2"),
        (((0, 0), (4, 0), (4, 2), (2, 0), (0, 2)), "edges 0 and 2"),
        (((0, 0), (1, 0), (1, 0), (0, 1)), "edges 0 and 2"),
        (((0, 0), (1, 0)), "three or more"),
        (((0, 0), (1, 0), (2, 0)), "no area"),
        (((0, 0), (1, 0), (0, math.nan)), "finite, corner 2"),
    ],
)
def test_what_is_no_outline_is_refused(points, message):
    with pytest.raises(ValueError, match=message):
        parts_from_outline(points)


def test_a_missing_package_is_named(monkeypatch):
    usual = builtins.__import__

    def none(name, *args, **kwargs):
        if name == "mapbox_earcut":
            raise ImportError(name)
        return usual(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", none)
    with pytest.raises(ImportError, match=r"carom\[outlines\]"):
        parts_from_outline(ANGLE)

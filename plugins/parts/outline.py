"""Outlines that are not convex, as convex pieces: triangles of mapbox_earcut, joined where they stay convex.

(S. Hertel and K. Mehlhorn, "Fast triangulation of simple polygons", 1983: at most four times as many pieces as needed.)
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

STRAIGHT = 1e-9  # of the lengths: a corner that turns by less is none
MISSING = "mapbox_earcut is missing; it comes with the extra: pip install 'carom[outlines]'"


class Piece(NamedTuple):
    """A convex part of an outline.

    position
        (2,) m, its centre from the centre of the outline
    vertices
        (k, 2) m, its corners around its own centre, counter-clockwise
    share
        of the area of the outline
    """

    position: np.ndarray
    vertices: np.ndarray
    share: float


class Outline(NamedTuple):
    """An outline as convex pieces, the largest first: ``centre`` (2,) m, of its area, as the outline was given."""

    centre: np.ndarray
    area: float
    pieces: list[Piece]


def parts_from_outline(points: Any) -> Outline:
    """The convex pieces of an outline of ``points``, (n, 2) m, in either order; ValueError if it is none, or crosses
    itself. ImportError without the extra ``outlines``."""
    try:
        import mapbox_earcut  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise ImportError(MISSING) from error
    corners = sound_corners(points)
    triangles = np.asarray(mapbox_earcut.triangulate_float64(corners, np.array([len(corners)], np.uint32)), np.int64)
    polygons = _joined(corners, [tuple(triangle) for triangle in triangles.reshape(-1, 3).tolist()])
    found = sorted((_measured(corners[list(polygon)]) for polygon in polygons), key=lambda one: -one[0])
    area = sum(one[0] for one in found)
    centre = sum(one[0] * one[1] for one in found) / area
    pieces = [Piece(middle - centre, vertices - middle, own / area) for own, middle, vertices in found]
    return Outline(centre, area, pieces)


def sound_corners(points: Any) -> np.ndarray:
    """The corners, counter-clockwise, without those that turn by nothing."""
    corners = np.array(points, float)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
        raise ValueError(f"an outline is three or more corners (n, 2), got shape {corners.shape}")
    bad = ~np.isfinite(corners).all(axis=1)
    if bad.any():
        k = int(np.argmax(bad))
        raise ValueError(f"the corners of an outline must be finite, corner {k} is {tuple(corners[k].tolist())}")
    if len(corners) > 3 and (corners[0] == corners[-1]).all():
        corners = corners[:-1]
    crossing = _crossing(corners)
    if crossing is not None:
        raise ValueError("the outline crosses or touches itself: edges {} and {}".format(*crossing))
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    size = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    corners = corners[np.abs(_cross(before, after)) > STRAIGHT * size]
    if len(corners) < 3:
        raise ValueError("the outline has no area")
    return corners if _cross(corners, np.roll(corners, -1, axis=0)).sum() > 0.0 else corners[::-1].copy()


def _cross(u: Any, v: Any) -> Any:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def _crossing(corners: np.ndarray) -> tuple[int, int] | None:
    """The first two edges that meet elsewhere than at a corner between them; edge i begins at corner i."""
    ends, n = np.roll(corners, -1, axis=0), len(corners)
    for i in range(n):
        if (corners[i] == ends[i]).all():
            return i, (i + 1) % n
        others = np.arange(i + 2, n - (i == 0))
        p, q, a, b = corners[i], ends[i], corners[others], ends[others]
        sides = [np.sign(_cross(q - p, a - p)), np.sign(_cross(q - p, b - p))]
        sides += [np.sign(_cross(b - a, p - a)), np.sign(_cross(b - a, q - a))]
        near = (np.minimum(a, b) <= np.maximum(p, q)).all(axis=1) & (np.maximum(a, b) >= np.minimum(p, q)).all(axis=1)
        meets = (sides[0] * sides[1] <= 0.0) & (sides[2] * sides[3] <= 0.0) & near
        if meets.any():
            return i, int(others[np.argmax(meets)])
    return None


def _joined(corners: np.ndarray, polygons: list[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Polygons that share an edge become one, as long as it is convex: over one edge after the other."""
    polygons = [p if _cross(*(corners[list(p[1:])] - corners[p[0]])) > 0.0 else p[::-1] for p in polygons]
    edges = {tuple(sorted((p[k - 1], p[k]))) for p in polygons for k in range(len(p))}
    for one, other in sorted(edges):
        sharing = [p for p in polygons if _has_edge(p, one, other) or _has_edge(p, other, one)]
        if len(sharing) < 2:
            continue
        first, second = sharing if _has_edge(sharing[0], one, other) else sharing[::-1]
        whole = (*_from(first, other), *_from(second, one)[1:-1])  # other ... one, and back around the second
        if _is_convex(corners[list(whole)]):
            polygons = [p for p in polygons if p not in (first, second)] + [whole]
    return polygons


def _has_edge(polygon: tuple[int, ...], one: int, other: int) -> bool:
    return one in polygon and polygon[(polygon.index(one) + 1) % len(polygon)] == other


def _from(polygon: tuple[int, ...], corner: int) -> tuple[int, ...]:
    """The same polygon, beginning at a corner."""
    at = polygon.index(corner)
    return polygon[at:] + polygon[:at]


def _is_convex(corners: np.ndarray) -> bool:
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    size = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    return bool((_cross(before, after) > STRAIGHT * size).all())


def _measured(vertices: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """(area, centre, vertices) of a convex polygon."""
    first, second = vertices[1:-1] - vertices[0], vertices[2:] - vertices[0]
    areas = 0.5 * _cross(first, second)
    return float(areas.sum()), vertices[0] + (areas[:, None] * (first + second) / 3.0).sum(0) / areas.sum(), vertices

"""The outlines of shapes that turn in a plane, and how deep two outlines overlap."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...framework import World
from ...plugins.capsule import CapsuleCollider
from ...plugins.convex_polygon import ConvexPolygonCollider
from ...plugins.rotation import BoxCollider
from ...plugins.terrain.segment import ChainSegmentCollider

Floats = NDArray[np.float64]

SIGNS = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
MOST_NUMBERS = 4_000_000  # in one array: more pairs are looked at by turns


class Outline(NamedTuple):
    """``corners`` (m, 2), counter-clockwise, about the shape's centre and along the body's own axes; the shape goes
    ``rounding`` beyond them; ``size``: its smallest extent."""

    corners: Floats
    rounding: float
    size: float


def _box(box: Any) -> Outline:
    return Outline(SIGNS * box.half_extents, 0.0, 2 * float(np.min(box.half_extents)))


def _capsule(capsule: Any) -> Outline:
    ends = np.array([(0.0, -capsule.half_height), (0.0, capsule.half_height)])
    return Outline(ends, capsule.radius, 2 * capsule.radius)


def _polygon(polygon: Any) -> Outline:
    corners, rounding = np.array(polygon.vertices), polygon.corner_radius
    widths = np.ptp(corners @ _normals(corners).T, axis=0)
    return Outline(corners, rounding, float(widths.min()) + 2 * rounding)


def _segment(segment: Any) -> Outline:
    ends = np.array([segment.start, segment.end])
    return Outline(ends, 0.0, float(np.linalg.norm(ends[1] - ends[0])))


OUTLINES = {
    BoxCollider: _box, CapsuleCollider: _capsule, ConvexPolygonCollider: _polygon, ChainSegmentCollider: _segment,
}  # fmt: skip


def outlines_of(world: World, collider: Any, entities: NDArray[np.int64]) -> tuple[list[Floats], Floats, Floats]:
    """The corners, the roundings and the sizes of that collider of each of the entities."""
    found = [OUTLINES[collider](world.component_for_entity(entity, collider)) for entity in entities.tolist()]
    corners, rounding, size = zip(*found, strict=True)
    return list(corners), np.array(rounding), np.array(size)


def rounded(corners: Floats, rounding: float, points: int = 9) -> Floats:
    """The polygon (n, 2) around a rounded one; ``points`` at each corner."""
    if not rounding > 0.0:
        return corners
    normals = _normals(corners)
    ends = np.arctan2(normals[:, 1], normals[:, 0])
    starts = np.roll(ends, 1)
    turns = (ends - starts) % (2 * np.pi)
    turns[turns == 0.0] = 2 * np.pi  # the corners are one point
    angles = starts[:, None] + turns[:, None] * np.linspace(0.0, 1.0, points)
    arcs = rounding * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return (corners[:, None] + arcs).reshape(-1, 2)


def depths(a: list[Floats], b: list[Floats], apart: Floats, reach: Floats) -> Floats:
    """How deep each of the polygons ``a`` is in the same one of ``b``, whose centre is ``apart`` (k, 2) from its own;
    they go ``reach`` (k,) beyond their corners, together. Negative where apart.

    Along the normals of the edges, which are enough for corners that are not rounded, and the ways between corners.
    """
    found = np.empty(len(a))
    corners = max(map(len, [*a, *b]), default=1)
    some = max(1, MOST_NUMBERS // (2 * corners * (corners * corners + 2 * corners)))
    for first in range(0, len(a), some):
        rows = slice(first, first + some)
        one, other = _padded(a[rows], corners), _padded(b[rows], corners) + apart[rows, None]
        axes = np.concatenate([_normals(one), -_normals(other)], axis=1)
        if reach[rows].any():
            between = (other[:, :, None] - one[:, None]).reshape(len(one), -1, 2)
            axes = np.concatenate([axes, _units(between)], axis=1)
        ends = np.einsum("kad,kcd->kac", axes, other).min(axis=2), np.einsum("kad,kcd->kac", axes, one).max(axis=2)
        gaps = np.where(axes.any(axis=2), ends[0] - ends[1], -np.inf).max(axis=1)
        found[rows] = reach[rows] - np.where(np.isfinite(gaps), gaps, 0.0)  # two points on each other have no axis
    return found


def _padded(polygons: list[Floats], corners: int) -> Floats:
    """(k, corners, 2): the last corner is repeated."""
    return np.array([np.concatenate([one, np.repeat(one[-1:], corners - len(one), axis=0)]) for one in polygons])


def _normals(corners: Floats) -> Floats:
    """Outward unit normals of the edges (..., m, 2), from each corner to the next; 0 where these are the same."""
    edges = np.roll(corners, -1, axis=-2) - corners
    return _units(np.stack([edges[..., 1], -edges[..., 0]], axis=-1))


def _units(vectors: Floats) -> Floats:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0)

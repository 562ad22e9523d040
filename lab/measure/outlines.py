"""The outlines of shapes that turn."""

from __future__ import annotations

import collections
import functools
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...framework import World
from ...framework.data.arrays.column import ArrayColumn
from ...plugins.capsule import CapsuleCollider
from ...plugins.convex_hull import ConvexHullCollider, around, faces_of
from ...plugins.convex_polygon import ConvexPolygonCollider
from ...plugins.half_space import HalfSpaceCollider
from ...plugins.rotation import BoxCollider
from ...plugins.terrain.segment import ChainSegmentCollider
from ...plugins.terrain.triangle import TerrainTriangleCollider
from ...plugins.tile_grid import TileGridCollider

Floats = NDArray[np.float64]

Rows = NDArray[np.int64]

SIGNS = {  # by the dimensions: the corners of a box; in space bit k of a corner's number is the end of axis k
    2: np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]),
    3: 2.0 * (np.arange(8)[:, None] >> np.arange(3) & 1) - 1.0,
}
NO_FACES = np.zeros((0, 3), np.int64)
BOX_FACES = np.array([(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)])
FACES = {2: NO_FACES, 3: BOX_FACES}  # of a box
FAR = 1e4  # m, how far half-spaces are drawn


class Outline(NamedTuple):
    """``corners`` (m, d) about the shape's centre and along the body's own axes, in a plane counter-clockwise; the
    shape goes ``rounding`` beyond them; ``size``: its smallest extent; ``faces`` (f, k): in space the rows of the
    corners of each face, counter-clockwise from outside, the last one repeated where a face has fewer than k; in a
    plane those of each piece, of what is not convex."""

    corners: Floats
    rounding: float
    size: float
    faces: Rows = NO_FACES


def _box(box: Any) -> Outline:
    d = len(box.half_extents)
    return Outline(SIGNS[d] * box.half_extents, 0.0, 2 * float(np.min(box.half_extents)), FACES[d])


def _capsule(capsule: Any) -> Outline:
    ends = np.zeros((2, len(capsule.offset)))
    ends[:, 1] = -capsule.half_height, capsule.half_height
    return Outline(ends, capsule.radius, 2 * capsule.radius)


def _polygon(polygon: Any) -> Outline:
    corners, rounding = np.array(polygon.vertices), polygon.corner_radius
    widths = np.ptp(corners @ _normals(corners).T, axis=0)
    return Outline(corners, rounding, float(widths.min()) + 2 * rounding)


def _segment(segment: Any) -> Outline:
    ends = np.array([segment.start, segment.end])
    return Outline(ends, 0.0, float(np.linalg.norm(ends[1] - ends[0])))


def _hull(hull: Any) -> Outline:
    corners = np.array(hull.corners)
    return Outline(corners, 0.0, float(np.ptp(corners, axis=0).min()), _hull_faces(corners.tobytes()))


@functools.lru_cache(maxsize=256)
def _hull_faces(data: bytes) -> Rows:
    """Of corners (m, 3), given as their bytes."""
    corners = np.frombuffer(data).reshape(-1, 3)
    corners = corners - corners.mean(axis=0)
    corners /= np.abs(corners).max()
    rings = [np.flatnonzero(on)[around(corners[on], normal)] for on, normal in faces_of(corners)]
    return padded(rings, max(map(len, rings)))


def _triangle(triangle: Any) -> Outline:
    corners = np.array([triangle.a, triangle.b, triangle.c])
    return Outline(corners, 0.0, float(np.ptp(corners, axis=0).max()), np.arange(3)[None])


def _half_space(half_space: Any) -> Outline:
    up = half_space.normal / np.linalg.norm(half_space.normal)
    aside = np.array((up[1], -up[0]))
    axes = [aside, up]
    if len(up) == 3:
        aside = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
        aside /= np.linalg.norm(aside)
        axes = [aside, up, np.cross(aside, up)]
    corners = (SIGNS[len(up)] - np.eye(len(up))[1]) @ np.array(axes)
    return Outline(FAR * corners, 0.0, 2 * FAR, FACES[len(up)])


def _tiles(grid: Any) -> Outline:
    cells, size = np.pad(grid.cells[::-1], ((0, 0), (1, 1))), grid.tile_size  # the lowest row first
    row, ends = np.nonzero(cells[:, 1:] != cells[:, :-1])  # of the runs of tiles, by turns
    low, high = np.stack([ends[::2], row[::2]], axis=1), np.stack([ends[1::2], row[1::2] + 1], axis=1)
    corners = np.where(SIGNS[2] > 0.0, high[:, None], low[:, None]) - (cells.shape[1] / 2 - 1, cells.shape[0] / 2)
    return Outline(size * corners.reshape(-1, 2), 0.0, size, np.arange(4 * len(low)).reshape(-1, 4))


OUTLINES = {
    BoxCollider: _box, CapsuleCollider: _capsule, ConvexPolygonCollider: _polygon, ChainSegmentCollider: _segment,
}  # fmt: skip
ONLY_DRAWN = {
    HalfSpaceCollider: _half_space, TileGridCollider: _tiles,
    ConvexHullCollider: _hull, TerrainTriangleCollider: _triangle,
}  # fmt: skip


def outlines_of(world: World, collider: Any, entities: Rows) -> tuple[list[Floats], Floats, Floats, list[Rows]]:
    """The corners, the roundings, the sizes and the faces of that collider of each of the entities, in the order of
    the rows of ``world.bodies``."""
    if any(isinstance(column, ArrayColumn) for column in collider.columns.values()):
        rows: Any = (world.component_for_entity(entity, collider) for entity in entities.tolist())
    else:  # without a handle for each: they may be the pieces of a terrain
        columns, chosen = getattr(world.bodies, collider.prefix[:-1]), np.isin(world.bodies.entity, entities)
        fields = [getattr(columns, name)[chosen] for name in collider.columns]
        rows = map(collections.namedtuple("Row", collider.columns)._make, zip(*fields, strict=True))
    found = map({**OUTLINES, **ONLY_DRAWN}[collider], rows)
    corners, rounding, size, faces = zip(*found, strict=True)
    return list(corners), np.array(rounding), np.array(size), list(faces)


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


def padded(polygons: list[Any], corners: int) -> NDArray[Any]:
    """(k, corners, ...): the last corner is repeated."""
    return np.array([np.concatenate([one, np.repeat(one[-1:], corners - len(one), axis=0)]) for one in polygons])


def _normals(corners: Floats) -> Floats:
    """Outward unit normals of the edges (m, 2), from each corner to the next; 0 where these are the same."""
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)

"""Faces around points in space."""

from __future__ import annotations

import numpy as np

from ..framework.outlines import Outline
from ..plugins.convex_hull import around
from .lists import Floats

FLAT = 1e-9  # of the size: points so near to a face lie in it


def faces_around(points: Floats) -> Outline:
    """The convex hull of points (n, 3), as triangles: point by point (Barber, Dobkin and Huhdanpaa, 1996, without its
    partition), each new one takes the place of the faces that it sees. Of points in a plane both sides are faces; those
    on a line, or in one place, have none."""
    size = float(np.ptp(points, axis=0).max(initial=0.0))
    if not size > 0.0:
        return Outline(points[:1], ())
    _, first = np.unique(np.round((points - points[0]) / (FLAT * size)), axis=0, return_index=True)
    points = points[np.sort(first)]
    faces = _first_faces(points, size)
    if faces is None:
        ends = np.argmin(points @ (points[-1] - points[0])), np.argmax(points @ (points[-1] - points[0]))
        return Outline(points[list(ends)], ())
    if len(faces) == 1:  # all in a plane
        normal = np.cross(*(points[faces[0, 1:]] - points[faces[0, 0]]))
        ring = around(points, normal)
        return Outline(points, (ring, ring[::-1]))
    normals, heights = _planes(points, faces)
    for k in range(len(points)):
        sees = normals @ points[k] > heights + FLAT * size
        if not sees.any():
            continue
        rings = faces[sees]
        edges = set(zip(rings.ravel().tolist(), np.roll(rings, -1, axis=1).ravel().tolist(), strict=True))
        fresh = np.array(sorted((a, b, k) for a, b in edges if (b, a) not in edges))
        planes = _planes(points, fresh)
        faces = np.concatenate((faces[~sees], fresh))
        normals, heights = np.concatenate((normals[~sees], planes[0])), np.concatenate((heights[~sees], planes[1]))
    return Outline(points, tuple(faces))


def _planes(points: Floats, faces: np.ndarray) -> tuple[Floats, Floats]:
    """The unit normals of triangles, (f, 3), and how far along these they lie, (f,)."""
    a, b, c = points[faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    return normals, (a * normals).sum(axis=1)


def _first_faces(points: Floats, size: float) -> np.ndarray | None:
    """A tetrahedron of far points; a triangle, if all are in a plane; None: on a line."""
    a = int(np.argmin(points[:, 0]))
    b = int(np.argmax(((points - points[a]) ** 2).sum(axis=1)))
    areas = np.linalg.norm(np.cross(points - points[a], points[b] - points[a]), axis=1)
    c = int(np.argmax(areas))
    if areas[c] <= FLAT * size * size:
        return None
    heights = (points - points[a]) @ np.cross(points[b] - points[a], points[c] - points[a]) / areas[c]
    top = int(np.argmax(np.abs(heights)))
    if abs(heights[top]) <= FLAT * size:
        return np.array(((a, b, c),))
    if heights[top] > 0.0:
        b, c = c, b
    return np.array(((a, b, c), (a, top, b), (b, top, c), (c, top, a)))

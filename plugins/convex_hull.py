"""Convex hulls in 3D, turned by the Transform: the smallest convex bodies around some points."""

from __future__ import annotations

import functools
import itertools
import math
from typing import Any, ClassVar, Self

import numpy as np

from ..components.colliders import Collider
from ..framework import Plugin, array_column
from ..framework.elementary import atan2, power
from ..framework.typing import ArrayField
from .corners import bounds_of, support_of

__all__ = ["ConvexHullCollider"]

NARROWEST = 1e-150  # m: squares of it are not 0, which its inertia needs
FEWEST_POINTS, MOST_POINTS = 4, 64
FLAT = 1e-6  # of the size: points so near to a plane lie in it
NARROW = 1e-5  # of the size: three points within such a strip span no plane
FIRST = 5  # row of the first corner; before: the mass centre, three vectors whose products sum to the covariance, and
# the sides of a box of the same volume: lengths all, so that they stretch as the corners do

plugin = Plugin("convex_hull", version="1.0")


def faces_of(points: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """(which points it has, outward unit normal) of each face: a plane through three of them with none beyond."""
    triples = np.array(list(itertools.combinations(range(len(points)), 3)), int).reshape(-1, 3)
    places = points[triples]
    edges = places - np.roll(places, 1, axis=1)
    normals = np.cross(edges[:, 0], edges[:, 1])
    areas = np.linalg.norm(normals, axis=1)
    order = np.argsort(-areas, kind="stable")  # of all triples of a face the widest gives its normal
    order = order[areas[order] > NARROW * np.linalg.norm(edges, axis=2).max(axis=1)[order]]
    normals, triples = normals[order] / areas[order, None], triples[order]
    heights = np.multiply.outer(normals[:, 0], points[:, 0])  # no BLAS, whose bits are the processor's
    for k in (1, 2):
        heights += np.multiply.outer(normals[:, k], points[:, k])
    heights -= (normals * points[triples[:, 0]]).sum(axis=1)[:, None]
    side = np.where((heights <= FLAT).all(axis=1), 1.0, -1.0)
    left = np.flatnonzero((side[:, None] * heights <= FLAT).all(axis=1))
    faces = []
    while len(left):
        on = np.abs(heights[left[0]]) <= FLAT
        faces.append((on, side[left[0]] * normals[left[0]]))
        left = left[~on[triples[left]].all(axis=1)]
    return faces


def around(ring: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The order of the corners of a face, counter-clockwise about its normal."""
    ways = ring - ring.mean(axis=0)
    aside, along = (np.cross(ways[0], ways) * normal).sum(axis=1), (ways * ways[0]).sum(axis=1)
    return np.argsort([atan2(y, x) for y, x in zip(aside.tolist(), along.tolist(), strict=True)])


def outline_of(corners: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """(corners (n, 3), of each face the rows of its corners) of a hull that needs all of them."""
    shape = corners - corners.mean(axis=0)
    shape /= np.abs(shape).max()
    return corners, [np.flatnonzero(on)[around(shape[on], normal)] for on, normal in faces_of(shape)]


def cholesky(m: np.ndarray) -> np.ndarray:
    """Of a positive definite matrix (3, 3), the lower one. numpy asks LAPACK, whose bits are the processor's."""
    (xx, _, _), (xy, yy, _), (xz, yz, zz) = m.tolist()
    a = math.sqrt(xx)
    b, d = xy / a, xz / a
    c = math.sqrt(yy - b * b)
    e = (yz - b * d) / c
    return np.array(((a, 0.0, 0.0), (b, c, 0.0), (d, e, math.sqrt(zz - d * d - e * e))))


@functools.lru_cache(maxsize=256)
def _hull_of(data: bytes) -> np.ndarray | str:
    """The rows of the hull of points, given as their bytes; or what is wrong with the points."""
    points = np.frombuffer(data).reshape(-1, 3)
    if not FEWEST_POINTS <= len(points) <= MOST_POINTS:
        return f"must have {FEWEST_POINTS} to {MOST_POINTS} points"
    size = np.abs(points).max() or 1.0  # divided by it nothing overflows, at any size
    size *= np.abs((points - points[0]) / size).max() or 1.0
    if size < NARROWEST:
        return f"must be at least {NARROWEST:g} m across"
    shape, index = np.unique((points - points[0]) / size, axis=0, return_index=True)
    faces = faces_of(shape)
    if not faces or any(on.all() for on, _ in faces):
        return "must not all lie in a plane"
    corner = sum(on.astype(int) for on, _ in faces) >= 3  # of fewer faces: inside of one, or of an edge
    middle = shape[corner].mean(axis=0)
    triangles = []
    for on, normal in faces:
        ring = shape[on & corner] - middle
        ring = ring[around(ring, normal)]
        triangles += [ring[[0, k, k + 1]] for k in range(1, len(ring) - 1)]
    a, b, c = np.array(triangles).transpose(1, 0, 2)
    six = (a * np.cross(b, c)).sum(axis=1)  # times the volumes of the tetrahedra from the middle
    volume, whole = six.sum() / 6.0, a + b + c
    centre = (six[:, None] * whole).sum(axis=0) / (24.0 * volume)
    corners = np.array((a, b, c, whole))
    products = six[:, None, None] * corners[..., None] * corners[..., None, :]
    roots = cholesky(products.reshape(-1, 3, 3).sum(axis=0) / (120.0 * volume) - np.outer(centre, centre))
    sides = np.diag(roots) * power(float(volume / np.diag(roots).prod()), 1.0 / 3.0)
    return np.array(
        (points[0] + (centre + middle) * size, *roots.T * size, sides * size, *points[np.sort(index[corner])])
    )


def _is_hull(rows: np.ndarray) -> bool:
    """Whether these are the rows of a hull, not points."""
    if len(rows) < FIRST + 4 or rows[2, 0] != 0.0 or rows[3, :2].any():
        return False
    made = _hull_of(rows[FIRST:].tobytes())
    return (
        not isinstance(made, str) and made.shape == rows.shape and np.allclose(made, rows, 1e-6, 1e-9 * rows[4].max())
    )


def _rows_of(points: np.ndarray) -> np.ndarray | str:
    """The rows of the hull of points, these themselves if they are such rows; or what is wrong with the points."""
    return points if _is_hull(points) else _hull_of(points.tobytes())


def _wrong_with(points: np.ndarray) -> str | None:
    """Why these are neither a hull nor points that have one."""
    made = _rows_of(points)
    return made if isinstance(made, str) else None


@plugin.shape(cost=4)
class ConvexHullCollider(Collider):
    """The convex hull of some points in a 3D world; it turns with the Transform.

    hull
        (n, 3) m, 4 to 64 points around the shape's centre, not all in one plane; those inside are left out. Reads as
        the rows that are stored, which may be given again: five with the mass, then the :attr:`corners`
    """

    __slots__ = ()

    dimensions: ClassVar[tuple[int, ...]] = (3,)
    rotates: ClassVar[bool] = True

    hull: ArrayField = array_column(3, check=_wrong_with, convert=_rows_of)

    @property
    def corners(self) -> np.ndarray:
        """(n, 3) m, the points that the hull needs, in the order in which they were given."""
        return self.hull[FIRST:]

    @property
    def centre_of_mass(self) -> np.ndarray:
        """(3,) m, of the hull filled evenly, relative to the shape's centre."""
        return self.hull[0]

    @classmethod
    def sample(cls, **common: Any) -> Self:
        return cls(
            ((0.5, 0.0, -0.3), (-0.5, 0.1, -0.4), (0.0, 0.6, -0.3), (0.1, -0.5, -0.2), (0.1, 0.0, 0.5)), **common
        )

    @staticmethod
    def bounds(shape, dimensions):
        return bounds_of(shape.hull, FIRST, shape)

    @staticmethod
    def support(shape, direction):
        return support_of(shape.hull, FIRST, shape, direction)

    @staticmethod
    def outline(shape, dimensions):
        return outline_of(shape.hull[FIRST:])

    @staticmethod
    def second_moments(shape, dimensions):
        """The centre's square and the covariance, sums over the rows before the corners."""
        volume = shape.hull[4, 0] * shape.hull[4, 1] * shape.hull[4, 2]
        xx = yy = zz = xy = xz = yz = 0.0
        for j in range(4):
            x, y, z = shape.hull[j, 0], shape.hull[j, 1], shape.hull[j, 2]
            xx, yy, zz, xy, xz, yz = xx + x * x, yy + y * y, zz + z * z, xy + x * y, xz + x * z, yz + y * z
        return volume, shape.hull[0, 0], shape.hull[0, 1], shape.hull[0, 2], xx, yy, zz, xy, xz, yz

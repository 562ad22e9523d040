"""The reference of the geometry study: which convex polygons overlap, by separating axes in numpy.

Also the expected shares: two objects placed at random overlap with a probability proportional to the area of the
Minkowski sum of one with the mirror image of the other. So the shares of false positives are known in closed form,
independent of the density.
"""

from __future__ import annotations

import math

import numpy as np

from .objects import Object, area


def placed(corners: np.ndarray, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """(m, n, 2) corners in the world; corners (n, 2), positions (m, 2) m, rotations (m,) radians."""
    cosine, sine = np.cos(rotations)[:, None], np.sin(rotations)[:, None]
    x, y = corners.T
    return positions[:, None] + np.stack((cosine * x - sine * y, sine * x + cosine * y), axis=2)


def overlaps(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(m,) depth, m, of the overlap of convex polygons (m, n, 2) and (m, k, 2), counter-clockwise; negative if apart.

    Two separate convex polygons are separated along the normal of some edge (separating axis theorem). For overlapping
    ones this is the shortest translation along such a normal that separates them; for separate ones it is minus a lower
    bound of their distance.
    """
    return np.minimum(_least_overlap(one, other), _least_overlap(other, one))


def _least_overlap(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The smallest overlap over the edge normals of ``one``."""
    edges = np.roll(one, -1, axis=1) - one
    normals = np.stack((edges[..., 1], -edges[..., 0]), axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    surface = np.einsum("mij,mij->mi", normals, one)
    nearest = np.einsum("mij,mkj->mik", normals, other).min(axis=2)
    return (surface - nearest).min(axis=1)


def touching(corners: np.ndarray, positions: np.ndarray, rotations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Overlapping pairs of equal polygons: (pairs (k, 2), the smaller index first, sorted; overlaps (k,) m)."""
    reach = 2 * float(np.linalg.norm(corners, axis=1).max())
    first, second = _near(positions, reach)
    polygons = placed(corners, positions, rotations)
    depths = overlaps(polygons[first], polygons[second])
    hit = depths >= 0
    pairs = np.sort(np.stack((first, second), axis=1)[hit], axis=1)
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    return pairs[order], depths[hit][order]


def _near(positions: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Pairs at most ``reach`` apart: sort by x, then compare each with its successors while any is near in x."""
    order = np.argsort(positions[:, 0], kind="stable")
    places = positions[order]
    first, second = [], []
    for step in range(1, len(places)):
        apart = places[step:] - places[:-step]
        if apart[:, 0].min() > reach:
            break
        near = np.flatnonzero((apart**2).sum(axis=1) <= reach**2)
        first.append(order[near])
        second.append(order[near + step])
    none = np.empty(0, np.int64)
    return np.concatenate((none, *first)), np.concatenate((none, *second))


def expected_area(thing: Object, levels: tuple[str, ...], turned: bool) -> float | None:
    """m2 of the offsets at which two of these objects overlap in every level; the mean over all rotations if
    ``turned``.

    Levels as in :data:`~carom.lab.studies.geometry.study.OPTIONS`. Circles: pi (2 r)^2.
    Upright boxes: 4 w h; boxes enlarged to hold the turned one:
    2 E[W H] + 2 E[W]^2 with E[W] = 2 (w + h) / pi and E[W H] = w h + (w^2 + h^2) / pi. Upright polygons: 2 A plus the
    mixed area; turned: 2 A + P^2 / (2 pi), after Santalo. None: there is no such formula for a circle together with an
    enlarged box. A last level that lies inside the levels before it decides alone.
    """
    if levels == ("sphere", "box") and turned:
        return None
    last = levels[-1]
    if last == "sphere":
        return math.pi * (2 * thing.circle[1]) ** 2
    if last == "box":
        wide, high = 2 * thing.half_extents
        if not turned:
            return float(4 * wide * high)
        product = wide * high + (wide**2 + high**2) / math.pi
        return float(2 * product + 2 * (2 * (wide + high) / math.pi) ** 2)
    corners = thing.corners
    edges = np.roll(corners, -1, axis=0) - corners
    if turned:
        return 2 * area(corners) + float(np.linalg.norm(edges, axis=1).sum()) ** 2 / (2 * math.pi)
    outwards = np.stack((edges[:, 1], -edges[:, 0]), axis=1)  # as long as the edges
    return 2 * area(corners) + float((outwards @ -corners.T).max(axis=1).sum())

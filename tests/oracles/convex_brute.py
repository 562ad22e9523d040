"""Overlap depth of two hulls of a few points by definition: every axis, every pair of features.

Points are arrays (n, v, d), n poses of v points; all pairs and triples of points count as edges and faces, which adds
candidates that are never better than the true ones.
"""

from __future__ import annotations

import itertools

import numpy as np


def _pairs(points):
    chosen = list(itertools.combinations(range(points.shape[1]), 2))
    return [(points[:, i], points[:, j]) for i, j in chosen]


def _dots(a, b):
    return np.einsum("...k,...k->...", a, b)


def _units(axes):
    """(units, whether they are valid axes); the product of parallel edges is not."""
    size = np.linalg.norm(axes, axis=-1, keepdims=True)
    with np.errstate(all="ignore"):
        return axes / size, np.isfinite(1.0 / size[..., 0])


def _axes(a, b):
    """Candidates for the normal of least overlap: (n, axes, d)."""
    if a.shape[2] == 2:
        return np.stack([np.stack((p[:, 1] - q[:, 1], q[:, 0] - p[:, 0]), 1) for p, q in _pairs(a) + _pairs(b)], 1)
    found = []
    for points in (a, b):
        for i, j, k in itertools.combinations(range(points.shape[1]), 3):
            found.append(np.cross(_direction(points, i, j), _direction(points, i, k)))
    for p, q in itertools.product(range(len(_pairs(a))), range(len(_pairs(b)))):
        one, two = _pairs(a)[p], _pairs(b)[q]
        found.append(np.cross(_units(one[1] - one[0])[0], _units(two[1] - two[0])[0]))
    axes = np.stack(found, 1) if found else np.zeros((len(a), 1, 3))
    axes[_dots(axes, axes) < 1e-20] = 0.0
    return axes


def _direction(points, i, j):
    return _units(points[:, j] - points[:, i])[0]


def overlap_along(a, b, axes):
    """Distance that b has to move along each axis (n, ..., d), a unit vector, to be beyond a."""
    return np.einsum("nvd,n...d->nv...", a, axes).max(1) - np.einsum("nvd,n...d->nv...", b, axes).min(1)


def penetration(a, b):
    """The least overlap over all axes in both directions, and its axis; exact for touching hulls, else a bound."""
    axes, valid = _units(_axes(a, b))
    axes = np.concatenate((axes, -axes), 1)
    overlaps = np.where(np.tile(valid, 2), overlap_along(a, b, np.nan_to_num(axes)), np.inf)
    best = overlaps.argmin(1)
    rows = np.arange(len(a))
    return overlaps[rows, best], axes[rows, best]


def separation(a, b):
    """(distance, vector from a to b) of the nearest points of hulls that are apart."""
    vectors = [b[:, j] - a[:, i] for i in range(a.shape[1]) for j in range(b.shape[1])]
    for points, others, sign in ((a, b, 1.0), (b, a, -1.0)):
        for p, q in _pairs(points):
            edge = q - p
            for k in range(others.shape[1]):
                with np.errstate(all="ignore"):
                    share = _dots(others[:, k] - p, edge) / _dots(edge, edge)
                share = np.clip(np.nan_to_num(share), 0, 1)[:, None]
                vectors.append(sign * (others[:, k] - (p + share * edge)))
    if a.shape[2] == 3:
        vectors += _between_faces_and_corners(a, b, 1.0) + _between_faces_and_corners(b, a, -1.0)
        vectors += [_between_lines(*one, *two) for one in _pairs(a) for two in _pairs(b)]
    vectors = np.stack(vectors, 1)
    best = np.nanargmin(np.linalg.norm(vectors, axis=2), 1)
    chosen = vectors[np.arange(len(a)), best]
    return np.linalg.norm(chosen, axis=1), chosen


def _between_faces_and_corners(points, others, sign):
    """From inside a triangle straight out to a point; nan where the foot is not inside."""
    found = []
    for i, j, k in itertools.combinations(range(points.shape[1]), 3):
        base, one, two = points[:, i], points[:, j] - points[:, i], points[:, k] - points[:, i]
        normal = np.cross(one, two)
        with np.errstate(all="ignore"):
            unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
            for m in range(others.shape[1]):
                way = others[:, m] - base
                s = _dots(np.cross(way, two), normal) / _dots(normal, normal)
                t = _dots(np.cross(one, way), normal) / _dots(normal, normal)
                inside = (s >= 0) & (t >= 0) & (s + t <= 1)
                found.append(np.where(inside[:, None], sign * _dots(way, unit)[:, None] * unit, np.nan))
    return found


def _between_lines(p, q, r, s):
    """The common perpendicular of two segments; nan where its feet are not inside both."""
    one, two, way = q - p, s - r, r - p
    normal = np.cross(one, two)
    with np.errstate(all="ignore"):
        square = _dots(normal, normal)
        t = _dots(np.cross(way, two), normal) / square
        u = _dots(np.cross(way, one), normal) / square
        inside = (t >= 0) & (t <= 1) & (u >= 0) & (u <= 1)
        return np.where(inside[:, None], (_dots(way, normal) / square)[:, None] * normal, np.nan)


def meet(a, b):
    """(depth, vector): the overlap and its axis, or minus the distance and the vector between the nearest points."""
    depth, axis = penetration(a, b)
    distance, way = separation(a, b)
    apart = (depth < 0.0) | np.isinf(depth)  # without edges and faces there is no overlap
    return np.where(apart, -distance, depth), np.where(apart[:, None], way, axis)


def least_overlap(overlap, d):
    """The least ``overlap`` (units (m, d) -> (m,)) of convex shapes over all directions, by refinement of many."""
    if d == 2:
        angle = np.linspace(0, 2 * np.pi, 4001)
        directions = np.stack((np.cos(angle), np.sin(angle)), 1)
    else:
        k = np.arange(20001) + 0.5
        z, angle = 1 - 2 * k / len(k), np.pi * (1 + 5**0.5) * k
        directions = np.stack((np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z), 1)
    values = overlap(directions)
    rng = np.random.default_rng(0)
    lowest = np.inf
    for start in np.argsort(values)[:3]:
        best, least, reach = directions[start], values[start], 0.05
        while reach > 1e-7:
            tries = best + reach * rng.normal(size=(300, d)) * 10 ** rng.uniform(-2, 0, (300, 1))
            tries /= np.linalg.norm(tries, axis=1, keepdims=True)
            found = overlap(tries)
            if found.min() < least:
                best, least = tries[found.argmin()], found.min()
            else:
                reach *= 0.7
        lowest = min(lowest, least)
    return lowest

"""Parts of lines and polygons within a rectangle: what draws pixels does not take any number."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def clipped_lines(lines: Floats, size: tuple[int, int], margin: float = 8.0) -> tuple[Floats, NDArray[np.int64]]:
    """The parts of ``lines`` (n, 2, 2) within a margin around a screen of that ``size``, and the rows they are of.

    Liang and Barsky, 1984.
    """
    rows = np.flatnonzero(np.isfinite(lines).all(axis=(1, 2)))
    start, way = lines[rows, 0], lines[rows, 1] - lines[rows, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (-margin - start) / way, (np.add(size, margin) - start) / way
    still = way == 0.0
    inside = (start >= -margin) & (start <= np.add(size, margin))
    first = np.where(still, np.where(inside, -np.inf, np.inf), np.minimum(one, other)).max(axis=1)
    last = np.where(still, np.inf, np.maximum(one, other)).min(axis=1)
    first, last = np.maximum(first, 0.0), np.minimum(last, 1.0)
    seen = first <= last
    start, way = start[seen], way[seen]
    ends = np.stack((start + first[seen, None] * way, start + last[seen, None] * way), axis=1)
    return ends, rows[seen]


def clipped_polygon(points: Floats, size: tuple[int, int], margin: float = 64.0) -> list[Any]:
    """The part of a polygon (k, 2) there; empty where there is none. Sutherland and Hodgman, 1974."""
    found: list[Any] = points.tolist()
    for axis, sign, limit in ((0, 1, -margin), (1, 1, -margin), (0, -1, -size[0] - margin), (1, -1, -size[1] - margin)):
        kept = []
        for before, here in zip(found[-1:] + found[:-1], found, strict=True):
            a, b = sign * before[axis] - limit, sign * here[axis] - limit
            if (a >= 0) != (b >= 0):
                part = a / (a - b)
                kept.append([before[k] + part * (here[k] - before[k]) for k in (0, 1)])
            if b >= 0:
                kept.append(here)
        found = kept
    return found

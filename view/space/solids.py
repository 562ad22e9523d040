"""Triangles, balls and capsules of a drawing list, as rows of numbers that a graphics card takes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...drawing import Capsules, Circles, Lines, Polygons, Style
from ..colours import FILLS, tints

CORNER = np.dtype([("place", "f4", 3), ("normal", "f4", 3), ("colour", "u1", 4)])
ROUND = np.dtype([("one", "f4", 3), ("other", "f4", 3), ("radius", "f4"), ("axes", "f4", 9), ("colour", "u1", 4)])
END = np.dtype([("place", "f4", 3), ("colour", "u1", 4)])
GLASS = 70  # of 255, how opaque sensors are
MARKED, PLAIN = 255, 254  # how opaque bodies are: those that turn have marks


def colours_of(style: Any, entity: Any, fills: Any = FILLS) -> NDArray[np.uint8]:
    """(n, 4)"""
    colour = np.full((len(style), 4), PLAIN, np.uint8)
    colour[:, :3] = fills.reshape(-1, 3)[tints(np.asarray(style), np.asarray(entity))]
    colour[np.asarray(style) == Style.SENSOR, 3] = GLASS
    return colour


def triangles(groups: Iterable[Polygons], fills: Any = FILLS) -> NDArray[Any]:
    """(3 t,) CORNER: each face as a fan, with its normal."""
    made = [np.empty(0, CORNER)]
    for group in groups:
        points = group.points
        n, k = points.shape[:2]
        one, other = points[:, 1:-1] - points[:, :1], points[:, 2:] - points[:, :1]
        normal = np.cross(one, other).sum(axis=1)  # of faces whose last corner is repeated, too
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0.0)
        corners = np.empty((n, k - 2, 3), CORNER)
        corners["place"][:, :, 0] = points[:, :1]
        corners["place"][:, :, 1], corners["place"][:, :, 2] = points[:, 1:-1], points[:, 2:]
        corners["normal"] = normal[:, None, None]
        corners["colour"] = colours_of(group.style, group.entity, fills)[:, None, None]
        made.append(corners.reshape(-1))
    return np.concatenate(made)


def rounds(circles: Circles, capsules: Capsules, fills: Any = FILLS) -> NDArray[Any]:
    """(n,) ROUND: balls are capsules without length."""
    n, m = len(circles.radius), len(capsules.radius)
    made = np.empty(n + m, ROUND)
    made["one"][:n] = made["other"][:n] = circles.centre
    made["one"][n:], made["other"][n:] = capsules.ends[:, 0], capsules.ends[:, 1]
    made["radius"][:n], made["radius"][n:] = circles.radius, capsules.radius
    turned: Any = np.isfinite(circles.angle).all(axis=(1, 2))
    made["axes"][:n] = np.where(turned[:, None, None], circles.angle, np.eye(3)).reshape(n, 9)
    made["axes"][n:] = along(capsules.ends[:, 1] - capsules.ends[:, 0]).reshape(m, 9)
    made["colour"][:n] = colours_of(circles.style, circles.entity, fills)
    made["colour"][n:] = colours_of(capsules.style, capsules.entity, fills)
    marked = np.flatnonzero(turned & (made["colour"][:n, 3] == PLAIN))
    made["colour"][marked, 3] = MARKED
    return made


def along(ways: Any) -> NDArray[np.float64]:
    """(n, 3, 3) axes as columns, the third along ``ways`` (n, 3)."""
    length = np.linalg.norm(ways, axis=1, keepdims=True)
    third = np.where(length > 0.0, ways / np.maximum(length, 1e-300), (0.0, 0.0, 1.0))
    aside = np.eye(3)[np.argmin(np.abs(third), axis=1)]
    first = np.cross(aside, third)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack((first, np.cross(third, first), third), axis=2)


def ends(groups: Iterable[Lines], fills: Any = FILLS) -> NDArray[Any]:
    """(2 n,) END of lines."""
    made = [np.empty(0, END)]
    for group in groups:
        some = np.empty((len(group.points), 2), END)
        some["place"] = group.points
        some["colour"] = colours_of(group.style, np.zeros(len(some), np.int64), fills)[:, None]
        made.append(some.reshape(-1))
    return np.concatenate(made)


def ball(times: int) -> NDArray[np.float32]:
    """(3 t, 3) corners of 20 * 4^times triangles on the unit sphere: an icosahedron, divided so often."""
    golden = (1 + 5**0.5) / 2
    corners = np.array([(0, a, b) for a in (-1, 1) for b in (-golden, golden)], float)
    corners = np.concatenate([np.roll(corners, k, axis=1) for k in range(3)])
    apart = np.linalg.norm(corners[:, None] - corners, axis=2)
    faces = [
        (i, j, k) for i in range(12) for j in range(i) for k in range(j)
        if max(apart[i, j], apart[j, k], apart[i, k]) < 2.1
    ]  # fmt: skip
    found = corners[np.array(faces)]
    inward = np.einsum("nk,nk->n", np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]), found[:, 0]) < 0.0
    found[inward] = found[inward, ::-1]
    for _ in range(times):
        middles = (found + np.roll(found, -1, axis=1)) / 2  # of the edges
        a, b, c = (np.stack((found[:, k], middles[:, k], middles[:, k - 1]), axis=1) for k in range(3))
        found = np.concatenate((a, b, c, middles))
    found /= np.linalg.norm(found, axis=2, keepdims=True)
    return found.reshape(-1, 3).astype(np.float32)

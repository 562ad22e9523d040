"""The outline of one shape: as its class gives it, or as seen from its support function."""

from __future__ import annotations

import collections
import functools
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..framework.data.arrays.column import ArrayColumn
from ..framework.outlines import box_outline
from .convex import faces_around
from .lists import Floats

DIRECTIONS = 64  # in a plane, in which a support function is asked for corners
ARC = np.pi / 8  # the most that a polygon turns at one corner of what is rounded
SAME = 1e-9  # of the size: points so near are one


class Outline(NamedTuple):
    """``corners`` (m, d) m about the shape's centre, along its body's axes if the shape turns, in a plane
    counter-clockwise; the shape goes ``rounding`` m beyond them. ``faces``: of each face in space, of each convex
    piece in a plane, the rows of its corners; none: one corner, two, or in a plane a convex polygon."""

    corners: Floats
    rounding: float
    faces: tuple[Any, ...] = ()

    def pieces(self) -> list[tuple[Floats, float]]:
        """What is drawn: rings (..., k, d) of k corners, of some p at once (p, k, d), and how far they reach beyond.
        One corner is a ball, two with a radius a capsule."""
        flat = self.corners.shape[1] == 2
        if len(self.faces):
            by_corners: dict[int, list[Any]] = {}
            for face in self.faces:
                by_corners.setdefault(len(face), []).append(face)
            return [(self.corners[np.array(some)], 0.0) for some in by_corners.values()]
        ring = self.corners
        if len(ring) == 1 or not self.rounding > 0.0 or (len(ring) == 2 and not flat):
            return [(ring[None], self.rounding)]
        return [(rounded(ring, self.rounding)[None], 0.0)]


def fields_of(component: Any, columns: dict[str, Any], row: Any, dimensions: int) -> Any:
    """The fields of one shape as the functions of its class take them, of a body that is not turned; ``columns``: by
    name those of the shape, ``row`` the one of them."""
    values: dict[str, Any] = {}
    for name, array in columns.items():
        column, value = component.columns[name], array[row]
        if isinstance(column, ArrayColumn):
            values[name] = column.shown(value)
        else:
            values[name] = tuple(value.tolist()) if np.ndim(value) else value.item()
    if component.rotates:
        values["axes"] = tuple(map(tuple, np.eye(dimensions).tolist()))
    return _tuple_of(component.__name__, tuple(values))(**values)


@functools.cache
def _tuple_of(name: str, names: tuple[str, ...]) -> Any:
    return collections.namedtuple(name, names)


def outline_of(component: Any, shape: Any, dimensions: int) -> Outline:
    """Of one shape with these fields."""
    rounding = float(component.rounding(shape)) if hasattr(component, "rounding") else 0.0
    if callable(getattr(component, "outline", None)):
        corners, faces = component.outline(shape, dimensions)
        corners = np.array(corners, float).reshape(-1, dimensions)
        if dimensions == 2 or not rounding > 0.0 or len(corners) < 3:
            return Outline(corners, rounding, tuple(np.asarray(face, np.int64) for face in faces))
    if callable(getattr(component, "support", None)):
        return _sampled(component, shape, rounding, dimensions)
    half = np.array(component.bounds(shape, dimensions), float)
    corners, faces = box_outline(np.where(np.isfinite(half), half, 0.0), dimensions)
    return Outline(corners, 0.0, tuple(np.array(face) for face in faces))


def _sampled(component: Any, shape: Any, rounding: float, dimensions: int) -> Outline:
    """The farthest points in many directions."""
    directions = directions_of(dimensions)
    points = np.array([component.support(shape, tuple(one)) for one in directions.tolist()], float)
    if dimensions == 2:
        near = SAME * np.abs(points).max(initial=0.0)
        other = np.abs(points - np.roll(points, 1, axis=0)).max(axis=1) > near
        return Outline(points[other] if other.any() else points[:1], rounding)
    points = points + rounding * directions
    return Outline(*faces_around(points))


@functools.cache
def directions_of(dimensions: int) -> Floats:
    """(n, d) unit vectors, spread evenly: in a plane counter-clockwise, in space from a pole to the other."""
    if dimensions == 2:
        angles = (np.arange(DIRECTIONS) + 0.5) * (2.0 * np.pi / DIRECTIONS)
        return np.stack((np.cos(angles), np.sin(angles)), axis=1)
    count = 2 * DIRECTIONS
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    around, wide = np.pi * (1.0 + 5.0**0.5) * np.arange(count), np.sqrt(1.0 - height * height)
    return np.stack((wide * np.cos(around), height, wide * np.sin(around)), axis=1)


def rounded(corners: Floats, rounding: float) -> Floats:
    """The polygon (n, 2) around a rounded one, which may be a segment."""
    normals = outward(corners)
    ends = np.arctan2(normals[:, 1], normals[:, 0])
    starts = np.roll(ends, 1)
    turns = (ends - starts) % (2.0 * np.pi)
    turns[turns == 0.0] = 2.0 * np.pi  # the corners are one point
    counts = np.ceil(turns / ARC - SAME).astype(int) + 1
    arcs = [start + np.linspace(0.0, turn, count) for start, turn, count in zip(starts, turns, counts, strict=True)]
    angles = np.concatenate(arcs)
    return np.repeat(corners, counts, axis=0) + rounding * np.stack((np.cos(angles), np.sin(angles)), axis=1)


def outward(corners: Floats) -> NDArray[np.float64]:
    """Unit normals of the edges (m, 2), from each corner to the next; 0 where these are the same."""
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.stack((edges[:, 1], -edges[:, 0]), axis=1)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)

"""What one shape looks like: by the outline of its class, or as its support function tells."""

from __future__ import annotations

import collections
import functools
from typing import Any

import numpy as np

from ..framework.data.arrays.column import ArrayColumn
from ..framework.outlines import Outline, box_outline
from ..framework.plugins.checks import shape_function
from ..framework.plugins.registry import Shape
from .convex import faces_around
from .lists import Floats

DIRECTIONS = {2: 64, 3: 128}  # in which a support function is asked for corners
ARC = np.pi / 8  # the most that a polygon turns at one corner of what is rounded
SAME = 1e-9  # of the size: points so near are one


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


def outline_of(shape: Shape, fields: Any, dimensions: int) -> tuple[Outline, float]:
    """Of a shape with these fields, and how far it goes beyond it, m."""
    component: Any = shape.component
    around = _rounding_of(component) if shape.support is not None else None
    rounding = 0.0 if around is None else float(around(fields))
    if shape.outline is not None:
        outline = Outline.of(shape.outline(fields, dimensions), dimensions)
        if dimensions == 2 or not rounding > 0.0 or len(outline.corners) < 3:
            return outline, rounding
    if shape.support is not None:
        return _sampled(component, fields, rounding, dimensions)
    half = np.array(component.bounds(fields, dimensions), float)
    return Outline.of(box_outline(np.where(np.isfinite(half), half, 0.0), dimensions), dimensions), 0.0


@functools.cache
def _rounding_of(component: Any) -> Any:
    return shape_function(component, "rounding")


def pieces_of(outline: Outline, rounding: float) -> list[tuple[Floats, float]]:
    """What is drawn of it: rings (p, k, d), all those of k corners at once, and how far they go beyond: one corner is a
    ball, two with a radius are a capsule, of the others nothing does."""
    corners, faces = outline
    if len(faces):
        rings: dict[int, list[Any]] = {}
        for face in faces:
            rings.setdefault(len(face), []).append(face)
        return [(corners[np.array(some)], 0.0) for some in rings.values()]
    if len(corners) == 1 or not rounding > 0.0 or corners.shape[1] == 3:
        return [(corners[None], rounding)]
    return [(rounded(corners, rounding)[None], 0.0)]


def _sampled(component: Any, fields: Any, rounding: float, dimensions: int) -> tuple[Outline, float]:
    """The farthest points in many directions, or what is around them."""
    directions = directions_of(dimensions)
    points = np.array([component.support(fields, tuple(one)) for one in directions.tolist()], float)
    if dimensions == 2:
        near = SAME * np.abs(points).max(initial=0.0)
        other = np.abs(points - np.roll(points, 1, axis=0)).max(axis=1) > near
        return Outline(points[other] if other.any() else points[:1], ()), rounding
    if not np.ptp(points, axis=0).any():
        return Outline(points[:1], ()), rounding  # a ball
    return faces_around(points + rounding * directions), 0.0


@functools.cache
def directions_of(dimensions: int) -> Floats:
    """(n, d) unit vectors, spread evenly: in a plane counter-clockwise, in space from a pole to the other."""
    count = DIRECTIONS[dimensions]
    if dimensions == 2:
        angles = (np.arange(count) + 0.5) * (2.0 * np.pi / count)
        return np.stack((np.cos(angles), np.sin(angles)), axis=1)
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


def outward(corners: Floats) -> Floats:
    """Unit normals of the edges (m, 2), from each corner to the next; 0 where these are the same."""
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.stack((edges[:, 1], -edges[:, 0]), axis=1)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)

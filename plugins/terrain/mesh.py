"""Meshes of triangles and fields of heights: static ground in 3D, one entity for each triangle."""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np

from ...components import Transform
from ...components.colliders import LONGEST, MaterialRows
from ...framework import Column, World
from ...framework.typing import Numbers, Vector
from .chain import bound, points_of
from .triangle import TerrainTriangleCollider

MESH_POSITION = Column(item="vector", owner="create_triangle_mesh", name="position")
FIELD_CELL = Column(positive=True, owner="create_height_field", name="cell")


def create_triangle_mesh(
    world: World,
    vertices: Any,
    triangles: Any,
    *,
    thickness: Numbers = 0.0,
    position: Vector = (0.0, 0.0, 0.0),
    **material: Unpack[MaterialRows],
) -> range:
    """Create the triangles of a mesh; the ids of their entities, which are consecutive. ValueError if they are none, or
    the world is not 3D.

    vertices
        (n, 3) m, relative to ``position``; equal ones are one corner
    triangles
        (k, 3) whole numbers, the vertices of each, counter-clockwise as seen from its front
    thickness
        m, how far behind a triangle the centres of bodies may be that are still pushed out to its front
    material
        friction, restitution, sensor, layer, mask, group and the like: one value for all triangles, or a list with one
        for each, in order; of vectors (k, 3). ``thickness`` too
    """
    if world.dimensions != 3:
        raise ValueError(f"create_triangle_mesh: a mesh is for 3D worlds, this world is {world.dimensions}D")
    places = points_of(vertices, "create_triangle_mesh: vertices", 3, 3) + MESH_POSITION.checked(position)
    corners = _corners(triangles, places)
    beyond = places[_neighbours(corners)]
    faces = places[corners]
    middles = 0.5 * (faces.min(axis=1) + faces.max(axis=1))
    fields = [array - middles for array in (*faces.swapaxes(0, 1), *beyond.swapaxes(0, 1))]
    names = ("a", "b", "c", "beyond_ab", "beyond_bc", "beyond_ca")
    given: Any = dict(zip(names, fields, strict=True))
    return world.create_entities(
        len(middles), Transform.many(middles), TerrainTriangleCollider.many(**given, thickness=thickness, **material)
    )


def create_height_field(
    world: World,
    heights: Any,
    cell: float,
    *,
    thickness: Numbers = 0.0,
    position: Vector = (0.0, 0.0, 0.0),
    **material: Unpack[MaterialRows],
) -> range:
    """Create ground whose height, y, is given on a grid, two triangles for each cell; ``thickness``, ``position``,
    ``material``, ids and ValueError as of :func:`create_triangle_mesh`.

    heights
        (rows, columns) m: [i, j] is the height at x = i cell, z = j cell, from ``position``; solid below
    cell
        m, the distance of neighbouring points
    """
    if world.dimensions != 3:
        raise ValueError(f"create_height_field: a mesh is for 3D worlds, this world is {world.dimensions}D")
    size = FIELD_CELL.checked(cell)
    try:
        levels = np.asarray(heights, float)
    except (TypeError, ValueError, OverflowError):
        levels = np.empty(0)
    if levels.ndim != 2 or min(levels.shape) < 2:
        got = f"an array of shape {levels.shape}" if isinstance(heights, np.ndarray) else repr(heights)
        raise ValueError(f"create_height_field: heights must be rows and columns of numbers, at least 2 x 2, got {got}")
    bad = np.argwhere(~(abs(levels) <= LONGEST))
    if len(bad):
        i, j = bad[0].tolist()
        value = levels[i, j]
        raise ValueError(f"create_height_field: heights must be {bound(value)}, heights[{i}, {j}] is {value}")
    rows, columns = levels.shape
    x, z = np.meshgrid(size * np.arange(rows), size * np.arange(columns), indexing="ij")
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    one = np.stack((first, first + 1, first + columns), axis=1)
    two = np.stack((first + 1, first + columns + 1, first + columns), axis=1)
    return create_triangle_mesh(
        world,
        np.stack((x, levels, z), axis=2).reshape(-1, 3),
        np.stack((one, two), axis=1).reshape(-1, 3),
        thickness=thickness,
        position=position,
        **material,
    )


def _corners(triangles: Any, places: np.ndarray) -> np.ndarray:
    """(k, 3) vertices of each triangle, equal vertices as one; ValueError if they are no triangles."""
    try:
        array = np.asarray(triangles)
    except ValueError:
        array = np.empty(0)
    if array.ndim != 2 or array.shape[1:] != (3,) or not len(array) or array.dtype.kind not in "iu":
        got = f"an array of shape {array.shape}" if isinstance(triangles, np.ndarray) else repr(triangles)
        raise ValueError(f"create_triangle_mesh: triangles must be 1 or more of 3 whole numbers each, got {got}")
    outside = ((array < 0) | (array >= len(places))).any(axis=1)
    if outside.any():
        i = int(np.argmax(outside))
        raise ValueError(
            f"create_triangle_mesh: there are {len(places)} vertices, triangle {i} is {tuple(array[i].tolist())}"
        )
    _, first, same = np.unique(places, axis=0, return_index=True, return_inverse=True)
    array = first[same.reshape(-1)[array]]
    a, b, c = places[array].swapaxes(0, 1)
    flat = ~np.cross(b - a, c - a).any(axis=1)
    if flat.any():
        raise ValueError(f"create_triangle_mesh: triangle {int(np.argmax(flat))} has no area")
    return array


def _neighbours(corners: np.ndarray) -> np.ndarray:
    """(k, 3) the vertex across each edge of each triangle; the edge's first vertex where there is no neighbour."""
    across: dict[tuple[int, int], tuple[int, int]] = {}
    for i, (a, b, c) in enumerate(corners.tolist()):
        for start, end, other in ((a, b, c), (b, c, a), (c, a, b)):
            if (start, end) in across:
                raise ValueError(
                    f"create_triangle_mesh: triangles {across[start, end][0]} and {i} have the same edge in the same "
                    f"direction: corners run counter-clockwise, and an edge has at most two triangles"
                )
            across[start, end] = i, other
    return np.array(
        [[across.get((q, p), (0, p))[1] for p, q in ((a, b), (b, c), (c, a))] for a, b, c in corners.tolist()]
    )

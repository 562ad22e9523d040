"""Casts on chains and meshes, against the distance to every piece by itself: each touch is found where it begins.

A shape is its core, corners and edges, with a rounding; a piece a segment or a triangle. The distance of two of these
is the least of a corner of one to the other, and of an edge to an edge.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import World
from carom.plugins import Physics, capsule, convex_polygon, terrain, tile_grid
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.rotation import Rotation
from carom.plugins.terrain import create_chain, create_height_field
from carom.plugins.tile_grid import TileGridCollider

pytestmark = pytest.mark.slow  # its shapes take long to compile

LENGTH, EXACT, BESIDE = 6.0, 1e-9, 2e-3  # m; a triangle of 1 m may have what is a thousandth of its size beside it


def dot(u, v):
    return np.sum(u * v, axis=-1)


def to_segment(p, a, b):
    """From the nearest point of a segment to a point."""
    way = b - a
    t = np.clip(dot(p - a, way) / dot(way, way), 0.0, 1.0)
    return p - a - t[..., None] * way


def to_triangle(p, a, b, c):
    """The same of a triangle, where that is none of its edges; else of one of its corners."""
    n = np.cross(b - a, c - a)
    inside = np.all([dot(np.cross(y - x, p - x), n) >= 0.0 for x, y in ((a, b), (b, c), (c, a))], axis=0)
    return np.where(inside[..., None], (dot(p - a, n) / dot(n, n))[..., None] * n, p - a)


def between_segments(p, q, a, b):
    """The same of two segments: where their lines are nearest, if that is on both; else of two of their ends."""
    u, v, w = q - p, b - a, p - a
    n = np.cross(u, v)
    square = np.where(dot(n, n) > 0.0, dot(n, n), 1.0)
    s, t = dot(np.cross(v, w), n) / square, dot(np.cross(u, w), n) / square
    inside = (dot(n, n) > 0.0) & (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)
    return np.where(inside[..., None], w + s[..., None] * u - t[..., None] * v, w)


def ways_apart(core, pieces, places):
    """(places, pieces, 3): from the nearest point of each piece, (n, 2 or 3, 3), to a shape's core at each place."""
    corners, edges, half = core
    d, piece = places[:, None, :], [pieces[None, :, k] for k in range(pieces.shape[1])]
    sides = list(itertools.combinations(piece, 2))
    ways = [to_segment(d + corner, a, b) for corner in corners for a, b in sides]
    ways += [d - corner + np.clip(corner - d, -half, half) for corner in piece]
    ways += [-to_segment(corner - d, p, q) for p, q in edges for corner in piece]
    ways += [between_segments(d + p, d + q, a, b) for p, q in edges for a, b in sides]
    if len(piece) == 3:
        ways += [to_triangle(d + corner, *piece) for corner in corners]
    ways = np.stack(np.broadcast_arrays(*ways))
    nearest = np.argmin(dot(ways, ways), axis=0)
    return np.take_along_axis(ways, nearest[None, :, :, None], axis=0)[0]


def random_shape(random, d):
    """(collider, corners, edges and half extents of its core, rounding)."""
    kind, radius, half = random.integers(4), random.uniform(0.1, 0.5), np.zeros(3)
    if kind == 3 and d == 2:
        angles = np.arange(5) * 0.4 * np.pi + random.uniform(0.0, 1.0, 5)
        made = ConvexPolygonCollider(radius * np.stack((np.cos(angles), np.sin(angles)), axis=1))
        corners = np.pad(made.vertices, ((0, 0), (0, 1)))
        return made, (corners, list(zip(corners, np.roll(corners, 1, axis=0), strict=True)), half), 0.0
    if kind == 1:
        half[1] = random.uniform(0.1, 0.6)
    elif kind >= 2:
        half[:d], radius = random.uniform(0.1, 0.6, d), 0.0
    corners = [half * sign for sign in itertools.product(*[(-1.0, 1.0) if extent else (0.0,) for extent in half])]
    edges = [(p, q) for p, q in itertools.combinations(corners, 2) if np.count_nonzero(p != q) == 1]
    made = SphereCollider(radius) if kind == 0 else CapsuleCollider(radius, half[1])
    return AABBCollider(tuple(half[:d].tolist())) if kind >= 2 else made, (corners, edges, half), radius


def random_ground(random, d):
    """(world, its pieces, their unit normals)."""
    plugins = Rotation(), terrain.plugin, capsule.plugin, *([convex_polygon.plugin, tile_grid.plugin] if d == 2 else [])
    world, height = World(Physics(dimensions=d), *plugins), random.choice((0.05, 0.3, 1.0))
    if d == 2:
        points = np.zeros((7, 3))
        points[:, 0], points[:, 1] = np.cumsum(random.uniform(0.3, 1.5, 7)), random.uniform(-height, height, 7)
        create_chain(world, points[:, :2])
        pieces = np.stack((points[:-1], points[1:]), axis=1)
        normals = np.cross((0.0, 0.0, 1.0), pieces[:, 1] - pieces[:, 0])
    else:
        heights = random.uniform(-height, height, (4, 4))
        create_height_field(world, heights, 1.0)
        at = np.array([[(i, heights[i, j], j) for j in range(4)] for i in range(4)])
        p, q, r, s = at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]
        pieces = np.concatenate([np.stack(corners, axis=2).reshape(-1, 3, 3) for corners in ((p, q, r), (q, s, r))])
        normals = np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])
    return world, pieces, normals / np.linalg.norm(normals, axis=1)[:, None]


def first_touches(core, radius, pieces, starts, ways):
    """(distance, way apart from each piece just before) of each cast; nan if that is no touch, or a graze. What is
    apart can go as far as the gap is wide."""
    far, gaps, on = np.zeros(len(starts)), np.zeros(len(starts)), np.arange(len(starts))  # those still on their way
    for _ in range(80):
        apart = ways_apart(core, pieces, starts[on] + far[on, None] * ways[on])
        gaps[on] = np.linalg.norm(apart, axis=2).min(axis=1) - radius
        far[on] += np.where(gaps[on] > 1e-13, np.minimum(gaps[on], LENGTH), 0.0)
        on = on[(gaps[on] > 1e-13) & (far[on] < LENGTH)]
        if not len(on):
            break
    before = ways_apart(core, pieces, starts + (far - 1e-7)[:, None] * ways)
    return np.where((gaps < 1e-12) & (far < LENGTH), far, np.nan), before


@pytest.mark.parametrize("d", [2, 3])
def test_what_falls_on_edges_corners_and_ends_is_found_where_it_touches(d):
    random, met, beyond = np.random.default_rng(40 + d), 0, 0
    for _ in range(5 if d == 2 else 2):
        world, pieces, normals = random_ground(random, d)
        corners = pieces.reshape(-1, 3)
        for _ in range(4):
            shape, core, radius = random_shape(random, d)
            aims = corners[random.integers(len(corners), size=25)] + random.normal(size=(25, 3)) * 0.15
            ways = random.normal(size=(25, 3)) * random.choice((0.0, 0.7), size=(25, 1))
            ways[:, 1] = -1.0
            aims[:, d:] = ways[:, d:] = 0.0
            ways /= np.linalg.norm(ways, axis=1)[:, None]
            starts = aims - 4.0 * ways
            clear = np.linalg.norm(ways_apart(core, pieces, starts), axis=2).min(axis=1) > radius
            distances, before = first_touches(core, radius, pieces, starts, ways)
            gaps = np.linalg.norm(before, axis=2)
            from_front = (dot(before, normals) > 1e-6 * gaps) | (gaps > radius + 1e-6)
            found = LENGTH * world.shape_casts(shape, starts[:, :d], LENGTH * ways[:, :d]).fraction
            for k in np.nonzero(clear & from_front.all(axis=1) & ~np.isnan(distances))[0].tolist():
                place = starts[k] + (distances[k] + 1e-6) * ways[k]
                assert found[k] <= distances[k] + EXACT
                at_hit = ways_apart(core, pieces, starts[[k]] + found[k] * ways[k])
                assert np.linalg.norm(at_hit, axis=2).min() - radius <= (EXACT if d == 2 else BESIDE)
                assert world.overlaps(shape, place[:d])
                met += 1
                beyond += not corners[:, 0].min() <= place[0] <= corners[:, 0].max()
        world.close()
    assert met > 150
    assert beyond > 15


@pytest.mark.parametrize("d", [2, 3])
def test_a_cast_finds_each_body_as_if_it_were_alone(d):
    """To the last digit: what else lies on its way, and what was cast before, has no part in it."""
    random, met = np.random.default_rng(50 + d), 0
    for _ in range(3):
        world, _, _ = random_ground(random, d)
        for k in range(12):
            body = [RigidBody()] if k % 2 else []
            world.create_entity(Transform(random.uniform(-2, 9, d)), *body, random_shape(random, d)[0])
        for share in (0.1, 0.5, 0.9) if d == 2 else ():
            cells = TileGridCollider(random.random((30, 70)) < share, random.uniform(0.1, 0.3))
            world.create_entity(Transform(random.uniform(-4, 12, d)), cells)
        everyone = [entity for entity, _ in world.get_component(Transform)]
        for _ in range(60):
            shape, start, against = random_shape(random, d)[0], random.uniform(-9, 15, d), random.random() < 0.5
            way = (random.uniform(0, 6, d) - start) * 10 ** random.uniform(0, 4)
            hits = world.shape_cast(shape, start, way, against=against)
            hits += world.shape_cast(shape, start, way, against=against, only_nearest=True)
            for hit in hits:
                others = [entity for entity in everyone if entity != hit.entity]
                (alone,) = world.shape_cast(shape, start, way, against=against, exclude=others)
                assert (hit.distance, *hit.normal, *hit.point) == (alone.distance, *alone.normal, *alone.point)
                met += 1
        world.close()
    assert met > 150

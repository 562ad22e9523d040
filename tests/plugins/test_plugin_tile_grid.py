"""Tile grids: maps, poses against brute force over single cells, queries, and bodies on them."""

from __future__ import annotations

import math
import runpy
from collections import namedtuple
from pathlib import Path

import numpy as np
import pytest
from oracles import convex_brute

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import World
from carom.framework.compilation import inlined, kernel
from carom.framework.vectors import row, store
from carom.plugins import Physics, convex_polygon, tile_grid
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.tile_grid import TileGridCollider, cells_of_text, rectangles
from carom.plugins.tile_grid.contact import deepest_contact
from carom.plugins.tile_grid.sweep import first_touch


def boxes_of(cells, tile, lower=(0.0, 0.0)):
    """Lower and upper corners of all tiles, from the definition."""
    cells = np.asarray(cells)
    tiles = [(x, len(cells) - 1 - y) for y in range(len(cells)) for x in range(len(cells[0])) if cells[y][x]]
    low = np.array(tiles, float).reshape(-1, 2) * tile + lower
    return low, low + tile


def distances(points, low, high):
    """From each point to the nearest of the boxes."""
    away = np.maximum(np.maximum(low - points[:, None], points[:, None] - high), 0.0)
    return np.linalg.norm(away, axis=2).min(1)


def make_world(gravity=(0, -10), others=False):
    """A world with only spheres and tiles, or with all shapes of the tests, so that tests share compiled code."""
    world = World(Physics(dimensions=2, gravity=gravity), convex_polygon.plugin, tile_grid.plugin)
    world.create_entity(Transform((0, -5000)), SphereCollider(1.0))
    if others:
        world.create_entity(Transform((0, -6000)), AABBCollider(1.0))
        world.create_entity(Transform((0, -7000)), ConvexPolygonCollider.box(1.0))
    return world


def run(world, steps):
    for _ in range(steps):
        world.step()


pytestmark = pytest.mark.slow  # its scenes compile for long


def test_a_map_is_drawn_from_top_to_bottom():
    drawn = TileGridCollider("""
        #..
        ####
    """, 0.5, lower=(10, 20))  # fmt: skip
    np.testing.assert_array_equal(drawn.cells, ((1, 0, 0, 0), (1, 1, 1, 1)))
    np.testing.assert_array_equal(drawn.cells, TileGridCollider(["#", "####"], 0.5).cells)
    np.testing.assert_array_equal(drawn.cells, TileGridCollider(((7, 0, 0, 0), (1, -1, 1, 1)), 0.5).cells)
    np.testing.assert_allclose(drawn.centre_of(0, 0), (10.25, 20.75))
    np.testing.assert_allclose(drawn.centre_of(1, 3), (11.75, 20.25))
    np.testing.assert_allclose(TileGridCollider(((1, 1),), 2.0).centre_of(0, 0), (-1, 0))
    np.testing.assert_array_equal(cells_of_text("a.b\n x ", empty=".x "), ((1, 0, 1), (0, 0, 0)))
    assert "2 rows and 4 columns, 5 tiles" in repr(drawn)
    np.testing.assert_array_equal(drawn.copy().cells, drawn.cells)


@pytest.mark.parametrize(
    ("cells", "rule"),
    [
        (((1, 0), (1,)), "same length"), ((), "same length"), (((0.5, 1.0),), "bool or integers"), (5, "same length"),
        (((), ()), "same length"), ("  \n ", "no cells"),
    ],
)  # fmt: skip
def test_what_is_no_map_is_refused(cells, rule):
    with pytest.raises(ValueError, match=rule):
        TileGridCollider(cells, 1.0)


def test_other_values_that_are_refused():
    with pytest.raises(ValueError, match="tile_size must be positive"):
        TileGridCollider(((1,),), 0.0)
    with pytest.raises(ValueError, match="lower says where the map lies, and offset too"):
        TileGridCollider(((1,),), 1.0, lower=(0, 0), offset=(1, 0))
    with pytest.raises(ValueError, match="faces must be one of all, floors, walls"):
        TileGridCollider(((1,),), 1.0, faces="floor")
    with pytest.raises(ValueError, match="2 rows and 1 columns, got row 2"):
        TileGridCollider(((1,), (1,)), 1.0).centre_of(2, 0)
    with pytest.raises(ValueError, match="must keep its shape"):
        TileGridCollider(((1,), (1,)), 1.0).cells = ((1,),)


Grid = namedtuple("Grid", "packed tile_size faces")
Polygon = namedtuple("Polygon", "vertices corner_radius axes")
support, rounding = inlined(ConvexPolygonCollider.support), inlined(ConvexPolygonCollider.rounding)


@kernel
def meet_all(packed, tile, vertices, radii, offsets, ways, depths, normals, points, times, like):
    grid = Grid(packed, tile, 0)
    for i in range(len(offsets)):
        body = Polygon(vertices[i], radii[i], ((1.0, 0.0), (0.0, 1.0)))
        d = row(offsets, i, like)
        _, depths[i], normal, point = deepest_contact(grid, body, d, support, rounding)
        store(normals, i, normal)
        store(points, i, point)
        times[i] = first_touch(grid, body, d, row(ways, i, like), support, rounding)[1]


def meet(cells, tile, vertices, radii, offsets, ways=None):
    """Depths, normals, points, times of touch; offsets from the map's middle."""
    n = len(offsets)
    results = np.zeros(n), np.zeros((n, 2)), np.zeros((n, 2)), np.zeros(n)
    packed = np.array(TileGridCollider(cells, tile).packed)
    meet_all(packed, tile, vertices, radii, offsets, np.zeros((n, 2)) if ways is None else ways, *results, (0.0, 0.0))
    assert (abs(np.hypot(*results[1].T) - 1) < 1e-12).all()
    return results


def cellwise(low, high, bodies):
    """The depth in every single cell (n, cells), bodies (n, v, 2)."""
    n, count = len(bodies), len(low)
    x, y = np.stack((low[:, 0], high[:, 0])), np.stack((low[:, 1], high[:, 1]))
    tiles = np.stack((np.stack((x[0], y[0]), 1), np.stack((x[1], y[0]), 1), np.stack((x[1], y[1]), 1),
                      np.stack((x[0], y[1]), 1)), 1)  # fmt: skip
    depth, _ = convex_brute.meet(np.tile(tiles, (n, 1, 1)), np.repeat(bodies, count, 0))
    return depth.reshape(n, count)


@pytest.mark.parametrize(("size", "tile"), [
    (1.0, 1.0), *(pytest.param(*case, marks=pytest.mark.slow) for case in ((3.0, 1.0), (1e-9, 3e-9))),
    *(pytest.param(*case, marks=pytest.mark.long) for case in ((0.3, 1.0), (1e-3, 1.0), (1e9, 1e9))),
])  # fmt: skip
def test_random_polygons_against_every_single_cell(size, tile):
    rng = np.random.default_rng(int(100 * size / tile))
    count = 1000
    cells = rng.random((7, 6)) < 0.3
    middle = np.array((3.0, 3.5)) * tile
    low, high = boxes_of(cells, tile)
    turns = rng.uniform(0, 2 * np.pi, (count, 1)) + np.array((0.0, 1.5, 3.0, 4.8)) + rng.uniform(-0.5, 0.5, (count, 4))
    vertices = size * np.stack((np.cos(turns), np.sin(turns)), 2)
    offsets = rng.uniform(-5, 5, (count, 2)) * tile
    offsets[:20] = np.round(offsets[:20] / tile) * tile
    radii = np.where(rng.random(count) < 0.5, 0.0, rng.uniform(0, 0.5 * size, count))
    depths, normals, points, _ = meet(cells, tile, vertices, radii, offsets)
    bodies = vertices + (offsets + middle)[:, None]
    single = cellwise(low, high, bodies).max(1) + radii
    scale = size + tile
    apart = single < 0
    assert 30 < apart.sum() < count - 30
    assert abs(depths - single)[apart].max() < 1e-13 * scale  # the true distance
    assert depths[~apart].min() > -1e-13 * scale
    # The point lies in the middle of a gap or overlap: not farther from the body than half the depth.
    to_body = np.einsum("nvk,nk->nv", vertices + offsets[:, None] - points[:, None], normals).min(1) - radii
    assert abs(to_body + depths / 2)[apart].max() < 1e-9 * scale


def random_map(rng, shape):
    """Rocks, holes in them, single tiles and long floors, so that blocks are full, empty and mixed."""
    tiles = np.zeros(shape, bool)
    for _ in range(rng.integers(0, 6)):
        low = rng.integers(0, shape)
        high = low + rng.integers(1, 40, 2)
        tiles[low[0] : high[0], low[1] : high[1]] ^= True
    tiles[rng.random(shape) < rng.choice((0.0, 0.002, 0.1))] ^= True
    return tiles


@pytest.mark.plain
def test_rectangles_against_counting():
    rng = np.random.default_rng(11)
    found = set()
    for _ in range(60):
        shape = rng.integers(1, 90, 2)
        tiles = random_map(rng, shape)
        grid, from_below = rectangles.grid_of(np.array(TileGridCollider(tiles, 1.0).packed)), tiles[::-1]
        for _ in range(40):
            x0, y0 = (int(rng.integers(n)) for n in shape[::-1])
            x1, y1 = (int(rng.integers(a, n)) + 1 for a, n in zip((x0, y0), shape[::-1], strict=True))
            if rng.random() < 0.3:  # whole blocks
                x0, y0 = x0 // 16 * 16, y0 // 16 * 16
                x1, y1 = min(x1 + 15 & -16, shape[1]), min(y1 + 15 & -16, shape[0])
            inside = from_below[y0:y1, x0:x1]
            assert rectangles.has_tiles(grid, (x0, y0, x1, y1)) == inside.any()
            state, cells = rectangles.contents(grid, (x0, y0, x1, y1))
            large = max(x1 - x0, y1 - y0) > 16
            found.add((state, large))
            if not inside.any():
                assert state == rectangles.EMPTY
                continue
            if large:
                assert cells == (x0, y0, x1, y1)
            else:
                y, x = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
                assert cells == (x0 + x[0], y0 + y[0], x0 + x[-1] + 1, y0 + y[-1] + 1)
            filled = from_below[cells[1] : cells[3], cells[0] : cells[2]].all()
            assert state == (rectangles.FULL if filled else rectangles.MIXED)
            if filled:
                limits = max(x0 - 20, 0), max(y0 - 20, 0), min(x1 + 20, shape[1]), min(y1 + 20, shape[0])
                for wide_first in (True, False):
                    more = rectangles.grown_within(grid, cells, limits, wide_first)
                    assert more == grown_by_counting(from_below, cells, limits, wide_first)
    assert len(found) == 6


def grown_by_counting(tiles, cells, limits, wide_first):
    """One column or row after the other."""
    for side in (0, 2, 1, 3) if wide_first else (1, 3, 0, 2):
        while cells[side] != limits[side]:
            more = list(cells)
            more[side] += 1 if side > 1 else -1
            if not tiles[more[1] : more[3], more[0] : more[2]].all():
                break
            cells = tuple(more)
    return cells


@pytest.mark.parametrize("size", [0.4, 3.0, pytest.param(7.0, marks=pytest.mark.slow)])
def test_large_maps_against_every_single_cell(size):
    """Distances across many blocks, and times of touch on long ways."""
    rng = np.random.default_rng(int(size))
    shape, count = (70, 90), 60
    tiles = rng.random(shape) < 0.004
    tiles[-2:, 10:70], tiles[20:50, 85:] = True, True
    low, high = boxes_of(tiles, 1.0)
    turns = rng.uniform(0, 2 * np.pi, (count, 1)) + np.array((0.0, 1.5, 3.0, 4.8)) + rng.uniform(-0.5, 0.5, (count, 4))
    vertices = size * np.stack((np.cos(turns), np.sin(turns)), 2)
    offsets, ways = rng.uniform((-55, -45), (55, 45), (count, 2)), rng.normal(size=(count, 2)) * 40
    radii = np.where(rng.random(count) < 0.5, 0.0, rng.uniform(0, 0.5 * size, count))
    depths, _, _, times = meet(tiles, 1.0, vertices, radii, offsets, ways)
    bodies = vertices + (offsets + np.array((45.0, 35.0)))[:, None]
    single = cellwise(low, high, bodies).max(1) + radii
    apart = single < 0
    assert apart.sum() > 20
    assert abs(depths - single)[apart].max() < 1e-11
    assert depths[~apart].min() > -1e-11
    met = np.isfinite(times) & apart
    assert met.sum() > 5
    at_touch = cellwise(low, high, bodies[met] + (times[met, None] * ways[met])[:, None]).max(1) + radii[met]
    assert abs(at_touch).max() < 1e-11
    for share in np.linspace(0.0, 1.0, 9):  # apart until then
        before = np.where(np.isfinite(times), np.minimum(times, 1.0), 1.0) * share
        on_way = cellwise(low, high, bodies[apart] + (before[apart, None] * ways[apart])[:, None]).max(1) + radii[apart]
        assert on_way.max() < 1e-11


def test_out_of_a_corner_it_goes_in_one_move():
    """The depth of a body in floor and wall is its distance from the place where it is out of both."""
    cells = cells_of_text("""
        ...#
        ...#
        ####
    """)
    square = np.array([((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))])
    offset = np.array(((2.5 + 0.03, 1.5 - 0.04),)) - (2.0, 1.5)
    depths, normals, _, _ = meet(cells, 1.0, square, np.zeros(1), offset)
    assert depths[0] == pytest.approx(0.05)
    np.testing.assert_allclose(normals[0], (-0.6, 0.8), atol=1e-12)


def test_where_tiles_border_on_each_other_are_no_faces():
    """From above a row of tiles has one face, for any position of the body, even barely over the next column."""
    cells = cells_of_text("""
        ..........
        ##########
        .#.#.##.#.
    """)
    square = np.array(((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)))
    x = np.concatenate((np.linspace(1, 9, 2001), [3.5 + e for e in (0, 1e-15, -1e-15, 1e-9, -1e-9, 1e-3, -1e-3)]))
    for sunk in (0.0, 1e-12, 1e-3, 0.1, 0.4):
        offsets = np.stack((x, np.full(len(x), 2.5 - sunk)), 1) - (5.0, 1.5)
        for radius in (0.0, 0.2):
            vertices = np.tile(square * (1 - 2 * radius), (len(x), 1, 1))
            depths, normals, _, _ = meet(cells, 1.0, vertices, np.full(len(x), radius), offsets)
            np.testing.assert_array_equal(normals, np.tile((0.0, 1.0), (len(x), 1)))
            np.testing.assert_allclose(depths, sunk, atol=1e-14)


def test_moving_polygons_touch_when_the_first_cell_says_so():
    """Against steps of a thousandth of the path: apart before, and touching at the time given."""
    rng = np.random.default_rng(5)
    cells = rng.random((9, 9)) < 0.25
    count = 500
    turns = rng.uniform(0, 2 * np.pi, (count, 1)) + np.array((0.0, 2.0, 4.2))
    vertices = rng.uniform(0.1, 1.2, (count, 1, 1)) * np.stack((np.cos(turns), np.sin(turns)), 2)
    offsets, ways = rng.uniform(-7, 7, (count, 2)), rng.normal(size=(count, 2)) * 6
    radii = rng.uniform(0, 0.2, count)
    start, _, _, times = meet(cells, 1.0, vertices, radii, offsets, ways)
    assert (times[start >= 0] == 0.0).all()
    met = np.isfinite(times)
    assert 100 < met.sum() < 480
    for share in np.linspace(0, 1, 101):
        before = np.where(met, np.minimum(times, 1.0), 1.0) * share
        depths = meet(cells, 1.0, vertices, radii, offsets + before[:, None] * ways)[0]
        if share == 1.0:
            assert abs(depths[met & (start < 0)]).max() < 1e-13
        assert depths[~met].max() < 0
        assert depths[met & (start < 0)].max() < 1e-13


@pytest.mark.slow
def test_queries_find_the_tiles():
    rng = np.random.default_rng(2)
    cells = rng.random((20, 30)) < 0.3
    low, high = boxes_of(cells, 0.7, (3.0, -2.0))
    world = make_world()
    grid = world.create_entity(Transform((3, -2)), TileGridCollider(cells, 0.7, lower=(0, 0)))
    world.step()
    points = rng.uniform((2, -3), (25, 13), (2000, 2))
    away = distances(points, low, high)
    near = world.query_nearests(points)
    np.testing.assert_allclose(near.distance[away > 0], away[away > 0], atol=1e-13)
    assert (near.distance[away == 0] <= 0).all()
    assert (np.diff(world.query_spheres(points, 0.3).offsets) == (away <= 0.3)).all()
    directions = rng.normal(size=points.shape)
    units = directions / np.linalg.norm(directions, axis=1)[:, None]
    one, two = (low - points[:, None]) / units[:, None], (high - points[:, None]) / units[:, None]
    enter, leave = np.minimum(one, two).max(2).clip(0), np.maximum(one, two).min(2)
    expected = np.where(enter <= leave, enter, np.inf).min(1)
    hits = world.ray_casts(points, directions, 20.0)
    np.testing.assert_array_equal(hits.entity == grid, expected <= 20)
    found = hits.entity == grid
    np.testing.assert_allclose(hits.distance[found], expected[found], atol=1e-12)
    outside = found & (away > 0)
    assert (abs(hits.normal[outside]).max(1) == 1.0).all()
    assert (np.einsum("nk,nk->n", hits.normal, units)[outside] < 0).all()


@pytest.mark.slow
def test_rays_and_shapes_pass_close_by_walls():
    """A ray along a wall, very close to it, ends at the next one."""
    cells = cells_of_text("#" * 40 + "\n" + "." * 39 + "#\n" + "#" * 40)
    world = make_world()
    world.create_entity(Transform((0, 0)), TileGridCollider(cells, 1.0, lower=(0, 0)))
    world.step()
    for gap in (1e-3, 1e-9, 0.4):
        hit = world.ray_cast((0.5, 1 + gap), (1, 0), 100)[0]
        assert hit.distance == 38.5
        np.testing.assert_array_equal(hit.normal, (-1, 0))
        hit = world.shape_cast(SphereCollider(0.25), (0.5, 1.25 + gap), (100, 0))[0]
        assert hit.distance == pytest.approx(38.25, abs=1e-12)
        np.testing.assert_allclose(hit.normal, (-1, 0), atol=1e-9)


def test_a_million_cells_and_an_empty_map():
    cells = np.zeros((1000, 1000), bool)
    cells[-1] = True
    world = make_world()
    world.create_entity(Transform((0, 0)), TileGridCollider(cells, 1.0, lower=(0, 0)))
    world.create_entity(Transform((0, 0)), TileGridCollider(np.zeros((3, 3), bool), 1.0, lower=(0, 0)))
    ball = world.create_entity(Transform((777.3, 1.6)), RigidBody(), SphereCollider(0.5))
    run(world, 60)
    np.testing.assert_allclose(world.component_for_entity(ball, Transform).position, (777.3, 1.5), atol=1e-3)
    assert world.query_nearest((500.0, 900.0)).distance == 899.1 - 0.1


ROOT = Path(__file__).resolve().parents[2]


def octagon(radius, **common):
    """Flat below; its half extent is the same on all sides."""
    angles = (np.arange(8) + 0.5) * math.pi / 4
    corners = np.stack((np.cos(angles), np.sin(angles)), 1) / math.cos(math.pi / 8)
    return ConvexPolygonCollider(radius * corners, **common)


def capsule(radius, **common):
    """Nearly a capsule, tilted; its box has the same half extent on all sides."""
    ends = np.array(((-0.5, -0.5), (0.5, 0.5), (0.5, 0.5), (-0.5, -0.5)))
    ends += np.array(((1, -1), (1, -1), (-1, 1), (-1, 1))) * 1e-6
    return ConvexPolygonCollider(radius * ends / abs(ends).max() / 2, corner_radius=radius / 2, **common)


SHAPES = {
    "sphere": lambda s, **common: SphereCollider(s, **common),
    "box": lambda s, **common: AABBCollider(s, **common),
    "polygon": octagon,
    "capsule": capsule,
}

# A channel, ragged outside: bodies that slide along its inner sides pass ends of columns of all lengths.
LENGTH = 60
CHANNEL = np.zeros((14, LENGTH), bool)
CHANNEL[[4, 9]] = True
CHANNEL[10:, ::3] = True
CHANNEL[11, ::2] = True
CHANNEL[:4, 1::4] = True
CHANNEL[2, ::5] = True
SPEEDS = (0.01, 0.3, 2.7, 31.0, 400.0)
SIZES = (0.07, 0.5, 1.4, 1.9)
SLIDES = [
    (shape, side, faces)
    for shape in SHAPES for side in ("floor", "ceiling", "left wall", "right wall") for faces in ("all", "two entities")
    if faces == "all" or shape in ("sphere", "box")
]  # fmt: skip
QUICK_SLIDES = {("sphere", "floor", "all"), ("sphere", "left wall", "two entities")}


@pytest.mark.parametrize(("shape", "side", "faces"), [
    pytest.param(*slide, marks=() if slide in QUICK_SLIDES else pytest.mark.slow) for slide in SLIDES
])  # fmt: skip
def test_sliding_bodies_feel_no_seams(shape, side, faces):
    """The velocity along the tiles of a body that is pressed onto them does not change."""
    cells = CHANNEL if side in ("floor", "ceiling") else CHANNEL.T
    down = {"floor": (0, -1), "ceiling": (0, 1), "left wall": (-1, 0), "right wall": (1, 0)}[side]
    down = np.array(down, float)
    along = np.array((abs(down[1]), abs(down[0])))
    world = make_world(gravity=10 * down, others=shape != "sphere")
    grids = [TileGridCollider(cells, 1.0, layer=2)]
    if faces != "all":
        grids = TileGridCollider.floors_and_walls(cells, 1.0, layer=2)
    for grid in grids:
        world.create_entity(Transform((0, 0)), grid)
    rng = np.random.default_rng(3)
    bodies = []
    for size in SIZES:
        for speed in SPEEDS:
            for e in (0.0, 0.6):
                # The channel is 4 m wide, centred on the map. The body starts anywhere along it, at rest or falling.
                place = -20 * along + rng.uniform(0, 1) * along + down * (2 - size - rng.choice((0.0, 0.01)))
                common = {"layer": 1, "mask": 2, "restitution": e}
                body = world.create_entity(
                    Transform(place), RigidBody(linear_velocity=speed * along), SHAPES[shape](size, **common)
                )
                bodies.append((body, size, speed))
    for step in range(60):
        world.step()
        for body, size, speed in bodies:
            if speed * (step + 1) / 60 > 44:
                continue  # beyond the end of the channel
            velocity = world.component_for_entity(body, RigidBody).linear_velocity
            position = world.component_for_entity(body, Transform).position
            assert velocity @ along == pytest.approx(speed, rel=1e-14), (size, speed, position)
            assert 2 - size - 0.05 < position @ down < 2 - size + 0.001 or step < 3


def corner_world(faces, shape, size, friction, **body):
    world = make_world(others=shape != "sphere")
    cells = np.zeros((8, 12), int)
    cells[-1], cells[:, 8:] = 1, 1
    grids = [TileGridCollider(cells, 1.0, lower=(0, 0))]
    if faces == "two entities":
        grids = TileGridCollider.floors_and_walls(cells, 1.0, lower=(0, 0))
    for grid in grids:
        world.create_entity(Transform((0, 0)), grid)
    entity = world.create_entity(
        Transform((8 - size - 0.1, 1 + size)), RigidBody(**body), SHAPES[shape](size, friction=friction)
    )
    return world, entity


@pytest.mark.parametrize("shape", ["sphere", *(pytest.param(s, marks=pytest.mark.slow) for s in ("box", "polygon"))])
@pytest.mark.parametrize("size", [0.5, *(pytest.param(size, marks=pytest.mark.slow) for size in (0.1, 1.7))])
def test_pushed_against_a_wall_it_stands_still_on_the_floor(shape, size):
    """With floors and walls as two entities: 10 s, pushed by its own weight or walking into the wall."""
    for speed in (None, 5.0):
        world, entity = corner_world(
            "two entities", shape, size, 0.0, **({"constant_force": (10, 0)} if speed is None else {})
        )
        transform, body = (world.component_for_entity(entity, kind) for kind in (Transform, RigidBody))
        places = []
        for _ in range(600):
            if speed is not None:
                body.linear_velocity[0] = speed
            world.step()
            places.append(transform.position - (8 - size, 1 + size))
        late = np.array(places[60:])
        assert np.ptp(late, axis=0).max() < 1e-6  # jitter and drift, m
        # It overlaps the floor by 0.07 mm, and by 2 mm the wall that it walks into with 5 m/s in each step.
        assert late[:, 1].min() > -0.0001
        assert late[:, 0].max() < (0.0001 if speed is None else 0.003)


@pytest.mark.parametrize("shape", ["sphere", pytest.param("box", marks=pytest.mark.slow)])
@pytest.mark.parametrize("size", [pytest.param(0.1, marks=pytest.mark.slow), 0.5])
def test_in_a_corner_of_one_collider_it_stays(shape, size):
    """One contact serves both sides: it yields by millimetres, and nothing gets through."""
    world, entity = corner_world("all", shape, size, 0.0, constant_force=(10, 0))
    transform, body = (world.component_for_entity(entity, kind) for kind in (Transform, RigidBody))
    places = []
    for _ in range(600):
        world.step()
        places.append(transform.position - (8 - size, 1 + size))
    late = np.array(places[60:])
    assert np.ptp(late, axis=0).max() < 0.005
    assert abs(late).max() < 0.005
    for _ in range(300):
        body.linear_velocity[0] = 5.0
        world.step()
        assert transform.x < 8 - size + 0.1  # at most its walk in a step, 83 mm, and a little
        assert transform.y > 1 + size - 0.05
    world, entity = corner_world("all", shape, size, 0.5, constant_force=(10, 0))
    places = []
    for _ in range(300):
        world.step()
        places.append(world.component_for_entity(entity, Transform).position.copy())
    assert np.ptp(places[60:], axis=0).max() < 1e-5  # friction stops it


@pytest.mark.slow
@pytest.mark.parametrize("faces", ["all", "two entities"])
def test_nothing_gets_in_between_the_tiles(faces):
    """A closed cave with a ragged inside, bodies of all sizes thrown about in it for 5 s."""
    rng = np.random.default_rng(8)
    cells = rng.random((30, 30)) < 0.15
    cells[[0, 1, -1, -2]], cells[:, [0, 1, -1, -2]] = True, True
    world = make_world(others=True)
    grids = [TileGridCollider(cells, 1.0, lower=(0, 0), restitution=0.5)]
    if faces != "all":
        grids = TileGridCollider.floors_and_walls(cells, 1.0, lower=(0, 0), restitution=0.5)
    for grid in grids:
        world.create_entity(Transform((0, 0)), grid)
    low, high = boxes_of(cells, 1.0)
    places = rng.uniform(2, 28, (2000, 2))
    places = places[distances(places, low, high) > 0.45][:120]
    makers = list(SHAPES.values())
    bodies = [
        world.create_entity(Transform(place), RigidBody(linear_velocity=rng.normal(size=2) * 6),
                            makers[k % 4](rng.uniform(0.1, 0.3), layer=2, mask=1))
        for k, place in enumerate(places)
    ]  # fmt: skip
    run(world, 300)
    ends = np.array([world.component_for_entity(body, Transform).position for body in bodies])
    assert np.isfinite(ends).all()
    assert distances(ends, low, high).min() > 0.05  # no centre is in a tile or near it
    assert ((ends > 2) & (ends < 28)).all()


def test_a_tile_dug_away_lets_them_fall():
    world = make_world()
    grid = world.create_entity(Transform((0, 0)), TileGridCollider(np.ones((1, 9), bool), 1.0, lower=(0, 0)))
    ball = world.create_entity(Transform((4.5, 1.4)), RigidBody(), SphereCollider(0.4))
    run(world, 30)
    assert world.component_for_entity(ball, Transform).y == pytest.approx(1.4, abs=1e-3)
    tiles = world.component_for_entity(grid, TileGridCollider)
    cells = tiles.cells
    cells[0, 4] = False
    tiles.cells = cells
    run(world, 60)
    assert world.component_for_entity(ball, Transform).y < -1


@pytest.mark.slow
def test_the_example_runs_to_the_end_of_the_map(capsys):
    path = np.array(runpy.run_path(str(ROOT / "examples" / "tile_map.py"))["main"]())
    assert path[-1, 0] == pytest.approx(58.65, abs=0.01)  # 59 m less half its width
    assert np.diff(path[:, 0]).min() > -0.02  # it is never thrown back
    assert path[:, 1].min() > 1.4
    assert len(capsys.readouterr().out.splitlines()) == 12

"""Tile grids: maps, and poses against brute force over single cells."""

from __future__ import annotations

from collections import namedtuple

import numpy as np
import pytest
from helpers_tiles import boxes_of
from oracles import convex_brute

from carom.framework.compilation import inlined, kernel
from carom.framework.vectors import row, store
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.tile_grid import TileGridCollider, cells_of_text, rectangles
from carom.plugins.tile_grid.contact import deepest_contact
from carom.plugins.tile_grid.sweep import first_touch

pytestmark = pytest.mark.slow  # its kernels compile for long


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
    (1.0, 1.0), (3.0, 1.0), (1e-9, 3e-9),
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
    corners = np.array(((-1, -1), (1, -1), (1, 1), (-1, 1)))
    vertices[::2] = corners * (size * rng.uniform(0.05, 1, (len(vertices[::2]), 1, 2)))  # boxes meet in closed form
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


@pytest.mark.parametrize("size", [0.4, 3.0, 7.0])
def test_large_maps_against_every_single_cell(size):
    """Distances across many blocks, and times of touch on long ways."""
    rng = np.random.default_rng(int(size))
    shape, count = (70, 90), 30
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
    assert apart.sum() > 10
    assert abs(depths - single)[apart].max() < 1e-11
    assert depths[~apart].min() > -1e-11
    met = np.isfinite(times) & apart
    assert met.sum() > 2
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

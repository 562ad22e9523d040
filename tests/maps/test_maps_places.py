"""Where things of a map are in the world: tiles and objects however flipped and turned, against a naive drawing."""

from __future__ import annotations

import base64
import functools
import gzip
import math
import zlib

import numpy as np
import pytest
from helpers_maps import FLIPPED, SLOPE, map_of, objects_of, quiet_world_for_maps, thing, tile, tiles_of, tileset, write

from carom import BoxCollider, RigidBody, Spin, Transform, maps

FORMATS = pytest.mark.parametrize("suffix", ["tmx", "tmj"])


def covers(polygon, point) -> bool:
    """Whether a polygon has the point in it, by the crossings of a ray."""
    inside, (x, y) = False, point
    for (ax, ay), (bx, by) in zip(polygon, (*polygon[1:], polygon[0]), strict=True):
        if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
            inside = not inside
    return inside


@functools.cache
def mask_of(polygon, size=16):
    """(size, size) of pixels whose middle is in the polygon, row 0 above."""
    return np.array([[covers(polygon, (c + 0.5, r + 0.5)) for c in range(size)] for r in range(size)])


def flipped(mask, flips):
    """As Tiled draws it: along the diagonal first."""
    mask = mask.T if flips & 4 else mask
    mask = mask[:, ::-1] if flips & 1 else mask
    return mask[::-1] if flips & 2 else mask


def gid(number, flips):
    return number | sum(bit for ours, bit in FLIPPED.items() if flips & ours)


def solid_pixels(world, left, top, size, high, metres=1.0):
    """The mask of what is solid there; corners in pixels, y down, of a map that is ``high`` pixels high."""
    scale = metres / 16
    return np.array([
        [bool(world.query_point(((left + c + 0.5) * scale, (high - top - r - 0.5) * scale))) for c in range(size)]
        for r in range(size)
    ])  # fmt: skip


L_SHAPE = ((0, 0), (16, 0), (16, 5), (6, 5), (6, 16), (0, 16))  # in no way symmetric


@pytest.mark.slow
@pytest.mark.parametrize("flips", range(8))
def test_tiles_and_tile_objects_are_flipped_in_all_eight_ways(flips, tmp_path):
    """A slope, and an L of two rectangles, as a tile in a layer and as an object of that tile."""
    tall, wide = thing(2, 0, 0, 6, 16), thing(3, 6, 0, 10, 5)
    tiles = tileset(tile(0, "", thing(1, 0, 0, polygon=SLOPE)), tile(1, "", tall, wide))
    things = [thing(k, 16 * (2 * k - 1), 64, 16, 16, gid=gid(k, flips)) for k in (1, 2)]
    cells = np.zeros((4, 6), np.int64)
    cells[1, 1], cells[1, 3] = gid(1, flips), gid(2, flips)
    path = write(tmp_path / "map.tmx", map_of(6, 4, tiles_of(cells), objects_of(*things), tilesets=[tiles]))
    world = quiet_world_for_maps()
    level = maps.load(path, world)
    world.step()
    for k, shape in enumerate((SLOPE, L_SHAPE)):
        wanted = flipped(mask_of(shape), flips)
        on_edge = flipped(np.eye(16, dtype=bool)[::-1], flips) if k == 0 else np.zeros((16, 16), bool)
        for top in (16, 48):
            found = solid_pixels(world, 16 * (2 * k + 1), top, 16, 64)
            np.testing.assert_array_equal(found | on_edge, wanted | on_edge)
    assert level.layers["ground"].tiles.flips.tolist() == [flips, flips]
    assert [sprite.flips for sprite in level.layers["things"].sprites] == [flips, flips]
    world.close()


@pytest.mark.parametrize("flips", range(8))
def test_a_body_of_several_shapes_is_one_plate(flips, tmp_path, world):
    """However its tile is flipped: place, mass, centre and moment are those of a plate of even thickness."""
    shapes = thing(1, 1, 1, 14, 6, capsule=True), thing(2, 12, 12, 3, 3)
    given = {"mass": 4.0, "spins": True, "gravity_scale": 0.0}
    drawn = thing(1, 16, 48, 16, 16, gid=gid(1, flips), properties=given)
    tiles = tileset(tile(0, "", *shapes))
    level = maps.load(write(tmp_path / "map.tmx", map_of(4, 6, objects_of(drawn), tilesets=[tiles])), world)
    world.step()

    def mask(size):
        places = (np.arange(size) + 0.5) * (16 / size)
        whole = np.array([[any(contains(each, (x, y)) for each in shapes) for x in places] for y in places])
        return flipped(whole, flips)

    np.testing.assert_array_equal(solid_pixels(world, 16, 32, 16, 96), mask(16))
    rows, columns = np.nonzero(mask(128))
    plate = np.stack((1 + (columns + 0.5) / 128, 6 - 2 - (rows + 0.5) / 128), axis=1)
    body = level.object(1).entity
    assert world.component_for_entity(body, RigidBody).mass == pytest.approx(4.0, rel=1e-12)
    np.testing.assert_allclose(world.component_for_entity(body, Transform).position, plate.mean(axis=0), atol=1e-3)
    moment = 4.0 * ((plate - plate.mean(axis=0)) ** 2).sum(axis=1).mean()
    assert world.component_for_entity(body, Spin).moments == pytest.approx(moment, rel=5e-3)
    parts = next(plugin for plugin in world.plugins if plugin.name == "parts")
    np.testing.assert_allclose(parts.centre(body), 0, atol=1e-12)


@pytest.mark.slow
@FORMATS
def test_objects_of_each_shape_are_where_they_were_drawn(suffix, tmp_path):
    """Turned clockwise around their corner, by degrees, in a group with an offset; against pixels."""
    convex = ((0, 0), (20, 4), (12, 18))
    concave = ((0, 0), (24, 0), (24, 24), (12, 6), (0, 24))
    drawn = [
        thing(1, 40, 40, 24, 10), thing(2, 90, 40, 24, 10, rotation=30), thing(3, 140, 40, 24, 10, rotation=-90),
        thing(4, 40, 90, 20, 20, ellipse=True), thing(5, 90, 90, 24, 10, ellipse=True, rotation=75),
        thing(6, 140, 90, 24, 10, capsule=True, rotation=20), thing(7, 40, 140, polygon=convex, rotation=50),
        thing(8, 90, 140, polygon=concave, rotation=10, properties={"sensor": True}),
        thing(9, 160, 140, 10, 24, rotation=180, properties={"shape": "capsule"}),
    ]  # fmt: skip
    inner = objects_of(*drawn, offsetx=2, offsety=1)
    group = {"type": "group", "name": "far", "offsetx": 5, "offsety": -3, "layers": [inner]}
    path = write(tmp_path / f"map.{suffix}", map_of(12, 12, group))
    world = quiet_world_for_maps()
    level = maps.load(path, world, metres=0.5)
    world.step()
    random, scale = np.random.default_rng(5), 0.5 / 16
    owner, wrong = {entity: k for k in range(1, 10) for entity in level.object(k).entities}, 0
    for pixel in random.uniform(20, 190, (2000, 2)):
        inside = {each["id"] for each in drawn if contains(each, pixel - (7, -2))}
        found = world.query_point((pixel[0] * scale, (192 - pixel[1]) * scale))
        wrong += inside != {owner[entity] for entity in found}
    assert wrong <= 4  # ellipses are polygons of 24 corners, whose sides are up to .9 % inside
    angle = world.component_for_entity(level.object(2).entity, Transform).rotation
    assert angle == pytest.approx(-math.radians(30))
    world.close()


FULL = ((0, 0), (16, 0), (16, 16), (0, 16))
SHAPES_OF = (), FULL, FULL, SLOPE, ((0, 8), (16, 8), (16, 16), (0, 16)), (), FULL  # of the tiles below


def contains(each, pixel) -> bool:
    """Whether an object, as Tiled draws it, has a pixel in it."""
    turn = math.radians(each["rotation"])
    x, y = pixel[0] - each["x"], pixel[1] - each["y"]
    x, y = x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn)  # back, y is down
    w, h = each["width"], each["height"]
    if "polygon" in each:
        return covers([(p["x"], p["y"]) for p in each["polygon"]], (x, y))
    if each.get("ellipse"):
        return (2 * x / w - 1) ** 2 + (2 * y / h - 1) ** 2 < 1
    if each.get("capsule") or each.get("properties", [{}])[0].get("name") == "shape":
        r = min(w, h) / 2
        return math.hypot(x - min(max(x, r), w - r), y - min(max(y, r), h - r)) < r
    return 0 < x < w and 0 < y < h


@pytest.mark.parametrize("rotation", [0, 90, 35])
def test_bodies_of_tile_objects_hang_at_the_corner_of_their_tile(rotation, tmp_path):
    """A moving body of two parts, stretched and turned; the sprite's middle is that of what Tiled draws."""
    tall, wide = thing(2, 0, 0, 6, 16), thing(3, 6, 0, 10, 5)
    tiles = tileset(tile(0, "", tall, wide))
    body = {"kind": "dynamic", "mass": 6.0, "gravity_scale": 0.0}
    drawn = thing(1, 60, 70, 32, 24, gid=1, rotation=rotation, properties=body)
    path = write(tmp_path / "map.tmx", map_of(8, 8, objects_of(drawn), tilesets=[tiles]))
    world = quiet_world_for_maps()
    level = maps.load(path, world)
    world.step()
    entity = level.object(1).entity
    assert world.component_for_entity(entity, RigidBody).mass == pytest.approx(6.0)
    place = world.component_for_entity(entity, Transform)
    lower_left = np.array((60 / 16, (128 - 70) / 16))
    turn = -math.radians(rotation)
    axes = np.array(((math.cos(turn), -math.sin(turn)), (math.sin(turn), math.cos(turn))))
    areas, middles = np.array((96, 50)), np.array(((3, 8), (11, 2.5)))
    x, y = (areas @ middles) / areas.sum()
    np.testing.assert_allclose(place.position, lower_left + axes @ (x / 16 * 2, (16 - y) / 16 * 1.5), atol=1e-12)
    (sprite,) = level.layers["things"].sprites
    middle = place.position + axes @ np.array(sprite.offset)
    np.testing.assert_allclose(middle, lower_left + axes @ (1.0, 0.75), atol=1e-12)
    assert sprite.entity == entity
    assert sprite.size == (2.0, 1.5)
    for u, v in np.random.default_rng(1).uniform(0, 1, (200, 2)):  # of the tile, from its upper left corner
        inside = u < 6 / 16 or v < 5 / 16
        point = lower_left + axes @ (2.0 * u, 1.5 * (1 - v))
        assert bool(world.query_point(point)) == inside
    world.close()


@pytest.mark.parametrize(("alignment", "x", "y"), [("topleft", 0, 0), ("center", 0.5, 0.5), ("right", 1, 0.5)])
def test_tilesets_say_where_the_place_of_their_objects_is(alignment, x, y, tmp_path):
    tiles = tileset(tile(0), objectalignment=alignment)
    drawn = thing(1, 64, 64, 32, 16, gid=1, rotation=90)
    world = quiet_world_for_maps()
    level = maps.load(write(tmp_path / "map.tmj", map_of(8, 8, objects_of(drawn), tilesets=[tiles])), world)
    aside = np.array(((0.5 - x) * 2.0, (y - 0.5) * 1.0))
    place = world.component_for_entity(level.object(1).entity, Transform).position
    np.testing.assert_allclose(place, (4 + aside[1], 4 - aside[0]), atol=1e-12)  # a quarter turn clockwise
    np.testing.assert_allclose(level.object(1).place, place, atol=1e-12)
    world.close()


def test_a_turned_rectangle_is_a_box_and_a_straight_one_is_none(tmp_path):
    drawn = [thing(1, 20, 20, 16, 8), thing(2, 60, 20, 16, 8, rotation=90), thing(3, 100, 20, 16, 8, rotation=1)]
    world = quiet_world_for_maps()
    level = maps.load(write(tmp_path / "map.tmx", map_of(8, 8, objects_of(*drawn))), world)
    boxes = [world.has_component(level.object(k).entity, BoxCollider) for k in (1, 2, 3)]
    assert boxes == [False, False, True]
    world.close()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_random_tile_maps_are_solid_where_their_cells_are(seed, tmp_path):
    """Several materials, shapes, flips and layers with offsets, CSV, base64 and XML, against cell by cell drawing."""
    random = np.random.default_rng(seed)
    tiles = tileset(
        tile(0, "Solid"), tile(1, "Solid", friction=0.02), tile(2, "", thing(1, 0, 0, polygon=SLOPE)),
        tile(3, "", thing(1, 0, 8, 16, 8)), tile(5, "Solid", layer=2, restitution=0.5),
    )  # fmt: skip
    columns, rows = random.integers(3, 12, 2).tolist()
    layers, wanted = [], np.zeros((rows * 16, columns * 16), bool)
    unsure = wanted.copy()
    for k in range(2):
        cells = np.where(random.random((rows, columns)) < 0.5, random.integers(1, 7, (rows, columns)), 0)
        flips = random.integers(0, 8, (rows, columns))
        gids = np.array([gid(int(c), int(f)) if c else 0 for c, f in zip(cells.flat, flips.flat, strict=True)])
        gids = gids.reshape(rows, columns)
        raw = gids.astype("<u4").tobytes()
        how, packed = ("gzip", gzip.compress(raw)) if seed else ("zlib", zlib.compress(raw))
        coded = {"data": base64.b64encode(packed).decode(), "encoding": "base64", "compression": how}
        layers.append(tiles_of(gids, f"layer {k}", **(coded if k else {})))
        for r in range(rows):
            for c in range(columns):
                kind = int(cells[r, c])
                shape = SHAPES_OF[kind]
                part = slice(16 * r, 16 * r + 16), slice(16 * c, 16 * c + 16)
                if len(shape):
                    wanted[part] |= flipped(mask_of(shape), flips[r, c])
                if kind == 3:
                    unsure[part] |= flipped(np.eye(16, dtype=bool)[::-1], flips[r, c])
    path = write(tmp_path / ("map.tmj" if seed == 1 else "map.tmx"), map_of(columns, rows, *layers, tilesets=[tiles]))
    world = quiet_world_for_maps()
    maps.load(path, world)
    world.step()
    pixels = np.stack(np.meshgrid(np.arange(rows * 16), np.arange(columns * 16), indexing="ij"), axis=-1).reshape(-1, 2)
    for r, c in random.permutation(pixels)[:1500].tolist():
        found = bool(world.query_point(((c + 0.5) / 16, rows - (r + 0.5) / 16)))
        assert unsure[r, c] or found == wanted[r, c], (r, c)
    world.close()

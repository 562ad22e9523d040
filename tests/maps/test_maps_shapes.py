"""What lines, polygons and tiles of a map become: chains, parts, cells of grids; and the same as another reader's."""

from __future__ import annotations

import math
from pathlib import Path as File

import numpy as np
import pytest
from helpers_maps import map_of, objects_of, quiet_world_for_maps, thing, tile, tiles_of, tileset, write

from carom import (
    AABBCollider,
    BoxCollider,
    ChainSegmentCollider,
    ConvexPolygonCollider,
    RigidBody,
    SphereCollider,
    TileGridCollider,
    TileShape,
    Transform,
    maps,
)  # fmt: skip


def test_lines_are_solid_on_their_right_and_rings_inside(tmp_path, world):
    """Balls lie on a line and an island, in a hollow, and fall through a line drawn from right to left."""
    island = ((0, 16), (16, 0), (32, 16), (16, 8))
    drawn = [
        thing(1, 0, 32, polyline=((0, 0), (32, 0))), thing(2, 48, 32, polyline=((32, 0), (0, 0))),
        thing(3, 96, 16, polygon=island), thing(4, 96, 64, polygon=[*reversed(island)]),
        thing(5, 144, 16, polygon=((0, 0), (32, 0), (32, 32), (0, 32)), properties={"hollow": True}),
        thing(6, 0, 64, polyline=((0, 0), (16, 0), (32, -16)), properties={"one_way": True, "friction": 0.2}),
    ]  # fmt: skip
    level = maps.load(write(tmp_path / "map.tmx", map_of(12, 8, objects_of(*drawn))), world)

    def points(k):
        entities = level.object(k).entities
        segments = [world.component_for_entity(each, ChainSegmentCollider) for each in entities]
        places = [world.component_for_entity(each, Transform).position for each in entities]
        return np.array([place + each.start for place, each in zip(places, segments, strict=True)]), segments

    for k, sign in ((3, -1), (4, -1), (5, 1)):
        x, y = points(k)[0].T
        assert sign * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() > 0  # clockwise is solid inside
    segments = points(6)[1]
    np.testing.assert_allclose([each.one_way for each in segments], ((0, 1), (-1, 1)), atol=1e-12)
    assert {each.friction for each in segments} == {0.2}
    balls = [
        world.create_entity(Transform(place), RigidBody(), SphereCollider(0.2))
        for place in ((1, 6.5), (4, 6.5), (10, 6), (0.5, 4.5), (0.5, 3.4))
    ]
    for _ in range(90):
        world.step()
    heights = [world.component_for_entity(each, Transform).y for each in balls]
    assert heights[0] == pytest.approx(6.2, abs=0.01)
    assert heights[1] < 5
    assert heights[2] == pytest.approx(5.2, abs=0.01)
    assert heights[3] == pytest.approx(4.2, abs=0.01)
    assert heights[4] < 3


def test_lines_of_tiles_keep_their_solid_side(tmp_path, world):
    """In a tile that is flipped what was below the line is on the same side of it."""
    cells = 1 | np.arange(8)[None] << 29
    tiles = tileset(tile(0, "", thing(1, 0, 0, polyline=((0, 16), (16, 8)))))
    level = maps.load(write(tmp_path / "map.tmx", map_of(8, 1, tiles_of(cells), tilesets=[tiles])), world)
    for k, entity in enumerate(level.layers["ground"].entities):
        x, y = (14, 12) if k & 1 else (12, 14)  # pixels, below the line; the diagonal comes first
        x, y = 16 - x if k & 4 else x, 16 - y if k & 2 else y
        segment = world.component_for_entity(entity, ChainSegmentCollider)
        start = world.component_for_entity(entity, Transform).position + segment.start
        (a, b), (c, d) = segment.end - segment.start, np.array((k + x / 16, 1 - y / 16)) - start
        assert a * d - b * c < 0.0  # on its right


@pytest.mark.parametrize("what", ["sensor", "one_way"])
def test_concave_polygons_are_the_same_in_tiles_and_as_objects(what, tmp_path, world):
    """A sensor sees what is in its middle; what is one-way holds from above and lets through from below."""
    pytest.importorskip("mapbox_earcut")
    shape = ((0, 0), (4, 8), (12, 8), (16, 0), (16, 16), (0, 16))
    cells = np.zeros((8, 8), int)
    cells[4, 1] = 1
    tiles = tileset(tile(0, "", thing(1, 0, 0, polygon=shape), **{what: True}))
    drawn = thing(1, 48, 80, 16, 16, gid=1), thing(2, 80, 64, polygon=shape, properties={what: True})
    whole = map_of(8, 8, tiles_of(cells), objects_of(*drawn), tilesets=[tiles])
    maps.load(write(tmp_path / "map.tmx", whole), world)
    balls = [
        world.create_entity(Transform((x + aside, y)), RigidBody(linear_velocity=(0, v)), SphereCollider(0.1))
        for x in (1.5, 3.5, 5.5)
        for aside, y, v in ([(0, 3.2, 0)] if what == "sensor" else [(0.12, 4.5, 0), (-0.12, 2, 7)])
    ]
    if what == "sensor":
        world.step()
        assert {contact.entity_b for contact in world.contacts} == {*balls}
        return
    for _ in range(150):
        world.step()
    heights = [world.component_for_entity(each, Transform).y for each in balls]
    np.testing.assert_allclose(heights, 3.6, atol=0.01)


def test_concave_bodies_are_parts_with_the_mass_of_the_whole(tmp_path, world):
    pytest.importorskip("mapbox_earcut")
    shape = ((0, 0), (32, 0), (32, 16), (16, 16), (16, 48), (0, 48))
    drawn = thing(1, 48, 48, polygon=shape, rotation=30, properties={"mass": 8.0, "spins": True, "friction": 0.5})
    level = maps.load(write(tmp_path / "map.tmx", map_of(12, 12, objects_of(drawn))), world)
    world.step()
    entities = level.object(1).entities
    assert len(entities) == 2
    assert world.component_for_entity(entities[0], RigidBody).mass == pytest.approx(8.0)
    assert {world.component_for_entity(each, ConvexPolygonCollider).friction for each in entities} == {0.5}
    parts = next(plugin for plugin in world.plugins if plugin.name == "parts")
    np.testing.assert_allclose(parts.centre(entities[0]), 0, atol=1e-12)
    middles, areas = np.array(((1.0, 0.5), (0.5, 2.0))), np.array((2.0, 2.0))  # m, from the corner, y down
    x, y = areas @ middles / areas.sum()
    turn = math.radians(30)  # clockwise
    centre = 3 + x * math.cos(turn) - y * math.sin(turn), 9 - x * math.sin(turn) - y * math.cos(turn)
    before = world.component_for_entity(entities[0], Transform).position - (0, -10 / 60**2)
    np.testing.assert_allclose(before, centre, atol=1e-9)


def test_slopes_halves_and_materials_are_cells_of_one_grid(tmp_path, world):
    """In whichever way they are flipped; what stands upright is no cell of a grid. Layers make a grid of their own."""
    gentle, high = ((0, 16), (16, 8), (16, 16)), ((0, 8), (16, 0), (16, 16), (0, 16))
    tiles = tileset(
        tile(0, "Solid"), tile(1, "", thing(1, 0, 0, polygon=((0, 16), (16, 0), (16, 16))), friction=0.1),
        tile(2, "", thing(1, 0, 0, polygon=gentle)), tile(3, "", thing(1, 0, 0, polygon=high), restitution=0.5),
        tile(4, "", thing(1, 0, 8, 16, 8), surface_velocity=2.0), tile(5, "Solid", layer=2),
    )  # fmt: skip
    flips = np.arange(4)[:, None] << 30  # none, vertically, horizontally, both
    cells = np.concatenate((np.arange(1, 7) | flips, np.full((1, 6), 1)))
    level = maps.load(write(tmp_path / "map.tmx", map_of(6, 5, tiles_of(cells), tilesets=[tiles])), world)
    grids = [world.component_for_entity(each, TileGridCollider) for each in level.layers["ground"].entities]
    assert [(grid.faces, grid.layer) for grid in grids] == [(f, k) for k in (1, 2) for f in ("floors", "walls")]
    shapes, kinds = grids[0].shapes, TileShape
    assert shapes[0].tolist() == [0, kinds.SLOPE_UP, kinds.GENTLE_UP_LOW, kinds.GENTLE_UP_HIGH, kinds.LOWER_HALF, 0]
    assert shapes[1:4, 1].tolist() == [kinds.CEILING_DOWN, kinds.SLOPE_DOWN, kinds.CEILING_UP]
    assert (grids[0].cells[:, 5] != 0).tolist() == [False, False, False, False, True]
    made_of = [grids[0].materials.get(grids[0].material_of(0, c)) for c in range(5)]
    assert made_of[1].friction == 0.1
    assert made_of[3].restitution == 0.5
    assert tuple(made_of[4].surface_velocity) == (2.0, 0.0)
    assert (made_of[0], made_of[2]) == (None, None)
    peak = thing(1, 0, 0, polygon=((0, 16), (8, 0), (16, 16)))
    steep = tileset(tile(0, "", thing(1, 0, 0, 8, 16)), tile(1, "", peak))
    other = maps.load(write(tmp_path / "map.tmx", map_of(2, 1, tiles_of([[1, 2]]), tilesets=[steep])), world)
    half, roof = other.layers["ground"].entities
    assert world.component_for_entity(half, AABBCollider).half_extents.tolist() == [0.25, 0.5]
    assert world.has_component(roof, ConvexPolygonCollider)


def test_one_way_tiles_hold_from_above(tmp_path, world):
    """Beside full tiles and alone; a ball stays on them, one from below passes and comes to rest there."""
    cells = np.zeros((6, 6), int)
    cells[3], cells[3, 0] = 2, 1
    one_way = tileset(tile(0, "Solid"), tile(1, "OneWay", friction=0.3))
    alone = tiles_of(np.where(cells == 2, 2, 0), "alone", offsetx=160)
    level = maps.load(write(tmp_path / "map.tmx", map_of(6, 6, tiles_of(cells), alone, tilesets=[one_way])), world)
    faces = {name: [world.component_for_entity(each, TileGridCollider).faces for each in layer.entities]
             for name, layer in level.layers.items()}  # fmt: skip
    assert faces == {"ground": ["floors", "walls", "one_way"], "alone": ["one_way"]}
    balls = [
        world.create_entity(Transform((x, y)), RigidBody(linear_velocity=(0, speed)), SphereCollider(0.2))
        for left in (2, 12) for x, y, speed in ((left, 3.5, 0), (left + 1, 2.3, 8))
    ]  # fmt: skip
    for _ in range(150):
        world.step()
    for each in balls:
        assert world.component_for_entity(each, Transform).y == pytest.approx(3.2, abs=0.01)


def test_two_loads_are_the_same_to_the_bit(tmp_path):
    random = np.random.default_rng(3)
    drawn = [
        thing(k, *random.uniform(10, 200, 2), *random.uniform(4, 20, 2), rotation=float(random.uniform(0, 360)),
              properties={"kind": "dynamic", "spins": True})
        for k in range(1, 12)
    ]  # fmt: skip
    path = write(tmp_path / "map.tmx", map_of(14, 14, tiles_of(np.eye(14, dtype=int)), objects_of(*drawn)))
    hashes = set()
    for _ in range(2):
        world = quiet_world_for_maps()
        level = maps.load(path, world)
        assert all(world.has_component(level.object(k).entity, BoxCollider) for k in range(1, 12))
        for _ in range(30):
            world.step()
        hashes.add(world.state_hash())
        world.close()
    assert len(hashes) == 1


def test_the_same_as_pytiled_parser_reads(tmp_path):
    """An independent reader, of random maps without what it cannot do."""
    pytiled_parser = pytest.importorskip("pytiled_parser")
    from carom.maps.errors import Findings
    from carom.maps.formats.reading import document
    from carom.maps.formats.tiled import read_tiled

    random = np.random.default_rng(8)
    for seed in range(6):
        columns, rows = random.integers(2, 9, 2).tolist()
        cells = random.integers(0, 32, (rows, columns)) | random.integers(0, 8, (rows, columns)) << 29
        marks = [{}, {"ellipse": True}, {"point": True}, {"polygon": random.uniform(0, 9, (4, 2)).tolist()},
                 {"polyline": random.uniform(0, 9, (3, 2)).tolist()}, {"gid": 3 | 1 << 31}]  # fmt: skip
        drawn = [
            thing(k + 1, *random.uniform(0, 99, 2), *random.uniform(0, 20, 2), name=f"n{k}", kind=f"K{k}",
                  rotation=float(random.uniform(0, 360)),
                  properties={"a": k, "b": 0.5, "c": True, "d": "x & <y>"}, **mark)
            for k, mark in enumerate(marks)
        ]  # fmt: skip
        things = objects_of(*drawn, offsetx=3.5, offsety=-2.0, opacity=0.5)
        path = write(tmp_path / f"map.{'tmx' if seed % 2 else 'tmj'}", map_of(columns, rows, tiles_of(cells), things))
        theirs = pytiled_parser.parse_map(File(path))
        ours = read_tiled(path, document(path), Findings(path))
        whole = np.array(theirs.layers[0].data, np.int64)
        tiles, objects = ours.layers
        assert tiles.cells is not None
        assert tiles.flips is not None
        flips = sum(np.where(whole & bit, mine, 0) for bit, mine in ((1 << 31, 1), (1 << 30, 2), (1 << 29, 4)))
        np.testing.assert_array_equal(tiles.cells, whole & 0x0FFFFFFF)
        np.testing.assert_array_equal(tiles.flips, flips)
        assert (objects.opacity, objects.offset) == (0.5, tuple(theirs.layers[1].offset))
        for mine, other in zip(objects.objects, theirs.layers[1].tiled_objects, strict=True):
            assert mine.shape == type(other).__name__.lower()
            assert (mine.id, mine.name, mine.kinds, mine.angle) == (other.id, other.name, other.class_, other.rotation)
            assert (*mine.place, *mine.size) == (*other.coordinates, *other.size)
            assert {name: each.value for name, each in mine.properties.items()} == other.properties
            if mine.points is not None:
                np.testing.assert_allclose(mine.points, other.points)


@pytest.mark.slow
def test_a_level_of_10000_cells_loads_at_once(tmp_path):
    """The goal is .1 s, and .05 s for the first step; measured 10 and 4 ms. Ten times that is a fault of the method."""
    import time

    cells = np.where(np.random.default_rng(0).random((50, 200)) < 0.3, 1, 0)
    drawn = [thing(k, 16 * (k % 190), 16 * (k // 4), 8, 8, properties={"sensor": True}) for k in range(1, 101)]
    path = write(tmp_path / "map.tmx", map_of(200, 50, tiles_of(cells), objects_of(*drawn)))
    took = []
    for _ in range(3):
        world = quiet_world_for_maps()
        began = time.process_time()
        maps.load(path, world)
        middle = time.process_time()
        world.step()
        took.append((middle - began, time.process_time() - middle))
        world.close()
    load_time, step_time = np.min(took, axis=0)
    assert load_time < 0.1
    assert step_time < 0.05

"""What objects, tiles and layers of a map become: components, prefabs, fields, references, paths, chains, layers."""

from __future__ import annotations

import enum
import math
from pathlib import Path as File

import numpy as np
import pytest
from helpers_maps import (
    Ref,
    map_of,
    objects_of,
    properties,
    quiet_world_for_maps,
    thing,
    tile,
    tiles_of,
    tileset,
    world_for_maps,
    write,
)  # fmt: skip

from carom import (
    AABBCollider,
    BoxCollider,
    CapsuleCollider,
    ChainSegmentCollider,
    Component,
    ConvexPolygonCollider,
    Hinge,
    Joints,
    Path,
    Prefab,
    RigidBody,
    SphereCollider,
    Spin,
    TileGridCollider,
    TileShape,
    Transform,
    column,
    maps,
)  # fmt: skip
from carom.framework.typing import VectorField

FORMATS = pytest.mark.parametrize("suffix", ["tmx", "tmj"])


class Coin(Component):
    points = column(default=1.0)


class Enemy(Component):
    health = column(default=3.0, minimum=0.0)
    speed = column(default=1.0)
    target = column(default=0, dtype=int)
    home: VectorField = column(default=0.0, item="vector")
    team = column(default="red", choices=("red", "blue"))


class Layers(enum.IntFlag):
    GROUND, PLAYER = 1, 4


GOOM = Prefab(RigidBody(mass=3.0), SphereCollider(0.3, friction=0.5), Enemy(health=9.0))


def load(path, world, **options):
    return maps.load(path, world, (Coin, Enemy), {"goom": GOOM}, **options)


@pytest.fixture
def world():
    made = quiet_world_for_maps()
    yield made
    made.close()


@FORMATS
def test_classes_and_properties_are_components_and_fields(suffix, tmp_path, world):
    drawn = [
        thing(1, 0, 0, 16, 16, name="a", kind="Enemy, Coin",
              properties={"health": 5.0, "Coin.points": 2.0, "team": "blue"}),
        thing(2, 0, 0, 16, 16, properties={"foe": ("Enemy", {"speed": 7.0}), "Enemy.home": "1, 2", "mass": 2.0}),
        thing(3, 32, 16, 16, 16, ellipse=True, properties={
            "kind": "kinematic", "velocity_x": 1.5, "linear_damping": 2, "friction": 0.5, "mask": 4, "sensor": True}),
        thing(4, 0, 0, 8, 24, capsule=True, properties={"angular_velocity": 2.0, "layer": "ground, Player"}),
        thing(5, 0, 0, 16, 8, name="belt", properties={"surface_velocity": 3.0, "one_way": True, "_note": "mine"}),
        thing(6, 24, 8, name="spot", kind="Coin", point=True),
    ]  # fmt: skip
    path = write(tmp_path / f"map.{suffix}", map_of(4, 4, objects_of(*drawn)))
    level = load(path, world, layers=Layers)
    of = lambda k, kind: world.component_for_entity(level.object(k).entity, kind)  # noqa: E731
    enemy = of(1, Enemy)
    assert (enemy.health, enemy.team, of(1, Coin).points) == (5.0, "blue", 2.0)
    assert level.entities["a"] == level.object(1).entity
    assert level.of_class["Enemy"] == [level.object(1).entity]
    assert level.of_class["Coin"] == [level.object(1).entity, level.object(6).entity]
    assert (of(2, Enemy).speed, of(2, RigidBody).mass) == (7.0, 2.0)
    assert np.array_equal(of(2, Enemy).home, (1, 2))
    body, ball = of(3, RigidBody), of(3, SphereCollider)
    assert (body.kind, body.linear_damping, ball.friction, ball.mask, ball.sensor) == ("kinematic", 2.0, 0.5, 4, True)
    assert body.linear_velocity.tolist() == [1.5, 0.0]
    assert of(3, Transform).position.tolist() == [2.5, 2.5]
    capsule = of(4, CapsuleCollider)
    assert (capsule.radius, capsule.half_height, capsule.layer) == (0.25, 0.5, 5)
    assert of(4, Spin).angular_velocity == 2.0
    assert of(4, RigidBody).kind == "dynamic"
    belt = of(5, AABBCollider)
    assert np.array_equal((belt.surface_velocity, belt.one_way), ((3, 0), (0, 1)))
    assert level.object(5).properties == {"surface_velocity": 3.0, "one_way": True, "_note": "mine"}
    assert level.points["spot"] == (1.5, 3.5) == tuple(of(6, Transform).position)


def test_layers_give_their_objects_classes_and_fields(tmp_path, world):
    layer = objects_of(thing(1, 0, 0, 8, 8), thing(2, 9, 9, 8, 8, properties={"health": 1.0, "solid": False}),
                       properties={"health": 2.0, "sensor": True}, **{"class": "Enemy"})  # fmt: skip
    ground = tiles_of(np.ones((2, 2), int), properties={"friction": 0.25, "layer": 2})
    sky = tiles_of(np.ones((2, 2), int), "sky", **{"class": "Decoration"})
    plain = tiles_of(np.full((2, 2), 2), "plain", properties={"solid": True})
    level = load(write(tmp_path / "map.tmx", map_of(2, 2, ground, sky, plain, layer)), world)
    first, second = (level.object(k).entity for k in (1, 2))
    assert [world.component_for_entity(each, Enemy).health for each in (first, second)] == [2.0, 1.0]
    assert world.component_for_entity(first, AABBCollider).sensor
    assert not world.has_component(second, AABBCollider)
    grid = world.component_for_entity(level.layers["ground"].entities[0], TileGridCollider)
    assert (grid.friction, grid.layer) == (0.25, 2)
    assert level.layers["sky"].entities == []
    assert len(level.layers["sky"].tiles.picture) == 4
    assert level.layers["plain"].entities
    assert [*level.layers] == ["ground", "sky", "plain", "things"]


@FORMATS
def test_references_are_entities_whatever_the_order(suffix, tmp_path, world):
    """Forwards, backwards, in a circle, of itself; to a point a vector field gets its place."""
    drawn = [
        thing(1, 0, 0, 8, 8, kind="Enemy", properties={"target": Ref(3), "home": Ref(5)}),
        thing(2, 0, 0, 8, 8, kind="Enemy", properties={"Enemy.target": Ref(1)}),
        thing(3, 0, 0, 8, 8, kind="Enemy", properties={"target": Ref(2)}),
        thing(4, 0, 0, 8, 8, kind="Enemy", properties={"target": Ref(4)}), thing(5, 16, 16, point=True),
        thing(6, 0, 0, 8, 8, kind="Enemy", properties={"target": Ref(0)}),
    ]  # fmt: skip
    level = load(write(tmp_path / f"map.{suffix}", map_of(4, 4, objects_of(*drawn))), world)
    targets = {k: world.component_for_entity(level.object(k).entity, Enemy).target for k in (1, 2, 3, 4, 6)}
    assert targets == {k: level.object(n).entity for k, n in ((1, 3), (2, 1), (3, 2), (4, 4))} | {6: 0}
    home = world.component_for_entity(level.object(1).entity, Enemy).home
    assert home.tolist() == [1.0, 3.0]


def test_a_point_is_a_joint_of_two_objects(tmp_path):
    world = world_for_maps(Joints())
    drawn = [
        thing(1, 48, 48, kind="Hinge", point=True, properties={"a": Ref(2), "b": Ref(3), "anchor": Ref(1)}),
        thing(2, 40, 40, 8, 8), thing(3, 48, 46, 32, 4, properties={"spins": True}),
    ]  # fmt: skip
    level = load(write(tmp_path / "map.tmx", map_of(6, 6, objects_of(*drawn))), world)
    hinge = world.component_for_entity(level.object(1).entity, Hinge)
    assert (hinge.a, hinge.b) == (level.object(2).entity, level.object(3).entity)
    assert np.array_equal(hinge.anchor, (3, 3))
    world.close()


def test_prefabs_are_placed_and_changed(tmp_path, world):
    drawn = [
        thing(1, 16, 16, 16, 16, kind="goom", properties={"mass": 5.0, "health": 1.0, "restitution": 0.5}),
        thing(2, 16, 16, kind="goom, Coin", point=True),
    ]  # fmt: skip
    tiles = tileset(tile(0, "goom"), tile(1, "Coin", sensor=True))
    cells = np.array(((0, 0, 0, 0), (0, 1, 2, 0), (0, 0, 0, 0), (0, 0, 2, 0)))
    whole = map_of(4, 4, tiles_of(cells), objects_of(*drawn), tilesets=[tiles])
    level = load(write(tmp_path / "map.tmx", whole), world)
    first, ball = level.object(1).entity, SphereCollider
    assert world.component_for_entity(first, RigidBody).mass == 5.0
    assert world.component_for_entity(first, Enemy).health == 1.0
    assert world.component_for_entity(first, ball).restitution == 0.5
    assert not world.has_component(first, AABBCollider)
    assert world.component_for_entity(first, Transform).position.tolist() == [1.5, 2.5]
    assert GOOM._components[RigidBody].mass == 3.0
    of_cell = level.layers["ground"].entities
    assert [world.component_for_entity(each, Transform).position.tolist() for each in of_cell] == [
        [1.5, 2.5], [2.5, 2.5], [2.5, 0.5]]  # fmt: skip
    assert world.component_for_entity(of_cell[1], AABBCollider).sensor
    assert level.of_class["Coin"] == [*of_cell[1:], level.object(2).entity]
    assert [sprite.entity for sprite in level.layers["ground"].sprites] == of_cell
    assert len(level.layers["ground"].tiles.picture) == 0  # else a coin that is taken would still be seen


def test_paths_follow_their_lines(tmp_path, world):
    drawn = [
        thing(1, 0, 0, 16, 8, properties={"path": Ref(2), "speed": 3.0}), thing(2, 40, 40, polyline=((0, 0), (32, 0))),
        thing(3, 0, 0, 16, 8, properties={"path": Ref(4), "speed": 1.0, "ease": True, "travelled": 1.5}),
        thing(4, 16, 16, rotation=90, polygon=((0, 0), (16, 0), (16, 16))),
    ]  # fmt: skip
    level = load(write(tmp_path / "map.tmx", map_of(6, 6, objects_of(*drawn))), world)
    of = lambda k, kind: world.component_for_entity(level.object(k).entity, kind)  # noqa: E731
    assert of(1, Transform).position.tolist() == [2.5, 3.5]
    assert of(1, RigidBody).kind == "kinematic"
    np.testing.assert_allclose(of(3, Path).points, ((1, 5), (1, 4), (0, 4)), atol=1e-12)
    assert of(3, Path).mode == "loop"
    np.testing.assert_allclose(of(3, Transform).position, (0.5, 4.0), atol=1e-12)
    assert level.object(2).entity is level.object(4).entity is None
    for _ in range(20):
        world.step()
    np.testing.assert_allclose(of(1, Transform).position, (3.5, 3.5), atol=1e-9)


def test_lines_are_solid_on_their_right_and_rings_inside(tmp_path, world):
    """Balls lie on a line and an island, in a hollow, and fall through a line drawn from right to left."""
    island = ((0, 16), (16, 0), (32, 16), (16, 8))
    drawn = [
        thing(1, 0, 32, polyline=((0, 0), (32, 0))), thing(2, 48, 32, polyline=((32, 0), (0, 0))),
        thing(3, 96, 16, polygon=island), thing(4, 96, 64, polygon=[*reversed(island)]),
        thing(5, 144, 16, polygon=((0, 0), (32, 0), (32, 32), (0, 32)), properties={"hollow": True}),
        thing(6, 0, 64, polyline=((0, 0), (16, 0), (32, -16)), properties={"one_way": True, "friction": 0.2}),
    ]  # fmt: skip
    level = load(write(tmp_path / "map.tmx", map_of(12, 8, objects_of(*drawn))), world)

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


def test_concave_bodies_are_parts_with_the_mass_of_the_whole(tmp_path, world):
    pytest.importorskip("mapbox_earcut")
    shape = ((0, 0), (32, 0), (32, 16), (16, 16), (16, 48), (0, 48))
    drawn = thing(1, 48, 48, polygon=shape, rotation=30, properties={"mass": 8.0, "spins": True, "friction": 0.5})
    level = load(write(tmp_path / "map.tmx", map_of(12, 12, objects_of(drawn))), world)
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
    level = load(write(tmp_path / "map.tmx", map_of(6, 5, tiles_of(cells), tilesets=[tiles])), world)
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
    other = load(write(tmp_path / "map.tmx", map_of(2, 1, tiles_of([[1, 2]]), tilesets=[steep])), world)
    half, roof = other.layers["ground"].entities
    assert world.component_for_entity(half, AABBCollider).half_extents.tolist() == [0.25, 0.5]
    assert world.has_component(roof, ConvexPolygonCollider)


def test_one_way_tiles_hold_from_above(tmp_path, world):
    """Beside full tiles and alone; a ball stays on them, one from below passes and comes to rest there."""
    cells = np.zeros((6, 6), int)
    cells[3], cells[3, 0] = 2, 1
    one_way = tileset(tile(0, "Solid"), tile(1, "OneWay", friction=0.3))
    alone = tiles_of(np.where(cells == 2, 2, 0), "alone", offsetx=160)
    level = load(write(tmp_path / "map.tmx", map_of(6, 6, tiles_of(cells), alone, tilesets=[one_way])), world)
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


@FORMATS
def test_templates_and_external_tilesets(suffix, tmp_path, world):
    """Of both formats, also mixed; an object's own fields and properties come first; a template brings its tileset."""
    (tmp_path / "sets").mkdir()
    basic = tileset(tile(0, "Solid"), tile(1, "", thing(1, 0, 0, 8, 16)), first=1)
    del basic["firstgid"]
    write(tmp_path / "sets" / "basic.tsx", basic, "tileset")
    write(tmp_path / "sets" / "other.tsj", {**basic, "type": "tileset", "name": "other"})
    own = thing(0, 0, 0, 16, 16, name="from template", kind="Enemy", properties={"health": 4.0, "speed": 4.0})
    write(tmp_path / "enemy.tx", {"object": own}, "template")
    half = {"id": 1, "name": "half", "gid": 2, "width": 16, "height": 16, "x": 0, "y": 0}
    of_other = {"firstgid": 1, "source": "sets/other.tsj"}
    write(tmp_path / "half.tj", {"type": "template", "object": half, "tileset": of_other})
    write(tmp_path / "again.tx", {"object": {"template": "enemy.tx", "height": 8}}, "template")
    drawn = [
        {"id": 1, "template": "enemy.tx", "x": 16, "y": 16, "properties": properties({"health": 1.0})},
        {"id": 2, "template": "half.tj", "x": 32, "y": 32},
        {"id": 3, "template": "again.tx", "x": 48, "y": 16, "width": 32, "name": "mine"},
    ]
    group = {"type": "group", "name": "g", "layers": [objects_of(*drawn)]}
    sets = [{"firstgid": 1, "source": "sets/basic.tsx"}]
    whole = map_of(8, 4, tiles_of(np.ones((4, 8), int)), group, tilesets=sets)
    level = load(write(tmp_path / f"map.{suffix}", whole), world)
    enemy = world.component_for_entity(level.object(1).entity, Enemy)
    assert (enemy.health, enemy.speed, level.object(1).name) == (1.0, 4.0, "from template")
    half = level.object(2).entity
    assert world.component_for_entity(half, AABBCollider).half_extents.tolist() == [0.25, 0.5]
    assert world.component_for_entity(half, Transform).position.tolist() == [2.25, 2.5]
    assert (level.object(3).size, level.object(3).name) == ((2.0, 0.5), "mine")
    picture = level.pictures[level.layers["things"].sprites[0].picture]
    assert picture.path is not None
    assert picture.path.resolve() == tmp_path / "sets" / "basic.png"
    assert picture.rectangle == (16, 0, 16, 16)


def test_names_that_several_objects_have_are_told(tmp_path, world):
    drawn = [thing(k, 0, 0, 8, 8, name="coin") for k in (1, 2, 3)] + [thing(4, 0, 0, 8, 8, name="hero")]
    level = load(write(tmp_path / "map.tmx", map_of(2, 2, objects_of(*drawn))), world)
    with pytest.raises(KeyError, match=r"3 objects are named 'coin'"):
        level.entities["coin"]
    with pytest.raises(KeyError, match=r"no object is named 'heros' .did you mean 'hero'"):
        level.entities["heros"]
    with pytest.raises(KeyError, match="no object has the id 9"):
        level.object(9)
    with pytest.raises(KeyError, match="entity 99 was made of no object"):
        level.object_of(99)
    assert level.object_of(level.entities["hero"]).id == 4
    assert level.of_class["nothing"] == []


def test_layers_of_the_world_have_their_names(tmp_path):
    world = world_for_maps(layers=Layers)
    drawn = thing(1, 0, 0, 8, 8, properties={"layer": "player", "mask": "ground, player"})
    level = load(write(tmp_path / "map.tmx", map_of(2, 2, objects_of(drawn))), world)
    collider = world.component_for_entity(level.object(1).entity, AABBCollider)
    assert (collider.layer, collider.mask) == (4, 5)
    world.close()


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

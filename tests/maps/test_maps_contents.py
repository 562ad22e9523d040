"""What objects, tiles and layers of a map become: components, prefabs, fields, references, paths, chains, layers."""

from __future__ import annotations

import enum

import numpy as np
import pytest
from helpers_maps import Ref, map_of, objects_of, properties, thing, tile, tiles_of, tileset, world_for_maps, write

from carom import (
    AABBCollider,
    CapsuleCollider,
    Component,
    Distance,
    Hinge,
    Joints,
    Path,
    Prefab,
    RigidBody,
    SphereCollider,
    Spin,
    TileGridCollider,
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


class Boss(Component):
    health = column(default=5.0)


class Layers(enum.IntFlag):
    GROUND, PLAYER = 1, 4


GOOM = Prefab(RigidBody(mass=3.0), SphereCollider(0.3, friction=0.5), Enemy(health=9.0))


def load(path, world, **options):
    return maps.load(path, world, (Coin, Enemy, Boss), {"goom": GOOM}, **options)


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


def test_points_of_a_layer_with_a_class_are_entities(tmp_path, world):
    layers = [objects_of(thing(k, 16, 16, point=True), name=name, properties={"mass": 2.0}, **{"class": name})
              for k, name in enumerate(("Enemy", "goom", ""), 1)]  # fmt: skip
    level = load(write(tmp_path / "map.tmx", map_of(2, 2, *layers)), world)
    found = [world.component_for_entity(level.object(k).entity, Enemy).health for k in (1, 2)]
    assert found == [3.0, 9.0]
    assert level.object(3).entity is None


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


def test_groups_give_their_layers_classes_and_fields(tmp_path, world):
    """Their own come first: fields, and whether there are bodies."""
    ones = np.ones((2, 2), int)

    def group(name, *layers, **fields):
        return {"type": "group", "name": name, "layers": [*layers], **fields,
                "properties": properties(fields.pop("properties", {}))}  # fmt: skip

    things = objects_of(thing(1, 0, 0, 8, 8), thing(2, 0, 0, 8, 8, kind="Enemy", properties={"health": 7.0}),
                        thing(3, 0, 0, 8, 8, kind="Boss", properties={"health": 9.0}),
                        properties={"sensor": True})  # fmt: skip
    inner = group("inner", things, properties={"health": 2.0, "_note": "inner"})
    enemies = group("enemies", inner, properties={"health": 1.0, "speed": 4.0}, **{"class": "Enemy"})
    own = tiles_of(ones, "own", **{"class": "Solid"})
    sky = group("sky", tiles_of(ones, "clouds"), own, **{"class": "Decoration"})
    bare = group("bare", tiles_of(ones + 1, "walls"), tiles_of(ones + 1, "none", **{"class": "Decoration"}),
                 tiles_of(ones + 2, "air"), tiles_of(ones + 1, "steps", **{"class": "OneWay"}),
                 properties={"solid": True, "friction": 0.25})  # fmt: skip
    tiles = tileset(tile(0, "Solid"), tile(2, "Air"))
    path = write(tmp_path / "map.tmx", map_of(2, 2, enemies, sky, bare, tilesets=[tiles]))
    level = load(path, world, materials={"Air": None})
    boss = world.component_for_entity(level.object(3).entity, Boss)
    assert (boss.health, world.component_for_entity(level.object(3).entity, Enemy).health) == (9.0, 2.0)
    enemies = [world.component_for_entity(level.object(k).entity, Enemy) for k in (1, 2)]
    assert [(each.health, each.speed) for each in enemies] == [(2.0, 4.0), (7.0, 4.0)]
    assert level.of_class["Enemy"] == [level.object(k).entity for k in (1, 2, 3)]
    assert world.component_for_entity(level.object(1).entity, AABBCollider).sensor
    shown = level.layers["things"]
    assert shown.kinds == ("Enemy",)
    assert shown.properties == {"health": 2.0, "speed": 4.0, "_note": "inner", "sensor": True}
    grids = {name: [world.component_for_entity(each, TileGridCollider) for each in layer.entities]
             for name, layer in level.layers.items() if name != "things"}  # fmt: skip
    faces = {name: [each.faces for each in found] for name, found in grids.items()}
    both = ["floors", "walls"]
    assert faces == {"clouds": [], "own": both, "walls": both, "none": [], "air": [], "steps": ["one_way"]}
    assert grids["walls"][0].friction == 0.25


def test_a_class_of_a_tile_object_replaces_that_of_its_tile(tmp_path, world):
    drawn = [thing(k, 0, 16, 16, 16, gid=1, kind=kind) for k, kind in enumerate(("", "Coin"), 1)]
    tiles = tileset(tile(0, "Enemy"))
    level = load(write(tmp_path / "map.tmx", map_of(2, 2, objects_of(*drawn), tilesets=[tiles])), world)
    assert {k: level.object(k).kinds for k in (1, 2)} == {1: ("Enemy",), 2: ("Coin",)}
    assert dict(level.of_class) == {"Enemy": [level.object(1).entity], "Coin": [level.object(2).entity]}
    assert not world.has_component(level.object(2).entity, Enemy)


def test_one_velocity_changes_the_other_in_nothing(tmp_path, world):
    fast = Prefab(RigidBody(linear_velocity=(1, 7)), SphereCollider(0.3))
    drawn = [
        thing(1, 0, 0, kind="fast", point=True, properties={"velocity_x": 5.0}),
        thing(2, 0, 0, 8, 8, properties={"linear_velocity": "1, 7", "velocity_y": 5}),
        thing(3, 0, 0, 8, 8, properties={"velocity_y": 2.0, "velocity_x": 3.0}),
    ]  # fmt: skip
    path = write(tmp_path / "map.tmx", map_of(2, 2, objects_of(*drawn)))
    level = maps.load(path, world, prefabs={"fast": fast})
    found = [world.component_for_entity(level.object(k).entity, RigidBody).linear_velocity for k in (1, 2, 3)]
    assert [each.tolist() for each in found] == [[5, 7], [1, 5], [3, 2]]


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
        thing(4, 80, 16, kind="Hinge", point=True, properties={"b": Ref(3), "lower": -1.0, "upper": 2.0}),
        thing(5, 80, 16, kind="Distance", point=True, properties={"b": Ref(3), "least": 0.0, "most": 4.0}),
    ]  # fmt: skip
    level = load(write(tmp_path / "map.tmx", map_of(6, 6, objects_of(*drawn))), world)
    hinge = world.component_for_entity(level.object(1).entity, Hinge)
    assert (hinge.a, hinge.b) == (level.object(2).entity, level.object(3).entity)
    assert np.array_equal(hinge.anchor, (3, 3))
    own, rope = (world.component_for_entity(level.object(k).entity, kind) for k, kind in ((4, Hinge), (5, Distance)))
    assert (own.anchor.tolist(), own.limits, rope.length) == ([5.0, 5.0], (-1.0, 2.0), (0.0, 4.0))
    assert own.b == rope.b == level.object(3).entity
    for _ in range(3):  # to the world
        world.step()
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
        thing(5, 0, 0, 16, 8, kind="lift", properties={"Path.speed": 2.0}),
    ]  # fmt: skip
    lift = Prefab(RigidBody(kind="kinematic"), Path(((1, 1), (1, 3)), 1.0))
    path = write(tmp_path / "map.tmx", map_of(6, 6, objects_of(*drawn)))
    level = maps.load(path, world, prefabs={"lift": lift})
    of = lambda k, kind: world.component_for_entity(level.object(k).entity, kind)  # noqa: E731
    assert of(1, Transform).position.tolist() == [2.5, 3.5]
    assert (of(5, Transform).position.tolist(), of(5, Path).speed) == ([1.0, 1.0], 2.0)
    assert of(1, RigidBody).kind == "kinematic"
    np.testing.assert_allclose(of(3, Path).points, ((1, 5), (1, 4), (0, 4)), atol=1e-12)
    assert of(3, Path).mode == "loop"
    np.testing.assert_allclose(of(3, Transform).position, (0.5, 4.0), atol=1e-12)
    assert level.object(2).entity is level.object(4).entity is None
    for _ in range(20):
        world.step()
    np.testing.assert_allclose(of(1, Transform).position, (3.5, 3.5), atol=1e-9)


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



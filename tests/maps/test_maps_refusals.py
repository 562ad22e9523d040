"""What cannot be loaded: a MapError that names file, layer, object and property, and a world as it was."""

from __future__ import annotations

import copy
import json

import numpy as np
import pytest
from helpers_maps import Ref, map_of, objects_of, quiet_world_for_maps, thing, tile, tiles_of, tileset, write

from carom import Component, Physics, Prefab, RigidBody, SphereCollider, World, column, maps


class Coin(Component):
    points = column(default=1.0)


class Enemy(Component):
    health = column(default=3.0, minimum=0.0)
    target = column(default=0, dtype=int)


CELLS = np.zeros((4, 6), int)
CELLS[3] = 1
GOOD = [
    thing(1, 64, 32, 16, 16, name="crate", properties={"kind": "dynamic", "mass": 2.0}),
    thing(2, 20, 16, 14, 14, kind="Enemy", name="ball", ellipse=True, properties={"Enemy.health": 5.0}),
]
U = ((0, 0), (24, 0), (24, 24), (12, 6), (0, 24))


def good(**changes):
    return map_of(6, 4, tiles_of(CELLS), objects_of(*copy.deepcopy(GOOD)), **changes)


def with_object(**fields):
    x, y, w, h = (fields.pop(name, size) for name, size in (("x", 30), ("y", 30), ("w", 16), ("h", 16)))
    return map_of(6, 4, tiles_of(CELLS), objects_of(*copy.deepcopy(GOOD), thing(7, x, y, w, h, name="it", **fields)))


def with_layer(**fields):
    return map_of(6, 4, {**tiles_of(CELLS), **fields})


LINE = thing(8, 0, 0, polyline=((0, 0), (9, 9)))
IT = "layer 'things', object 7 'it'"
BROKEN = {
    # of the file
    "infinite": (good(infinite=True), ["the map is infinite; clear"]),
    "isometric": (good(orientation="isometric"), ["the map is isometric; only orthogonal"]),
    "hexagonal": (good(orientation="hexagonal"), ["the map is hexagonal"]),
    "no tiles": (good(width=0, height=0), ["the map is 0 x 0 tiles"]),
    "too large": (good(width=10_000, height=1_000), ["10000 x 1000 = 10,000,000 tiles; at most"]),
    "no squares": (good(tileheight=8), ["tiles are 16 x 8 pixels; they must be square"]),
    "no size": ({**good(), "width": "many"}, ["'width' must be a number, got 'many'"]),
    "missing tileset": (
        good(tilesets=[{"firstgid": 1, "source": "none.tsx"}]),
        ["tileset 'none.tsx': none.tsx is missing"],
    ),
    "not a tileset": (good(tilesets=[{"firstgid": 1, "source": "map.tmx"}]), ["map.tmx is no tileset"]),
    # of tile layers
    "rows missing": (with_layer(data=[1] * 18), ["layer 'ground': its data has 18 cells, and the map 6 x 4 = 24"]),
    "no numbers": (with_layer(data="1,x,2"), ["layer 'ground': its data cannot be read"]),
    "bad base64": (with_layer(data="!!!", encoding="base64"), ["layer 'ground': its data"]),
    "bad zlib": (
        with_layer(data="AAAA", encoding="base64", compression="zlib"),
        ["layer 'ground': its data cannot be read"],
    ),
    "zstd": (with_layer(data="AAAA", encoding="base64", compression="zstd"), ["compression zstd; choose CSV or zlib"]),
    "unknown tile": (with_layer(data=[99] + [0] * 23), ["row 0, column 0 has tile 99, which is in no tileset"]),
    "solid in parallax": (with_layer(parallaxx=0.5), ["layer 'ground': solid tiles with parallax (0.5, 1.0)"]),
    "tile's property": (
        good(tilesets=[tileset(tile(0, "Solid", friktion=1.0))]),
        ["tileset 'basic', tile 0, property 'friktion'", "did you mean 'friction'?"],
    ),
    "tile's class": (good(tilesets=[tileset(tile(0, "Solidd"))]), ["tile 0, class 'Solidd'", "did you mean 'Solid'?"]),
    "group's class": (
        map_of(6, 4, {"type": "group", "name": "all", "class": "Lavva", "layers": [tiles_of(CELLS)]}),
        ["layer 'all', class 'Lavva'"],
    ),
    "layer's component": (with_layer(**{"class": "Timer"}), ["layer 'ground': Timer needs a value for 'seconds'"]),
    "crossing tile": (
        good(tilesets=[tileset(tile(0, "", thing(1, 0, 0, polygon=((0, 0), (16, 16), (16, 0), (0, 12)))))]),
        ["layer 'ground', tileset 'basic', tile 0: the outline crosses"],
    ),
    "a tile's shape": (
        good(tilesets=[tileset(tile(0, "", thing(3, 0, 8, 16, 8, properties={"shape": "blob"})))]),
        ["tile 0, shape 3, property 'shape': it must be one of box, capsule"],
    ),
    "property of a tile's shape": (
        good(tilesets=[tileset(tile(0, "", thing(3, 0, 8, 16, 8, properties={"friction": 0.5})))]),
        ["tile 0, shape 3: a shape of a tile can say 'shape' alone"],
    ),
    "class of a tile's shape": (
        good(tilesets=[tileset(tile(0, "", thing(3, 0, 8, 16, 8, kind="Solidd")))]),
        ["tile 0, shape 3, class 'Solidd'", "did you mean 'Solid'?"],
    ),
    "layer's class": (with_layer(**{"class": "Lavva"}), ["layer 'ground', class 'Lavva'"]),
    # of objects
    "unknown class": (with_object(kind="Coim"), [f"{IT}, class 'Coim': it is no component", "did you mean 'Coin'?"]),
    "one of two classes": (with_object(kind="Coin, Enmy"), [f"{IT}, class 'Enmy'", "did you mean 'Enemy'?"]),
    "a collider as class": (with_object(kind="SphereCollider"), [f"{IT}, class 'SphereCollider': the shape"]),
    "misspelt property": (with_object(properties={"mas": 2.0}), [f"{IT}, property 'mas'", "did you mean 'mass'?"]),
    "unknown component": (
        with_object(properties={"Enemi.health": 1.0}),
        [f"{IT}, property 'Enemi.health'", "'Enemy'?"],
    ),
    "unknown field": (
        with_object(properties={"Enemy.helth": 1.0}),
        ["Enemy has no field 'helth' (did you mean 'health'?)"],
    ),
    "field of a class": (
        with_object(properties={"foe": ("Enemy", {"helth": 1.0})}),
        [f"{IT}, property 'foe'", "'health'?"],
    ),
    "no such class": (with_object(properties={"foe": ("Enmy", {"health": 1.0})}), ["class 'Enmy' is no component"]),
    "negative mass": (
        with_object(properties={"mass": -2.0}),
        [f"{IT}, property 'mass': RigidBody.mass must be positive"],
    ),
    "text for a number": (with_object(properties={"mass": "2"}), [f"{IT}, property 'mass'", "choose the type float"]),
    "negative field": (with_object(kind="Enemy", properties={"health": -1.0}), ["Enemy.health must be at least 0"]),
    "a kind": (with_object(properties={"kind": "dynamik"}), [f"{IT}, property 'kind'", "dynamic, kinematic, static"]),
    "no vector": (with_object(properties={"linear_velocity": "fast"}), [f"{IT}, property 'linear_velocity'", "'0, 1'"]),
    "velocity of nan": (
        with_object(properties={"velocity_x": float("nan")}),
        [f"{IT}, property 'velocity_x': RigidBody.linear_velocity must be finite"],
    ),
    "too fast": (with_object(properties={"velocity_y": 1e308}), [f"{IT}, property 'velocity_y'", "at most 1e+307"]),
    "velocity of text": (with_object(properties={"velocity_x": "3"}), [f"{IT}, property 'velocity_x'", "be numbers"]),
    "three numbers": (
        with_object(properties={"linear_velocity": "1, 2, 3"}),
        [f"{IT}, property 'linear_velocity': RigidBody.linear_velocity must have 2 components"],
    ),
    "a tile's three numbers": (
        good(tilesets=[tileset(tile(0, "Solid", surface_velocity="1, 2, 3"))]),
        ["tile 0, property 'surface_velocity'", "must have 2 components"],
    ),
    "unknown layer": (
        with_object(properties={"layer": "coins"}),
        [f"{IT}, property 'layer': no layer is named 'coins'"],
    ),
    "unknown shape": (
        with_object(properties={"shape": "blob"}),
        [f"{IT}, property 'shape': it must be one of box, capsule"],
    ),
    "two of one id": (
        map_of(6, 4, objects_of(*copy.deepcopy(GOOD)), objects_of(thing(2, 9, 9, 8, 8), name="more")),
        ["two objects have the id 2, in layers 'things' and 'more'"],
    ),
    "no extent": (with_object(w=0), [f"{IT}: a rectangle of 0 x 16 pixels"]),
    "flat polygon": (with_object(polygon=((0, 0), (8, 8), (16, 16))), [f"{IT}: the polygon has no area"]),
    "two corners": (with_object(polygon=((0, 0), (8, 8))), [f"{IT}: a polygon of 2 points"]),
    "crossing": (with_object(polygon=((0, 0), (16, 16), (20, 0), (0, 12))), [f"{IT}: the outline crosses"]),
    "crossing body": (
        with_object(polygon=((0, 0), (16, 16), (20, 0), (0, 12)), properties={"mass": 1.0}),
        [f"{IT}: ", "cross"],
    ),
    "line of a point": (with_object(polyline=((3, 3), (3, 3))), [f"{IT}: a polyline of less than two points"]),
    "body of a line": (
        with_object(polyline=((0, 0), (9, 9)), properties={"mass": 1.0}),
        [f"{IT}: a polyline is a chain"],
    ),
    "no numbers in points": (
        {**good(), "layers": [objects_of({**thing(7, 0, 0, name="it"), "polygon": [{"x": "a", "y": 0}]})]},
        [f"{IT}: 'polygon' must be pairs of numbers"],
    ),
    "no place": (
        {**good(), "layers": [objects_of({"id": 7, "name": "it", "width": 3, "height": 3, "y": 2})]},
        [f"{IT}: 'x' is missing"],
    ),
    "unknown tile of an object": (with_object(gid=77), [f"{IT}: it shows tile 77, which is in no tileset"]),
    "body in parallax": (
        {**good(), "layers": [objects_of(thing(7, 0, 0, 5, 5, name="it"), parallaxx=0.5)]},
        ["a body in a layer"],
    ),
    # of references
    "no such object": (
        with_object(kind="Enemy", properties={"target": Ref(55)}),
        [f"{IT}, property 'Enemy.target'", "object 55"],
    ),
    "a path of a box": (
        with_object(properties={"path": Ref(1), "speed": 1.0}),
        [f"{IT}: object 1 'crate' is a rectangle"],
    ),
    "a path without speed": (
        {**good(), "layers": [objects_of(thing(7, 0, 0, 5, 5, name="it", properties={"path": Ref(8)}), LINE)]},
        [f"{IT}: its path needs a speed"],
    ),
    "a Path without points": (with_object(properties={"Path.speed": 2.0}), [f"{IT}: its Path needs points: property"]),
    "a path that is not set": (
        with_object(properties={"path": Ref(0), "Path.speed": 2.0}),
        [f"{IT}: its Path needs points"],
    ),
    "class Path": (with_object(kind="Path", properties={"speed": 2.0}), [f"{IT}: its Path needs points"]),
    "a Path of a tile": (
        good(tilesets=[tileset(tile(0, "", **{"Path.mode": "loop"}))]),
        ["layer 'ground', tileset 'basic', tile 0: its Path needs points"],
    ),
    "a path of itself": (
        with_object(polygon=U, properties={"path": Ref(7), "speed": 1.0}),
        [f"{IT}: it is a path, and has one itself"],
    ),
    "a path of nothing": (with_object(properties={"path": Ref(8), "speed": 1.0}), [f"{IT}: it refers to object 8"]),
    "a template": (with_object(template="none.tx"), [f"{IT}: none.tx is missing"]),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_map_names_the_place_and_leaves_nothing(name, tmp_path):
    broken, texts = BROKEN[name]
    world = quiet_world_for_maps()
    before = world.create_entity()
    path = write(tmp_path / "map.tmj", broken)
    write(tmp_path / "map.tmx", good())
    with pytest.raises(maps.MapError) as told:
        maps.load(path, world, (Coin, Enemy))
    for text in texts:
        assert text in str(told.value)
    assert str(path) in str(told.value)
    assert world.create_entity() > before  # not one more than these
    assert len(world.bodies) == 0
    world.close()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("<map", "is no XML that can be read: unclosed token, line 1"), ("<html/>", "this is no map of Tiled"),
        ("{", "is no JSON that can be read"), ("[1]", "its JSON is list"), ("{}", "this is no map of Tiled"),
        ("", "is no JSON"), ("\x00\xff", "is no"), ("[" * 100_000, "neither XML nor JSON"),
        ('{"levels": [], "defs": {}}', "0 levels: there is nothing to load"),
        (json.dumps({**good(), "layers": 5}), "'layers' must be a list"),
        (json.dumps({**good(), "layers": [{"type": "quilt", "name": "q"}]}), "layer 'q': a layer of kind 'quilt'"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_map_is_told(text, told, tmp_path):
    path = tmp_path / "map.tmj"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(maps.MapError, match=told.replace("(", r"\(")):
        maps.load(path, World(Physics(2)))
    with pytest.raises(maps.MapError, match=r"none\.tmx is missing"):
        maps.load(tmp_path / "none.tmx", World(Physics(2)))


def test_all_findings_are_told_at_once(tmp_path):
    things = [thing(k, 9, 9, 5, 5, properties={"mas": 1.0, "frction": 2.0}) for k in (3, 4)]
    path = write(tmp_path / "map.tmx", map_of(6, 4, with_layer(data=[1])["layers"][0], objects_of(*things, GOOD[0])))
    found = maps.check(path, (Coin, Enemy))
    places = [each.place for each in found]
    assert places == [
        "layer 'ground'",
        *(f"layer 'things', object {k}, property '{name}'" for k in (3, 4) for name in ("mas", "frction")),
        "",
    ]
    assert "basic.png is missing" in found[-1].text
    with pytest.raises(maps.MapError) as told:
        maps.load(path, World(Physics(2)))
    assert told.value.findings == found[:-1]
    assert str(told.value).splitlines() == list(map(str, found[:-1]))
    many = [thing(k, 9, 9, 5, 5, properties={"mas": 1.0}) for k in range(1, 21)]
    with pytest.raises(maps.MapError, match=r"and 14 more$"):
        maps.load(write(path, map_of(6, 4, objects_of(*many))), World(Physics(2)))


def test_what_the_world_refuses_late_is_taken_back(tmp_path):
    """A prefab that no entity can be made of is only known when it is made; what came before it goes again."""
    bad = Prefab(RigidBody(), SphereCollider(0.5, layer="nobody"))
    path = write(tmp_path / "map.tmx", with_object(kind="bad"))
    world = quiet_world_for_maps()
    with pytest.raises(maps.MapError, match=r"object 7 'it': SphereCollider.layer: 'nobody' names a layer"):
        maps.load(path, world, (Enemy,), {"bad": bad})
    world.step()
    assert len(world.bodies) == 0
    maps.load(write(tmp_path / "map.tmx", good()), world, (Enemy,))
    world.step()
    assert len(world.bodies) == 4
    world.close()


def test_plugins_that_are_missing_are_told(tmp_path):
    path = write(tmp_path / "map.tmx", with_object(polygon=U, properties={"mass": 1.0, "spins": True}))
    with pytest.raises(maps.MapError) as told:
        maps.load(path, World(Physics(2)), (Enemy,))
    text = " ".join(each.text for each in told.value.findings)
    for cure in ("Rotation()", "Parts()", "tile_grid.plugin", "convex_polygon.plugin"):
        assert cure in text


def test_templates_in_a_circle_are_refused(tmp_path):
    for name, other in (("a", "b"), ("b", "c"), ("c", "b")):
        write(tmp_path / f"{name}.tx", {"object": {"template": f"{other}.tx", "name": name}}, "template")
    path = write(tmp_path / "map.tmx", with_object(template="a.tx"))
    with pytest.raises(maps.MapError, match=r"object 7 'it': templates in a circle: b\.tx uses c\.tx uses b\.tx"):
        maps.load(path, quiet_world_for_maps(), (Enemy,))


def test_groups_without_end_are_told(tmp_path):
    path = tmp_path / "map.tmx"
    for depth in (400, 5_000):
        inside = '<group name="g">' * depth + "</group>" * depth
        size = 'width="1" height="1" tilewidth="8" tileheight="8"'
        path.write_text(f'<map orientation="orthogonal" {size}>{inside}</map>')
        try:
            maps.load(path, World(Physics(2)))
        except maps.MapError as error:
            assert "recursion" in str(error) or "too deep" in str(error)  # noqa: PT017


def test_wrong_arguments_are_told_before_a_file_is_read():
    world = World(Physics(2))
    for bad, told in (
        ({"components": (3,)}, "components are classes"),
        ({"prefabs": {"a": 3}}, r"prefabs\['a'\] must be a Prefab"),
        ({"materials": {"Ice": {"frction": 1}}}, "no field 'frction' .did you mean 'friction'"),
        ({"metres": 0}, "above 0"),
        ({"metres": "1"}, "a finite number above 0, got '1'"),
    ):
        with pytest.raises((ValueError, TypeError), match=told):
            maps.load("none.tmx", world, **bad)
    with pytest.raises(ValueError, match="maps are for 2D worlds, this world has 3"):
        maps.load("none.tmx", World(Physics(3)))

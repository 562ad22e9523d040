"""Levels of LDtk projects, written by code in the form of its JSON."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_maps_ldtk import CELLS, entity, field, level, project, write

from carom import AABBCollider, Component, Path, RigidBody, SphereCollider, TileGridCollider, Transform, column, maps
from carom.framework.typing import VectorField


class Enemy(Component):
    health = column(default=3.0, minimum=0.0)
    target = column(default=0, dtype=int)
    home: VectorField = column(default=0.0, item="vector")


class Spring(Component):
    power = column(default=1.0)


class Gate(Component): ...


NOBODY = field("target", "EntityRef", {"entityIid": "q"})


def test_a_level_becomes_a_world(tmp_path, world):
    of_boss = [
        field("name", "String", "boss"), field("health", "Float", 7), field("home", "Point", {"cx": 2, "cy": 1}),
        field("target", "EntityRef", {"entityIid": "b-2"}), field("kind", "LocalEnum.Kind", "kinematic"),
        field("mass", "Float", None),
    ]  # fmt: skip
    of_gate = [field("path", "Array<Point>", [{"cx": 4, "cy": 1}, {"cx": 4, "cy": 2}]), field("speed", "Float", 2)]
    shown = {"tilesetUid": 3, "x": 16, "y": 0, "w": 16, "h": 16}
    things = [
        entity("a-1", "Enemy", 40, 40, 16, 24, (0.5, 1), of_boss),
        entity("b-2", "Gate", 64, 16, fields=of_gate, uid=2),
        entity("c-3", "Start", 8, 24, uid=3, pivot=(0.5, 0.5)),
        entity("d-4", "Gate", 0, 0, uid=4, tile=shown),
    ]
    own = [field("music", "String", "cave"), field("unset", "Int", None)]
    path = write(tmp_path / "world.ldtk", project(level("Level_0", CELLS, *things, fieldInstances=own)))
    made = maps.load(path, world, (Enemy, Gate, Spring), materials={"ice": {"friction": 0.02}})
    of = lambda id, kind: world.component_for_entity(made.object(id).entity, kind)  # noqa: E731
    assert made.size == (6.0, 4.0)
    assert made.properties == {"music": "cave"}
    boss = made.entities["boss"]
    assert made.of_class["Enemy"] == [boss]
    assert made.of_class["Gate"] == [made.object("b-2").entity, made.object("d-4").entity]
    enemy = of("a-1", Enemy)
    assert (enemy.health, enemy.target, enemy.home.tolist()) == (7.0, made.object("b-2").entity, [2.5, 2.5])
    assert of("a-1", RigidBody).kind == "kinematic"
    assert of("a-1", Transform).position.tolist() == [2.5, 2.25]  # the pivot is at its feet
    assert of("a-1", AABBCollider).half_extents.tolist() == [0.5, 0.75]
    assert np.array_equal(of("b-2", Path).points, ((4.5, 2.5), (4.5, 1.5)))
    assert of("b-2", SphereCollider).radius == 0.5
    assert made.points["Start"] == (0.5, 2.5)
    (sprite,) = made.layers["Things"].sprites
    assert made.pictures[sprite.picture].rectangle == (16, 0, 16, 16)
    tiles = made.layers["Ground"].tiles
    assert (tiles.place.tolist(), tiles.flips.tolist()) == ([[1.0, 1.0]], [3])
    assert made.pictures[tiles.picture[0]].path == tmp_path / "tiles.png"
    assert [*made.layers] == ["Ground", "Things"]  # the first one is in front
    (spring,) = made.of_class["Spring"]
    assert world.component_for_entity(spring, Transform).position.tolist() == [4.5, 2.5]
    world.step()
    solid = {(r, c) for r in range(4) for c in range(6) if any(
        world.has_component(each, TileGridCollider) for each in world.query_point((c + 0.5, 3.5 - r)))}  # fmt: skip
    assert solid == {(3, c) for c in range(6)}
    icy = [world.component_for_entity(each, TileGridCollider) for each in world.query_point((3.5, 0.5))]
    assert {tiles.materials[tiles.material_of(3, 3)].friction for tiles in icy} == {0.02}


@pytest.mark.parametrize(("ice", "solid"), [({}, "1235"), ({"ice": {"friction": 0.5}}, "1235"), ({"ice": None}, "135")])
def test_values_are_solid_whatever_their_name(ice, solid, tmp_path, world):
    """1 has no name, 2 is ice, 3 one_way, 4 Decoration, 5 a component where the game is known, and a wall else."""
    path = write(tmp_path / "world.ldtk", project(level("L", [[1, 2, 3, 4, 5]])))
    assert maps.load(path, world, (Spring,), materials=ice).of_class["Spring"]
    without_the_game, made = maps.world_of(path)
    assert "Spring" not in made.of_class
    with_it, made = maps.world_of(path, components=[Spring])
    assert [with_it.has_component(entity, Spring) for entity in made.of_class["Spring"]] == [True]
    for each, where in ((world, solid), (without_the_game, "1235")):
        assert [x + 1 for x in range(5) if each.ray_cast((x + 0.5, 1.5), (0, -0.9))] == [*map(int, where)]


def test_one_of_several_levels_is_chosen(tmp_path, world):
    one, two = level("One", CELLS[3:]), level("Two", np.ones((2, 3), int), worldX=500)
    external = {**two, "layerInstances": None, "externalRelPath": "world/Two.ldtkl"}
    (tmp_path / "world").mkdir()
    write(tmp_path / "world" / "Two.ldtkl", two)
    path = write(tmp_path / "world.ldtk", project(one, external, externalLevels=True))
    assert maps.load(path, world, level="Two").size == (3.0, 2.0)
    assert maps.levels_of(path) == ["One", "Two"]
    with pytest.raises(maps.MapError, match=r"the project has 2 levels: choose one, level=\.\.\., of One, Two"):
        maps.load(path, world)
    with pytest.raises(maps.MapError, match="no level is named 'Three'; there are One, Two"):
        maps.load(path, world, level="Three")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"cells": [[6]]}, None),
        ({"things": [entity("x", "Enmy", 0, 0)]}, r"layer 'Things', object x 'Enmy', class 'Enmy': .*'Enemy'"),
        ({"things": [entity("x", "Enemy", 0, 0, fields=[field("helth", "Int", 3)])]}, r"property 'helth': .*'health'"),
        ({"things": [entity("x", "Enemy", 0, 0, fields=[field("health", "Int", -3)])]}, r"property 'health'.*at least"),
        ({"things": [entity("x", "Enemy", 0, 0, fields=[NOBODY])]}, r"object q, which is not in the map"),
        ({"short": True}, r"layer 'Ground': its data has 1 cells, and the level 2 x 1 = 2"),
        ({"tile": {"px": [1]}}, r"layer 'Ground': 'src' must be two numbers"),
    ],
)
def test_what_is_wrong_is_told(change, told, tmp_path, world):
    node = level("L", change.get("cells", [[1, 0]]), *change.get("things", ()))
    if "short" in change:
        node["layerInstances"][1]["intGridCsv"] = [1]
    if "tile" in change:
        node["layerInstances"][1]["gridTiles"] = [change["tile"]]
    path = write(tmp_path / "world.ldtk", project(node))
    if told is None:
        assert maps.load(path, world, (Enemy,)).layers["Ground"].entities
        return
    with pytest.raises(maps.MapError, match=told):
        maps.load(path, world, (Enemy,))
    assert len(world.bodies) == 0


def test_what_takes_no_reference_or_list_says_so(tmp_path, world):
    ref, two = {"entityIid": "x"}, [{"cx": 1, "cy": 1}, {"cx": 2, "cy": 1}]
    names = "mass", "kind", "angular_velocity", "linear_velocity", "velocity_x", "friction", "solid", "speed"
    fields = [field(name, "EntityRef", ref) for name in names]
    lift = [field("path", "Array<Point>", two), *fields, field("home", "Array<Point>", two)]
    path = write(tmp_path / "world.ldtk", project(level("L", CELLS, entity("x", "Enemy", 0, 0, fields=lift))))
    found = {each.place.rpartition(" ")[2]: each.text for each in maps.check(path, (Enemy,))}
    assert {found.get(f"'{name}'") for name in names} == {"it takes no reference to an object"}
    assert found["'home'"] == "it takes one point, got 2"
    mask = [field("mask", "Array<LocalEnum.Layer>", ["WALL", "FOE"])]
    write(path, project(level("L", CELLS, entity("x", "Enemy", 0, 0, fields=mask))))
    made = maps.load(path, world, (Enemy,), layers={"wall": 1, "foe": 4})
    assert world.component_for_entity(made.object("x").entity, AABBCollider).mask == 5
    with pytest.raises(maps.MapError, match="no layer is named 'FOE'"):
        maps.load(path, world, (Enemy,), layers={"wall": 1})

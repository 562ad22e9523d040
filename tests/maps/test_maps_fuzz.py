"""Maps with values replaced at random are loaded or refused with a MapError, and leave nothing behind then."""

from __future__ import annotations

import copy
import random

import numpy as np
import pytest
from helpers_maps import Ref, map_of, objects_of, quiet_world_for_maps, thing, tile, tiles_of, tileset, write
from helpers_maps_ldtk import entity, field, level, project

from carom import Component, column, maps

JUNK = (
    None, True, 0, 1, -1, 3, 2**31, 2**40, 0.5, 1e400, float("nan"), -1e300, "", "x", "1", "true", "Enemy", "1,2", [],
    [1], [[]], {}, {"x": 1}, [{}], [None], "\x00", "Solid",
)  # fmt: skip


class Enemy(Component):
    health = column(default=3.0, minimum=0.0)
    target = column(default=0, dtype=int)


def of_tiled():
    shapes = thing(1, 0, 16, polygon=((0, 0), (16, -16), (16, 0)))
    ice, enemy = tile(0, "Solid", friction=0.5), tile(3, "Enemy", solid=True)
    tiles = tileset(ice, tile(1, "OneWay"), tile(2, "", shapes), enemy)
    drawn = [
        thing(1, 9, 9, 16, 8, name="a", kind="Enemy", rotation=20, properties={"health": 2.0, "target": Ref(2)}),
        thing(2, 9, 9, 16, 8, ellipse=True, properties={"mass": 2.0, "Enemy": ("Enemy", {"health": 1.0}), "layer": 2}),
        thing(3, 9, 9, polygon=((0, 0), (9, 0), (9, 9), (4, 2)), properties={"spins": True}),
        thing(4, 9, 9, polyline=((0, 0), (9, 4))), thing(5, 3, 3, point=True, name="p"), thing(6, 9, 9, 16, 16, gid=3),
        thing(7, 9, 9, 8, 8, properties={"path": Ref(4), "speed": 1.0, "one_way": True}),
    ]  # fmt: skip
    cells = np.array(((0, 1, 2), (3, 4, 0x80000003)))
    group = {"type": "group", "name": "g", "offsetx": 2, "layers": [objects_of(*drawn)]}
    image = {"type": "imagelayer", "name": "i", "image": "x.png", "parallaxx": 0.5}
    return map_of(3, 2, tiles_of(cells), group, image, tilesets=[tiles])


def of_ldtk():
    fields = [field("health", "Float", 2), field("path", "Array<Point>", [{"cx": 1, "cy": 1}, {"cx": 2, "cy": 1}]),
              field("speed", "Float", 1), field("target", "EntityRef", {"entityIid": "b"})]  # fmt: skip
    shown = {"tilesetUid": 3, "x": 16, "y": 0, "w": 16, "h": 16}
    things = entity("a", "Enemy", 9, 9, fields=fields), entity("b", "Enemy", 9, 9, uid=4, tile=shown)
    return project(level("L", [[0, 1, 3], [4, 1, 1]], *things))


def changed(node, chance):
    """With one value replaced, left out or twice."""
    whole = copy.deepcopy(node)
    places = []

    def walk(each):
        for key, value in each.items() if isinstance(each, dict) else enumerate(each):
            places.append((each, key))
            if isinstance(value, (dict, list)):
                walk(value)

    walk(whole)
    for _ in range(chance.choice((1, 1, 1, 3))):
        holder, key = chance.choice(places)
        how = chance.random()
        if how < 0.2 and isinstance(holder, dict):
            holder.pop(key, None)
        elif how < 0.3 and isinstance(holder, list):
            holder.append(chance.choice(JUNK))
        elif isinstance(holder, dict) or key < len(holder):
            holder[key] = copy.deepcopy(chance.choice(JUNK))
    return whole


def play(seed, folder, count):
    chance = random.Random(seed)
    world = quiet_world_for_maps()
    loaded = 0
    for k in range(count):
        suffix, node = chance.choice((("tmj", of_tiled()), ("tmx", of_tiled()), ("ldtk", of_ldtk())))
        try:
            path = write(folder / f"map.{suffix}", changed(node, chance))
        except (TypeError, KeyError, AttributeError, ValueError):  # what our writer of XML cannot write
            continue
        before = len(world.bodies)
        try:
            maps.load(path, world, (Enemy,))
        except maps.MapError:
            assert len(world.bodies) == before, (seed, k)
        except Exception as error:
            raise AssertionError(f"seed {seed}, map {k}: {path.read_text()[:3000]}") from error
        else:
            loaded += 1
    world.close()
    return loaded


@pytest.mark.slow
def test_changed_maps_are_loaded_or_refused(tmp_path):
    assert 20 < play(1, tmp_path, 150) < 140


@pytest.mark.long
@pytest.mark.parametrize("seed", range(100, 120))
def test_many_changed_maps(seed, tmp_path):
    play(seed, tmp_path, 500)

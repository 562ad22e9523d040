"""Prefabs in maps: what an object says counts, whatever its prefab has, and what no world can have is refused."""

from __future__ import annotations

import pytest
from helpers_maps import Ref, map_of, objects_of, thing, world_for_maps, write

from carom import (
    AABBCollider,
    BoxCollider,
    Component,
    Path,
    Prefab,
    RigidBody,
    SphereCollider,
    Spin,
    Transform,
    column,
    maps,
)  # fmt: skip


class Enemy(Component):
    health = column(default=3.0)
    target = column(default=0, dtype=int)


BODY, BALL = RigidBody(mass=3.0), SphereCollider(0.3)


@pytest.fixture
def loaded(tmp_path, world):
    """loaded(prefab, ..., properties, ...): (its level, object 7 being of the prefab "it", all that check finds)."""

    def loaded(prefab, given, **fields):
        drawn = thing(7, 32, 32, 16, 16, name="it", kind="it", properties=given, **fields)
        others = thing(8, 9, 9, 8, 8, kind="Enemy"), thing(9, 9, 9, polyline=((0, 0), (32, 0)))
        path = write(tmp_path / "map.tmx", map_of(6, 4, objects_of(drawn, *others)))
        prefabs = {"it": prefab}
        found = maps.check(path, (Enemy,), prefabs)
        try:
            return maps.load(path, world, (Enemy,), prefabs), found
        except maps.MapError as error:
            assert len(world.bodies) == 0
            return error, found

    return loaded


@pytest.mark.parametrize("more", [(), (BALL,), (BoxCollider((0.3, 0.3)), Spin())])
def test_what_a_prefab_moves_stands_if_its_object_says_static(more, loaded, world):
    it = loaded(Prefab(BODY, *more), {"kind": "static"})[0].entities["it"]
    world.step()
    assert world.component_for_entity(it, Transform).position.tolist() == [2.5, 1.5]
    assert world.component_for_entity(it, RigidBody).linear_velocity.tolist() == [0, 0]

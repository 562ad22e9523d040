"""Prefabs in maps: what an object says counts, whatever its prefab has, and what no world can have is refused."""

from __future__ import annotations

import pytest
from helpers_maps import Ref, map_of, objects_of, thing, write

from carom import (
    AABBCollider,
    BoxCollider,
    Character,
    Characters,
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


class Shield(Component):
    health = column(default=9.0)


IT = "layer 'things', object 7 'it'"
BODY, BALL = RigidBody(mass=3.0), SphereCollider(0.3)
PATH = {"path": Ref(9), "speed": 1.0}


@pytest.fixture
def loaded(tmp_path, world):
    """loaded(prefab, properties, ...): the level with object 7 of that prefab, or what is wrong with it."""

    def loaded(prefab, given, **fields):
        drawn = thing(7, 32, 32, 16, 16, name="it", kind="it", properties=given, **fields)
        others = thing(8, 9, 9, 8, 8, name="foe", kind="Enemy"), thing(9, 9, 9, polyline=((0, 0), (32, 0)))
        path, known = write(tmp_path / "map.tmx", map_of(6, 4, objects_of(drawn, *others))), {"it": prefab}
        found = [each for each in maps.check(path, (Enemy,), known, world=world) if each.place]  # no image is there
        if not found:
            return maps.load(path, world, (Enemy,), known)
        with pytest.raises(maps.MapError) as told:
            maps.load(path, world, (Enemy,), known)
        assert told.value.findings == found
        return [(each.place, each.text) for each in found]

    return loaded


@pytest.mark.parametrize("more", [(), (BALL,), (BoxCollider((0.3, 0.3)), Spin())])
def test_what_a_prefab_moves_stands_if_its_object_says_static(more, loaded, world):
    it = loaded(Prefab(BODY, *more), {"kind": "static"}).entities["it"]
    world.step()
    assert world.component_for_entity(it, Transform).position.tolist() == [2.5, 1.5]
    assert world.component_for_entity(it, RigidBody).linear_velocity.tolist() == [0, 0]


def test_a_field_that_two_components_of_a_prefab_have_is_refused(loaded, world):
    two = Prefab(BODY, BALL, AABBCollider((0.1, 0.1)), Enemy(), Shield())
    text = "2 components of its prefab have a field of that name"
    assert loaded(two, {"health": 1.0, "offset": "0, 1"}) == [
        (f"{IT}, property 'health'", f"{text}: Enemy.health or Shield.health"),
        (f"{IT}, property 'offset'", f"{text}: SphereCollider.offset or AABBCollider.offset"),
    ]
    it = loaded(two, {"Shield.health": 1.0, "AABBCollider.offset": "0, 0.1"}).entities["it"]
    assert world.component_for_entity(it, Shield).health == 1.0
    assert world.component_for_entity(it, AABBCollider).offset.tolist() == [0, 0.1]


@pytest.mark.parametrize("name", ["target", "Enemy.target"])
def test_a_field_of_a_prefab_refers_to_an_object(name, loaded, world):
    """Before that is made, or after it: of itself too."""
    for target in (7, 8):
        level = loaded(Prefab(BODY, BALL, Enemy(health=9.0)), {name: Ref(target), "mass": 2.0})
        enemy = world.component_for_entity(level.entities["it"], Enemy)
        assert (enemy.health, enemy.target) == (9.0, level.object(target).entity)
    where, text = f"{IT}, property 'Enemy.target'", "it refers to object 55, which is not in the map"
    assert loaded(Prefab(BODY, BALL, Enemy()), {name: Ref(55)}) == [(where, text)]


@pytest.mark.parametrize(
    ("parts", "given"),
    [((RigidBody(), BALL), PATH), ((BALL,), PATH), ((RigidBody(), BALL, Path(((1, 1), (2, 1)), 1.0)), {}),
     ((RigidBody(), BALL, Character()), {})],
)  # fmt: skip
def test_what_has_a_path_or_is_a_character_is_kinematic_whatever_its_prefab_says(parts, given, loaded, world):
    world.add_plugin(Characters())
    it = loaded(Prefab(*parts), given).entities["it"]
    world.step()
    assert world.component_for_entity(it, RigidBody).kind == "kinematic"


@pytest.mark.parametrize(
    ("parts", "given", "where", "text"),
    [
        ((BODY, BALL), {**PATH, "kind": "dynamic"}, ", property 'kind'", "what has a path or is a Character is kine"),
        ((BALL,), {**PATH, "kind": "static"}, ", property 'kind'", "what has a path or is a Character is kinematic"),
        ((BALL,), {"spins": True, "kind": "static"}, ", property 'kind'", "what spins, or has a property of Spin"),
        ((BODY, AABBCollider((0.3, 0.3))), {"spins": True}, "", "it has Spin, which no AABBCollider can have"),
        ((BODY, SphereCollider(2.0), AABBCollider((0.5, 0.5))), {"radius": 0.2}, "",
         "its SphereCollider is the cheaper level and must enclose its AABBCollider"),
        ((BODY, SphereCollider(2.0, layer="foe"), AABBCollider((0.5, 0.5))), {}, "",
         "SphereCollider.layer: 'foe' names a layer"),
    ],
)  # fmt: skip
def test_what_a_step_would_refuse_is_not_loaded(parts, given, where, text, loaded):
    ((place, told),) = loaded(Prefab(*parts), given)
    assert place == IT + where
    assert told.startswith(text)

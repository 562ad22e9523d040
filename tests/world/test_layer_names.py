"""Layers by name: wherever bits of layers are understood, so are names of the world's IntFlag class."""

from __future__ import annotations

import enum
import pickle

import esper
import numpy as np
import pytest

from carom import CaromError, Physics, Prefab, RigidBody, SphereCollider, Transform, World


class Layers(enum.IntFlag):
    PLAYER, WALLS, GHOST = 1, 2, 4
    SOLID = PLAYER | WALLS


def named_world():
    return World(Physics(2), layers=Layers)


def collider_of(world, entity):
    return world.component_for_entity(entity, SphereCollider)


@pytest.mark.plain
def test_every_way_of_creating_takes_names_and_stores_their_bits(tmp_path):
    world = named_world()
    given = SphereCollider(0.5, layer="player", mask=("player", "ghost"))
    loose = pickle.loads(pickle.dumps(given.copy()))
    assert (loose.layer, loose.mask) == ("player", ("player", "ghost"))
    made = [world.create_entity(Transform((0, 0)), RigidBody(), given)]
    assert (given.layer, given.mask) == (1, 5)
    with world:
        made.append(esper.create_entity(Transform((1, 0)), loose))
    made += world.create_entities(
        2, Transform.many((2, 0)), SphereCollider.many(0.5, layer=["walls", Layers.GHOST], mask={"solid"})
    )
    prefab = Prefab(RigidBody(), SphereCollider(0.5, layer="ghost", mask="walls"))
    made += [prefab.spawn(world, position=(9, 9), mask="solid"), *prefab.spawn_many(world, 1, position=(9, 5))]
    world.step()
    bits = [(collider_of(world, entity).layer, collider_of(world, entity).mask) for entity in made]
    assert bits == [(1, 5), (1, 5), (2, 3), (4, 3), (4, 3), (4, 2)]
    assert "layer='player', mask=('player', 'ghost')" in repr(given)
    world.save(tmp_path / "saved")
    loaded = World.load(tmp_path / "saved", Physics(2), layers=Layers)
    assert repr(collider_of(loaded, made[0])) == repr(given)
    assert loaded.state_hash() == world.state_hash()


class MoreLayers(enum.IntFlag):
    PLAYER, WALLS, GHOST, WATER = 1, 2, 4, 8
    SOLID = PLAYER | WALLS | WATER


class OtherLayers(enum.IntFlag):
    PLAYER, WALLS, GHOST = 1, 4, 2


@pytest.mark.plain
def test_what_a_file_needs_of_layers_is_told_when_it_is_loaded(tmp_path):
    world, path, worlds = named_world(), tmp_path / "saved", esper.list_worlds()
    entity = entity_of(world, layer="walls")
    world.save(path)
    with pytest.raises(CaromError, match=r"names of its layers, player, walls, ghost: .*layers=Layers"):
        World.load(path, Physics(2))
    with pytest.raises(CaromError, match="layer 'walls' was 2 when it was saved, and is 4 now"):
        World.load(path, Physics(2), layers=OtherLayers)
    assert set(esper.list_worlds()) <= {world.name, *worlds}
    assert World.load(path, Physics(2), layers=MoreLayers).query_point((0, 0), mask="solid") == [entity]
    World(Physics(2)).save(path)
    World.load(path, Physics(2)).close()
    World.load(path, Physics(2), layers=Layers).close()


@pytest.mark.plain
def test_handles_columns_and_queries_take_names():
    world = named_world()
    made = world.create_entities(3, Transform.many([(0, 0), (2, 0), (4, 0)]), SphereCollider.many(0.5))
    collider_of(world, made[0]).mask = "walls", Layers.GHOST
    assert collider_of(world, made[0]).mask == 6
    world.step()
    collider_of(world, made[0]).layer = "Solid"
    assert np.array_equal(world.bodies.sphere_collider.layer, [3, 1, 1])
    world.bodies.sphere_collider.layer = ["walls", "player", "ghost"]
    assert world.query_aabb((-9, -9), (9, 9), mask=("ghost", "walls")) == [made[0], made[2]]
    assert [hit.entity for hit in world.ray_cast((-9, 0), (1, 0), 20, mask=Layers.GHOST)] == [made[2]]
    assert world.query_aabbs([(-9, -9)], [(9, 9)], masks="player")[0].tolist() == [made[1]]
    world.bodies.sphere_collider.mask = "walls"
    assert np.array_equal(world.bodies.sphere_collider.mask, [2, 2, 2])


def entity_of(world, **fields):
    return world.create_entity(Transform((0, 0)), SphereCollider(1.0, **fields))


def in_esper(world, **fields):
    with world:
        esper.create_entity(Transform((0, 0)), SphereCollider(1.0, **fields))
    world.step()


WRONG = {
    "created": (lambda world: entity_of(world, layer="wals"), r"SphereCollider.layer: no layer is named 'wals'"),
    "in esper": (lambda world: in_esper(world, mask=("walls", "gost")), "entity 1: SphereCollider.mask: no layer"),
    "in bulk": (
        lambda world: world.create_entities(2, Transform.many(0), SphereCollider.many(1, layer=["walls", "x"])),
        r"layer \(row 1\): no layer is named 'x'; there are player, walls, ghost, solid",
    ),
    "a query": (lambda world: world.query_point((0, 0), mask="x"), "query_point: mask: no layer is named 'x'"),
    "no names": (lambda world: entity_of(World(Physics(2)), layer="walls"), "'walls' names a layer: World"),
    "no names in a query": (lambda world: World(Physics(2)).query_point((0, 0), mask="x"), r"World\(layers=Layers\)"),
    "part a number": (lambda world: SphereCollider(1.0, mask=("walls", 2.5)), "SphereCollider.mask must be"),
    "no bits": (lambda world: World(layers=enum.IntFlag("L", {"NONE": 0, "A": 1})), "L.NONE must have one or more of"),
    "bit 63": (lambda world: World(layers=enum.IntFlag("L", {"A": 1 << 63})), "L.A must have one or more of the bits"),
    "twice": (lambda world: World(layers=enum.IntFlag("L", {"A": 1, "a": 2})), "two members named a"),
    "no class": (lambda world: World(layers=["walls"]), "layers must be an enum.IntFlag class"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_names_no_layer_is_refused(case):
    attempt, message = WRONG[case]
    with pytest.raises((TypeError, ValueError), match=message):
        attempt(named_world())

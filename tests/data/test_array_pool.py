"""Arrays of array columns are forgotten when nothing has them any more."""

from __future__ import annotations

import copy
import gc

import numpy as np
import pytest
from worlds import ball, make_world

from carom.components import RigidBody, Transform
from carom.framework import StepError, System
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.convex_polygon import plugin as convex_polygon
from carom.plugins.tile_grid import TileGridCollider
from carom.plugins.tile_grid import plugin as tile_grid

pytestmark = pytest.mark.plain

POOL = ConvexPolygonCollider.columns["vertices"].pool
TILES = TileGridCollider.columns["packed"].pool


def polygon(number, corners=12):
    """A polygon that no other test has."""
    angles = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    return (1.0 + 1e-6 * number) * np.stack((np.cos(angles), np.sin(angles)), axis=1)


@pytest.mark.slow
@pytest.mark.compiled
def test_a_map_that_changes_in_each_step_takes_no_more_room():
    """A thousand maps one after the other: there is room for those that are new, and for a few more."""
    world = make_world(2)
    world.add_plugin(tile_grid)
    tiles = np.zeros((50, 50), bool)
    ground = world.create_entity(Transform((0, 0)), TileGridCollider(tiles, 1.0))
    ball(world, (0.0, 40.0))

    class Digs(System):
        def process(self, dt):
            count = self.world.step_count
            tiles[count // 50 % 50, count % 50] ^= True
            if count % 2:
                self.world.component_for_entity(ground, TileGridCollider).cells = tiles
            else:
                self.world.component_for_entity(ground, TileGridCollider).set(
                    (count // 50 % 50, count % 50), bool(tiles[count // 50 % 50, count % 50])
                )

    world.add_system(Digs())
    rooms, before = [], int(TILES.starts[-1])
    for _ in range(1000):
        world.step()
        rooms.append(len(TILES.data))
    length = len(world.component_for_entity(ground, TileGridCollider).packed)
    assert length < 2602 / 16
    assert max(rooms) <= 2 * (before + (16 + 2) * length)
    assert np.array_equal(world.component_for_entity(ground, TileGridCollider).cells, tiles)


@pytest.mark.slow
def test_all_that_holds_an_array_keeps_it():
    """Bodies of two worlds, prefabs, values for many, handles of what was deleted, snapshots and copies of them."""
    worlds = [make_world(2) for _ in range(2)]
    for world in worlds:
        world.add_plugin(convex_polygon)
    prefab, many = ConvexPolygonCollider(polygon(-1)), ConvexPolygonCollider.many([polygon(-2), polygon(-3)])
    bodies = [
        world.create_entity(Transform((9.0 * k, 0)), RigidBody(), ConvexPolygonCollider(polygon(-10 - k)))
        for k, world in enumerate(worlds)
    ]
    gone = worlds[0].create_entity(Transform((50, 0)), ConvexPolygonCollider(polygon(-4)))
    removed = worlds[0].component_for_entity(gone, ConvexPolygonCollider)
    worlds[0].step()
    worlds[0].delete_entity(gone)
    worlds[0].step()
    changing = worlds[0].create_entity(Transform((90, 0)), RigidBody(), ConvexPolygonCollider(polygon(-5)))
    worlds[0].step()
    hashed, saved = worlds[0].state_hash(), copy.deepcopy(worlds[0].snapshot())
    before = int(POOL.starts[-1])
    for number in range(1500):
        worlds[0].component_for_entity(changing, ConvexPolygonCollider).vertices = polygon(number)
    assert len(POOL.data) <= 2 * (before + (16 + 2) * 12)
    gc.collect()
    assert np.array_equal(prefab.vertices, polygon(-1))
    assert np.array_equal(prefab.copy().vertices, polygon(-1))
    assert np.array_equal(removed.vertices, polygon(-4))
    for k, (world, body) in enumerate(zip(worlds, bodies, strict=True)):
        assert np.array_equal(world.component_for_entity(body, ConvexPolygonCollider).vertices, polygon(-10 - k))
        assert world.query_point((9.0 * k + 0.9, 0.0)) == [body]
    pair = worlds[1].create_entities(2, Transform.many([(20, 0), (30, 0)]), many)
    worlds[1].step()
    for entity, number in zip(pair, (-2, -3), strict=True):
        assert np.array_equal(worlds[1].component_for_entity(entity, ConvexPolygonCollider).vertices, polygon(number))
    worlds[0].restore(saved)
    assert worlds[0].state_hash() == hashed
    assert np.array_equal(worlds[0].component_for_entity(changing, ConvexPolygonCollider).vertices, polygon(-5))


@pytest.mark.slow
@pytest.mark.compiled
def test_a_step_that_fails_has_its_arrays_back():
    world = make_world(2)
    world.add_plugin(convex_polygon)
    body = world.create_entity(Transform((0, 0)), RigidBody(), ConvexPolygonCollider(polygon(-6)))
    world.step()

    class Fails(System):
        def process(self, dt):
            for number in range(2000):
                self.world.component_for_entity(body, ConvexPolygonCollider).vertices = polygon(number + 0.5)
            raise RuntimeError("no")

    hashed = world.state_hash()
    world.add_system(Fails())
    with pytest.raises(StepError):
        world.step()
    assert world.state_hash() == hashed
    assert np.array_equal(world.component_for_entity(body, ConvexPolygonCollider).vertices, polygon(-6))

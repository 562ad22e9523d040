"""Batches of queries: larger than one call of a kernel, more hits than room, order of hits, errors of plugins."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_queries import directions, scene

from carom.components import RigidBody, SphereCollider, Transform
from carom.components.colliders import Collider
from carom.framework import Plugin, PluginError, World, column
from carom.framework.vectors import divided, length, replace, scale
from carom.plugins import Physics
from carom.systems.queries import batch


def answers(world, points, ways):
    """Everything that a world finds for some queries, as arrays."""
    ids = np.sort(world.bodies.entity)[::3]
    hits = [world.query_spheres(points, 1.5), world.query_aabbs(points - 0.5, points + 1.0), world.neighbours(2.0)]
    hits.append(world.neighbours(3.0, of=ids))
    nearest = world.query_nearests(points, max_distances=3.0, exclude=int(ids[0]))
    rays, casts = world.ray_casts(points, ways, 9.0), world.shape_casts(SphereCollider(0.3), points, 4.0 * ways)
    found = [column for h in hits for column in (h.offsets, h.entities, h.rows)]
    for h in (nearest, rays, casts):
        found += [h.entity, h.row, h.distance, h.point, h.normal]
    return [*found, rays.fraction, casts.fraction]


@pytest.mark.parametrize("d", [2, 3])
def test_batches_in_several_calls_find_the_same(d, monkeypatch):
    rng = np.random.default_rng(1)
    world, _, side = scene(d, 150, 2)
    points, ways = rng.random((40, d)) * side, directions(rng, 40, d)
    at_once = answers(world, points, ways)
    monkeypatch.setattr(batch, "MOST_QUERIES", 7)
    for one, other in zip(at_once, answers(world, points, ways), strict=True):
        np.testing.assert_array_equal(one, other)


def test_more_hits_than_there_is_room_for():
    world, known, side = scene(2, 300, 3)
    lower = np.full((500, 2), -side)
    hits = world.query_aabbs(lower, lower + 4 * side)  # 150,000 hits
    assert hits.counts.tolist() == [300] * 500
    assert all((found == np.sort(known.entity)).all() for found in hits)


def test_hits_of_all_kinds_of_body_are_in_the_order_of_their_ids():
    world, known, side = scene(2, 1000, 4)
    assert world.query_aabb((-side, -side), (3 * side, 3 * side)) == sorted(known.entity.tolist())
    neighbours = world.neighbours(side)
    assert all((np.diff(found) > 0).all() for found in neighbours)


@pytest.mark.parametrize("d", [2, 3])
def test_answers_do_not_depend_on_other_queries_of_a_batch(d):
    rng = np.random.default_rng(5)
    world, _, side = scene(d, 250, 6)
    points, ways = rng.random((30, d)) * side, directions(rng, 30, d) * 10.0 ** rng.uniform(-3, 3, (30, 1))
    many = world.shape_casts(SphereCollider(0.2), points, ways)
    for k in range(30):
        one = world.shape_casts(SphereCollider(0.2), points[k : k + 1], ways[k : k + 1])
        for name in ("entity", "distance", "point", "normal", "fraction"):
            np.testing.assert_array_equal(getattr(one, name)[0], getattr(many, name)[k])


def test_results_are_not_overwritten_by_later_queries():
    world, _, side = scene(2, 100, 7)
    points = np.array([[0.3 * side, 0.4 * side], [0.6 * side, 0.5 * side]])
    first = world.query_nearests(points)
    kept = [first.entity.copy(), first.distance.copy(), first.point.copy()]
    world.query_nearests(points[::-1] + 1.0)
    for one, other in zip(kept, (first.entity, first.distance, first.point), strict=True):
        np.testing.assert_array_equal(one, other)


def test_queries_grow_with_the_world():
    world = World(Physics())
    for k in range(300):
        world.create_entity(Transform((0.1 * k, 0.0)), RigidBody(), SphereCollider(1.0))
        if k % 60 == 59:
            assert world.query_aabb((-9, -9), (99, 9)) == sorted(world.bodies.entity.tolist())
            assert len(world.ray_cast((-9, 0), (1, 0))) == k + 1
            assert world.neighbours(1000.0).counts.tolist() == [k] * (k + 1)

RAISES, NOT_FINITE, LATE_SWEEP = 1.0, 2.0, 3.0


def fragile_plugin():
    """A shape whose functions go wrong, by its column ``fault``, when they meet a sphere."""
    plugin = Plugin("fragile")

    @plugin.shape(cost=2)
    class FragileCollider(Collider):
        fault = column(minimum=0.0)

        def bounds(shape, dimensions):
            return (1.0, 1.0) if dimensions == 2 else (1.0, 1.0, 1.0)

    @plugin.pair(SphereCollider, FragileCollider)
    def sphere_fragile(a, b, d):
        if b.fault == RAISES:
            raise ValueError("broken glass", b.fault)
        distance = length(d)
        depth = a.radius + 1.0 - distance
        normal = divided(d, distance) if distance > 0.0 else replace(d, 0, 1.0)
        return depth >= 0.0, math.nan if b.fault == NOT_FINITE else depth, normal, scale(d, 0.5)

    @plugin.sweep(SphereCollider, FragileCollider)
    def sphere_fragile_sweep(a, b, d, v):
        return b.fault == LATE_SWEEP, 7.0

    return plugin, FragileCollider


def fragile_world(fault):
    plugin, fragile = fragile_plugin()
    world = World(Physics(), plugin)
    world.create_entity(Transform((50.0, 0.0)), SphereCollider(1.0))
    return world, world.create_entity(Transform((3.0, 0.0)), fragile(fault))


QUERIES = {
    "point": lambda world: world.query_point((3.2, 0.1)),
    "spheres": lambda world: world.query_spheres([(3.2, 0.1)], 0.5),
    "nearest": lambda world: world.query_nearest((3.2, 0.1)),
    "cast": lambda world: world.shape_cast(SphereCollider(0.1), (3.2, 0.1), (0.0, 0.0)),
}


@pytest.mark.parametrize("name", [name for name in QUERIES if name != "cast"])
def test_errors_in_functions_of_plugins_name_plugin_pair_and_entity(name):
    world, entity = fragile_world(RAISES)
    for _ in range(2):
        with pytest.raises(ValueError, match="broken glass") as caught:
            QUERIES[name](world)
        (note,) = caught.value.__notes__
        assert note == (
            "plugin fragile: pair sphere_fragile of SphereCollider and FragileCollider of a query, entity "
            f"{entity}"
        )  # fmt: skip
    assert world.query_point((50.0, 0.0)) == [entity - 1]


@pytest.mark.parametrize("name", ["point", "spheres"])
def test_answers_that_are_no_contacts_are_refused(name):
    world, entity = fragile_world(NOT_FINITE)
    with pytest.raises(PluginError, match=f"of a query, entity {entity} returned a contact that is not finite"):
        QUERIES[name](world)
    assert world.query_point((50.0, 0.0)) == [entity - 1]


def test_sweeps_out_of_their_time_are_refused():
    world, entity = fragile_world(LATE_SWEEP)
    with pytest.raises(PluginError, match=f"of a query, entity {entity}: its sweep returned a time that is not"):
        QUERIES["cast"](world)
    world, _ = fragile_world(0.0)
    assert QUERIES["cast"](world) == []  # the sweep says so

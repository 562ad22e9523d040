"""Overlaps of colliders, and which bodies they and casts meet: naive loops over all bodies."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_pairwise import pairwise
from queries.helpers_queries import GRAZE, Bodies, directions, scene
from worlds import both_dimensions, box, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform

FILTERS = ("layer", "mask", "group")


def filters(rng, m):
    """(m,) layers, masks and groups, half of them in no group."""
    groups = rng.integers(1, 4, m) * rng.integers(0, 2, m)
    return 1 << rng.integers(0, 4, m), rng.integers(0, 16, m) | rng.integers(0, 16, m), groups


def filtered_scene(d, n, rng):
    """A scene whose bodies have random layers, masks and groups; and these, (n,) each."""
    world, bodies, side = scene(d, n, seed=n + d)
    filtered = filters(rng, n)
    for k, (entity, sphere) in enumerate(zip(bodies.entity.tolist(), bodies.sphere.tolist(), strict=True)):
        collider = world.component_for_entity(entity, SphereCollider if sphere else AABBCollider)
        for name, values in zip(FILTERS, filtered, strict=True):
            setattr(collider, name, int(values[k]))
    return world, bodies, side, filtered


def met(one, others):
    """(n,) whether a layer, mask and group meet those of others: the rule of the narrow phase."""
    (layer, mask, group), (layers, masks, groups) = one, others
    return ((layer & masks) != 0) & ((mask & layers) != 0) & ((group == 0) | (group != groups))


def depths(bodies, centre, half, sphere):
    """How deep a sphere or a box is in each body."""
    if sphere:
        return bodies.depth_of_point(centre) + half[0]
    asked = Bodies([0], [centre], [half], [False])
    of_spheres = [asked.depth_of_point(place)[0] for place in bodies.centre]
    return np.where(bodies.sphere, of_spheres + bodies.half[:, 0], -bodies.gap(centre, half, False))


@pytest.mark.slow
@pytest.mark.parametrize(("d", "n", "sphere"), pairwise((2, 3), (60, 800), (True, False)))
def test_overlaps_of_many_bodies(d, n, sphere):
    """Which, how deep, in order, by layers, masks, groups and what is left out; moved out by the depth, they touch."""
    rng = np.random.default_rng(n)
    world, bodies, _, filtered = filtered_scene(d, n, rng)
    m = 60
    places = bodies.centre[rng.integers(0, n, m)] + 0.5 * rng.standard_normal((m, d))
    halves, others = 2.0 * rng.random((m, d)), rng.choice(bodies.entity, (m, 3))
    layers, own, groups = filters(rng, m)
    masks, offset = rng.integers(0, 16, m), 0.25 * np.eye(d)[0]
    common = {"layer": layers, "mask": own, "group": groups, "offset": np.tile(offset, (m, 1))}
    if sphere:
        halves[:] = halves[:, :1]
        many = SphereCollider.many(radius=halves[:, 0], **common)
    else:
        many = AABBCollider.many(half_extents=halves, **common)
    hits = world.shape_overlaps(many, places - offset, masks, excludes=others)
    count = 0
    for i in range(m):
        deep = depths(bodies, places[i], halves[i], sphere)
        wanted = met((layers[i], own[i] & masks[i], groups[i]), filtered) & ~np.isin(bodies.entity, others[i])
        sure = np.abs(deep) > GRAZE
        assert np.isin(bodies.entity, hits[i])[sure].tolist() == (wanted & (deep >= 0.0))[sure].tolist()
        some = slice(hits.offsets[i], hits.offsets[i + 1])
        found = np.searchsorted(bodies.entity, hits[i])
        np.testing.assert_allclose(hits.depths[some], np.maximum(deep[found], 0.0), rtol=0, atol=1e-12)
        ranked = list(zip(-hits.depths[some], hits[i], strict=True))
        assert ranked == sorted(ranked)
        for k, normal, depth in zip(found, hits.normals[some], hits.depths[some], strict=True):
            out = depths(bodies, places[i] + depth * normal, halves[i], sphere)[k]
            assert abs(out) < 1e-12
            assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
        fields = {name: int(values[i]) for name, values in zip(FILTERS, (layers, own, groups), strict=True)}
        one = SphereCollider(halves[i, 0], offset=offset, **fields) if sphere else None
        one = one or AABBCollider(halves[i], offset=offset, **fields)
        singles = world.overlaps(one, places[i] - offset, masks[i], exclude=others[i])
        assert [(hit.entity, hit.depth) for hit in singles] == list(zip(hits[i], hits.depths[some], strict=True))
        for hit, normal, point in zip(singles, hits.normals[some], hits.points[some], strict=True):
            assert (hit.normal.tolist(), hit.point.tolist()) == (normal.tolist(), point.tolist())
        count += len(singles)
    assert count > 20
    assert world.bodies.entity[hits.rows].tolist() == hits.entities.tolist()


@pytest.mark.slow
@both_dimensions
def test_casts_meet_what_a_body_would_meet(d):
    """The nearest of those that layers, masks and groups let meet, that the call asks for and does not leave out."""
    rng = np.random.default_rng(d)
    world, bodies, side, filtered = filtered_scene(d, 800, rng)
    m = 30
    starts, ways = rng.random((m, d)) * side, directions(rng, m, d)
    (layers, own, groups), masks, others = filters(rng, m), rng.integers(0, 16, m), rng.choice(bodies.entity, (m, 2))
    balls = SphereCollider.many(radius=np.full(m, 0.4), layer=layers, mask=own, group=groups)
    hits = world.shape_casts(balls, starts, side * ways, masks, excludes=others)
    rays = world.ray_casts(starts, ways, side, masks, excludes=others)
    for i in range(m):
        allowed = ~np.isin(bodies.entity, others[i]) & ((masks[i] & filtered[0]) != 0)
        for found, wanted, radius in (
            (hits, allowed & met((layers[i], own[i], groups[i]), filtered), 0.4), (rays, allowed, 0.0),
        ):  # fmt: skip
            distances, least = bodies.cast(starts[i], ways[i], side, np.full(d, radius), True)
            if (np.abs(least[wanted]) > GRAZE).all():
                nearest = np.where(wanted, distances, math.inf).min(initial=math.inf)
                assert found.distance[i] == pytest.approx(nearest, abs=1e-6)
    assert 5 < hits.found.sum() < m


@pytest.mark.slow
@both_dimensions
def test_only_what_opposes_the_motion(d):
    """Of all hits those with a normal against the way; and what a shape has stopped at does not stop it from sliding
    along, or leaving."""
    world, bodies, _ = scene(d, 300, seed=d)
    rng, m = np.random.default_rng(d), 200
    starts, ways = bodies.centre[rng.integers(0, 300, m)] + 0.7 * rng.standard_normal((m, d)), directions(rng, m, d)
    stopped = 0
    for k in range(m):
        shape, way = (SphereCollider(0.3) if k % 2 else AABBCollider(0.3)), 5.0 * ways[k]
        every = world.shape_cast(shape, starts[k], way)
        opposing = [(hit.entity, hit.distance) for hit in every if hit.normal @ ways[k] < -1e-9]
        assert [(hit.entity, hit.distance) for hit in world.shape_cast(shape, starts[k], way, against=True)] == opposing
        first = world.shape_casts(shape, starts[k : k + 1], way, against=True)
        assert (first.entity[0], first.distance[0]) == (opposing[0] if opposing else (-1, math.inf))
        if opposing and first.distance[0] > 0.0:
            stopped += 1
            place = starts[k] + first.fraction[0] * way
            for motion in (way - (way @ first.normal[0]) * first.normal[0], 5.0 * first.normal[0]):
                on = world.shape_cast(shape, place, motion, against=True)
                assert first.entity[0] not in [hit.entity for hit in on]
                assert all(hit.normal @ motion < 0.0 for hit in on)
    assert stopped > 20


def test_a_shape_on_the_floor():
    """By default it is touched first, as is told by its normal; against the motion, the wall is."""
    world = make_world()
    floor, wall = box(world, (0, -0.5), half=(50, 0.5), kind="static"), box(world, (8, 2), half=(0.5, 2), kind="static")
    cube = AABBCollider(0.5)
    assert [hit.entity for hit in world.shape_cast(cube, (0, 0.5), (10, 0))] == [floor, wall]
    assert [hit.entity for hit in world.shape_cast(cube, (0, 0.5), (10, 0), against=True)] == [wall]
    assert [hit.entity for hit in world.shape_cast(cube, (0, 0.5), (10, -1), against=True)] == [floor, wall]
    assert world.shape_cast(cube, (0, 0.5), (0, 0), against=True) == []
    (hit,) = world.overlaps(cube, (0, 0.5))
    assert (hit.entity, hit.depth, hit.normal.tolist(), hit.point.tolist()) == (floor, 0.0, [0.0, 1.0], [0.0, 0.0])
    assert world.overlaps(cube, (0, 0.6)) == []
    assert world.overlaps(cube, (0, 0.4), exclude=(wall, floor)) == []
    hero = world.create_entity(Transform((0, 0.4)), RigidBody(kind="kinematic"), AABBCollider(0.5, mask=1, group=3))
    own = world.component_for_entity(hero, AABBCollider)
    assert [hit.entity for hit in world.overlaps(own, (0, 0.4))] == [floor]  # of its own group is the hero itself
    assert len(world.shape_overlaps(own, np.empty((0, 2)))) == 0


@pytest.mark.plain
@both_dimensions
def test_nothing_touches_where_nothing_has_a_shape(d):
    world = make_world(d)
    world.create_entity(Transform((0.0,) * d), RigidBody())
    assert world.overlaps(SphereCollider(1.0), (0.0,) * d) == []
    hits = world.shape_overlaps(SphereCollider(1.0), np.zeros((3, d)))
    assert (hits.offsets.tolist(), hits.points.shape) == ([0, 0, 0, 0], (0, d))


WRONG = {
    "overlaps: position must be 2 finite": lambda w: w.overlaps(SphereCollider(1), (0, math.nan)),
    "overlaps: mask: .red. names a layer": lambda w: w.overlaps(SphereCollider(1), (0, 0), "red"),
    "overlaps: exclude must be None, an entity or sev": lambda w: w.overlaps(SphereCollider(1), (0, 0), exclude=1.5),
    "AABBCollider.half_extents": lambda w: w.overlaps(AABBCollider((1, 1, 1)), (0, 0)),
    "shape_overlaps: positions must have shape": lambda w: w.shape_overlaps(SphereCollider(1), (0, 0)),
    "shape_overlaps: masks .* 64 bits": lambda w: w.shape_overlaps(SphereCollider(1), [(0, 0)], [1, 2]),
    "SphereCollider.radius": lambda w: w.shape_overlaps(SphereCollider.many(radius=[1, 2]), [(0, 0)]),
    "shape_casts: masks .* or 2 of them": lambda w: w.shape_casts(SphereCollider(1), [(0, 0)] * 2, (1, 0), [1.0, 2.0]),
    "ray_casts: masks": lambda w: w.ray_casts([(0, 0)], (1, 0), masks=[1 << 63]),
    "ray_casts: excludes must be None, an entity or 2 of them, or several for each": lambda w: w.ray_casts(
        [(0, 0)] * 2, (1, 0), excludes=[1, 2, 3]
    ),
    "shape_casts: excludes": lambda w: w.shape_casts(SphereCollider(1), [(0, 0)] * 2, (1, 0), excludes=[[1], [2, 3]]),
    "query_nearest: exclude": lambda w: w.query_nearest((0, 0), exclude=[[1, 2]] * 2),
    "shape_cast: against must be True or False": lambda w: w.shape_cast(SphereCollider(1), (0, 0), (1, 0), against=1),
    "shape_casts: against": lambda w: w.shape_casts(SphereCollider(1), [(0, 0)], (1, 0), against=[True]),
}


@pytest.mark.slow
@pytest.mark.parametrize("message", WRONG)
@pytest.mark.parametrize("empty", [True, False])
def test_wrong_arguments(message, empty):
    world = make_world()
    if not empty:
        box(world, (0, 0))
    with pytest.raises(ValueError, match=message):
        WRONG[message](world)


@pytest.mark.plain
def test_wrong_shapes():
    world = make_world()
    for shape in (RigidBody(), 0.5, SphereCollider, SphereCollider.many(radius=1.0)):
        with pytest.raises(TypeError, match=r"overlaps: shape must be a collider of this world \(AABBCollider, Sph"):
            world.overlaps(shape, (0, 0))
    with pytest.raises(TypeError, match="shape_overlaps: shape"):
        world.shape_overlaps(Transform.many(position=(0, 0)), [(0, 0)])

"""Overlap, nearest and neighbour queries against brute force; batches; errors of plugins; rules of all queries."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_pairwise import pairwise
from queries.helpers_queries import directions, scene
from worlds import ball, both_dimensions, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.components.colliders import Collider
from carom.framework import Phase, Plugin, PluginError, System, World, column
from carom.framework.vectors import divided, length, replace, scale
from carom.plugins import Physics, capsule
from carom.plugins.standard_sweeps import ball as ball_sweep
from carom.systems.queries import batch


@pytest.mark.slow
@pytest.mark.parametrize(("d", "n", "sizes"), pairwise((2, 3), (60, 800), ("even", "power", "clusters")))
def test_nearest_of_many_bodies(d, n, sizes):
    world, bodies, side = scene(d, n, seed=n, sizes=sizes)
    rng = np.random.default_rng(3)
    points = (rng.random((100, d)) * 2 - 0.5) * side
    points[:5] += 1e3 * side
    limits = np.where(np.arange(100) % 3, math.inf, rng.random(100))
    hits = world.query_nearests(points, max_distances=limits)
    for i in range(len(points)):
        distance = -bodies.depth_of_point(points[i])
        nearest = int(np.argmin(distance))
        single = world.query_nearest(points[i], max_distance=limits[i])
        if distance[nearest] > limits[i]:
            assert single is None
            assert hits.entity[i] == -1
            assert hits.distance[i] == math.inf
            continue
        tolerance = 1e-14 * np.abs(points[i]).max() + 1e-14 * side
        assert hits.distance[i] == pytest.approx(distance[nearest], abs=tolerance)
        assert distance[bodies.entity == hits.entity[i]][0] == pytest.approx(distance[nearest], abs=2 * tolerance)
        assert (single.entity, single.distance) == (hits.entity[i], hits.distance[i])
        # the point lies on the surface, and the normal points from it to the query point
        np.testing.assert_allclose(single.point + single.distance * single.normal, points[i], atol=10 * tolerance)
        on_surface = bodies.depth_of_point(single.point)[bodies.entity == single.entity][0]
        assert abs(on_surface) < 10 * tolerance


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize(("n", "sizes"), [(60, "even"), (800, "even"), (800, "spread")])
def test_touching_many_bodies(d, n, sizes):
    world, bodies, side = scene(d, n, seed=5, sizes=sizes)
    rng = np.random.default_rng(5)
    m, some = 300, rng.integers(0, n, 300)
    centres = bodies.centre[some] + 0.1 * side * rng.standard_normal((m, d)) * 10.0 ** rng.uniform(-3, 0, (m, 1))
    radii, halves = 2 * rng.random(m), 2 * rng.random((m, d)) * 10.0 ** rng.uniform(-1, 2, (m, 1))
    spheres, boxes = world.query_spheres(centres, radii), world.query_aabbs(centres - halves, centres + halves)
    for i in range(m):
        expected = bodies.entity[bodies.gap(centres[i], radii[i : i + 1], True) <= 0]
        np.testing.assert_array_equal(spheres[i], expected)
        assert world.query_sphere(centres[i], radii[i]) == expected.tolist()
        expected = bodies.entity[bodies.gap(centres[i], halves[i], False) <= 0]
        np.testing.assert_array_equal(boxes[i], expected)
        assert world.query_aabb(centres[i] - halves[i], centres[i] + halves[i]) == expected.tolist()
        inside = bodies.entity[bodies.depth_of_point(centres[i]) >= 0]
        assert world.query_point(centres[i]) == inside.tolist()
    np.testing.assert_array_equal(world.bodies.entity[spheres.rows], spheres.entities)


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize("n", [60, 800])
def test_neighbours_of_many_bodies(d, n):
    world, bodies, side = scene(d, n, seed=9, sizes="clusters")
    radius = 0.1 * side
    near = world.neighbours(radius)
    np.testing.assert_array_equal(near.askers, np.sort(bodies.entity))
    distance = np.linalg.norm(bodies.centre[:, None] - bodies.centre[None], axis=2)
    within = (distance <= radius) & ~np.eye(n, dtype=bool)
    for i in range(n):
        np.testing.assert_array_equal(near[i], bodies.entity[within[i]])
    asker, other = near.pairs()
    pairs = set(zip(asker.tolist(), other.tolist(), strict=True))
    assert pairs == {(j, i) for i, j in pairs}
    np.testing.assert_array_equal(world.bodies.entity[asker], np.repeat(near.askers, near.counts))
    np.testing.assert_array_equal(world.bodies.entity[other], near.entities)

    of = bodies.entity[::-7]
    some = world.neighbours(radius, mask=0b0101, of=of)
    np.testing.assert_array_equal(some.askers, of)
    wanted = np.arange(n) % 4 % 2 == 0  # layers 1 and 4
    for i, entity in enumerate(of):
        expected = bodies.entity[within[bodies.entity == entity][0] & wanted]
        np.testing.assert_array_equal(some[i], expected)
        np.testing.assert_array_equal(some.of(entity), expected)


@both_dimensions
def test_ties_go_to_the_smaller_id(d):
    world = make_world(d)
    kinds = ("static", "dynamic", "kinematic", "dynamic", "static")
    entities = [ball(world, 5, kind=kind) for kind in kinds]
    away = np.zeros(d)
    assert [hit.entity for hit in world.ray_cast(away, np.eye(d)[0])] == entities
    assert world.ray_casts([away], np.eye(d)[0]).entity.tolist() == [entities[0]]
    assert world.query_nearest(away).entity == entities[0]
    assert world.query_nearest(away, exclude=entities[0]).entity == entities[1]


@pytest.mark.slow
@both_dimensions
def test_the_order_of_rows_does_not_matter(d):
    """The kinds of bodies decide on rows and trees; ids and positions are the same, and so are the bits."""
    answers = []
    for kinds in (("dynamic",), ("static",), ("static", "dynamic", "kinematic")):
        world, _, side = scene(d, 400, seed=11, kinds=kinds)
        rng = np.random.default_rng(1)
        starts, ways = rng.random((200, d)) * side, directions(rng, 200, d)
        casts = world.shape_casts(SphereCollider(0.2), starts, side * ways)
        nearest = world.query_nearests(starts)
        columns = [getattr(casts, name) for name in ("entity", "distance", "fraction", "normal", "point")]
        columns += [getattr(nearest, name) for name in ("entity", "distance", "normal", "point")]
        answers.append([*columns, world.neighbours(3.0).entities])
    for other in answers[1:]:
        for one, two in zip(answers[0], other, strict=True):
            np.testing.assert_array_equal(one, two)


@both_dimensions
def test_masks_and_exclusion(d):
    world = make_world(d)
    first = ball(world, 3, layer=1, sensor=True)
    second = ball(world, 6, layer=2, kind="static")
    third = ball(world, 9, layer=4, mask=0)  # its own mask does not matter for queries
    origin, way = np.zeros(d), np.eye(d)[0]

    def along(**arguments):
        return [hit.entity for hit in world.ray_cast(origin, way, **arguments)]

    assert along() == [first, second, third]
    assert along(mask=2 | 4) == [second, third]
    assert along(exclude=second) == [first, third]
    assert along(max_distance=5.6) == [first, second]
    assert along(only_nearest=True, exclude=first) == [second]
    assert along(mask=8) == []
    assert world.ray_cast(origin, way, only_nearest=True)[0].entity == first
    many = world.ray_casts([origin] * 4, way, excludes=[-1, first, second, 77], masks=1 | 2)
    assert many.entity.tolist() == [first, second, first, first]
    assert world.bodies.entity[many.row].tolist() == many.entity.tolist()
    assert many.found.all()
    moved = world.shape_casts(SphereCollider(0.5), [origin] * 2, [100 * way, way], excludes=first)
    assert moved.entity.tolist() == [second, -1]
    assert world.query_nearest(origin, mask=4).entity == third
    assert world.query_nearest(origin, mask=8) is None
    assert world.query_nearests([origin, 6 * way], excludes=[first, second]).entity.tolist() == [second, first]


@both_dimensions
def test_what_is_deleted_and_what_is_written(d):
    world = make_world(d)
    gone, stays = ball(world, 3), ball(world, 6)
    origin, way = np.zeros(d), np.eye(d)[0]
    assert world.ray_cast(origin, way, only_nearest=True)[0].entity == gone
    world.delete_entity(gone, immediate=True)
    assert world.ray_cast(origin, way, only_nearest=True)[0].entity == stays
    assert world.query_nearest(origin).entity == stays
    assert world.neighbours(100.0).askers.tolist() == [stays]
    world.component_for_entity(stays, Transform).position = 50 * way
    world.refresh_queries()
    assert world.ray_cast(origin, way)[0].distance == 49.5
    assert world.query_nearest(origin).distance == 49.5
    new = ball(world, 20)
    assert [hit.entity for hit in world.ray_cast(origin, way)] == [new, stays]
    np.testing.assert_array_equal(world.neighbours(30.0)[0], [new])
    world.delete_entity(new, immediate=True)
    world.delete_entity(stays, immediate=True)
    assert world.ray_cast(origin, way) == []
    assert world.query_nearest(origin) is None
    assert len(world.neighbours(1.0)) == 0
    assert world.ray_casts(np.empty((0, d)), way).entity.shape == (0,)


@both_dimensions
def test_empty_lists_are_no_queries_and_no_entities(d):
    world, shape, radii = make_world(d), SphereCollider(0.3), SphereCollider.many(radius=[])
    ball(world, np.zeros(d))
    for none in ([], (), np.array([])):
        found = [world.ray_casts(none, none), world.ray_casts(none, none, none), world.query_nearests(none),
                 world.shape_casts(shape, none, none), world.shape_casts(radii, none, none)]  # fmt: skip
        assert [len(each.entity) for each in found] == [0] * len(found)
        found = world.shape_overlaps(shape, none), world.query_spheres(none, 1.0), world.query_aabbs(none, none)
        assert [len(each) for each in found] == [0] * len(found)
        bodies = Transform.many(none), RigidBody.many(linear_velocity=none, mass=none, kind=list(none)), radii
        assert len(world.create_entities(0, *bodies)) == 0
        world.delete_entities(none)
        world.bodies.kinematic.move_to(none)
    with pytest.raises(ValueError, match=r"Transform\.position must be one value or one per row"):
        world.create_entities(2, Transform.many([]))


def test_a_query_between_a_shape_that_came_and_went_changes_no_step():
    """The query links the functions of other shapes than the steps before and after it."""

    def hashed(asks):
        world = World(Physics(2), capsule.plugin)
        world.create_entity(Transform((0, 0)), RigidBody(kind="static"), AABBCollider((30.0, 0.5)))
        world.create_entity(Transform((0, 3)), RigidBody(linear_velocity=(0, -1)), capsule.CapsuleCollider(0.5, 0.5))
        world.step()
        passing = ball(world, (0, 90))
        if asks:
            assert world.query_point((0, 90)) == [passing]
        world.delete_entity(passing, immediate=True)
        for _ in range(200):
            world.step()
        return world.state_hash()

    assert hashed(True) == hashed(False)


def test_systems_see_bodies_where_they_are():
    """In every phase of a step, after any earlier query in it."""
    world = make_world(restitution_threshold=0.0)
    mover = ball(world, (0, 0), (60.0, 0.0), restitution=1.0)
    ball(world, (1.5, 0), kind="static", restitution=1.0)
    seen = []

    class Look(System):
        def process(self, dt):
            place = self.world.bodies.position[self.world.bodies.row_of(mover)]
            hit = self.world.ray_cast((-50, 0), (1, 0), only_nearest=True)[0]
            nearest = self.world.query_nearest((-50, 0))
            near = self.world.neighbours(1e-9 + abs(1.5 - place[0])).counts.sum()
            seen.append((self.phase, hit.distance - (place[0] + 49.5), nearest.distance - (place[0] + 49.5), near))

    for phase in (Phase.START, Phase.INTEGRATION, Phase.BROAD, Phase.NARROW, Phase.RESPONSE, Phase.END):
        world.add_system(type(f"Look{phase.name}", (Look,), {"phase": phase})())
    world.step()
    assert len(seen) == 6
    for _, *errors, near in seen:
        np.testing.assert_allclose(errors, 0.0, atol=1e-13)
        assert near == 2


@both_dimensions
@pytest.mark.parametrize("n", [3, 300])
@pytest.mark.filterwarnings("error")
def test_bodies_that_are_nowhere_disturb_no_answer(d, n):
    world = make_world(d)
    there = [ball(world, 3 * (k + 1)) for k in range(n)]
    world.bodies.position[0] = math.nan
    world.bodies.position[1] = math.inf
    origin, way = np.zeros(d), np.eye(d)[0]
    world.refresh_queries()
    assert [hit.entity for hit in world.ray_cast(origin, way)] == there[2:]
    assert world.query_nearest(origin).entity == there[2]
    assert world.query_sphere(origin, 8.5) == there[2:3]
    assert world.neighbours(3.5).counts.tolist() == [0, 0] + [min(1, n - 3)] + [2] * (n - 4) + [1] * (n > 3)


def test_neighbours_without_colliders():
    world = make_world()
    birds = [world.create_entity(Transform((x, 0)), RigidBody()) for x in (0.0, 1.0, 3.0)]
    assert [found.tolist() for found in world.neighbours(1.0)] == [[birds[1]], [birds[0]], []]
    assert [found.tolist() for found in world.neighbours(1.0, mask=1)] == [[], [], []]
    hawk = ball(world, (2, 0), layer=2)
    assert world.neighbours(1.0).of(hawk).tolist() == birds[1:]
    assert [found.tolist() for found in world.neighbours(1.0, mask=2)] == [[], [hawk], [hawk], []]
    with pytest.raises(KeyError, match="no body"):
        world.neighbours(1.0, of=[birds[0], 99])


WRONG = {
    "query_point: point": lambda w: w.query_point((0, math.nan)),
    "query_sphere: radius": lambda w: w.query_sphere((0, 0), -1.0),
    "query_sphere: mask": lambda w: w.query_sphere((0, 0), 1.0, mask=1.5),
    "query_spheres: radii": lambda w: w.query_spheres([(0, 0)], [-1.0]),
    "query_spheres: centres": lambda w: w.query_spheres([(0, 0, 0)], 1.0),
    "query_aabbs: lower": lambda w: w.query_aabbs([(0, 0)], [(-1, 0)]),
    "query_aabbs: upper": lambda w: w.query_aabbs([(0, 0)], [(math.inf, 0)]),
    "query_nearest: point": lambda w: w.query_nearest((0, 0, 0)),
    "query_nearest: max_distance": lambda w: w.query_nearest((0, 0), max_distance=-1),
    r"query_nearest: mask .*\(did you mean max_distance=3.5\?": lambda w: w.query_nearest((0, 0), 3.5),
    r"query_nearests: masks .*\(did you mean max_distances=3.5\?": lambda w: w.query_nearests([(0, 0)], 3.5),
    r"query_nearests: masks .*\(did you mean max_distances=\[3.5\]\?": lambda w: w.query_nearests([(0, 0)], [3.5]),
    "query_nearests: points": lambda w: w.query_nearests([(0, math.inf)]),
    "query_nearests: max_distances": lambda w: w.query_nearests([(0, 0)], max_distances=[1, 2]),
    "query_nearests: excludes": lambda w: w.query_nearests([(0, 0)], excludes=[1, 2]),
    "neighbours: radius": lambda w: w.neighbours(math.inf),
    "neighbours: of": lambda w: w.neighbours(1.0, of=3),
    "ray_cast: origin": lambda w: w.ray_cast("here", (1, 0)),
    "ray_cast: direction must not be zero": lambda w: w.ray_cast((0, 0), (0, 0)),
    "ray_cast: direction must be 2": lambda w: w.ray_cast((0, 0), (1, 0, 0)),
    "ray_cast: max_distance": lambda w: w.ray_cast((0, 0), (1, 0), math.nan),
    "ray_cast: mask": lambda w: w.ray_cast((0, 0), (1, 0), mask=1 << 70),
    "ray_cast: exclude": lambda w: w.ray_cast((0, 0), (1, 0), exclude="me"),
    "ray_casts: directions must not be zero, as row 1": lambda w: w.ray_casts([(0, 0)] * 2, [(1, 0), (0, 0)]),
    "ray_casts: directions must have shape": lambda w: w.ray_casts([(0, 0)] * 2, [(1, 0)] * 3),
    "ray_casts: max_distances": lambda w: w.ray_casts([(0, 0)], (1, 0), -1.0),
    "shape_cast: displacement": lambda w: w.shape_cast(SphereCollider(1), (0, 0), (math.inf, 0)),
    "shape_cast: position": lambda w: w.shape_cast(SphereCollider(1), (0,), (1, 0)),
    "shape_casts: positions": lambda w: w.shape_casts(SphereCollider(1), [(math.nan, 0)], (1, 0)),
    "AABBCollider.half_extents": lambda w: w.shape_cast(AABBCollider((1, 1, 1)), (0, 0), (1, 0)),
    "SphereCollider.radius": lambda w: w.shape_casts(SphereCollider.many(radius=[1, 2]), [(0, 0)], (1, 0)),
}


@pytest.mark.slow
@pytest.mark.plain
@pytest.mark.parametrize("message", WRONG)
@pytest.mark.parametrize("empty", [True, False])
def test_wrong_arguments(message, empty):
    world = make_world()
    if not empty:
        ball(world, (0, 0))
    with pytest.raises(ValueError, match=message):
        WRONG[message](world)


def answers(world, points, ways):
    """Everything that a world finds for some queries, as arrays."""
    ids = np.sort(world.bodies.entity)[::3]
    hits = [world.query_spheres(points, 1.5), world.query_aabbs(points - 0.5, points + 1.0), world.neighbours(2.0)]
    hits.append(world.neighbours(3.0, of=ids))
    nearest = world.query_nearests(points, max_distances=3.0, excludes=int(ids[0]))
    rays, casts = world.ray_casts(points, ways, 9.0), world.shape_casts(SphereCollider(0.3), points, 4.0 * ways)
    found = [column for h in hits for column in (h.offsets, h.entities, h.rows)]
    for h in (nearest, rays, casts):
        found += [h.entity, h.row, h.distance, h.point, h.normal]
    return [*found, rays.fraction, casts.fraction]


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("most", [1, 7])
def test_answers_depend_on_no_other_query_of_the_batch_or_later(d, most, monkeypatch):
    """In several calls, or one by one, they are the same; and others that come later leave them as they are."""
    rng = np.random.default_rng(1)
    world, _, side = scene(d, 150, 2)
    points, ways = rng.random((40, d)) * side, directions(rng, 40, d) * 10.0 ** rng.uniform(-3, 3, (40, 1))
    at_once = answers(world, points, ways)
    kept = [found.copy() for found in at_once]
    answers(world, points[::-1] + 1.0, ways[::-1])
    monkeypatch.setattr(batch, "MOST_QUERIES", most)
    for one, first, other in zip(at_once, kept, answers(world, points, ways), strict=True):
        np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(one, first)


def test_more_hits_than_there_is_room_for():
    world, known, side = scene(2, 300, 3)
    lower = np.full((500, 2), -side)
    hits = world.query_aabbs(lower, lower + 4 * side)  # 150,000 hits
    assert hits.counts.tolist() == [300] * 500
    assert all((found == np.sort(known.entity)).all() for found in hits)


def test_queries_grow_with_the_world():
    world = World(Physics())
    for k in range(300):
        world.create_entity(Transform((0.1 * k, 0.0)), RigidBody(), SphereCollider(1.0))
        if k % 60 == 59:
            assert world.query_aabb((-9, -9), (99, 9)) == sorted(world.bodies.entity.tolist())
            assert len(world.ray_cast((-9, 0), (1, 0))) == k + 1
            assert world.neighbours(1000.0).counts.tolist() == [k] * (k + 1)


RAISES, NOT_FINITE, LATE_SWEEP, NO_SWEEP = 1.0, 2.0, 3.0, 4.0


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
        if b.fault < LATE_SWEEP:
            return ball_sweep(d, v, a.radius + 1.0)
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


PAIR = "pair sphere_fragile of SphereCollider and FragileCollider of a query, entity 2"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "name", "error", "message"),
    [
        *((RAISES, name, ValueError, "broken glass") for name in ("point", "spheres", "nearest")),
        (NOT_FINITE, "point", PluginError, f"{PAIR} returned a contact that is not finite"),
        (NOT_FINITE, "spheres", PluginError, f"{PAIR} returned a contact that is not finite"),
        (LATE_SWEEP, "cast", PluginError, f"{PAIR}: its sweep returned a time that is not"),
    ],
)
def test_errors_in_functions_of_plugins_name_plugin_pair_and_entity(fault, name, error, message):
    world, entity = fragile_world(fault)
    for _ in range(2):
        with pytest.raises(error, match=message) as caught:
            QUERIES[name](world)
        assert fault != RAISES or caught.value.__notes__ == [f"plugin fragile: {PAIR}"]
    assert world.query_point((50.0, 0.0)) == [entity - 1]


def test_a_sweep_may_say_that_there_is_no_touch():
    assert QUERIES["cast"](fragile_world(NO_SWEEP)[0]) == []

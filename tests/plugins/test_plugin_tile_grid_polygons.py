"""Maps with slopes and half tiles against their tiles, each as a polygon: what stands, what is near, what overlaps."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_tiles import distance_to_polygons, polygons_of

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, capsule, convex_polygon, tile_grid
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.character import Character, Characters
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.tile_grid import TileGridCollider, TileShape

SOLID = tuple(shape for shape in TileShape if shape != TileShape.ONE_WAY)
SQUARE = np.array(((-1, -1), (1, -1), (1, 1), (-1, 1)))
MAKERS = {
    "one": lambda *args, **fields: (TileGridCollider(*args, **fields),),
    "two": TileGridCollider.floors_and_walls,
    "three": TileGridCollider.with_one_way,
}


def turned(corners, angle):
    c, s = np.cos(angle), np.sin(angle)
    return corners @ np.array(((c, s), (-s, c)))


def make_world(cells, shapes, make="one", mode="discrete", gravity=0.0):
    """make: one of MAKERS, or "polygons"."""
    world = World(
        Physics(2, gravity=(0, -gravity)), tile_grid.plugin, convex_polygon.plugin, capsule.plugin, Characters(),
        settings=Settings(collision=mode),
    )  # fmt: skip
    if make == "polygons":
        for corners in polygons_of(cells, shapes):
            world.create_entity(Transform((0, 0)), ConvexPolygonCollider(corners))
    else:
        for each in MAKERS[make](cells, 1.0, lower=(0, 0), shapes=shapes):
            world.create_entity(Transform((0, 0)), each)
    return world


def random_map(rng):
    """Of 5 x 5 cells, one at least with a shape."""
    shapes = rng.choice(SOLID, (5, 5)) * (rng.random((5, 5)) < 0.5)
    cells = rng.random((5, 5)) < 0.4
    cells[2, 2], shapes[2, 2] = True, rng.choice(SOLID[1:])
    return cells, shapes


def least_way_out(one, other):
    """Of two convex polygons: how far one has to move to part from the other; below 0: they are apart."""
    least = np.inf
    for corners in (one, other):
        for edge in np.roll(corners, -1, axis=0) - corners:
            out = np.array((edge[1], -edge[0])) / np.hypot(*edge)
            a, b = one @ out, other @ out
            least = min(least, a.max() - b.min(), b.max() - a.min())
    return least


@pytest.mark.parametrize("mode", ["discrete", "continuous"])
@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("hero", [False, True], ids=["body", "character"])
def test_what_overhangs_an_end_stands_on_it(mode, make, hero):
    """With its centre past either end of a row whose last tile is not full, as long as it is over it at all."""
    half, rng = 0.4, np.random.default_rng(3)
    colliders = (
        AABBCollider((half, half)), ConvexPolygonCollider(half * SQUARE), CapsuleCollider(half, 0.0),
        ConvexPolygonCollider(turned(half * SQUARE, 0.012)), ConvexPolygonCollider(turned(half * SQUARE, -0.012)),
    )  # fmt: skip
    for row in ([TileShape.LOWER_HALF], [0, 0, TileShape.UPPER_HALF], [TileShape.SLOPE_UP], [TileShape.SLOPE_DOWN]):
        cells, shapes = np.ones((1, len(row)), int), np.array([row])
        for collider in colliders:
            for end in (-1, 1):
                slope, over, heights = row[-1] in (TileShape.SLOPE_UP, TileShape.SLOPE_DOWN), rng.uniform(0.05, 0.3), []
                if slope and (isinstance(collider, CapsuleCollider) or (end > 0) != (row[-1] == TileShape.SLOPE_UP)):
                    continue  # on the peak only what is flat stands
                if isinstance(collider, CapsuleCollider):
                    over = -over  # what is round rolls off
                for one in (make, "polygons"):
                    world = make_world(cells, shapes, one, mode, gravity=10.0)
                    x = len(row) + over if end > 0 else -over
                    body = RigidBody(kind="kinematic" if hero else "dynamic")
                    top = 0.5 if row[0 if end < 0 else -1] == TileShape.LOWER_HALF else 1.0
                    entity = world.create_entity(Transform((x, top + 0.6)), body, collider.copy())
                    if hero:
                        world.add_component(entity, Character())
                    for _ in range(50):
                        world.step()
                    heights.append(world.component_for_entity(entity, Transform).y)
                    world.close()
                assert heights[0] == pytest.approx(heights[1], abs=0.01), (row, collider, end, over)
                assert heights[0] > top + 0.35, (row, collider, end, over)


def test_the_nearest_point_is_that_of_the_polygons():
    """Beside the map and far from it, too."""
    rng = np.random.default_rng(11)
    for _ in range(25):
        cells, shapes = random_map(rng)
        world, polygons = make_world(cells, shapes), polygons_of(cells, shapes)
        for _ in range(30):
            place = rng.uniform(-12, 17, 2) if rng.random() < 0.3 else rng.uniform(-1, 6, 2)
            away = distance_to_polygons(place, polygons)
            if away > 0.0:
                found = world.query_nearest(place)
                assert found.distance == pytest.approx(away, abs=1e-9)
                assert abs(distance_to_polygons(found.point, polygons)) < 1e-9
        world.close()


def test_boxes_overlap_where_they_do_the_polygons():
    """However deep; along the axes or turned; of one collider, and of two together."""
    rng, deep = np.random.default_rng(12), 0
    for make in ("one", "two"):
        for _ in range(12):
            cells, shapes = random_map(rng)
            world, polygons = make_world(cells, shapes, make), polygons_of(cells, shapes)
            for _ in range(40):
                place, half = rng.uniform(-0.5, 5.5, 2), rng.uniform(0.05, 0.6, 2)
                angle = rng.choice([0.0, 0.01, 0.5]) * rng.normal()
                box = turned(half * SQUARE, angle)
                depth = max(least_way_out(place + box, corners) for corners in polygons)
                if abs(depth) > 1e-6:
                    assert bool(world.overlaps(ConvexPolygonCollider(box), place)) == (depth > 0.0)
                    deep += depth > 0.3
                    if angle == 0.0:
                        assert bool(world.overlaps(AABBCollider(half), place)) == (depth > 0.0)
                        assert bool(world.query_aabb(place - half, place + half)) == (depth > 0.0)
            world.close()
    assert deep > 50


def test_a_little_overlap_with_one_tile_is_as_deep_as_with_its_polygon():
    """A face that is almost parallel to one of the tile's is not met beyond the corner there."""
    rng, met = np.random.default_rng(13), 0
    for shape in SOLID[1:]:
        world, tile = make_world([[1]], [[shape]]), np.array(shape.corners)
        for _ in range(200):
            place, half = rng.uniform(-0.6, 1.6, 2), rng.uniform(0.1, 0.6, 2)
            box = turned(half * SQUARE, rng.normal(0, 0.01))
            depth = least_way_out(place + box, tile)
            if 1e-6 < depth < 0.04:
                met += 1
                assert world.overlaps(ConvexPolygonCollider(box), place)[0].depth == pytest.approx(depth, abs=1e-4)
        world.close()
    assert met > 50


def test_nothing_passes_a_tile_in_steps_shorter_than_both():
    """A discrete body that moves by less than the tile's width and its own meets the tile: it does not keep its
    speed."""
    rng = np.random.default_rng(14)
    for shape in (TileShape.LOWER_HALF, TileShape.SLOPE_UP, TileShape.SLOPE_DOWN, TileShape.GENTLE_UP_HIGH):
        world, bodies = make_world([[1]], [[shape]]), []
        for _ in range(150):
            speed, half = rng.uniform(20, 60), rng.uniform(0.1, 0.6, 2)
            place = rng.uniform(-3, -2), rng.uniform(0, 0.4)
            body = RigidBody(linear_velocity=(speed, 0), gravity_scale=0.0)
            bodies.append((world.create_entity(Transform(place), body, AABBCollider(half, group=1)), speed))
        for _ in range(20):
            world.step()
        for entity, speed in bodies:
            assert world.component_for_entity(entity, RigidBody).linear_velocity[0] != speed
        world.close()


def test_what_falls_fast_on_one_way_cells_lands():
    """A discrete body that sinks in by less than its half in one step is held, on cells as on a box."""
    cells, shapes = np.ones((1, 4), int), np.full((1, 4), TileShape.ONE_WAY)
    for kind in (SphereCollider(0.5), AABBCollider((0.5, 0.5))):
        for start in np.linspace(1.6, 2.1, 6):
            world = make_world(cells, shapes, "three", gravity=10.0)
            entity = world.create_entity(Transform((2.0, start)), RigidBody(linear_velocity=(0, -22)), kind.copy())
            for _ in range(60):
                world.step()
            assert world.component_for_entity(entity, Transform).y == pytest.approx(1.5, abs=0.02)
            world.close()

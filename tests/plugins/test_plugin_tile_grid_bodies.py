"""Tile grids: queries, and bodies that slide, stand and fly among the tiles."""

from __future__ import annotations

import math
import runpy
from pathlib import Path

import numpy as np
import pytest
from helpers_tiles import boxes_of, distances

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, convex_polygon, tile_grid
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.joints import Hinge, Joints
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.plugins.tile_grid import TileGridCollider, cells_of_text

pytestmark = pytest.mark.slow  # its scenes compile for long

ROOT = Path(__file__).resolve().parents[2]


def make_world(gravity=(0, -10), others=False):
    """A world with only spheres and tiles, or with all shapes of the tests, so that tests share compiled code."""
    world = World(Physics(dimensions=2, gravity=gravity), convex_polygon.plugin, tile_grid.plugin)
    world.create_entity(Transform((0, -5000)), SphereCollider(1.0))
    if others:
        world.create_entity(Transform((0, -6000)), AABBCollider(1.0))
        world.create_entity(Transform((0, -7000)), ConvexPolygonCollider.box(1.0))
    return world


def run(world, steps):
    for _ in range(steps):
        world.step()


def test_queries_find_the_tiles():
    rng = np.random.default_rng(2)
    cells = rng.random((20, 30)) < 0.3
    low, high = boxes_of(cells, 0.7, (3.0, -2.0))
    world = make_world()
    grid = world.create_entity(Transform((3, -2)), TileGridCollider(cells, 0.7, lower=(0, 0)))
    world.step()
    points = rng.uniform((2, -3), (25, 13), (2000, 2))
    away = distances(points, low, high)
    near = world.query_nearests(points)
    np.testing.assert_allclose(near.distance[away > 0], away[away > 0], atol=1e-13)
    assert (near.distance[away == 0] <= 0).all()
    assert (np.diff(world.query_spheres(points, 0.3).offsets) == (away <= 0.3)).all()
    directions = rng.normal(size=points.shape)
    units = directions / np.linalg.norm(directions, axis=1)[:, None]
    one, two = (low - points[:, None]) / units[:, None], (high - points[:, None]) / units[:, None]
    enter, leave = np.minimum(one, two).max(2).clip(0), np.maximum(one, two).min(2)
    expected = np.where(enter <= leave, enter, np.inf).min(1)
    hits = world.ray_casts(points, directions, 20.0)
    np.testing.assert_array_equal(hits.entity == grid, expected <= 20)
    found = hits.entity == grid
    np.testing.assert_allclose(hits.distance[found], expected[found], atol=1e-12)
    outside = found & (away > 0)
    assert (abs(hits.normal[outside]).max(1) == 1.0).all()
    assert (np.einsum("nk,nk->n", hits.normal, units)[outside] < 0).all()


def test_rays_and_shapes_pass_close_by_walls():
    """A ray along a wall, very close to it, ends at the next one."""
    cells = cells_of_text("#" * 40 + "\n" + "." * 39 + "#\n" + "#" * 40)
    world = make_world()
    world.create_entity(Transform((0, 0)), TileGridCollider(cells, 1.0, lower=(0, 0)))
    world.step()
    for gap in (1e-3, 1e-9, 0.4):
        hit = world.ray_cast((0.5, 1 + gap), (1, 0), 100)[0]
        assert hit.distance == 38.5
        np.testing.assert_array_equal(hit.normal, (-1, 0))
        hit = world.shape_cast(SphereCollider(0.25), (0.5, 1.25 + gap), (100, 0))[0]
        assert hit.distance == pytest.approx(38.25, abs=1e-12)
        np.testing.assert_allclose(hit.normal, (-1, 0), atol=1e-9)


@pytest.mark.parametrize(("size", "halves"), [(0.7, (0.3,)), (0.5, (0.3, 0.5))])
def test_against_the_motion_the_next_wall_counts(size, halves):
    """Shapes slide along tiles that they touch, and fill corridors; the end of the way is a tile of the same map."""
    rng, tested = np.random.default_rng(8), 0
    cells = rng.random((12, 40)) < 0.35
    cells[[0, -1]] = cells[:, [0, -1]] = True
    world = make_world(others=True)
    grid = world.create_entity(Transform((0, 0)), TileGridCollider(cells, size, lower=(0, 0)))
    for row, column in np.argwhere(~cells).tolist():
        way = np.array(((1, 0), (-1, 0), (0, 1), (0, -1))[rng.integers(4)])
        across = rng.choice((-1, 1)) * way[::-1]  # towards the tile that it touches

        def is_tile(k, side, place=(row, column), way=way, across=across):
            x, y = k * way + side * across
            return cells[place[0] - y, place[1] + x]

        free = next(k for k in range(40) if is_tile(k + 1, 0))
        sides = [[is_tile(k, side) for k in range(free + 1)] for side in (1, -1)]
        for half in halves:
            if not (np.all(sides) if half == 0.5 else sides[0][0]):
                continue
            back = rng.random() * (1 - 2 * half)
            centre = np.array((column + 0.5, 11.5 - row)) + across * (0.5 - half) - way * (0.5 - half - back)
            for shape in (AABBCollider(size * half), SphereCollider(size * half)):
                (hit,) = world.shape_cast(shape, size * centre, 40 * way, against=True)
                assert hit.entity == grid
                assert hit.distance == pytest.approx(size * (free + 1 - 2 * half - back), abs=1e-9)
                np.testing.assert_allclose(hit.normal, -way, rtol=0, atol=1e-9)
                tested += 1
    assert tested > 100


def test_a_million_cells_and_an_empty_map():
    cells = np.zeros((1000, 1000), bool)
    cells[-1] = True
    world = make_world()
    world.create_entity(Transform((0, 0)), TileGridCollider(cells, 1.0, lower=(0, 0)))
    world.create_entity(Transform((0, 0)), TileGridCollider(np.zeros((3, 3), bool), 1.0, lower=(0, 0)))
    ball = world.create_entity(Transform((777.3, 1.6)), RigidBody(), SphereCollider(0.5))
    run(world, 60)
    np.testing.assert_allclose(world.component_for_entity(ball, Transform).position, (777.3, 1.5), atol=1e-3)
    assert world.query_nearest((500.0, 900.0)).distance == 899.1 - 0.1


def octagon(radius, **common):
    """Flat below; its half extent is the same on all sides."""
    angles = (np.arange(8) + 0.5) * math.pi / 4
    corners = np.stack((np.cos(angles), np.sin(angles)), 1) / math.cos(math.pi / 8)
    return ConvexPolygonCollider(radius * corners, **common)


def capsule(radius, **common):
    """Nearly a capsule, tilted; its box has the same half extent on all sides."""
    ends = np.array(((-0.5, -0.5), (0.5, 0.5), (0.5, 0.5), (-0.5, -0.5)))
    ends += np.array(((1, -1), (1, -1), (-1, 1), (-1, 1))) * 1e-6
    return ConvexPolygonCollider(radius * ends / abs(ends).max() / 2, corner_radius=radius / 2, **common)


SHAPES = {
    "sphere": lambda s, **common: SphereCollider(s, **common),
    "box": lambda s, **common: AABBCollider(s, **common),
    "polygon": octagon,
    "capsule": capsule,
}

# A channel, ragged outside: bodies that slide along its inner sides pass ends of columns of all lengths.
LENGTH = 60
CHANNEL = np.zeros((14, LENGTH), bool)
CHANNEL[[4, 9]] = True
CHANNEL[10:, ::3] = True
CHANNEL[11, ::2] = True
CHANNEL[:4, 1::4] = True
CHANNEL[2, ::5] = True
SPEEDS = (0.01, 0.3, 2.7, 31.0, 400.0)
SIZES = (0.07, 0.5, 1.4, 1.9)
SLIDES = [
    (shape, side, faces)
    for shape in SHAPES for side in ("floor", "ceiling", "left wall", "right wall") for faces in ("all", "two entities")
    if faces == "all" or shape in ("sphere", "box")
]  # fmt: skip


@pytest.mark.parametrize(("shape", "side", "faces"), SLIDES)
def test_sliding_bodies_feel_no_seams(shape, side, faces):
    """The velocity along the tiles of a body that is pressed onto them does not change."""
    cells = CHANNEL if side in ("floor", "ceiling") else CHANNEL.T
    down = {"floor": (0, -1), "ceiling": (0, 1), "left wall": (-1, 0), "right wall": (1, 0)}[side]
    down = np.array(down, float)
    along = np.array((abs(down[1]), abs(down[0])))
    world = make_world(gravity=10 * down, others=shape != "sphere")
    grids = [TileGridCollider(cells, 1.0, layer=2)]
    if faces != "all":
        grids = TileGridCollider.floors_and_walls(cells, 1.0, layer=2)
    for grid in grids:
        world.create_entity(Transform((0, 0)), grid)
    rng = np.random.default_rng(3)
    bodies = []
    for size in SIZES:
        for speed in SPEEDS:
            for e in (0.0, 0.6):
                # The channel is 4 m wide, centred on the map. The body starts anywhere along it, at rest or falling.
                place = -20 * along + rng.uniform(0, 1) * along + down * (2 - size - rng.choice((0.0, 0.01)))
                common = {"layer": 1, "mask": 2, "restitution": e}
                body = world.create_entity(
                    Transform(place), RigidBody(linear_velocity=speed * along), SHAPES[shape](size, **common)
                )
                bodies.append((body, size, speed))
    for step in range(60):
        world.step()
        for body, size, speed in bodies:
            if speed * (step + 1) / 60 > 44:
                continue  # beyond the end of the channel
            velocity = world.component_for_entity(body, RigidBody).linear_velocity
            position = world.component_for_entity(body, Transform).position
            assert velocity @ along == pytest.approx(speed, rel=1e-14), (size, speed, position)
            assert 2 - size - 0.05 < position @ down < 2 - size + 0.001 or step < 3


def corner_world(faces, shape, size, friction, **body):
    world = make_world(others=shape != "sphere")
    cells = np.zeros((8, 12), int)
    cells[-1], cells[:, 8:] = 1, 1
    grids = [TileGridCollider(cells, 1.0, lower=(0, 0))]
    if faces == "two entities":
        grids = TileGridCollider.floors_and_walls(cells, 1.0, lower=(0, 0))
    for grid in grids:
        world.create_entity(Transform((0, 0)), grid)
    entity = world.create_entity(
        Transform((8 - size - 0.1, 1 + size)), RigidBody(**body), SHAPES[shape](size, friction=friction)
    )
    return world, entity


@pytest.mark.parametrize("shape", ["sphere", "box", "polygon"])
@pytest.mark.parametrize("size", [0.1, 0.5, 1.7])
def test_pushed_against_a_wall_it_stands_still_on_the_floor(shape, size):
    """With floors and walls as two entities: 10 s, pushed by its own weight or walking into the wall."""
    for speed in (None, 5.0):
        world, entity = corner_world(
            "two entities", shape, size, 0.0, **({"constant_force": (10, 0)} if speed is None else {})
        )
        transform, body = (world.component_for_entity(entity, kind) for kind in (Transform, RigidBody))
        places = []
        for _ in range(600):
            if speed is not None:
                body.linear_velocity[0] = speed
            world.step()
            places.append(transform.position - (8 - size, 1 + size))
        late = np.array(places[60:])
        assert np.ptp(late, axis=0).max() < 1e-6  # jitter and drift, m
        # It overlaps the floor by 0.07 mm, and by 2 mm the wall that it walks into with 5 m/s in each step.
        assert late[:, 1].min() > -0.0001
        assert late[:, 0].max() < (0.0001 if speed is None else 0.003)


@pytest.mark.parametrize("shape", ["sphere", "box"])
@pytest.mark.parametrize("size", [0.1, 0.5])
def test_in_a_corner_of_one_collider_it_stays(shape, size):
    """One contact serves both sides: it yields by millimetres, and nothing gets through."""
    world, entity = corner_world("all", shape, size, 0.0, constant_force=(10, 0))
    transform, body = (world.component_for_entity(entity, kind) for kind in (Transform, RigidBody))
    places = []
    for _ in range(600):
        world.step()
        places.append(transform.position - (8 - size, 1 + size))
    late = np.array(places[60:])
    assert np.ptp(late, axis=0).max() < 0.005
    assert abs(late).max() < 0.005
    for _ in range(300):
        body.linear_velocity[0] = 5.0
        world.step()
        assert transform.x < 8 - size + 0.1  # at most its walk in a step, 83 mm, and a little
        assert transform.y > 1 + size - 0.05
    world, entity = corner_world("all", shape, size, 0.5, constant_force=(10, 0))
    places = []
    for _ in range(300):
        world.step()
        places.append(world.component_for_entity(entity, Transform).position.copy())
    assert np.ptp(places[60:], axis=0).max() < 1e-5  # friction stops it


@pytest.mark.parametrize("faces", ["all", "two entities"])
def test_nothing_gets_in_between_the_tiles(faces):
    """A closed cave with a ragged inside, bodies of all sizes thrown about in it for 5 s."""
    rng = np.random.default_rng(8)
    cells = rng.random((30, 30)) < 0.15
    cells[[0, 1, -1, -2]], cells[:, [0, 1, -1, -2]] = True, True
    world = make_world(others=True)
    grids = [TileGridCollider(cells, 1.0, lower=(0, 0), restitution=0.5)]
    if faces != "all":
        grids = TileGridCollider.floors_and_walls(cells, 1.0, lower=(0, 0), restitution=0.5)
    for grid in grids:
        world.create_entity(Transform((0, 0)), grid)
    low, high = boxes_of(cells, 1.0)
    places = rng.uniform(2, 28, (2000, 2))
    places = places[distances(places, low, high) > 0.45][:120]
    makers = list(SHAPES.values())
    bodies = [
        world.create_entity(Transform(place), RigidBody(linear_velocity=rng.normal(size=2) * 6),
                            makers[k % 4](rng.uniform(0.1, 0.3), layer=2, mask=1))
        for k, place in enumerate(places)
    ]  # fmt: skip
    run(world, 300)
    ends = np.array([world.component_for_entity(body, Transform).position for body in bodies])
    assert np.isfinite(ends).all()
    assert distances(ends, low, high).min() > 0.05  # no centre is in a tile or near it
    assert ((ends > 2) & (ends < 28)).all()


def test_the_example_runs_to_the_end_of_the_map(capsys):
    path = np.array(runpy.run_path(str(ROOT / "examples" / "tile_map.py"))["main"]())
    assert path[-1, 0] == pytest.approx(58.65, abs=0.01)  # 59 m less half its width
    assert np.diff(path[:, 0]).min() > -0.02  # it is never thrown back
    assert path[:, 1].min() > 1.4
    assert len(capsys.readouterr().out.splitlines()) == 12


@pytest.mark.long
@pytest.mark.parametrize("mode", ["discrete", "continuous"])
def test_a_chain_of_boxes_put_into_rock_stays_finite(mode):
    """Deep in a map there is no face of a kind at either end of a box's way: no contact then, and no infinite gap."""
    for seed in (59001,):
        rng, rows = np.random.default_rng([seed, 5]), []
        rng.choice(("a", "b", "c"))
        for _ in range(8):
            rows.append("#" + "".join(rng.choice(list("....#="), 18)) + "#")
        text = "\n".join(["#" * 20, *rows, "#" * 20])
        cells, shapes = tile_grid.map_of_text(text, {"=": tile_grid.TileShape.ONE_WAY})
        plugins = Rotation(), Joints(), convex_polygon.plugin, tile_grid.plugin
        world = World(Physics(2, gravity=(0, -20)), *plugins, settings=Settings(collision=mode, on_fault="ignore"))
        for each in TileGridCollider.with_one_way(cells, 1.0, lower=(0, 0), shapes=shapes):
            world.create_entity(Transform((0, 0)), each)
        last = None
        for k in range(5):
            collider = BoxCollider((0.3, 0.3), friction=0.5)
            box = world.create_entity(Transform((2.5 + k, 7.5)), RigidBody(), collider, Spin())
            if last is not None:
                world.create_entity(Hinge(last, box, anchor=(2.0 + k, 7.5)))
            last = box
        for _ in range(30):
            world.step()
        assert np.isfinite(world.bodies.position).all()
        world.close()

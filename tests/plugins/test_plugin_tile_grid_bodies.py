"""Bodies on tile maps: no seams, no motion at rest in a corner, no body between tiles."""

from __future__ import annotations

import math
import runpy
from pathlib import Path

import numpy as np
import pytest
from helpers_tile_grid import boxes_of, distances, make_world, run

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.tile_grid import TileGridCollider

pytestmark = pytest.mark.slow  # its scenes compile for long

ROOT = Path(__file__).resolve().parents[2]


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
QUICK_SLIDES = {("sphere", "floor", "all"), ("sphere", "left wall", "two entities")}


@pytest.mark.parametrize(("shape", "side", "faces"), [
    pytest.param(*slide, marks=() if slide in QUICK_SLIDES else pytest.mark.slow) for slide in SLIDES
])  # fmt: skip
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


@pytest.mark.parametrize("shape", ["sphere", *(pytest.param(s, marks=pytest.mark.slow) for s in ("box", "polygon"))])
@pytest.mark.parametrize("size", [0.5, *(pytest.param(size, marks=pytest.mark.slow) for size in (0.1, 1.7))])
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


@pytest.mark.parametrize("shape", ["sphere", pytest.param("box", marks=pytest.mark.slow)])
@pytest.mark.parametrize("size", [pytest.param(0.1, marks=pytest.mark.slow), 0.5])
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


@pytest.mark.parametrize("others", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_it_bounces_at_the_right_height_wherever_it_meets_the_tiles(others):
    world = make_world(others=others)
    world.create_entity(Transform((0, 0)), TileGridCollider(CHANNEL, 1.0, lower=(0, -5)))
    balls = []
    for k, x in enumerate(np.linspace(3, 9, 25)):
        maker = list(SHAPES.values())[k % 4 if others else 0]
        shape = maker(0.5, restitution=0.8, layer=2, mask=1)
        balls.append(world.create_entity(Transform((x, 2.0)), RigidBody(), shape))
    tops = np.zeros(len(balls))
    for step in range(80):
        world.step()
        places = np.array([world.component_for_entity(ball, Transform).position for ball in balls])
        if step > 40:
            tops = np.maximum(tops, places[:, 1])
    np.testing.assert_array_equal(places[:, 0], np.linspace(3, 9, 25))
    np.testing.assert_allclose(tops - 0.5, 0.64 * 1.5, rtol=0.01)  # the floor is at y = 0; a step's sampling


@pytest.mark.slow
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


def test_a_tile_dug_away_lets_them_fall():
    world = make_world()
    grid = world.create_entity(Transform((0, 0)), TileGridCollider(np.ones((1, 9), bool), 1.0, lower=(0, 0)))
    ball = world.create_entity(Transform((4.5, 1.4)), RigidBody(), SphereCollider(0.4))
    run(world, 30)
    assert world.component_for_entity(ball, Transform).y == pytest.approx(1.4, abs=1e-3)
    tiles = world.component_for_entity(grid, TileGridCollider)
    cells = tiles.cells
    cells[0, 4] = False
    tiles.cells = cells
    run(world, 60)
    assert world.component_for_entity(ball, Transform).y < -1


@pytest.mark.slow
def test_the_example_runs_to_the_end_of_the_map(capsys):
    path = np.array(runpy.run_path(str(ROOT / "examples" / "tile_map.py"))["main"]())
    assert path[-1, 0] == pytest.approx(58.65, abs=0.01)  # 59 m less half its width
    assert np.diff(path[:, 0]).min() > -0.02  # it is never thrown back
    assert path[:, 1].min() > 1.4
    assert len(capsys.readouterr().out.splitlines()) == 12

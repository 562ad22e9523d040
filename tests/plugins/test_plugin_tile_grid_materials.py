"""Maps of several materials: friction, bounces and belts of the cell that is touched, changes, what is stored."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from helpers_character import FIGURES, Stage

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, tile_grid
from carom.plugins.tile_grid import TileGridCollider, TileMaterial, TileShape, map_of_text
from carom.plugins.tile_grid.faces import FACES

G, DT = 10.0, 1 / 60
WRONG: Any = ({1: 0.5}, [TileMaterial()], {"#": 0.5})
MODES = ("discrete", "continuous", "event_driven")
each_mode = pytest.mark.parametrize("mode", MODES)


def make_world(cells, materials, mode="discrete", **fields):
    """A world with that map, its lower left corner at 0; (world, entity of the map)."""
    settings = Settings(collision=mode, friction_mixing="min")
    world = World(Physics(dimensions=2, gravity=(0, -G)), tile_grid.plugin, settings=settings)
    return world, world.create_entity(
        Transform((0, 0)), TileGridCollider(cells, 1.0, lower=(0, 0), materials=materials, **fields)
    )


def body_at(world, place, collider, velocity=(0, 0)):
    return world.create_entity(Transform(place), RigidBody(linear_velocity=velocity), collider)


def run(world, steps):
    for _ in range(steps):
        world.step()


def place(world, entity):
    return tuple(world.component_for_entity(entity, Transform).position)


def velocity(world, entity):
    return tuple(world.component_for_entity(entity, RigidBody).linear_velocity)


@each_mode
def test_what_slides_stops_where_the_frictions_of_its_cells_say(mode):
    """v^2 / 2 mu g on each stretch; a step sees the friction of where it begins, so each change comes by v dt later."""
    rng = np.random.default_rng(11)
    for shape in (SphereCollider(0.3, friction=0.4), AABBCollider(0.3, friction=0.4)):
        speed, length = rng.uniform(4, 6), int(rng.integers(3, 6))
        cells = [[1] * 4 + [2] * length + [3] * 60]
        materials = {1: TileMaterial(friction=0.0), 2: TileMaterial(friction=0.1), 3: TileMaterial(friction=0.15)}
        world, _ = make_world(cells, materials, mode, friction=0.9)
        slider = body_at(world, (2.0, 1.3), shape, (speed, 0))
        run(world, 420)
        there = 4 + length + (speed**2 - 2 * 0.1 * G * length) / (2 * 0.15 * G)
        assert abs(place(world, slider)[0] - there) < speed * DT
        assert velocity(world, slider)[0] == pytest.approx(0.0, abs=1e-9)


@each_mode
def test_each_cell_bounces_by_its_restitution(mode):
    """Speed after over before, for balls that fall on the middles of cells; gravity acts for a step besides."""
    es = (0.0, 0.3, 0.6, 1.0)
    world, _ = make_world([[1, 2, 3, 4]], {k + 1: TileMaterial(restitution=e) for k, e in enumerate(es)}, mode)
    balls = [body_at(world, (k + 0.5, 2.25), SphereCollider(0.25)) for k in range(4)]
    most = np.zeros(4)
    for _ in range(45):
        world.step()
        most = np.maximum(most, [velocity(world, ball)[1] for ball in balls])
    assert abs(most - np.array(es) * math.sqrt(2 * G)).max() < 2 * G * DT
    assert most[0] < 1e-9


@each_mode
def test_belts_run_as_their_cells_say(mode):
    """Up to the speed of the belt, at mu g; on the next belt to that of that one. The others stand."""
    cells = [[1] * 8 + [2] * 12 + [3] * 12]
    materials = {1: TileMaterial(surface_velocity=2.0), 2: TileMaterial(surface_velocity=(3.0, 0.0))}
    world, _ = make_world(cells, materials, mode, friction=0.5)
    rider, still = (body_at(world, (x, 1.3), SphereCollider(0.3)) for x in (1.0, 25.5))
    run(world, round(2.0 / (0.5 * G) / DT))
    assert velocity(world, rider)[0] == pytest.approx(2.0, abs=1e-9)
    while place(world, rider)[0] < 10.0:
        world.step()
    assert velocity(world, rider)[0] == pytest.approx(3.0, abs=1e-9)
    assert place(world, still) == pytest.approx((25.5, 1.3), abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["box 2D", "capsule 2D"])
def test_a_character_rides_the_belt_of_its_cell(name):
    """Where it stands in the middle of a cell, and where its middle is beyond the last one."""
    materials = {1: TileMaterial(surface_velocity=2.0), 2: TileMaterial(surface_velocity=-1.0)}
    for x, speed in ((1.0, 2.0), (6.0, 0.0), (11.0, -1.0), (12.1, -1.0)):
        stage = Stage(FIGURES[name], x=x, y=1.0)
        tiles = TileGridCollider([[1] * 4 + [3] * 4 + [2] * 4], 1.0, lower=(0, 0), materials=materials)
        stage.world.create_entity(Transform((0, 0)), tiles)
        stage.run(10)
        before = stage.place.x
        stage.run(30)
        assert stage.me.state == "floor"
        assert stage.place.x - before == pytest.approx(0.5 * speed, abs=1e-9)


def test_a_cell_that_gets_another_material_rubs_at_once():
    """And is the same by other ways: assigned, from a snapshot, made so."""
    materials = {2: TileMaterial(friction=0.0)}
    world, ground = make_world([[1] * 40], materials, friction=0.5)
    slider = body_at(world, (1.5, 1.3), SphereCollider(0.3), (5, 0))
    run(world, 3)
    slowed = velocity(world, slider)[0]
    assert slowed < 5 - 2 * DT
    snapshot = world.snapshot()
    tiles = world.component_for_entity(ground, TileGridCollider)
    tiles.set([(0, x) for x in range(40)], 2)
    changed = world.state_hash()
    run(world, 20)
    assert velocity(world, slider)[0] == slowed
    assert tiles.material_of(0, 3) == 2
    world.restore(snapshot)
    tiles = world.component_for_entity(ground, TileGridCollider)
    assert tiles.material_of(0, 3) == 1
    tiles.cells = np.full((1, 40), 2)
    assert world.state_hash() == changed
    run(world, 20)
    assert velocity(world, slider)[0] == slowed


@pytest.mark.plain
@pytest.mark.parametrize("seed", range(4))
def test_numbers_and_shapes_are_kept(seed):
    rng = np.random.default_rng(seed)
    size = tuple(rng.integers(1, 45, 2))
    cells, shapes = rng.integers(0, 6, size), rng.integers(0, len(TileShape), size)
    fields: Any = {"materials": {5: TileMaterial(0.1, 0.2, 3.0)}, "faces": "one_way"}
    tiles = TileGridCollider(cells, 0.5, shapes=shapes, **fields)
    for _ in range(30):
        at, number, shape = tuple(rng.integers(0, size)), *rng.integers(0, (256, len(TileShape))).tolist()
        tiles.set(at, number, shape)
        cells[at], shapes[at] = number, shape
        assert tiles.material_of(*at) == number
    assert np.array_equal(tiles.cells, cells)
    assert np.array_equal(tiles.shapes, np.where(cells > 0, shapes, 0))
    assert tiles.materials == {5: TileMaterial(0.1, 0.2, (3.0, 0.0))}
    again = TileGridCollider(tiles.cells, 0.5, shapes=tiles.shapes, **fields)
    assert np.array_equal(again.packed, tiles.packed)


@pytest.mark.plain
def test_a_legend_reads_materials_and_shapes():
    text = """
       ./~
       ###
    """
    cells, shapes = map_of_text(text, {"/": TileShape.SLOPE_UP, "~": (2, TileShape.LOWER_HALF)})
    assert cells.tolist() == [[0, 1, 2], [1, 1, 1]]
    assert shapes.tolist() == [[0, TileShape.SLOPE_UP, TileShape.LOWER_HALF], [0, 0, 0]]


@pytest.mark.plain
@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: TileGridCollider([[256]], 1.0, materials={}), r"1 to 255.*got 256 at row 0, column 0"),
        (lambda: TileGridCollider([[1]], 1.0, materials={0: TileMaterial()}), "numbers are 1 to 255, got 0"),
        (lambda: TileGridCollider([[1]], 1.0, materials=WRONG[0]), "number 1 must be a TileMaterial, got 0.5"),
        (lambda: TileGridCollider([[1]], 1.0, materials=WRONG[1]), "must be a dict of TileMaterial"),
        (lambda: TileMaterial(friction=-1.0), "TileMaterial.friction must be at least 0"),
        (lambda: TileMaterial(surface_velocity=(1, 2, 3)), "TileMaterial.surface_velocity must be a number or 2"),
        (lambda: TileGridCollider([[1]], 1.0, shapes=[[16]]), "0 to 15, got 16 at row 0, column 0"),
        (lambda: TileGridCollider([[1]], 1.0, shapes=[1]), r"must have the shape \(1, 1\)"),
        (lambda: TileGridCollider([[1]], 1.0).set((0, 0), 1, TileShape.SLOPE_UP), "full tiles only"),
        (lambda: TileGridCollider([[1]], 1.0, materials={}).set((0, 0), 300), "1 to 255, got 300"),
        (lambda: TileGridCollider([[1]], 1.0, materials={}).set((0, 0), 1, 16), "must be a TileShape"),
        (lambda: TileGridCollider([[1]], 1.0).material_of(1, 0), "material_of: the map has 1 rows and 1 columns"),
        (lambda: map_of_text("#", WRONG[2]), "legend"),
    ],
)  # fmt: skip
def test_what_is_refused(make, match):
    with pytest.raises(ValueError, match=match):
        make()


def test_pictures_show_what_each_cell_fills():
    """A half, three quarters, a quarter of a tile; one-way cells as a strip, on their own collider."""
    shapes = np.arange(16).reshape(2, 8)
    areas = []
    for grid in TileGridCollider.with_one_way(np.ones((2, 8), int), 0.5, shapes=shapes, walls=False):
        fields = SimpleNamespace(packed=grid.packed, tile_size=0.5, faces=FACES.index(grid.faces))
        corners, faces = TileGridCollider.outline(fields, 2)
        rings = [corners[face] for face in faces]
        areas.append([0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() for x, y in (ring.T for ring in rings)])
    solid, one_way = (np.array(area) / 0.25 for area in areas)
    assert np.allclose(solid, [1, *[0.5] * 4, 0.25, 0.75, 0.75, 0.25, 0.75, 0.25, 0.25, 0.75, 0.5, 0.5])
    assert np.allclose(one_way, 0.125)

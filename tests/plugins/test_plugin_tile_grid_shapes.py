"""Maps with slopes, half tiles and one-way cells: distances, seams, closed forms on slopes, what passes from below."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from helpers_character import FIGURES, Stage
from helpers_tiles import distance_to_polygons, polygons_of, way_to_polygons
from worlds import position, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Phase, Settings, StepError, System, World
from carom.plugins import Physics, capsule, convex_polygon, terrain, tile_grid
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.terrain import create_chain
from carom.plugins.tile_grid import TileGridCollider, TileShape, map_of_text

G, DT = 10.0, 1 / 60
MODES = ("discrete", "continuous", "event_driven")
each_mode = pytest.mark.parametrize("mode", MODES)
LEGEND = {
    "/": TileShape.SLOPE_UP, "\\": TileShape.SLOPE_DOWN, "1": TileShape.GENTLE_UP_LOW, "2": TileShape.GENTLE_UP_HIGH,
    "3": TileShape.GENTLE_DOWN_HIGH, "4": TileShape.GENTLE_DOWN_LOW, "_": TileShape.LOWER_HALF,
    "-": TileShape.UPPER_HALF, "=": TileShape.ONE_WAY,
}  # fmt: skip
FLAT_ON_TOP = tuple(
    shape for shape in TileShape if {(0.0, 1.0), (1.0, 1.0)} <= set(shape.corners) or shape == TileShape.ONE_WAY
)
# Bodies that do not turn, and how far their lowest point is below their centre.
BODIES = {
    "ball": (SphereCollider(0.35), 0.35),
    "box": (AABBCollider((0.3, 0.4)), 0.4),
    "capsule": (CapsuleCollider(0.25, 0.2), 0.45),
    "polygon": (ConvexPolygonCollider(((-0.3, -0.3), (0.3, -0.3), (0.4, 0.1), (0.0, 0.4))), 0.3),
}


def make_world(mode: str = "discrete", *colliders: Any):
    plugins = (tile_grid.plugin, capsule.plugin, convex_polygon.plugin, terrain.plugin)
    world = World(Physics(dimensions=2, gravity=(0, -G)), *plugins, settings=Settings(collision=mode))
    for collider in colliders:
        world.create_entity(Transform((0, 0)), collider)
    return world


def single(*args, **fields):
    return (TileGridCollider(*args, **fields),)


def grids(text, make: Any = TileGridCollider.floors_and_walls, **fields):
    """The colliders of a map with its lower left corner at 0."""
    cells, shapes = map_of_text(text, LEGEND)
    return make(cells, 1.0, lower=(0, 0), shapes=shapes, **fields)


def body_at(world, x, y, collider, velocity=(0, 0)):
    """It meets no other body."""
    own = collider.copy()
    own.group = 1
    return world.create_entity(Transform((x, y)), RigidBody(linear_velocity=velocity), own)


def track(world, entity, steps):
    """(steps, 4): place and velocity after each step."""
    rows = []
    for _ in range(steps):
        world.step()
        rows.append((*position(world, entity), *velocity(world, entity)))
    return np.array(rows)


def random_map(rng, share):
    """(cells, shapes) of a few rows and columns, no one-way cells, one slope at least."""
    size = tuple(rng.integers(2, 8, 2))
    shapes = rng.integers(0, TileShape.ONE_WAY, size) * (rng.random(size) < 0.6)
    cells = rng.random(size) < share
    cells[0, 0], shapes[0, 0] = True, TileShape.SLOPE_UP
    return cells, shapes


@pytest.mark.plain
def test_corners_fill_what_sides_and_lines_say():
    """Area by the corners; half of what a slope leaves open is what its ceiling fills."""
    areas = []
    for shape in TileShape:
        corners = np.array(shape.corners).reshape(-1, 2)
        ahead = np.roll(corners, -1, axis=0)
        areas.append(0.5 * (corners[:, 0] * ahead[:, 1] - corners[:, 1] * ahead[:, 0]).sum())
    assert areas == [1, *[0.5] * 4, 0.25, 0.75, 0.75, 0.25, 0.75, 0.25, 0.25, 0.75, 0.5, 0.5, 0]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_overlaps_are_those_with_the_polygons(seed):
    """A circle overlaps where its distance to the polygons is less than the radius, by as much; in corners by more."""
    rng, touching = np.random.default_rng(seed), 0
    for _ in range(5):
        cells, shapes = random_map(rng, 0.6)
        polygons = polygons_of(cells, shapes)
        world = make_world("discrete", TileGridCollider(cells, 1.0, lower=(0, 0), shapes=shapes))
        for _ in range(40):
            place, radius = rng.uniform(-0.5, np.array(cells.shape[::-1]) + 0.5), rng.choice([0.1, 0.3, 0.45, 0.7])
            away = distance_to_polygons(place, polygons)
            if away <= 0.0 or abs(away - radius) < 1e-9:
                continue
            found = world.overlaps(SphereCollider(radius), place)
            assert len(found) == (away < radius), (place, radius, away)
            if len(found):
                touching += 1
                assert found[0].depth > radius - away - 1e-9
                if radius < 0.2:
                    assert found[0].depth < math.sqrt(2.0) * (radius - away) + 1e-9 or radius - away > 0.05
        world.close()
    assert touching > 40


@pytest.mark.slow
@pytest.mark.plain
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.compiled) for seed in (1, 2, 3))])
def test_casts_end_where_the_polygons_begin(seed):
    rng, hits = np.random.default_rng(100 + seed), 0
    for _ in range(5):
        cells, shapes = random_map(rng, 0.4)
        polygons = polygons_of(cells, shapes)
        world = make_world("discrete", TileGridCollider(cells, 1.0, lower=(0, 0), shapes=shapes))
        for _ in range(15):
            start, radius = rng.uniform(-1.5, np.array(cells.shape[::-1]) + 1.5), rng.choice([0.05, 0.1, 0.3, 0.45])
            angle, size = rng.uniform(0, 2 * math.pi), rng.uniform(1, 12)
            way = size * np.array((math.cos(angle), math.sin(angle)))
            if distance_to_polygons(start, polygons) < radius + 1e-6:
                continue
            share = way_to_polygons(start, way, radius, polygons)
            found = world.shape_cast(SphereCollider(radius), start, way)
            assert len(found) == (share is not None), (start, way, radius)
            hits += len(found)
            if share is not None:
                assert abs(found[0].fraction - share) * size < 1e-6
        world.close()
    assert hits > 10


@pytest.mark.slow
@each_mode
@pytest.mark.parametrize("name", BODIES)
def test_seams_of_level_tiles_are_silent(mode, name):
    """Of all shapes that are level on top, one-way cells among them, in any order: speed and height stay, both ways."""
    collider, foot = BODIES[name]
    for seed in range(3):
        rng = np.random.default_rng(seed)
        shapes = np.array(FLAT_ON_TOP)[rng.integers(0, len(FLAT_ON_TOP), (1, 24))]
        ground = TileGridCollider.with_one_way(np.ones((1, 24), int), 1.0, lower=(0, 0), shapes=shapes)
        world, speed = make_world(mode, *ground), rng.uniform(2, 6)
        right, left = (body_at(world, x, y, collider, (v, 0)) for x, y, v in ((2, 1 + foot, speed), (22, 3, -speed)))
        rows = track(world, right, 150)
        assert abs(rows[:, 2] - speed).max() < 1e-9
        assert abs(rows[:, 1] - 1 - foot).max() < 0.005
        assert velocity(world, left)[0] == pytest.approx(-speed, abs=1e-9)  # it has fallen on it
        assert position(world, left)[1] == pytest.approx(1 + foot, abs=0.005)
        world.close()


@pytest.mark.slow
@each_mode
@pytest.mark.parametrize("fields", [{}, {"make": single}], ids=["two", "one"])
@pytest.mark.parametrize("slope", [1.0, 0.5])
def test_slopes_accelerate_by_gravity_less_friction(mode, slope, fields):
    """g (sin a - mu cos a) from cell to cell, to rounding; nothing where friction holds."""
    n, a = 14, math.atan(slope)
    text = "\n".join("#" * k + "\\" if slope == 1.0 else "##" * k + "34" for k in range(n))
    out = np.array((math.sin(a), math.cos(a)))
    for mu in (0.0, 0.3, 0.9):
        world = make_world(mode, *grids(text, friction=mu, **fields))
        bodies = []
        for k, (collider, away) in enumerate(((SphereCollider(0.35), 0.35), (AABBCollider(0.3), 0.3 * out.sum()))):
            collider.friction = mu
            x, y = np.array((2.0 + k, n - slope * (2.0 + k))) + away * out
            bodies.append(body_at(world, x, y, collider))
        want = max(0.0, G * (math.sin(a) - mu * math.cos(a)))
        for step in range(1, 76):
            world.step()
            for body in bodies:
                assert np.linalg.norm(velocity(world, body)) == pytest.approx(want * step * DT, abs=1e-9)
        world.close()


HILL = r"""
    ....12#\.......
    .12#####34.....
    ###############
"""
GROUND = ((0, 1), (1, 1), (3, 2), (4, 2), (6, 3), (7, 3), (8, 2), (10, 1), (15, 1))  # its outline


@pytest.mark.slow
@each_mode
@pytest.mark.parametrize("name", BODIES)
def test_a_hill_is_as_its_outline(mode, name):
    """What goes up does as on a chain of segments, to rounding, until it leaves the first slope; and gains nothing."""
    collider, foot = BODIES[name]
    runs = []
    for chain in (True, False):
        world = make_world(mode, *(() if chain else grids(HILL)))
        if chain:
            create_chain(world, GROUND)
        runs.append(track(world, body_at(world, 0.45, 1 + foot, collider, (9.0, 0)), 16))
        world.close()
    on_slope = runs[0][:, 0] < 2.5
    assert on_slope.sum() >= 8
    assert abs(runs[0] - runs[1])[on_slope].max() < 1e-9
    energy = 0.5 * (runs[1][:, 2:] ** 2).sum(1) + G * runs[1][:, 1]
    assert np.diff(energy).max() < 0.01  # 46 J/kg


@pytest.mark.slow
@pytest.mark.parametrize("name", ["box 2D", "capsule 2D"])
def test_a_character_walks_over_hills(name):
    """At its speed, on the floor all the way, and as high as on the outline, with one collider and with two."""
    tracks = []
    for make in (None, single, TileGridCollider.floors_and_walls):
        stage = Stage(FIGURES[name], x=0.8, y=1.0)
        for collider in () if make is None else grids(HILL, make=make):
            stage.world.create_entity(Transform((0, 0)), collider)
        if make is None:
            create_chain(stage.world, GROUND)
        stage.run(5)
        stage.me.move = 2.5
        tracks.append(stage.run(320))
        assert set(tracks[-1].state) == {"floor"}
        assert tracks[-1].x[-1] > 10.0
    for found in tracks[1:]:
        for x in np.linspace(1.0, 10.0, 91):
            heights = [np.interp(x, path.x, path.y) for path in (tracks[0], found)]
            assert heights[0] == pytest.approx(heights[1], abs=0.02)


LADDER = """
    ...
    ===
    ===
    ===
    ###
"""


@pytest.mark.slow
@each_mode
@pytest.mark.parametrize("name", BODIES)
def test_what_jumps_passes_one_way_cells_and_lands_on_them(mode, name):
    """Platforms one above the other: it comes up through the next one, lands there, and never falls through."""
    collider, foot = BODIES[name]
    world = make_world(mode, *grids(LADDER, make=TileGridCollider.with_one_way))
    jumper = body_at(world, 1.5, 1 + foot, collider)
    for floor in (2.0, 3.0, 4.0):
        world.component_for_entity(jumper, RigidBody).linear_velocity = (0, 5.2)
        heights = track(world, jumper, 90)[:, 1] - foot
        assert heights.max() == pytest.approx(floor - 1.0 + 5.2**2 / (2 * G), abs=5.2 * DT)
        assert heights[-1] == pytest.approx(floor, abs=0.005)
        assert heights[60:].min() > floor - 0.01


def test_a_character_jumps_up_through_one_way_cells_and_drops():
    stage = Stage(FIGURES["box 2D"], x=1.5, y=1.0)
    for collider in grids(LADDER.replace("===\n    ===\n", "===\n    ...\n"), make=TileGridCollider.with_one_way):
        stage.world.create_entity(Transform((0, 0)), collider)
    stage.run(5)
    stage.me.jump = True
    stage.run(60)
    assert stage.place.y - stage.stands == pytest.approx(2.0, abs=1e-6)
    stage.me.drop = True
    stage.run(60)
    assert stage.place.y - stage.stands == pytest.approx(1.0, abs=1e-6)


def test_half_tiles_leave_half_of_their_cells():
    """A body of .4 goes between a lower and an upper half one cell above, and stands half a tile high."""
    world = make_world("discrete", *grids("------------\n____________"))
    ball = body_at(world, 1.0, 0.9, SphereCollider(0.2), (4, 0))
    assert track(world, ball, 60)[-1] == pytest.approx((5.0, 0.7, 4.0, 0.0), abs=0.02)


@pytest.mark.plain
def test_a_cell_that_gets_another_shape_is_that_at_once():
    """In the next step, for sleepers too; a step that fails and a snapshot put it back."""
    cells, shapes = map_of_text("....\n####", LEGEND)
    plugins = (tile_grid.plugin, capsule.plugin, convex_polygon.plugin, terrain.plugin)
    world = World(Physics(dimensions=2, gravity=(0, -G)), *plugins, settings=Settings(sleeping=True))
    ground = world.create_entity(Transform((0, 0)), TileGridCollider(cells, 1.0, lower=(0, 0), shapes=shapes))
    ball = body_at(world, 1.5, 1.3, SphereCollider(0.3))
    track(world, ball, 90)
    assert world.component_for_entity(ball, RigidBody).asleep
    snapshot, before = world.snapshot(), world.state_hash()
    tiles = world.component_for_entity(ground, TileGridCollider)
    tiles.set((1, 1), 1, shape=TileShape.LOWER_HALF)
    assert tiles.shapes[1].tolist() == [0, TileShape.LOWER_HALF, 0, 0]
    assert track(world, ball, 60)[-1, 1] == pytest.approx(0.8, abs=0.005)
    world.restore(snapshot)
    assert world.state_hash() == before
    world.add_system(BuildsAndFails(ground))
    with pytest.raises(StepError):
        world.step()
    assert world.state_hash() == before


class BuildsAndFails(System):
    phase = Phase.START

    def __init__(self, ground):
        self.ground = ground

    def process(self, dt):
        self.world.component_for_entity(self.ground, TileGridCollider).set((1, 2), 1, shape=TileShape.SLOPE_UP)
        raise RuntimeError("on purpose")


@pytest.mark.plain
def test_what_is_refused():
    with pytest.raises(ValueError, match="faces='one_way' needs shapes"):
        TileGridCollider([[1]], 1.0, faces="one_way")
    with pytest.raises(ValueError, match="with_one_way makes all of them"):
        TileGridCollider([[1]], 1.0, shapes=[[TileShape.ONE_WAY]])


@pytest.mark.long
@each_mode
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("make", [single, TileGridCollider.floors_and_walls], ids=["one", "two"])
def test_heaps_in_random_maps_come_to_rest_outside_of_tiles(mode, seed, make):
    """Of all shapes, in a closed cave: nothing gets out, sinks in with its centre, or moves in the end."""
    rng, size = np.random.default_rng(seed), (14, 24)
    cells, shapes = rng.random(size) < 0.25, rng.integers(0, TileShape.ONE_WAY, size) * (rng.random(size) < 0.6)
    for edge in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]):
        cells[edge], shapes[edge] = True, TileShape.FULL
    world = make_world(mode, *make(cells, 1.0, lower=(0, 0), shapes=shapes, friction=0.3))
    bodies = []
    while len(bodies) < 16:
        place, kind = rng.uniform((1, 1), (23, 13)), list(BODIES)[len(bodies) % len(BODIES)]
        if distance_to_polygons(place, polygons_of(cells, 0 * shapes)) > 0.5:
            entity = world.create_entity(Transform(place), RigidBody(linear_velocity=rng.normal(0, 2, 2)))
            world.add_component(entity, BODIES[kind][0].copy())
            bodies.append(entity)
    track(world, bodies[0], 600)
    polygons = polygons_of(cells, shapes)
    for body in bodies:
        x, y = position(world, body)
        assert 0 < x < 24
        assert 0 < y < 14
        assert distance_to_polygons(np.array((x, y)), polygons) > 0.1
        assert np.linalg.norm(velocity(world, body)) < 0.5

"""Terrain in 3D: fields of heights and meshes of triangles under what rolls, slides and falls on them."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from worlds import position, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, capsule, convex_hull, terrain
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_hull import ConvexHullCollider
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.plugins.terrain import create_height_field, create_triangle_mesh

pytestmark = pytest.mark.slow  # its shapes take long to compile

G = 10.0
MODES = ("discrete", "continuous", "event_driven")
each_mode = pytest.mark.parametrize("mode", MODES)
SIDE = 25  # points of the hills along each axis


def make_world(gravity=(0.0, -G, 0.0), **settings):
    plugins = Rotation(), terrain.plugin, capsule.plugin, convex_hull.plugin
    return World(Physics(dimensions=3, gravity=gravity), *plugins, settings=Settings(**settings))


def throw(world, place, velocity, shape, spin=None):
    parts = [Transform(place), RigidBody(linear_velocity=velocity), shape]
    return world.create_entity(*parts, *(() if spin is None else (Spin(spin),)))


def hills(seed):
    """Heights on a grid with steps of 1 m, with a high rim."""
    i, j = np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij")
    heights = 1.2 * np.sin(i / 2.0) * np.cos(j / 2.5) + np.random.default_rng(seed).uniform(-0.15, 0.15, i.shape)
    heights[[0, -1]] = heights[:, [0, -1]] = 25.0
    return heights


def height_at(heights, places):
    """Of the two triangles of each cell."""
    i, j = np.clip(places[:, ::2].astype(int).T, 0, SIDE - 2)
    u, v = places[:, 0] - i, places[:, 2] - j
    one = heights[i, j] + u * (heights[i + 1, j] - heights[i, j]) + v * (heights[i, j + 1] - heights[i, j])
    far = heights[i + 1, j + 1]
    two = far + (1 - u) * (heights[i, j + 1] - far) + (1 - v) * (heights[i + 1, j] - far)
    return np.where(u + v <= 1, one, two)


def rock(rng):
    """A random hull about its centre of mass; corners of a box, turned at random, one time in three."""
    if rng.random() < 1 / 3:
        turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        return ConvexHullCollider(0.4 * np.array(list(itertools.product((-1, 1), repeat=3))) @ turned)
    hull = ConvexHullCollider(rng.normal(size=(10, 3)) * 0.3)
    hull.offset = -hull.centre_of_mass
    return hull


def test_what_reaches_into_a_floor_of_triangles_touches_it():
    """Wherever it is over inner edges, and however deep, while its middle is in front."""
    rng, world = np.random.default_rng(14), make_world(gravity=(0.0, 0.0, 0.0), on_fault="ignore")
    create_height_field(world, np.zeros((60, 60)), 1.0)
    bodies = []
    for k in range(180):
        shape, share = rock(rng), (0.05, 0.3, 0.6, 0.95)[k % 4]
        heights = (shape.corners + shape.offset)[:, 1]
        low, middle = heights.min(), 0.5 * (heights.min() + heights.max())
        x, z = 3.0 + 4.0 * (k % 14) + rng.uniform(-1, 1), 3.0 + 4.0 * (k // 14) + rng.uniform(-1, 1)
        bodies.append(throw(world, (x, -low - share * (middle - low), z), (0.0, 0.0, 0.0), shape))
    world.step()
    assert [body for body in bodies if not len(world.contacts.of(body))] == []


def test_rocks_stay_on_a_floor_of_triangles():
    rng, world = np.random.default_rng(3), make_world()
    create_height_field(world, np.zeros((45, 45)), 1.0, friction=0.5)
    grid = np.array([(3.0 + 4.0 * (k % 10), 1.5, 3.0 + 4.0 * (k // 10)) for k in range(100)])
    places = grid + rng.uniform(-0.5, 0.5, grid.shape)
    rocks = [throw(world, place, (0.0, -4.0, 0.0), rock(rng), (0.0, 0.0, 0.0)) for place in places]
    for _ in range(90):
        world.step()
    assert min(position(world, body)[1] for body in rocks) > 0.0


@each_mode
def test_what_slides_over_a_floor_of_triangles_keeps_height_speed_and_angle(mode):
    """At 20 m/s, across a hundred inner edges, without friction."""
    world = make_world(collision=mode)
    create_height_field(world, np.zeros((60, 12)), 1.0, friction=0.0)
    shapes = (
        (0.5, SphereCollider(0.5, friction=0.0), None),
        (0.5, SphereCollider(0.5, friction=0.0), 0.0),
        (0.4, AABBCollider((0.5, 0.4, 0.3), friction=0.0), None),
        (0.3, BoxCollider((0.5, 0.3, 0.4), friction=0.0), 0.0),
    )
    bodies = [
        throw(world, (1.3 + 4.0 * k, high, 5.2), (20.0, 0.0, 1.0), shape, spin)
        for k, (high, shape, spin) in enumerate(shapes)
    ]
    for _ in range(120):
        world.step()
    for k, (entity, (high, _, _)) in enumerate(zip(bodies, shapes, strict=True)):
        assert position(world, entity) == pytest.approx((41.3 + 4.0 * k, high, 7.2), abs=1e-4)
        assert velocity(world, entity) == pytest.approx((20.0, 0.0, 1.0), abs=1e-4)
    assert abs(world.component_for_entity(bodies[3], Transform).rotation[0]) == pytest.approx(1.0, abs=1e-9)


@each_mode
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_nobody_passes_the_hills(mode, seed):
    heights, random, world = hills(seed), np.random.default_rng(seed), make_world(collision=mode)
    create_height_field(world, heights, 1.0, friction=0.6)
    for k in range(60):
        shape = (
            SphereCollider(random.uniform(0.15, 0.5), friction=0.6),
            BoxCollider(random.uniform(0.15, 0.5, 3), friction=0.6),
            CapsuleCollider(0.2, 0.3, friction=0.6),
            AABBCollider(0.3, friction=0.6),
        )[k % 4]
        spin = None if k % 4 == 3 else random.uniform(-2.0, 2.0, 3)
        throw(world, random.uniform((2, 3, 2), (22, 8, 22)), random.uniform(-6, 6, 3), shape, spin)
    for _ in range(80):
        world.step()
        places = world.bodies.dynamic.position
        assert (places[:, 1] > height_at(heights, places)).all()


@pytest.mark.parametrize("mode", MODES[1:])
def test_nothing_fast_passes_in_swept_worlds(mode):
    """Balls of 2 cm that cover a hundred times their size in a step; none of them meets another."""
    heights, random, world = hills(3), np.random.default_rng(5), make_world(collision=mode)
    create_height_field(world, heights, 1.0, mask=3)
    for _ in range(80):
        way = random.uniform((-40, -300, -40), (40, -50, 40))
        throw(world, random.uniform((3, 8, 3), (21, 12, 21)), way, SphereCollider(0.02, layer=2, mask=1))
    for _ in range(60):
        world.step()
        places = world.bodies.dynamic.position
        inside = ((places[:, ::2] > 1.0) & (places[:, ::2] < SIDE - 2.0)).all(axis=1)  # others may fly over the rim
        assert (places[:, 1] > height_at(heights, places))[inside].all()
    assert inside.sum() > 10


def pipe_of(points, half=0.1):
    """(vertices, triangles) of a mesh that is straight along z, over points in the plane of x and y."""
    vertices = [(x, y, z) for x, y in points for z in (-half, half)]
    pieces = range(0, 2 * len(points) - 2, 2)
    return vertices, [face for k in pieces for face in ((k, k + 1, k + 3), (k, k + 3, k + 2))]


@each_mode
@pytest.mark.parametrize("restitution", [0.0, 0.05, 0.3, 0.9])
def test_waves_that_lean_along_x_push_no_ball_along_z(mode, restitution):
    """A face without friction pushes along its normal only."""
    heights = np.repeat(0.3 * np.cos(np.pi / 6.0 * np.arange(81))[:, None], 9, axis=1)
    for k, gravity in itertools.product(range(8), (G, 0.0)):
        world = make_world((0.0, -gravity, 0.0), collision=mode)
        create_height_field(world, heights, 0.5)
        smooth = SphereCollider(0.3, restitution=restitution)
        ball = throw(world, (6.0 + 0.137 * k, 0.61, 2.1), (6.0, -0.5, 0.0), smooth)
        for _ in range(240):
            world.step()
            assert abs(velocity(world, ball)[2]) < 1e-9
        world.close()


@each_mode
@pytest.mark.parametrize("facets", [8, 16])
def test_a_ball_keeps_in_a_bend_of_facets_what_each_of_them_leaves_it(mode, facets):
    """At each facet, without gravity and restitution, the part of its velocity along that: cos(turn)^2 of the energy;
    at the first and the last, half a turn."""
    turn, bend = 0.5 * math.pi / facets, 0.5
    angles = turn * np.arange(facets + 1)
    points = [(-2.0, 0.0), *zip(bend * np.sin(angles), bend - bend * np.cos(angles), strict=True), (bend, 4.0)]
    for k in range(10):
        world = make_world((0.0, 0.0, 0.0), collision=mode)
        create_triangle_mesh(world, *pipe_of(points))
        ball = throw(world, (-0.5 - 0.013 * k, 0.03, 0.0), (2.0, 0.0, 0.0), SphereCollider(0.03))
        while position(world, ball)[1] < bend + 0.1 and world.time < 2.0:
            world.step()
        kept = math.cos(turn) ** (facets - 1) * math.cos(0.5 * turn) ** 2
        assert velocity(world, ball) == pytest.approx((0.0, 2.0 * kept, 0.0), abs=1e-9)
        world.close()


@pytest.mark.parametrize("mode", MODES[1:])
def test_a_ball_that_lands_on_a_plane_of_many_triangles_slides_on(mode):
    """Without gravity, friction and restitution the plane takes the velocity along its normal, and no more."""
    for degrees, k in itertools.product((0.0, 3.0, 45.0), range(12)):
        tilt = math.radians(degrees)
        way, up = np.array((math.cos(tilt), math.sin(tilt), 0.0)), np.array((-math.sin(tilt), math.cos(tilt), 0.0))
        world = make_world((0.0, 0.0, 0.0), collision=mode)
        create_triangle_mesh(world, *pipe_of([(0.4 * n * way)[:2] for n in range(-2, 9)], 0.2))
        ball = throw(world, 0.05 * up + (0.031 * k - 0.4) * way, 2.0 * way - 0.2 * up, SphereCollider(0.03))
        for _ in range(78):
            world.step()
        assert velocity(world, ball) == pytest.approx(2.0 * way, abs=1e-9)
        world.close()


@each_mode
@pytest.mark.parametrize("seed", range(3))
def test_impacts_on_hills_have_normals_that_faces_have(mode, seed):
    """All of these look up, by 45 degrees at least."""
    rng, size, cell = np.random.default_rng(seed), 49, 0.25
    i, j = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    for _ in range(8):
        heights = 0.3 * np.sin(0.2 * i) * np.cos(0.15 * j) + 0.02 * rng.uniform(-1, 1, i.shape)
        world = make_world(collision=mode, on_fault="ignore")
        create_height_field(world, heights, cell, friction=0.0)
        ball = SphereCollider(rng.uniform(0.2, 0.5), restitution=rng.choice((0.05, 0.3)), friction=0.0)
        throw(world, (6.0, 0.4 + ball.radius, 6.0), rng.normal(size=3) * (3.0, 0.3, 3.0), ball)
        for _ in range(90):
            world.step()
            assert all(impact.normal[1] > 0.7 for impact in world.contacts.impacts)
        world.close()


@each_mode
def test_a_ball_rolls_down_a_slope_of_triangles_as_down_a_plane(mode):
    """By 5/7 g sin a, across inner edges at all angles; without a spin by g sin a."""
    slope = math.atan(0.5)
    world = make_world(collision=mode)
    i, j = np.meshgrid(np.arange(61.0), np.arange(21.0), indexing="ij")
    create_height_field(world, -0.5 * i + 0.0 * j, 1.0, friction=0.8)
    up = 0.4 * np.array((math.sin(slope), math.cos(slope), 0.0))
    ball = throw(world, np.array((3.2, -1.6, 8.3)) + up, (0, 0, 0), SphereCollider(0.4, friction=0.8), 0.0)
    for _ in range(180):
        world.step()
    speed = np.linalg.norm(velocity(world, ball))
    assert speed == pytest.approx(5.0 / 7.0 * G * math.sin(slope) * 3.0, rel=2e-3)
    assert velocity(world, ball)[2] == pytest.approx(0.0, abs=1e-4)
    x, y, _ = position(world, ball)
    assert (0.5 * x + y) * math.cos(slope) == pytest.approx(0.4, abs=2e-3)


@each_mode
def test_boxes_lie_still_on_slopes(mode):
    slope = math.atan(0.3)
    world = make_world(collision=mode)
    i, j = np.meshgrid(np.arange(13.0), np.arange(13.0), indexing="ij")
    create_height_field(world, 0.3 * i + 0.0 * j, 1.0, friction=0.8)
    up = 0.4 * np.array((-math.sin(slope), math.cos(slope), 0.0))
    turn = (math.cos(slope / 2.0), 0.0, 0.0, math.sin(slope / 2.0))
    parts = RigidBody(), Spin(), BoxCollider((0.8, 0.4, 0.6), friction=0.8)
    box = world.create_entity(Transform(np.array((6.2, 1.86, 6.3)) + up, turn), *parts)
    before = position(world, box).copy()
    for _ in range(300):
        world.step()
    assert position(world, box) == pytest.approx(before, abs=2e-3)
    assert velocity(world, box) == pytest.approx((0, 0, 0), abs=1e-4)


@each_mode
def test_a_mesh_of_a_bowl_holds_balls(mode):
    """An octahedron whose fronts look inwards, with equal vertices given more than once."""
    corners = 4.0 * np.array(((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)), float)
    faces = [
        (x, y, z) if (sx * sy * sz < 0) else (x, z, y)
        for x, sx in ((0, 1), (1, -1)) for y, sy in ((2, 1), (3, -1)) for z, sz in ((4, 1), (5, -1))
    ]  # fmt: skip
    vertices = corners[np.array(faces)].reshape(-1, 3)
    world = make_world(collision=mode)
    create_triangle_mesh(world, vertices, np.arange(24).reshape(8, 3), friction=0.3)
    random = np.random.default_rng(2)
    for _ in range(12):
        ball = SphereCollider(0.2, restitution=0.5, friction=0.3)
        throw(world, random.uniform(-1.0, 1.0, 3), random.uniform(-9, 9, 3), ball)
    for _ in range(300):
        world.step()
        assert (np.abs(world.bodies.dynamic.position).sum(axis=1) < 4.0).all()


@each_mode
@pytest.mark.parametrize("seed", range(3))
def test_thickness_is_how_far_behind_straight_ground_bodies_are_pushed_out(mode, seed):
    random = np.random.default_rng(seed)
    slope, cell, thickness = random.uniform(-0.5, 0.5), random.uniform(0.3, 2.0), random.uniform(0.3, 3.0)
    up = np.array((-slope, 1.0, 0.0)) / math.hypot(slope, 1.0)
    world = make_world(-G * up, collision=mode)
    i, j = np.meshgrid(np.arange(31.0), np.arange(31.0), indexing="ij")
    create_height_field(world, slope * cell * i + 0.0 * j, cell, thickness=thickness)
    behind = random.uniform(0.05, 2.0, 30) * thickness
    behind[np.abs(behind - thickness) < 0.1 * max(cell, 1.0)] = 0.5 * thickness
    balls = []
    for far in behind:
        x, z = random.uniform(12, 18, 2) * cell
        ball = SphereCollider(random.uniform(0.1, 0.6), layer=2, mask=1)
        balls.append(world.create_entity(Transform(np.array((x, slope * x, z)) - far * up), RigidBody(), ball))
    for _ in range(30):
        world.step()
    rises = [position(world, ball) @ up > -far for ball, far in zip(balls, behind, strict=True)]
    assert rises == (behind < thickness).tolist()
    world.close()


def test_rays_see_fronts_only():
    world = make_world()
    ground = create_height_field(world, [[0.0, 0.0], [0.0, 0.0]], 2.0)
    assert [hit.entity for hit in world.ray_cast((0.4, 3.0, 0.4), (0, -1, 0))] == [ground[0]]
    hit = world.ray_cast((1.7, 3.0, 1.6), (0, -1, 0))[0]
    assert hit.entity == ground[1]
    assert hit.distance == pytest.approx(3.0)
    assert hit.normal == pytest.approx((0, 1, 0))


@pytest.mark.parametrize("rough", [0.02, 0.05, 0.3])
def test_balls_cast_down_stop_where_they_touch(rough):
    """On smooth and on rough hills, many right over edges: never deeper, and less than a thousandth of a cell too
    high."""
    rng, world = np.random.default_rng(3), make_world()
    i, j = np.indices((12, 12))
    heights = 0.5 * np.sin(0.5 * i) + 0.4 * np.cos(0.7 * j) + rough * rng.uniform(0, 1, (12, 12))
    create_height_field(world, heights, 1.0)
    world.step()
    corners = np.stack((i, heights, j), axis=-1)
    a, b, c, d = corners[:-1, :-1], corners[1:, :-1], corners[:-1, 1:], corners[1:, 1:]
    faces = np.concatenate([np.stack(face, axis=-2).reshape(-1, 3, 3) for face in ((a, c, b), (b, c, d))])
    for radius in (0.3, 0.7):
        starts = rng.uniform(1, 10, (300, 3))
        starts[:, 1] = 2.5
        starts[:150, 0] = np.round(starts[:150, 0]) + 0.03 * rng.normal(size=150)
        hits = world.shape_casts(SphereCollider(radius), starts, (0.0, -5.0, 0.0))
        ends = starts - hits.distance[:, None] * (0.0, 1.0, 0.0)
        gaps = [distance_to(faces, end) - radius for end in ends]
        assert hits.found.all()
        assert min(gaps) > -1e-6
        assert max(gaps) < 1e-3


def distance_to(faces, point):
    """From a point to the nearest of triangles (n, 3, 3)."""
    corners, edges = faces, np.roll(faces, -1, axis=1) - faces
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    heights = ((point - corners[:, 0]) * normals).sum(1)
    arms = point - heights[:, None, None] * normals[:, None] - corners
    over = (np.cross(edges, arms) * normals[:, None]).sum(2).min(1) >= 0
    t = np.clip(((point - corners) * edges).sum(2) / (edges**2).sum(2), 0, 1)
    to_edges = np.linalg.norm(point - corners - t[..., None] * edges, axis=2).min(1)
    return np.where(over, abs(heights), to_edges).min()


@pytest.mark.parametrize(
    ("vertices", "triangles", "message"),
    [
        (
            np.zeros((4, 2)),
            [(0, 1, 2)],
            r"vertices must be 3 or more of 3 numbers each, got an array of shape \(4, 2\)",
        ),
        ([(0, 0, 0), (1, 0, math.nan), (0, 0, 1)], [(0, 1, 2)], r"row 1 is \(1.0, 0.0, nan\)"),
        ([(0, 0, 0), (1, 0, 0), (0, 0, 10**400)], [(0, 1, 2)], "vertices must be 3 or more of 3 numbers each"),
        ([(0, 0, 0), (1, 0, 0), (0, 0, 1)], [(0, 1)], "triangles must be 1 or more of 3 whole numbers each"),
        ([(0, 0, 0), (1, 0, 0), (0, 0, 1)], [(0, 1, 3)], r"there are 3 vertices, triangle 0 is \(0, 1, 3\)"),
        ([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)], "triangle 0 has no area"),
        ([(0, 0, 0), (1, 0, 0), (0, 0, 1), (1, 0, 1)], [(0, 1, 2), (0, 1, 3)], "triangles 0 and 1 have the same edge"),
    ],
)
def test_bad_meshes_are_refused(vertices, triangles, message):
    world = make_world()
    with pytest.raises(ValueError, match=f"create_triangle_mesh: .*{message}"):
        create_triangle_mesh(world, vertices, triangles)
    assert not len(world.bodies)


def test_bad_heights_are_refused():
    world = make_world()
    with pytest.raises(ValueError, match=r"create_height_field: heights .* at least 2 x 2, got \[\[1.0\]\]"):
        create_height_field(world, [[1.0]], 1.0)
    with pytest.raises(ValueError, match=r"heights\[1, 0\] is nan"):
        create_height_field(world, [[1.0, 2.0], [math.nan, 0.0]], 1.0)
    with pytest.raises(ValueError, match=r"create_height_field.cell must be .*0"):
        create_height_field(world, np.zeros((2, 2)), 0.0)
    world = World(Physics(dimensions=2), terrain.plugin)
    with pytest.raises(ValueError, match="create_height_field: a mesh is for 3D worlds, this world is 2D"):
        create_height_field(world, np.zeros((2, 2)), 1.0)

"""Convex hulls from points: refused input, mass, boxes made of points, landing on faces, files."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import scipy.spatial

from carom.components import RigidBody, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, convex_hull
from carom.plugins.convex_hull import ConvexHullCollider
from carom.plugins.rotation import BoxCollider, Rotation, Spin

G = 9.81
MODES = ("discrete", "continuous", "event_driven")
CUBE = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
TETRAHEDRON = np.array([(1.0, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]) / math.sqrt(8)  # edges of 1
OCTAHEDRON = np.concatenate((np.eye(3), -np.eye(3))) / math.sqrt(2)  # edges of 1


def space(gravity=(0.0, 0.0, 0.0), **settings):
    return World(Physics(3, gravity=gravity), Rotation(), convex_hull.plugin, settings=Settings(**settings))


def ground(mode, lean=0.0, e=0.0):
    """A level floor; gravity leans by an angle towards x."""
    world = space((G * math.sin(lean), -G * math.cos(lean), 0), collision=mode)
    floor = BoxCollider((50, 1, 50), friction=2.0, restitution=e)
    world.create_entity(Transform((0, -1, 0)), RigidBody(kind="static"), floor)
    return world


def pose(world, entity):
    place = world.component_for_entity(entity, Transform)
    return np.concatenate((place.position, place.rotation))


def any_turn(seed):
    q = np.random.default_rng(seed).normal(size=4)
    return q / np.linalg.norm(q)


# -- what it is -----------------------------------------------------------------------------------


@pytest.mark.plain
@pytest.mark.parametrize(
    ("points", "rule"),
    [
        (TETRAHEDRON[:3], "must have 4 to 64 points"),
        (np.zeros((5, 3)), "all lie in a plane"),
        (CUBE * (1, 0, 1), "all lie in a plane"),
        (any_turn(0)[:3] * np.arange(6)[:, None], "all lie in a plane"),
        (np.random.default_rng(0).normal(size=(65, 3)), "must have 4 to 64 points"),
        ([*TETRAHEDRON, (0, 0, math.inf)], "finite"),
        (CUBE[:, :2], r"shape \(n, 3\)"),
        ([(0, 0, 0), (1, 0), (0, 1, 0), (0, 0, 1)], "numbers"),
        (7, r"shape \(n, 3\)"),
    ],
)
def test_points_that_have_no_hull_are_refused(points, rule):
    with pytest.raises(ValueError, match=f"ConvexHullCollider.hull .*{rule}"):
        ConvexHullCollider(points)


@pytest.mark.plain
@pytest.mark.parametrize("size", [1e-100, 1e-9, 1.0, 1e100])
def test_points_inside_are_left_out_at_any_size(size):
    """Inside of the hull, of a face and of an edge, and what is there twice; a hull may be given again."""
    inside = [(0, 0, 0), (0.3, -0.2, 0.9), (0, 0, 1), (0.5, 1, 0.2), (1, 1, 0)]
    hull = ConvexHullCollider(np.concatenate((inside, CUBE, CUBE[:3], inside)) * size)
    assert np.array_equal(hull.corners, CUBE * size)
    assert np.allclose(hull.centre_of_mass, 0.0, atol=1e-15 * size)
    assert np.array_equal(ConvexHullCollider(hull.hull).hull, hull.hull)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
def test_corners_and_volume_are_those_of_qhull(seed):
    """Of points anywhere, on a sphere, and of a lattice, which has many in a plane; read backwards it is the same."""
    random = np.random.default_rng(seed)
    points = random.normal(size=(random.integers(8, 40), 3))
    if seed % 3 == 1:
        points /= np.linalg.norm(points, axis=1)[:, None]
    elif seed % 3 == 2:
        points = np.round(points)
    hull, expected = ConvexHullCollider(points), scipy.spatial.ConvexHull(points)
    assert hull.second_moments(hull, 3)[0] == pytest.approx(expected.volume, rel=1e-12)
    if seed % 3 < 2:
        assert np.array_equal(hull.corners, points[np.sort(expected.vertices)])
    backwards = ConvexHullCollider(points[::-1])
    assert np.array_equal(np.unique(backwards.corners, axis=0), np.unique(hull.corners, axis=0))


@pytest.mark.plain
def test_inertia_of_tetrahedron_octahedron_and_of_what_is_off_its_centre():
    """m a^2 / 20 and m a^2 / 10 about the centre, for edges of a; elsewhere Steiner's."""
    centre = np.array((0.2, -0.5, 0.7))
    with space() as world:
        for points, part in ((TETRAHEDRON, 20), (OCTAHEDRON, 10)):
            for mass, size, away in itertools.product((1.0, 3.0), (1.0, 1e-3, 40.0), (0.0, 1.0)):
                hull = ConvexHullCollider((points + away * centre) * size)
                entity = world.create_entity(Transform((0, 0, 0)), RigidBody(mass), Spin(), hull)
                steiner = away * (centre @ centre * np.eye(3) - np.outer(centre, centre))
                assert len(world.bodies)
                found = world.component_for_entity(entity, Spin).moments / (mass * size * size)
                assert np.allclose(found, np.eye(3) / part + steiner, rtol=1e-12, atol=1e-14)
                assert np.allclose(hull.centre_of_mass, away * size * centre, rtol=1e-12, atol=1e-14 * size)


# -- in a world -----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    ("lean", "place", "turn", "spin", "e"),
    [
        (0.0, (0, 0.5, 0), (1, 0, 0, 0), (0, 0, 0), 0.0),  # stands
        (0.6, (0, 0.5, 0), (1, 0, 0, 0), (0, 0, 0), 0.0),  # tips over its edge: at atan(0.6) = 0.54
        (0.0, (0, 1.5, 0), any_turn(1), (1, -2, 3), 0.0),  # lands
        (0.0, (0, 1.5, 0), any_turn(2), (0, 0, 0), 0.5),  # bounces
    ],
    ids=("stands", "tips", "lands", "bounces"),
)
def test_a_box_of_points_does_what_a_box_does(mode, lean, place, turn, spin, e):
    half, ends = np.array((0.3, 0.5, 0.4)), []
    for shape in (
        BoxCollider(half, friction=2.0, restitution=e),
        ConvexHullCollider(CUBE * half, friction=2.0, restitution=e),
    ):
        with ground(mode, lean, e) as world:
            entity = world.create_entity(Transform(place, turn), RigidBody(), Spin(spin), shape)
            poses = []
            for _ in range(150):
                world.step()
                poses.append(pose(world, entity))
        ends.append(np.array(poses))
    assert np.abs(ends[0] - ends[1]).max() < 1e-6
    if place[1] == 0.5:
        assert (ends[0][-1, 0] > 0.5) == (lean > 0)  # it has gone over its edge, and may go on


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("points", "height"), [(TETRAHEDRON, 1 / math.sqrt(24)), (OCTAHEDRON, 1 / math.sqrt(6))])
def test_it_comes_to_rest_on_a_face(points, height, mode):
    """Dropped askew: the centre is as high as the middle of a face is deep, and no corner is below the floor."""
    with ground(mode) as world:
        entities = [
            world.create_entity(
                Transform((4.0 * k, 1.2, 0), any_turn(k)), RigidBody(), Spin(), ConvexHullCollider(points)
            )
            for k in range(3)
        ]
        for _ in range(300):
            world.step()
        for entity in entities:
            assert pose(world, entity)[1] == pytest.approx(height, abs=1e-4)
            assert np.abs(world.component_for_entity(entity, Spin).angular_velocity).max() < 1e-9
            assert np.abs(world.component_for_entity(entity, RigidBody).linear_velocity).max() < 1e-9


def test_files_and_prefabs_keep_it_and_another_hull_can_be_assigned(tmp_path):
    prefab = ConvexHullCollider(OCTAHEDRON, friction=0.5)
    with ground("discrete") as world:
        entity = world.create_entity(Transform((0, 1, 0), any_turn(3)), RigidBody(), Spin(), prefab.copy())
        for _ in range(10):
            world.step()
        world.save(tmp_path / "world.npz")
        with World.load(tmp_path / "world.npz", Physics(3), Rotation(), convex_hull.plugin) as loaded:
            for _ in range(30):
                world.step()
                loaded.step()
            assert loaded.state_hash() == world.state_hash()
        world.component_for_entity(entity, ConvexHullCollider).hull = TETRAHEDRON
        moments = world.component_for_entity(entity, Spin).moments
        assert np.allclose(moments, np.eye(3) / 20, rtol=1e-12, atol=1e-14)
        assert np.array_equal(prefab.corners, OCTAHEDRON)

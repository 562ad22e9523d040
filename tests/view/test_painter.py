"""What is painted is what the drawing list holds: in windows, in films, and at any zoom."""

import numpy as np
import pygame
import pytest
from helpers_view import Player

from carom import (
    BoxCollider,
    CapsuleCollider,
    ConvexPolygonCollider,
    Physics,
    RigidBody,
    Rotation,
    SphereCollider,
    Spin,
    Transform,
    World,
)
from carom.drawing import Drawing
from carom.plugins import capsule, convex_polygon, half_space
from carom.plugins.half_space import HalfSpaceCollider
from carom.view import Camera
from carom.view.colours import BACKGROUND, GRID
from carom.view.film import Recording
from carom.view.plane.clipping import clipped_lines, clipped_polygon
from carom.view.plane.painter import Painter

random = np.random.default_rng(3)


@pytest.fixture
def world():
    """Twelve bodies of four shapes, some static, some turned."""
    shapes = (
        SphereCollider(0.5),
        BoxCollider((0.5, 0.2)),
        CapsuleCollider(0.2, 0.4),
        ConvexPolygonCollider.regular(5, 0.5),
    )
    made = World(Physics(2, gravity=(0.0, 0.0)), Rotation(), capsule.plugin, convex_polygon.plugin, half_space.plugin)
    for k in range(12):
        body = () if k > 8 else (RigidBody(linear_velocity=(0.1, k)), Spin(0.3 * k))
        made.create_entity(Transform((1.3 * k, 0.0), 0.4 * k), *body, shapes[k % 4].copy())
    for _ in range(5):
        made.step()
    yield made
    made.close()


def distances(shown, camera, pixels):
    """(n,) pixels from each of ``pixels`` (n, 2) to the nearest border of the list; negative inside of a shape."""
    at = camera.to_world(pixels)
    found = np.full(len(at), np.inf)
    for circles in (shown.circles, shown.fixed_circles):
        for centre, radius in zip(circles.centre, circles.radius, strict=True):
            found = np.minimum(found, np.linalg.norm(at - centre, axis=1) - radius)
    for corners in (points for group in (*shown.polygons, *shown.fixed) for points in group.points):
        ways = np.roll(corners, -1, axis=0) - corners
        outward = np.stack((ways[:, 1], -ways[:, 0]), axis=1) / np.linalg.norm(ways, axis=1)[:, None]
        found = np.minimum(found, np.einsum("nkd,kd->nk", at[:, None] - corners, outward).max(axis=1))
    return found * camera.scale


def ground_of(surface):
    """(width, height), whether nothing is painted there."""
    pixels = pygame.surfarray.array3d(surface).astype(int)
    return ((pixels == BACKGROUND) | (pixels == GRID)).all(axis=2)


def check(surface, shown, camera, border=2.0):
    """Within shapes there is colour, outside the ground."""
    ground = ground_of(surface)
    pixels = random.integers((0, 0), camera.size, (8000, 2))
    away, empty = distances(shown, camera, pixels), ground[tuple(pixels.T)]
    assert not empty[away < -border].any()
    assert empty[away > border].all()
    assert (away < -border).sum() > 100


def test_a_window_a_film_and_a_surface_show_the_list(world, tmp_path):
    player = Player(world, (700, 300), controls=False)
    player.view.paused = True
    player.frame(2)
    check(player.view.screen, Drawing(world).update(), player.view.camera)
    player.view.close()
    film = Recording(world, tmp_path / "film.gif")
    check(film.screen, Drawing(world).update(interpolated=False), film.camera)
    camera, surface = Camera((300, 300), (3, 0.2), 60), pygame.Surface((300, 300))
    painter = Painter()
    for _ in range(2):
        painter.paint(surface, Drawing(world).update(), camera)
        check(surface, Drawing(world).update(), camera)
        camera.pan((40, 30))  # what is static is painted anew


def test_small_shapes_are_seen_and_no_larger_than_they_are(world):
    """Levels of detail: discs, capsules of few pixels."""
    for scale in (1.0, 3.0, 8.0, 15.0):
        camera, surface = Camera((300, 100), (7, 0.2), scale), pygame.Surface((300, 100))
        shown = Drawing(world).update()
        Painter().paint(surface, shown, camera)
        ground, pixels = ground_of(surface), np.argwhere(np.ones(camera.size, bool))
        assert ground.ravel()[distances(shown, camera, pixels) > 2.0].all()
        for places in (world.bodies.position,):
            x, y = np.rint(camera.to_screen(places)).astype(int).T
            assert all(
                not ground[max(a - 1, 0) : a + 2, max(b - 1, 0) : b + 2].all() for a, b in zip(x, y, strict=True)
            )


@pytest.mark.slow
def test_pictures_of_discs_are_kept_within_a_bound(world, monkeypatch):
    monkeypatch.setattr("carom.view.plane.painter.MOST_BYTES", 100_000)
    camera, surface, painter = Camera((300, 100), (7, 0.2), 5.0), pygame.Surface((300, 100)), Painter()
    for _ in range(60):
        camera.zoom(1.03)
        painter.paint(surface, Drawing(world).update(), camera)
        held = sum(disc.get_width() * disc.get_height() * 4 for disc in painter._discs.values())
        assert held == painter._disc_bytes <= 100_000


def test_what_is_larger_than_the_screen_is_cut(world):
    world.create_entity(Transform((0.0, -1.0)), HalfSpaceCollider((0.0, 1.0)))
    world.create_entity(Transform((500.0, 500.0)), RigidBody(), SphereCollider(700.0))
    for scale in (0.1, 1.0, 1e3, 1e5):
        camera, surface = Camera((200, 150), (0.0, -1.0), scale), pygame.Surface((200, 150))
        Painter().paint(surface, Drawing(world).update(), camera)
        pixels = pygame.surfarray.array3d(surface).astype(int)
        assert tuple(pixels[100, 140]) not in (BACKGROUND, GRID)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_bodies_at_no_place_are_left_out(world, value):
    world.bodies.dynamic.position[0] = value
    world.bodies.dynamic.position[1] = value
    surface = pygame.Surface((100, 100))
    Painter().paint(surface, Drawing(world).update(interpolated=False, velocities=True), Camera((100, 100)))


def test_lines_and_polygons_are_cut_at_the_screen():
    size = (100, 60)
    lines = random.normal((50, 30), 200, (300, 2, 2))
    ends, rows = clipped_lines(lines, size, 0.0)
    t = np.linspace(0, 1, 4001)[:, None, None]
    points = lines[:, 0] + t * (lines[:, 1] - lines[:, 0])
    seen = ((points >= 0) & (points <= size)).all(axis=2).mean(axis=0) * np.linalg.norm(
        lines[:, 1] - lines[:, 0], axis=1
    )
    lengths = np.zeros(len(lines))
    lengths[rows] = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert np.abs(lengths - seen).max() < 2e-3 * np.abs(lines).max()
    assert (ends >= -1e-9).all()
    assert (ends <= np.array(size) + 1e-9).all()
    square = np.array([(-1e9, -1e9), (1e9, -1e9), (1e9, 1e9), (-1e9, 1e9)])
    cut = np.array(clipped_polygon(square, size, 0.0))
    assert sorted(map(tuple, cut.round(6).tolist())) == [(0, 0), (0, 60), (100, 0), (100, 60)]
    assert clipped_polygon(square + 3e9, size) == []

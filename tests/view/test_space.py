"""Worlds in 3D: the camera that goes round, solids, and a window on them. Drawn in software where there is no card."""

import numpy as np
import pygame
import pytest
from helpers_view import Player

from carom import AABBCollider, Joints, Physics, RigidBody, SphereCollider, Transform, World
from carom.drawing import Drawing
from carom.view import OrbitCamera, View
from carom.view.colours import BACKGROUND
from carom.view.space.painter import GraphicsError, SpacePainter
from carom.view.space.solids import along, ball, triangles

random = np.random.default_rng(0)
CAMERAS = [
    OrbitCamera(
        (random.integers(50, 900), random.integers(50, 900)), random.normal(0, 30, 3), 10 ** random.uniform(-1, 3),
        random.uniform(-4, 4), random.uniform(-1.5, 1.5), up=random.normal(0, 1, 3),
    )
    for _ in range(12)
]  # fmt: skip


@pytest.fixture(scope="module")
def painter():
    try:
        made = SpacePainter()
    except GraphicsError as error:
        pytest.skip(str(error))
    yield made
    made.release()


@pytest.fixture
def world():
    made = World(Physics(3, gravity=(0.0, 0.0, -10.0)), Joints())
    made.create_entity(Transform((0.0, 0.0, -0.5)), AABBCollider((5.0, 5.0, 0.5)))
    yield made
    made.close()


def painted(painter, world, camera):
    surface = pygame.Surface(camera.size)
    painter.paint(surface, Drawing(world).update(), camera)
    return pygame.surfarray.array3d(surface).astype(int)


# -- the camera ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("camera", CAMERAS)
def test_pixels_and_places_belong_together(camera):
    points = camera.middle + camera.distance * random.uniform(-0.4, 0.4, (20, 3))
    pixels = camera.to_screen(points)
    clip = np.column_stack((points, np.ones(20))) @ camera.matrix().T
    flat = clip[:, :2] / clip[:, 3:]
    size = np.array(camera.size)
    assert pixels == pytest.approx(size / 2 * (1 + flat * (1, -1)), rel=1e-6, abs=1e-6)
    assert (np.abs(clip[:, 2]) < clip[:, 3]).all()
    for point, pixel in zip(points, pixels, strict=True):
        assert camera.to_world(pixel, point) == pytest.approx(point, abs=1e-9 * camera.distance)
        place, way = camera.ray(pixel)
        assert np.linalg.norm(np.cross(point - place, way)) < 1e-9 * camera.distance
    assert camera.to_screen(camera.middle) == pytest.approx(size / 2)
    assert np.isnan(camera.to_screen(camera.place - camera.axes[2])).all()
    assert camera.axes @ camera.axes.T == pytest.approx(np.eye(3), abs=1e-12)
    assert camera.axes[1] @ camera.up > 0.0


@pytest.mark.parametrize("camera", CAMERAS)
def test_zoom_turn_pan_and_fit(camera):
    at = np.array(camera.size) * 0.3
    under, distance = camera.to_world(at), camera.distance
    camera.zoom(1.5, at)
    assert camera.distance == pytest.approx(distance / 1.5)
    assert camera.to_world(at) == pytest.approx(under, abs=1e-9 * distance)
    camera.pan((7, -3))
    assert camera.to_world(np.add(at, (7, -3))) == pytest.approx(under, abs=1e-9 * distance)
    middle = camera.middle
    camera.turn((50, 1000))
    assert camera.pitch < np.pi / 2
    assert np.linalg.norm(camera.place - middle) == pytest.approx(camera.distance)
    low, high = np.array((-3, 1, 5)), np.array((4, 2, 30))
    camera.fit(low, high)
    corners = low + (high - low) * np.array([(a, b, c) for a in (0, 1) for b in (0, 1) for c in (0, 1)])
    pixels = camera.to_screen(corners)
    assert ((pixels >= 0) & (pixels <= camera.size)).all()


def test_what_is_no_camera_is_refused():
    for change, text in (
        ({"distance": 0.0}, "OrbitCamera.distance must be a finite number above 0"),
        ({"middle": (0.0, 1.0)}, "OrbitCamera.middle must be three finite numbers"),
    ):
        with pytest.raises(ValueError, match=text):
            OrbitCamera(**change)


# -- solids ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("times", [0, 1, 2, 3])
def test_a_ball_is_closed_and_looks_outwards(times):
    corners = ball(times).astype(float).reshape(-1, 3, 3)
    assert len(corners) == 20 * 4**times
    volume = np.einsum("nk,nk->n", np.cross(corners[:, 0], corners[:, 1]), corners[:, 2]) / 6
    assert (volume > 0).all()
    assert volume.sum() == pytest.approx(4 / 3 * np.pi, rel=0.4 / 3**times)
    assert np.abs((corners[:, 0] + corners[:, 1] + corners[:, 2]).sum(axis=0)).max() < 1e-4


def test_faces_are_triangles_with_their_normals(world):
    corners = triangles(Drawing(world).update().fixed)
    assert len(corners) == 36
    places, normals = corners["place"].reshape(-1, 3, 3), corners["normal"].reshape(-1, 3, 3)
    across = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    assert across / np.linalg.norm(across, axis=1, keepdims=True) == pytest.approx(normals[:, 0], abs=1e-6)
    assert (np.einsum("nk,nk->n", normals[:, 0], places[:, 0] - (0, 0, -0.5)) > 0).all()
    ways = random.normal(0, 1, (5, 3))
    axes = along(ways)
    assert axes[:, :, 2] == pytest.approx(ways / np.linalg.norm(ways, axis=1, keepdims=True))
    assert np.linalg.det(axes) == pytest.approx(np.ones(5))


def test_what_is_near_hides_what_is_far_and_walls_between_are_glass(painter, world):
    near = world.create_entity(Transform((0.0, -2.0, 1.0)), RigidBody(kind="kinematic"), SphereCollider(0.5))
    world.create_entity(Transform((0.0, 2.0, 1.0)), RigidBody(), SphereCollider(0.5))
    camera = OrbitCamera((200, 200), (0.0, 0.0, 1.0), 8.0, 0.0, 0.0, up=(0, 0, 1))
    camera.yaw += np.arctan2(*(camera.axes[[0, 2]] @ (0.0, 1.0, 0.0)))  # along y
    assert camera.axes[2] == pytest.approx((0, 1, 0), abs=1e-9)
    middle = painted(painter, world, camera)[100, 100]
    assert middle[0] > middle[2]  # kinematic ones are yellow
    world.delete_entity(near, immediate=True)
    seen = painted(painter, world, camera)
    assert seen[100, 100][2] > seen[100, 100][0] + 50  # blue
    assert tuple(seen[100, 20]) == BACKGROUND
    wall = world.create_entity(Transform((0.0, -3.0, 1.0)), AABBCollider((2.0, 0.1, 2.0)))
    behind = painted(painter, world, camera)[100, 100]
    assert behind[2] > behind[0] + 30  # seen through it
    world.delete_entity(wall, immediate=True)
    world.create_entity(Transform((0.0, 0.5, 1.0)), AABBCollider((2.0, 0.1, 2.0)))
    hidden = painted(painter, world, camera)[100, 100]
    assert abs(hidden[2] - hidden[0]) < 40  # grey: it stands behind what is looked at


# -- a window --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_window_on_a_world_in_3d(painter, world, tmp_path):
    body = world.create_entity(Transform((1.0, 0.5, 0.5)), RigidBody(), SphereCollider(0.5))
    player = Player(world, (300, 200), record=tmp_path / "film.gif")
    view, camera = player.view, player.view.camera
    assert camera.up == pytest.approx((0, 0, 1))
    player.frame(5)
    for key in "cvbnt":
        player.key(key)
    player.press((1.0, 0.5, 0.5))
    assert view.picked == body
    for height in np.linspace(0.5, 3.0, 20):
        player.move((1.0, 0.5, height))
    player.frame(60)
    assert world.component_for_entity(body, Transform).position[2] == pytest.approx(3.0, abs=0.6)
    player.release((1.0, 0.5, 3.0))
    yaw, middle = camera.yaw, camera.middle
    player.mouse(pygame.MOUSEMOTION, (90, 40), buttons=(0, 0, 1), rel=(30, 0))
    assert camera.yaw != yaw
    assert camera.middle == pytest.approx(middle)
    player.mouse(pygame.MOUSEMOTION, (90, 40), buttons=(0, 1, 0), rel=(30, 0))
    assert camera.middle != pytest.approx(middle)
    player.key("f")
    player.frame(60)
    assert camera.middle == pytest.approx(world.component_for_entity(body, Transform).position, abs=0.5)
    pygame.display.set_mode((1, 1), pygame.RESIZABLE)
    pygame.event.post(pygame.event.Event(pygame.VIDEORESIZE, size=(1, 1), w=1, h=1))
    player.key(pygame.K_TAB)
    view.close()
    assert (tmp_path / "film.gif").stat().st_size > 1000


def test_without_opengl_there_is_one_line(monkeypatch, world):
    def fails(**options):
        raise Exception("no libGL")

    monkeypatch.setattr("moderngl.create_standalone_context", fails)
    with pytest.raises(GraphicsError, match=r"3D are drawn by OpenGL 3.3, and there is none: no libGL; no libGL"):
        View(world)

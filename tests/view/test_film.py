"""Films of windows and of worlds that no window shows."""

import numpy as np
import pygame
import pytest
from helpers_view import Player
from PIL import Image

from carom import AABBCollider, CaromError, Physics, RigidBody, Transform, World
from carom.view.film import Film, Recording
from carom.view.packages import MissingPackageError, package


@pytest.fixture
def world():
    made = World(Physics(2, gravity=(0.0, -10.0)))
    made.create_entity(Transform((0.0, 0.0)), RigidBody(linear_velocity=(4.0, 8.0)), AABBCollider((0.5, 0.5)))
    made.create_entity(Transform((4.0, -1.0)), AABBCollider((6.0, 0.5)))
    yield made
    made.close()


def frames_of(path):
    """(n, y, x, 3), and how long each lasts, ms."""
    with Image.open(path) as film:
        found = []
        for k in range(film.n_frames):
            film.seek(k)
            found.append(np.asarray(film.convert("RGB"), int))
        return np.array(found), film.info["duration"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["gif", "webp"])
def test_a_window_is_filmed_as_it_is(world, tmp_path, kind):
    player = Player(world, (400, 300), record=tmp_path / "new" / f"film.{kind}", controls=False)
    shown = []
    for _ in range(31):
        player.frame()
        shown.append(pygame.surfarray.array3d(player.view.screen).swapaxes(0, 1).astype(int))
    player.view.close()
    frames, duration = frames_of(tmp_path / "new" / f"film.{kind}")
    assert duration == 50
    assert len(frames) == 10
    assert frames.shape[1:] == (300, 400, 3)
    assert np.abs(frames[1:] - frames[:-1]).max(axis=(1, 2, 3)).min() > 50
    assert np.abs(frames[-1] - shown[-3]).mean() < 3  # picture 27 of 60 a second is number 9 of 20 a second


@pytest.mark.slow
def test_an_mp4_has_as_many_seconds_as_the_world(world, tmp_path):
    film = Recording(world, tmp_path / "film.mp4")
    for step in range(1, 61):
        world.step()
        film.after_step(step)
    film.close()
    ffmpeg = package("imageio_ffmpeg", "a test")
    count, seconds = ffmpeg.count_frames_and_secs(str(tmp_path / "film.mp4"))
    assert (count, seconds) == (31, pytest.approx(31 / 30, abs=0.01))


def test_a_long_film_keeps_its_length_with_fewer_frames(tmp_path, monkeypatch):
    monkeypatch.setattr("carom.view.film.MOST_FRAMES", 10)
    film = Film(tmp_path / "film.gif")
    surface = pygame.Surface((30, 20))
    for k in range(100):
        surface.fill((k, 2 * k, 100), (k % 30, 0, 1, 20))
        film.add(surface, 0.05)
    film.close()
    frames, duration = frames_of(tmp_path / "film.gif")
    assert len(frames) * duration == pytest.approx(5000, abs=duration)
    assert len(frames) <= 10


def test_surfaces_of_other_sizes_are_fitted_in(tmp_path):
    film = Film(tmp_path / "film.webp")
    for size in ((2001, 1001), (1, 1), (40, 3000)):
        film.add(pygame.Surface(size), 0.05)
    film.close()
    frames, _ = frames_of(tmp_path / "film.webp")
    assert frames.shape[1:3] == (400, 800)


def test_what_cannot_be_written_is_told_before_the_run(tmp_path, monkeypatch):
    (tmp_path / "in the way").write_text("")
    for path, text in (
        ("film.avi", r"ends in \.mp4, \.gif, \.webp, not .*film.avi"),
        ("in the way/film.gif", "film .*in the way"),
    ):
        with pytest.raises(CaromError, match=text):
            Film(tmp_path / path)
    for name, path in (("imageio_ffmpeg", "film.mp4"), ("PIL.Image", "film.gif")):
        monkeypatch.setitem(__import__("sys").modules, name, None)
        with pytest.raises(MissingPackageError, match=r"pip install 'carom\[record\]'"):
            Film(tmp_path / path)
    assert [path.name for path in tmp_path.iterdir()] == ["in the way"]

"""What may happen to a window, and to the world below it; what compiles beside it."""

import threading
import time

import pygame
import pytest
from helpers_view import Player, floor_and_ball

from carom import CaromError, NoPhysicsError, Physics, SphereCollider, System, Transform, World
from carom.framework.compilation import log
from carom.view import DisplayError, OrbitCamera, View
from carom.view.packages import MissingPackageError, package


@pytest.fixture
def player():
    world, ball = floor_and_ball()
    made = Player(world)
    made.world, made.ball = world, ball
    yield made
    made.view.close()
    world.close()


# -- windows that go, worlds that go ---------------------------------------------------------------


def test_a_window_may_have_any_size(player):
    for size in ((1, 1), (2000, 1), (300, 300)):
        pygame.display.set_mode(size, pygame.RESIZABLE)
        pygame.event.post(pygame.event.Event(pygame.VIDEORESIZE, size=size, w=size[0], h=size[1]))
        player.key(pygame.K_TAB)
        player.key(pygame.K_F1)
        player.frame()
        assert player.view.camera.size == size


@pytest.mark.parametrize("how", ["event", "escape", "in a step", "pygame"])
def test_a_window_is_closed(player, how):
    view, world = player.view, player.world
    player.frame()
    if how == "event":
        pygame.event.post(pygame.event.Event(pygame.QUIT))
    elif how == "escape":
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_ESCAPE, unicode="", mod=0))
    elif how == "pygame":
        pygame.display.quit()
    else:

        class Closes(System):
            def process(self, dt):
                view.close()

        world.add_system(Closes())
        player.frame()
    with pytest.raises(StopIteration):
        player.frame(3)
    assert not view.open
    assert not pygame.display.get_init()
    assert list(view) == []
    world.step()  # goes on without


def test_a_world_that_is_closed_ends_the_loop():
    world, _ = floor_and_ball()
    frames = 0
    for _ in View(world, (100, 100), real_time=False):
        frames += 1
        if frames == 3:
            world.close()
    assert frames == 3


def test_a_world_that_is_restored_below_the_view_is_shown_as_it_is(player):
    start = player.world.snapshot()
    player.frame(30)
    player.press((3.0, 0.5))
    player.world.restore(start)
    player.frame(30)
    assert player.world.step_count == 30
    player.key(pygame.K_BACKSPACE)
    player.frame()


def test_only_worlds_that_can_be_seen_have_a_window():
    world = World()
    with pytest.raises(NoPhysicsError, match="no physics in world"):
        View(world)
    world.close()
    world, _ = floor_and_ball()
    with pytest.raises(ValueError, match="rate must be"):
        View(world, rate=0.0)
    with pytest.raises(ValueError, match="has 2 dimensions, the camera 3"):
        View(world, camera=OrbitCamera())
    world.close()


def test_an_empty_world_has_a_window_too():
    world = World(Physics(2))
    player = Player(world)
    for key in "cvjzbnto":
        player.key(key)
    player.key(pygame.K_TAB)
    player.press((0.0, 0.0))
    world.create_entity(Transform((0.0, 0.0)), SphereCollider(0.5))
    player.key(pygame.K_HOME)
    assert player.view.camera.scale > 200
    player.view.close()
    world.close()


def test_only_other_kernels_are_prepared_for(monkeypatch):
    world, _ = floor_and_ball()
    prepared = []
    monkeypatch.setattr(world, "prepare", lambda: prepared.append(world.settings), raising=False)
    player = Player(world)
    for k in range(1, 9):
        world.settings = world.settings.replace(dt=1 / 60 / k)
        player.frame()
    assert len(prepared) == 1
    world.settings = world.settings.replace(collision="continuous")
    player.frame()
    assert len(prepared) == 2
    player.view.close()
    world.close()


def test_without_a_screen_there_is_one_line(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "no-such-driver")
    world, _ = floor_and_ball()
    with pytest.raises(DisplayError, match=r"no display for a window: .*--record FILE draws without one"):
        View(world)
    world.close()


def test_a_missing_package_is_one_line(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyglet", None)
    with pytest.raises(MissingPackageError, match=r"this needs pyglet: pip install 'carom\[view-pyglet\]'"):
        package("pyglet", "this")


def test_the_sound_card_is_never_opened(monkeypatch):
    monkeypatch.setenv("SDL_AUDIODRIVER", "dummy")  # else there is none to be opened
    world, _ = floor_and_ball()
    player = Player(world)
    player.frame(2)
    assert pygame.display.get_init()
    assert pygame.mixer.get_init() is None
    player.view.close()
    world.close()


# -- compiling -------------------------------------------------------------------------------------


class Compiles:
    """Stands in for world.prepare(), with kernels that take a while."""

    def __init__(self, count=5, seconds=0.1):
        self.count, self.seconds, self.done, self.threads = count, seconds, 0, set()

    def __call__(self):
        self.threads.add(threading.current_thread())
        for k in range(self.count):
            log.left = self.count - k
            for listener in log.listeners:
                listener(f"module.kernel_{k}")
            time.sleep(self.seconds)
            self.done += 1
        log.left = 0


@pytest.mark.slow
def test_while_kernels_compile_the_window_says_so(monkeypatch):
    world, _ = floor_and_ball()
    work, texts = Compiles(), []
    monkeypatch.setattr(world, "prepare", work, raising=False)
    monkeypatch.setattr(View, "_paint_progress", lambda view, text, share: texts.append(text))
    player = Player(world)
    player.frame()
    assert work.done == 5
    assert threading.main_thread() not in work.threads
    assert any(text.startswith("compiling 5 kernels, ") and "kernel_" in text for text in texts)
    player.view.close()
    world.close()


def test_a_window_that_is_closed_then_waits_for_one_kernel_only(monkeypatch):
    world, _ = floor_and_ball()
    work = Compiles(20)
    monkeypatch.setattr(world, "prepare", work, raising=False)
    player = Player(world)
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_ESCAPE, unicode="", mod=0))
    with pytest.raises(StopIteration):
        player.frame()
    assert work.done <= 2
    assert not log.listeners
    world.close()


def test_what_fails_to_compile_is_raised(monkeypatch):
    def fails():
        raise CaromError("no compiler")

    world, _ = floor_and_ball()
    monkeypatch.setattr(world, "prepare", fails, raising=False)
    with pytest.raises(CaromError, match="no compiler"):
        Player(world).frame()
    assert not pygame.display.get_init()
    world.close()

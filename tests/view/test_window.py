"""A window's keys and mouse, its overlays, and what may happen to a world below it."""

import math

import numpy as np
import pygame
import pytest
from helpers_view import Player, floor_and_ball

from carom import (
    AABBCollider,
    Hinge,
    Joints,
    Physics,
    RigidBody,
    Rotation,
    Settings,
    SphereCollider,
    Spin,
    StepError,
    System,
    Transform,
    World,
)
from carom.plugins.parts import PartOf, Parts
from carom.view import Sprites, View
from carom.view.colours import BACKGROUND


@pytest.fixture
def player():
    world, ball = floor_and_ball()
    made = Player(world)
    made.world, made.ball = world, ball
    yield made
    made.view.close()
    world.close()


def brightness(view):
    """(x, y, 3), without the line of text that counts frames."""
    pixels = pygame.surfarray.array3d(view.screen).astype(int)
    pixels[:, :22] = 0
    return pixels


# -- time ----------------------------------------------------------------------------------------


def test_a_loop_gets_the_seconds_of_a_frame_and_none_while_time_stands(player):
    view, world = player.view, player.world
    assert player.frame() == pytest.approx(1 / 60)
    player.frame(3)
    steps = world.step_count
    assert steps == 4
    assert player.key(pygame.K_SPACE) == 0.0
    assert view.paused
    player.frame(3)
    assert world.step_count == steps
    player.key(pygame.K_PERIOD)
    player.key(pygame.K_PERIOD)
    assert world.step_count == steps + 2
    player.key(pygame.K_SPACE)
    player.key(pygame.K_MINUS)
    assert player.key(pygame.K_MINUS) == pytest.approx(1 / 240)
    player.key(pygame.K_0)
    assert player.key(pygame.K_PLUS) == pytest.approx(1 / 30)
    for _ in range(20):
        player.key(pygame.K_PLUS)
    assert view.speed == 8.0
    for wrong in ("a", None, True, -1, math.nan, math.inf):
        with pytest.raises(ValueError, match="View: speed must be a finite number of at least 0"):
            view.speed = wrong
    view.speed = 0.5
    assert player.frame() == pytest.approx(1 / 120)


def test_back_in_time_and_forth(player):
    world = player.world
    player.frame(2)
    hashes = {}
    for _ in range(40):
        player.frame()
        hashes[world.step_count] = world.state_hash()
    player.view._rewind._cost = 0.0
    now = world.step_count
    player.key(pygame.K_BACKSPACE)
    player.key(pygame.K_BACKSPACE)
    assert player.view.paused
    assert 0 < world.step_count < now
    assert world.state_hash() == hashes[world.step_count]
    for _ in range(3):
        player.key(pygame.K_BACKSPACE, mod=pygame.KMOD_SHIFT)
    assert world.step_count == now
    assert "present" in player.view.message


def test_what_a_step_raises_is_shown_and_time_stands():
    class Fails(System):
        tries = 0

        def process(self, dt):
            if self.world.step_count == 3:
                self.tries += 1
                raise RuntimeError("three is too many")

    world, _ = floor_and_ball()
    fails = Fails()
    world.add_system(fails)
    view = View(world, (320, 200), real_time=False)
    seen = []

    def look(_):
        seen.append((view.message, view.paused))
        if len(seen) > 8:
            view.close()

    view.above = look
    view.run()
    assert (world.step_count, fails.tries) == (3, 1)
    assert "three is too many" in seen[-1][0]
    assert seen[-1][1]
    with pytest.raises(StepError, match="three is too many"):
        View(world, (320, 200), real_time=False).run(seconds=1.0)
    world.close()


def test_run_ends_after_so_many_seconds():
    world, _ = floor_and_ball()
    View(world, (64, 64), real_time=False).run(0.25)
    assert world.step_count == 15
    assert not pygame.display.get_init()
    world.close()


# -- camera --------------------------------------------------------------------------------------


def test_zoom_pan_follow_and_all_in_the_picture(player):
    view = player.view
    player.frame()
    corners = view.camera.to_screen(np.array([(-8, -1), (8, 4.3)]))
    assert ((corners >= 0) & (corners <= (640, 480))).all()
    player.mouse(pygame.MOUSEMOTION, (100, 50), buttons=(0, 0, 0), rel=(0, 0))
    under, scale = view.mouse, view.camera.scale
    pygame.event.post(pygame.event.Event(pygame.MOUSEWHEEL, y=2, x=0))
    player.frame()
    assert view.camera.scale == pytest.approx(1.44 * scale)
    assert view.mouse == pytest.approx(under)
    player.mouse(pygame.MOUSEMOTION, (130, 40), buttons=(0, 0, 1), rel=(30, -10))
    assert view.mouse == pytest.approx(under)  # what was taken is still under it
    view.picked = player.ball
    player.key("f")
    player.frame(90)
    assert view.camera.middle == pytest.approx(
        player.world.component_for_entity(player.ball, Transform).position, abs=0.01
    )
    player.key(pygame.K_HOME)
    assert not view.following
    assert view.camera.scale == pytest.approx(scale, rel=0.1)


# -- the hand ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("joints", [True, False])
def test_a_body_is_picked_dragged_and_let_go(joints):
    world, ball = floor_and_ball(*([Joints()] if joints else []))
    player = Player(world)
    player.frame()
    player.press((3.2, 0.6))
    assert player.view.picked == ball
    for k in range(1, 31):
        player.move((3.2, 0.6 + 0.1 * k))
    player.frame(60)
    body, transform = world.component_for_entity(ball, RigidBody), world.component_for_entity(ball, Transform)
    assert transform.position == pytest.approx((3.2, 3.6), abs=0.3)
    count = len(world.get_entities())
    player.release((3.2, 3.6))
    player.frame(12)
    assert len(world.get_entities()) == count - joints
    assert body.linear_velocity[1] < -1.5  # it falls
    player.press((-7.0, 3.0))
    assert player.view.picked is None
    player.view.close()
    world.close()


@pytest.mark.slow
def test_the_part_of_a_body_takes_the_body_along():
    for joints in ((), (Joints(),)):
        world = World(Physics(2, gravity=(0.0, -10.0)), Rotation(), Parts(), *joints)
        world.create_entity(Transform((0.0, -0.5)), AABBCollider((8.0, 0.5)))
        body = world.create_entity(Transform((0.0, 0.5)), RigidBody(), AABBCollider((0.5, 0.5)))
        part = world.create_entity(PartOf(body, (1.0, 0.2)), AABBCollider((0.5, 0.2)))
        player = Player(world)
        player.frame(2)
        player.press((1.2, 0.7))
        assert player.view.picked == part
        for height in np.linspace(0.7, 3.0, 20):
            player.move((1.2, height))
        player.frame(30)
        assert world.component_for_entity(body, Transform).y == pytest.approx(2.8, abs=0.4)
        player.view.close()
        world.close()


def test_an_old_view_does_not_close_the_window_of_a_new_one(player):
    player.frame()
    world = player.world
    player.view.close()
    other = Player(world)
    other.frame()
    player._frames.close()
    other.frame(3)
    third = View(world, (100, 100))  # pygame has one window, which goes to the last
    with pytest.raises(StopIteration):
        other.frame()
    assert pygame.display.get_surface().get_size() == (100, 100)
    third.close()
    assert not pygame.display.get_init()


def test_while_time_stands_a_body_is_put_where_the_mouse_is(player):
    player.frame()
    player.key(pygame.K_SPACE)
    player.press((0.0, -0.5))
    player.move((1.0, -0.25))
    floor = player.world.component_for_entity(player.view.picked, Transform)
    assert floor.position == pytest.approx((1.0, -0.25), abs=0.05)  # by whole pixels
    player.release((1.0, -0.25))
    player.key(pygame.K_SPACE)
    player.press((1.0, -0.5))
    player.move((2.0, 0.0))
    assert floor.position == pytest.approx((1.0, -0.25), abs=0.05)  # static


def test_the_body_in_the_hand_may_go(player):
    player.frame()
    player.press((3.0, 0.5))
    player.world.delete_entity(player.ball, immediate=True)
    player.key("f")
    player.frame(3)
    assert player.view.picked is None
    player.release((3.0, 0.5))


def test_a_pull_is_not_brought_back_by_going_back_in_time():
    world, _ = floor_and_ball(Joints())
    player = Player(world)
    player.frame()
    count = len(world.get_entities())
    player.press((3.0, 0.5))
    for _ in range(30):
        player.view._rewind._cost = 0.0
        player.frame()
    assert len(world.get_entities()) == count + 1
    player.key(pygame.K_BACKSPACE)
    player.key(pygame.K_SPACE)
    player.frame(2)
    assert world.step_count > 8  # a snapshot with the pull in it
    assert len(world.get_entities()) == count
    player.view.close()
    world.close()


# -- what is shown -------------------------------------------------------------------------------


@pytest.mark.slow
def test_each_key_shows_something_and_takes_it_away():
    world = World(
        Physics(2, gravity=(0.0, -10.0)), Rotation(), Joints(), settings=Settings(sleeping=True, on_fault="ignore")
    )
    world.create_entity(Transform((0.0, -0.5)), AABBCollider((3.0, 0.5)))
    for x in (-1.0, 1.0):
        world.create_entity(Transform((x, 0.5)), RigidBody(), AABBCollider((0.5, 0.5)))
    bar = world.create_entity(Transform((0.0, 2.0)), RigidBody(), SphereCollider(0.3), Spin(angular_velocity=1.0))
    world.create_entity(Hinge(None, bar, anchor=(0.5, 2.0)))
    player = Player(world, controls=False)
    player.frame(90)
    player.view.paused = True
    player.frame()
    plain = brightness(player.view)
    player.key("c")
    assert (brightness(player.view) == plain).all()  # keys are the game's
    player.key(pygame.K_F10)
    player.key("j")
    player.frame()
    plain = brightness(player.view)
    for key in ("c", "v", "j", "z", "b", "n", "t", "o", pygame.K_F1, pygame.K_TAB):
        player.key(key)
        player.frame()
        changed = (brightness(player.view) != plain).any(axis=2).sum()
        assert changed > 10, key
        player.key(key)
        player.frame()
        assert (brightness(player.view) == plain).all(), key
    player.view.close()
    world.close()


def test_sprites_and_painting_of_ones_own(player):
    view, sprites = player.view, Sprites(player.world)
    surface = pygame.Surface((10, 10))
    surface.fill((255, 0, 0))
    sprites.add(player.ball, surface, metres=1.0)
    view.sprites.append(sprites)
    view.below = lambda view: view.screen.fill((0, 0, 200))
    view.above = lambda view: view.screen.fill((0, 250, 0), (600, 400, 9, 9))
    player.frame(2)
    pixels = brightness(view)
    assert tuple(pixels[605, 405]) == (0, 250, 0)
    assert tuple(pixels[500, 100]) == (0, 0, 200)
    x, y = view.camera.to_screen((3.0, 0.5)).astype(int)
    assert tuple(pixels[x, y]) == (255, 0, 0)
    view.below = lambda view: None  # what was there is gone, also where nothing is painted
    player.frame(2)
    assert tuple(brightness(view)[500, 100]) == BACKGROUND


def test_stacks_of_one_colour_have_edges(player):
    world = player.world
    for y in (0.5, 1.5, 2.5):
        world.create_entity(Transform((-5.0, y)), RigidBody(), AABBCollider((0.5, 0.5)))
    player.frame(2)
    view = player.view
    x, top = view.camera.to_screen((-5.0, 2.9)).astype(int)
    bottom = view.camera.to_screen((-5.0, 0.1)).astype(int)[1]
    column = brightness(view)[x, top:bottom].sum(axis=1)
    dark = column < 0.6 * column.max()
    assert (np.diff(dark.astype(int)) == 1).sum() == 2  # between three boxes


def test_a_view_shows_one_world_and_says_what_to_do_for_the_next(player):
    with pytest.raises(AttributeError, match=r"a view shows one world: .* make another View\(world\)"):
        player.view.world = player.world

"""Sprites follow bodies, and go with them."""

import numpy as np
import pygame
import pytest

from carom import Physics, RigidBody, Rotation, SphereCollider, Spin, Transform, World
from carom.view import Camera, Sprites

RED, BLUE = (255, 0, 0), (0, 0, 255)


@pytest.fixture
def world():
    with World(Physics(2), Rotation()) as made:
        yield made
    made.close()


def picture(left=RED, right=BLUE, size=(20, 20)):
    """Two halves."""
    surface = pygame.Surface(size, pygame.SRCALPHA)
    surface.fill(left)
    surface.fill(right, (size[0] // 2, 0, size[0] // 2, size[1]))
    return surface


def drawn(sprites, camera):
    surface = pygame.Surface(camera.size)
    count = sprites.draw(surface, camera)
    return count, pygame.surfarray.array3d(surface).astype(int)  # [x, y]


def middle_of(pixels, colour):
    """(x, y) of the middle of the pixels of a colour."""
    return np.argwhere((np.abs(pixels - colour) < 60).all(axis=2)).mean(axis=0)


def ball(world, place=(0.0, 0.0), angle=0.0, velocity=(0.0, 0.0)):
    return world.create_entity(
        Transform(place, rotation=angle), RigidBody(linear_velocity=velocity), SphereCollider(0.5), Spin()
    )


@pytest.mark.parametrize("angle", [0.0, 0.5, np.pi / 2, -2.5])
@pytest.mark.parametrize("flip", [False, True])
def test_a_sprite_is_where_its_body_is_as_large_and_as_turned(world, angle, flip):
    entity = ball(world, (1.0, 0.5), angle)
    camera = Camera((300, 300), scale=40.0)
    sprites = Sprites(world)
    sprites.add(entity, picture(), metres=2.0, offset=(0.5, 0.0), flip=flip)
    count, pixels = drawn(sprites, camera)
    assert count == 1
    turned = np.array((np.cos(angle), np.sin(angle)))
    middle = np.array((1.0, 0.5)) + 0.5 * turned
    for colour, side in ((RED, -1), (BLUE, 1)):
        side = -side if flip else side
        assert middle_of(pixels, colour) == pytest.approx(camera.to_screen(middle + side * 0.5 * turned), abs=1.5)
    area = (pixels.sum(axis=2) > 200).sum()
    assert area == pytest.approx(80 * 80, rel=0.03)


def test_a_sprite_is_between_two_steps(world):
    entity = ball(world, velocity=(6.0, 0.0))
    camera = Camera((200, 200), scale=40.0)
    sprites = Sprites(world)
    sprites.add(entity, picture(RED, RED), metres=0.5)
    world.advance(1.5 / 60)
    assert middle_of(drawn(sprites, camera)[1], RED)[0] == pytest.approx(100 + 40 * 0.05, abs=1)


def test_deleted_bodies_have_no_sprite_until_a_restore_brings_them_back(world):
    first, second = ball(world), ball(world, (2.0, 0.0))
    camera = Camera((200, 200), scale=20.0)
    sprites = Sprites(world)
    sprites.add([first, second], picture())
    before = world.snapshot()
    world.delete_entity(first, immediate=True)
    assert drawn(sprites, camera)[0] == 1
    world.restore(before)
    assert drawn(sprites, camera)[0] == 2
    sprites.remove(second)
    assert drawn(sprites, camera)[0] == 1
    camera.middle = 100.0, 0.0
    assert drawn(sprites, camera)[0] == 0  # out of sight


def test_sprites_of_many_bodies_that_come_and_go_are_forgotten(world, monkeypatch):
    monkeypatch.setattr("carom.view.sprites.KEPT_GONE", 50)
    camera, sprites = Camera((100, 100), scale=10.0), Sprites(world)
    surface = picture()
    for _ in range(20):
        ids = world.create_entities(20, Transform.many(position=(0, 0)), SphereCollider.many(radius=0.1))
        sprites.add(np.array(ids), surface)
        assert drawn(sprites, camera)[0] == 20
        world.delete_entities(ids)
        world.step()
    assert len(sprites) <= 120


@pytest.mark.slow
def test_surfaces_that_no_sprite_has_any_more_are_forgotten(world, monkeypatch):
    monkeypatch.setattr("carom.view.sprites.MOST_LOOKS", 20)
    camera, sprites = Camera((200, 200), scale=40.0), Sprites(world)
    first, second = ball(world, (-1.0, 0.0)), ball(world, (1.0, 0.0))
    sprites.add(first, picture(RED, RED))
    for k in range(300):
        sprites.add(second, picture((0, k % 200, 255), (0, k % 200, 255)))
        _, pixels = drawn(sprites, camera)
        assert tuple(pixels[60, 100]) == RED
        assert tuple(pixels[140, 100]) == (0, k % 200, 255)
    assert len(sprites._pictures) <= 30


def test_pictures_are_kept_within_a_bound_and_the_later_is_above(world):
    entity, other = ball(world), ball(world)
    camera = Camera((100, 100), scale=40.0)
    sprites = Sprites(world, cache_megabytes=0.05)
    sprites.add(entity, picture(RED, RED), z=1.0)
    sprites.add(other, picture(BLUE, BLUE))
    for _ in range(50):
        camera.zoom(1.02)
        _, pixels = drawn(sprites, camera)
        assert tuple(pixels[50, 50]) == RED
    assert sprites._cached_bytes <= 50_000
    assert sum(made.get_width() * made.get_height() * 4 for made in sprites._cached.values()) == sprites._cached_bytes
    sprites.add(entity, picture(RED, RED), z=-1.0)
    assert tuple(drawn(sprites, camera)[1][50, 50]) == BLUE


def test_what_is_no_sprite_is_refused(world):
    entity, sprites = ball(world), Sprites(world)
    for values, text in (
        ({"surface": picture(size=(0, 3))}, "no pixels"), ({"metres": 0.0}, "metres must be"),
        ({"metres": np.nan}, "metres must be"), ({"offset": (1, np.inf)}, "offset must be"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=text):
            sprites.add(entity, **{"surface": picture(), **values})
    with pytest.raises(TypeError, match=r"must be a pygame.Surface, got 'hero.png'"):
        sprites.add(entity, "hero.png")
    with pytest.raises(ValueError, match="y_up=False"):
        sprites.draw(pygame.Surface((9, 9)), Camera((9, 9), y_up=True))
    other = World(Physics(3))
    with pytest.raises(ValueError, match="worlds in 2D"):
        Sprites(other)
    other.close()


def test_bodies_at_no_place_are_left_out(world):
    entity = ball(world)
    sprites = Sprites(world)
    sprites.add(entity, picture())
    world.bodies.dynamic.position[0] = np.nan
    assert drawn(sprites, Camera((50, 50)))[0] == 0

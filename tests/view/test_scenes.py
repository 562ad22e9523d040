"""Each scene of the library opens in a window and is seen there."""

import pygame
import pytest
from helpers_view import Player

from carom import scenes
from carom.view.space.painter import GraphicsError

QUICK = ("billiards", "pyramid", "hills", "crane", "ragdoll", "lift")
NAMES = [pytest.param(name, marks=() if name in QUICK else pytest.mark.long) for name in scenes.names()]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_scene_is_seen(name):
    world = scenes.get(name).build(None, seed=0)
    try:
        player = Player(world, (320, 200))
    except GraphicsError as error:
        pytest.skip(str(error))
    for key in "cvbnt":
        player.key(key)
    player.key(pygame.K_TAB)
    player.view.picked = int(world.bodies.entity[0])
    player.frame(20)
    assert world.step_count > 20
    pixels = pygame.surfarray.array3d(player.view.screen)
    assert len({*map(tuple, pixels.reshape(-1, 3).tolist())}) > 10
    player.view.close()
    world.close()

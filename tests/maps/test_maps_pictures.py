"""What there is to draw of a map, with pygame into a surface, against images drawn by code."""

from __future__ import annotations

import sys
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
from helpers_folders import ROOT, imported
from helpers_maps import FLIPPED, map_of, objects_of, thing, tile, tiles_of, tileset, write

from carom import maps

pygame = pytest.importorskip("pygame")


def camera_of(width, height, scale, middle):
    """As carom.view.Camera has it."""
    half = np.array((width, height)) / (2 * scale)

    def to_screen(points):
        return (np.asarray(points) - middle) * (scale, -scale) + np.array((width, height)) / 2

    return SimpleNamespace(
        to_screen=to_screen, middle=np.array(middle), scale=scale, visible=(middle - half, middle + half)
    )


def image_of(path, pixels):
    """An image (rows, columns, 3)."""
    surface = pygame.Surface(pixels.shape[1::-1], pygame.SRCALPHA)
    for (r, c), _ in np.ndenumerate(pixels[:, :, 0]):
        surface.set_at((c, r), (*pixels[r, c].tolist(), 255))
    pygame.image.save(surface, str(path))


def pixels_of(surface):
    return pygame.surfarray.array3d(surface).transpose(1, 0, 2)


def test_tiles_are_drawn_in_all_eight_ways(tmp_path, world):
    """Each pixel of a tileset of 2 tiles, at one screen pixel each, also moved, and with a layer in front."""
    random = np.random.default_rng(2)
    image = random.integers(1, 255, (16, 32, 3)).astype(np.uint8)
    image_of(tmp_path / "basic.png", image)
    flips = np.arange(8).reshape(2, 4)
    numbers = np.array(((1, 2, 1, 2), (2, 1, 2, 1)))
    gids = numbers | sum(np.where(flips & ours, bit, 0) for ours, bit in FLIPPED.items())
    path = write(tmp_path / "map.tmx", map_of(4, 2, tiles_of(gids), tilesets=[tileset(count=2)]))
    level = maps.load(path, world)
    wanted = np.zeros((32, 64, 3), np.uint8)
    for r in range(2):
        for c in range(4):
            part = image[:, 16 * numbers[r, c] - 16 : 16 * numbers[r, c]]
            part = part.transpose(1, 0, 2) if flips[r, c] & 4 else part
            part = part[:, ::-1] if flips[r, c] & 1 else part
            wanted[16 * r : 16 * r + 16, 16 * c : 16 * c + 16] = part[::-1] if flips[r, c] & 2 else part
    screen = pygame.Surface((64, 32))
    level.draw(screen, camera_of(64, 32, 16.0, (2.0, 1.0)))
    np.testing.assert_array_equal(pixels_of(screen), wanted)
    screen.fill((0, 0, 0))
    level.draw(screen, camera_of(64, 32, 16.0, (2.5, 1.25)), layers=["ground"])
    np.testing.assert_array_equal(pixels_of(screen)[4:, :56], wanted[:-4, 8:])
    assert not pixels_of(screen)[:4].any()


def test_scaled_tiles_leave_no_gaps(tmp_path, world):
    image_of(tmp_path / "basic.png", np.full((16, 16, 3), 200, np.uint8))
    path = write(tmp_path / "map.tmx", map_of(9, 9, tiles_of(np.ones((9, 9), int)), tilesets=[tileset(count=1)]))
    level = maps.load(path, world, metres=0.7)
    for scale in (7.3, 11.9, 33.3):
        screen = pygame.Surface((40, 40))
        level.draw(screen, camera_of(40, 40, scale, (3.1, 3.3)))
        assert (pixels_of(screen) == 200).all()


def test_images_parallax_and_animations(tmp_path, world):
    """An image layer at half the camera's speed; a tile that shows another one after .1 s; a layer half seen."""
    image = np.zeros((16, 48, 3), np.uint8)
    image[:, :16, 0], image[:, 16:32, 1], image[:, 32:, 2] = 200, 200, 200
    image_of(tmp_path / "basic.png", image)
    image_of(tmp_path / "back.png", np.full((8, 8, 3), 90, np.uint8))
    back = {"type": "imagelayer", "name": "back", "image": "back.png", "imagewidth": 8, "imageheight": 8,
            "parallaxx": 0.5, "parallaxy": 1, "offsetx": 4, "offsety": 2, "opacity": 1, "visible": True}  # fmt: skip
    moving = {**tile(0), "animation": [{"duration": 100, "tileid": 1}, {"duration": 100, "tileid": 2}]}
    ground = tiles_of([[0, 0, 0, 0], [0, 0, 1, 0]], opacity=0.5)
    path = write(tmp_path / "map.tmx", map_of(4, 2, back, ground, tilesets=[tileset(moving, count=3)]))
    level = maps.load(path, world)
    screen = pygame.Surface((64, 32))
    level.draw(screen, camera_of(64, 32, 16.0, (2.0, 1.0)))
    found = pixels_of(screen)
    assert (found[2:10, 20:28] == 90).all()  # the camera is 32 pixels from the origin, so it lags 16 behind
    assert (np.abs(found[16:, 32:48].astype(int) - (0, 100, 0)) <= 1).all()
    level.draw(screen, camera_of(64, 32, 16.0, (2.0, 1.0)), layers=["ground"], seconds=0.15)
    assert pixels_of(screen)[20, 40, 2] >= 99


def test_sprites_of_tile_objects(tmp_path, world):
    image_of(tmp_path / "basic.png", np.arange(16 * 16 * 3).reshape(16, 16, 3).astype(np.uint8))
    drawn = [thing(1, 0, 32, 32, 16, gid=1 | 0x80000000, properties={"mass": 1.0}),
             thing(2, 32, 32, 16, 16, gid=1, rotation=90, kind="Decoration")]  # fmt: skip
    path = write(tmp_path / "map.tmx", map_of(4, 2, objects_of(*drawn), tilesets=[tileset(count=1)]))
    level = maps.load(path, world)
    added = []
    level.add_sprites(SimpleNamespace(add=lambda entity, surface, **values: added.append((entity, surface, values))))
    ((entity, surface, values),) = added
    assert entity == level.object(1).entity
    assert surface.get_size() == (32, 16)
    assert values == {"metres": 1.0, "offset": (0.0, 0.0), "z": 0}
    assert surface.get_at((31, 3))[:3] == (3 * 48, 3 * 48 + 1, 3 * 48 + 2)  # exchanged left and right
    screen = pygame.Surface((64, 32))
    level.draw(screen, camera_of(64, 32, 16.0, (2.0, 1.0)))
    left = pixels_of(screen)[16:, :32]
    assert not left.any()  # the body's is the sprite's to draw


def test_a_missing_image_is_told_once_and_drawn_as_a_box(tmp_path, world):
    path = write(tmp_path / "map.tmx", map_of(2, 1, tiles_of([[1, 2]]), tilesets=[tileset(count=2)]))
    level = maps.load(path, world)
    screen = pygame.Surface((32, 16))
    camera = camera_of(32, 16, 16.0, (1.0, 0.5))
    with pytest.warns(UserWarning, match=r"basic\.png is missing; what it shows is drawn as boxes"):
        level.draw(screen, camera)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        level.draw(screen, camera)
    assert pixels_of(screen).any(axis=2).all()
    (finding,) = maps.check(path)
    assert finding.text == f"image {tmp_path / 'basic.png'} is missing; what it shows is drawn as boxes"


@pytest.mark.slow
def test_no_module_of_maps_imports_what_is_heavy():
    """pygame is imported when something is drawn, and nothing else is needed."""
    roots = {name.partition(".")[0] for path in (ROOT / "maps").rglob("*.py") for name in imported(path)}
    outside = {name for name in roots if name not in sys.stdlib_module_names}
    assert outside == {"carom", "numpy"}

"""Tiles, images and sprites of a level with pygame, which is imported when something is drawn."""

from __future__ import annotations

import importlib
import math
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from .contents import LevelLayer, LevelSprite
from .formats.model import DIAGONAL, HORIZONTAL, VERTICAL, Picture

MOST = 4096  # scaled pictures that are kept
BOX, EDGE = (120, 120, 130, 160), (70, 70, 80, 255)  # of what has no image
MISSING = "pygame is missing; it comes with the extra: pip install 'carom[view]'"


class Pictures:
    """Draws the layers of a level of a ``size`` (width, height) in m, and makes its sprites; images are read when they
    are first seen."""

    def __init__(
        self, layers: dict[str, LevelLayer], pictures: list[Picture], size: tuple[float, float], metres_per_pixel: float
    ) -> None:
        try:
            self.pygame: Any = importlib.import_module("pygame")
        except ImportError as error:
            raise ImportError(MISSING) from error
        self._layers, self._pictures, self._size = layers, pictures, size
        self._metres_per_pixel = metres_per_pixel
        self._sizes = np.array([each.size for each in pictures], float).reshape(-1, 2) * metres_per_pixel
        self._images: dict[Path, Any] = {}
        self._scaled: dict[Any, Any] = {}

    def draw(self, surface: Any, camera: Any, layers: Iterable[str] | None, seconds: float) -> None:
        for name in self._layers if layers is None else layers:
            layer = self._layers[name]
            if layer.visible and layer.opacity > 0.0:
                self._layer(layer, surface, camera, seconds)

    def add_sprites(self, sprites: Any, layers: Iterable[str] | None) -> None:
        for z, (name, layer) in enumerate(self._layers.items()):
            for sprite in layer.sprites if layers is None or name in layers else ():
                if sprite.entity is not None and sprite.visible:
                    picture, metres = self._sprite(sprite, layer)
                    sprites.add(sprite.entity, picture, metres=metres, offset=sprite.offset, z=z)

    # -- layers ----------------------------------------------------------------------------------------

    def _layer(self, layer: LevelLayer, surface: Any, camera: Any, seconds: float) -> None:
        origin = np.array((0.0, self._size[1]))  # layers with parallax are at their place with the camera here
        shift = (np.asarray(camera.middle) - origin) * (1.0 - np.array(layer.parallax))
        low, high = (corner - shift for corner in camera.visible)
        blits: list[tuple[Any, tuple[int, int]]] = []
        if layer.tiles is not None:
            blits += self._tiles(layer, camera, shift, low, high, seconds)
        if layer.picture >= 0:
            blits += self._image(layer, camera, shift, low, high)
        for sprite in layer.sprites:
            if sprite.entity is None and sprite.visible:
                reach, middle = 0.5 * math.hypot(*sprite.size), np.array(sprite.offset)
                if (middle + reach >= low).all() and (middle - reach <= high).all():
                    picture, metres = self._sprite(sprite, layer)
                    blits.append(self._still(picture, metres, camera.to_screen(middle + shift), camera.scale))
        surface.fblits(blits)

    def _tiles(
        self, layer: LevelLayer, camera: Any, shift: Any, low: Any, high: Any, seconds: float
    ) -> list[tuple[Any, tuple[int, int]]]:
        tiles = layer.tiles
        assert tiles is not None
        if not len(tiles.place):
            return []
        size = self._sizes[tiles.picture]
        diagonal = (tiles.flips & DIAGONAL).astype(bool)
        size = np.where(diagonal[:, None], size[:, ::-1], size)
        seen = np.flatnonzero(((tiles.place + size >= low) & (tiles.place <= high)).all(axis=1))
        corners = tiles.place[seen] + shift
        size = size[seen]
        upper_left = np.floor(camera.to_screen(corners + size * (0.0, 1.0)) + 1e-6).astype(int)
        lower_right = np.ceil(camera.to_screen(corners + size * (1.0, 0.0)) - 1e-6).astype(int)
        pixels = np.maximum(lower_right - upper_left, 1)
        numbers = [self._frame(k, seconds) for k in tiles.picture[seen].tolist()]
        look = layer.opacity, layer.tint
        return [
            (self._look(number, flips, (w, h), *look), (x, y))
            for number, flips, (w, h), (x, y) in zip(
                numbers, tiles.flips[seen].tolist(), pixels.tolist(), upper_left.tolist(), strict=True
            )
        ]

    def _image(
        self, layer: LevelLayer, camera: Any, shift: Any, low: Any, high: Any
    ) -> list[tuple[Any, tuple[int, int]]]:
        picture = self._pictures[layer.picture]
        width, height = picture.size if all(picture.size) else self._part(picture).get_size()
        size = np.array((width, height)) * self._metres_per_pixel
        corner = np.array((layer.offset[0], self._size[1] + layer.offset[1] - size[1]))  # the lower left one
        counts = []
        for k, repeats in enumerate(layer.repeat):
            first, last = math.floor((low[k] - corner[k]) / size[k]), math.floor((high[k] - corner[k]) / size[k])
            counts.append(range(first, last + 1) if repeats else range(1))
        pixels = np.maximum(np.ceil(size * camera.scale - 1e-6).astype(int), 1)
        look = self._look(layer.picture, 0, tuple(pixels.tolist()), layer.opacity, layer.tint)
        places = [corner + size * (i, j + 1) + shift for j in counts[1] for i in counts[0]]
        return [(look, tuple(np.floor(camera.to_screen(place)).astype(int).tolist())) for place in places]

    def _still(self, picture: Any, metres: float, middle: Any, scale: float) -> tuple[Any, tuple[int, int]]:
        factor = metres * scale / picture.get_height()
        size = tuple(max(1, round(each * factor)) for each in picture.get_size())
        key = id(picture), size
        scaled = self._kept(key, lambda: self.pygame.transform.scale(picture, size))
        return scaled, (round(middle[0] - size[0] / 2), round(middle[1] - size[1] / 2))

    # -- pictures --------------------------------------------------------------------------------------

    def _frame(self, number: int, seconds: float) -> int:
        """The picture that an animation shows then."""
        frames = self._pictures[number].frames
        if not frames:
            return number
        left = seconds % sum(each[0] for each in frames) if seconds else 0.0
        for duration, shown in frames:
            if left < duration:
                return shown
            left -= duration
        return frames[-1][1]

    def _sprite(self, sprite: LevelSprite, layer: LevelLayer) -> tuple[Any, float]:
        """(its surface, how high that is, m), in the pixels of its image, flipped and turned against the body."""
        key = "sprite", sprite.picture, sprite.flips, sprite.size, round(sprite.angle, 9), layer.opacity, layer.tint

        def made() -> Any:
            own = self._part(self._pictures[sprite.picture]).get_size() if sprite.picture >= 0 else (16, 16)
            w, h = own[::-1] if sprite.flips & DIAGONAL else own
            w = max(1, round(h * sprite.size[0] / sprite.size[1]))
            look = self._look(sprite.picture, sprite.flips, (w, h), layer.opacity, layer.tint)
            turned = self.pygame.transform.rotate(look, math.degrees(sprite.angle)) if sprite.angle else look
            return turned, sprite.size[1] * turned.get_height() / h

        return self._kept(key, made)

    def _look(self, number: int, flips: int, size: tuple[int, ...], opacity: float, tint: str) -> Any:
        """A picture, flipped, of that many pixels."""

        def made() -> Any:
            pygame, part = self.pygame, self._part(self._pictures[number] if number >= 0 else None)
            if flips & DIAGONAL:
                part = pygame.transform.flip(pygame.transform.rotate(part, 90), False, True)
            if flips & (HORIZONTAL | VERTICAL):
                part = pygame.transform.flip(part, bool(flips & HORIZONTAL), bool(flips & VERTICAL))
            part = pygame.transform.scale(part, size)
            if tint:
                part.fill(_colour(tint), special_flags=pygame.BLEND_RGBA_MULT)
            if opacity < 1.0:
                part.fill((255, 255, 255, round(255 * opacity)), special_flags=pygame.BLEND_RGBA_MULT)
            return part

        return self._kept((number, flips, size, opacity, tint), made)

    def _kept(self, key: Any, made: Any) -> Any:
        if key not in self._scaled:
            if len(self._scaled) >= MOST:
                self._scaled = {key: each for key, each in self._scaled.items() if key[0] == "sprite"}
            self._scaled[key] = made()
        return self._scaled[key]

    def _part(self, picture: Picture | None) -> Any:
        """The part of its image; a box if there is none."""
        pygame, image = self.pygame, None
        if picture is not None and picture.path is not None:
            image = self._image_of(picture.path)
        if image is None:
            size = (16.0, 16.0) if picture is None or not all(picture.size) else picture.size
            box = pygame.Surface([max(1, round(each)) for each in size], pygame.SRCALPHA)
            box.fill(BOX)
            pygame.draw.rect(box, EDGE, box.get_rect(), 1)
            return box
        if picture is None or picture.rectangle is None:
            return image
        x, y, width, height = picture.rectangle
        part = pygame.Surface((width, height), pygame.SRCALPHA)
        part.blit(image, (0, 0), (x, y, width, height))
        return part

    def _image_of(self, path: Path) -> Any:
        if path not in self._images:
            try:
                image = self.pygame.image.load(str(path))
                alpha = self.pygame.Surface(image.get_size(), self.pygame.SRCALPHA)
                alpha.blit(image, (0, 0))
                self._images[path] = alpha
            except (OSError, self.pygame.error) as error:
                self._images[path] = None
                what = f"cannot be read: {error}" if path.exists() else "is missing"
                warnings.warn(f"image {path} {what}; what it shows is drawn as boxes", stacklevel=2)
        return self._images[path]


def _colour(text: str) -> tuple[int, int, int, int]:
    """Of Tiled's "#aarrggbb" or "#rrggbb"."""
    digits = text.lstrip("#")
    a, r, g, b = bytes.fromhex(digits if len(digits) == 8 else "ff" + digits)
    return r, g, b, a

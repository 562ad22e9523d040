"""What a loaded map is to its game: entities by name and class, places, layers, and what there is to draw."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .contents import Classes, LevelLayer, LevelObject, Names
from .formats.model import Picture
from .pictures import Pictures


class Level:
    """A map in a world; see :func:`carom.maps.load`.

    size, metres, tile_pixels
        (width, height) m of the map, and the side of a tile in m and pixels; its lower left corner is at (0, 0)
    entities, points
        by the names of objects: entities, and places (x, y) m of points
    of_class
        lists of entities by class
    layers
        by name, in the order of the map, which is that to draw; those of groups among them
    pictures
        what tiles, sprites and image layers show, by number
    properties
        of the map
    """

    def __init__(self, file: Path, size: tuple[float, float], metres: float, tile_pixels: float) -> None:
        self.file, self.size, self.metres, self.tile_pixels = file, size, metres, tile_pixels
        self.entities: dict[str, int] = Names("object")
        self.points: dict[str, tuple[float, float]] = Names("point")
        self.of_class: dict[str, list[int]] = Classes()
        self.layers: dict[str, LevelLayer] = {}
        self.pictures: list[Picture] = []
        self.properties: dict[str, Any] = {}
        self.background = ""
        self.objects: dict[Any, LevelObject] = {}
        self._pictures: Pictures | None = None

    def object(self, id: Any) -> LevelObject:
        """The object with this id: of Tiled a number, of LDtk a text; KeyError if there is none."""
        if id not in self.objects:
            raise KeyError(f"no object has the id {id!r}")
        return self.objects[id]

    def object_of(self, entity: int) -> LevelObject:
        """The object that this entity was made of; KeyError if it was made of none."""
        found = next((each for each in self.objects.values() if entity in each.entities), None)
        if found is None:
            raise KeyError(f"entity {entity!r} was made of no object")
        return found

    def draw(self, surface: Any, camera: Any, layers: Iterable[str] | None = None, seconds: float = 0.0) -> None:
        """Draw tiles, images, and objects without a body, on a pygame.Surface; ImportError without pygame.

        camera
            where metres are on it, as :class:`carom.view.Camera`
        layers
            names of those to draw, in this order; None: all that are visible
        seconds
            of game time, for animated tiles
        """
        self._pictures_with_pygame().draw(surface, camera, layers, seconds)

    def add_sprites(self, sprites: Any, layers: Iterable[str] | None = None) -> None:
        """Give the bodies of tile objects their pictures; ImportError without pygame.

        sprites
            as :class:`carom.view.Sprites`, whose ``add`` is called for each
        layers
            names of those whose objects get some; None: all
        """
        self._pictures_with_pygame().add_sprites(sprites, layers)

    def _pictures_with_pygame(self) -> Pictures:
        if self._pictures is None:
            self._pictures = Pictures(self.layers, self.pictures, self.size, self.metres / self.tile_pixels)
        return self._pictures

    def __repr__(self) -> str:
        size = f"{self.size[0]:g} x {self.size[1]:g} m"
        return f"<Level {self.file.name}, {size}, {len(self.layers)} layers, {len(self.objects)} objects>"

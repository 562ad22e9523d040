"""What a loaded map is to its game: entities by name and class, places, layers, and what there is to draw."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..framework.names import did_you_mean
from .formats.model import Picture


class Names(dict[str, Any]):
    """By name; KeyError tells of what is near, and of names that several things have."""

    def __init__(self, what: str) -> None:
        super().__init__()
        self.what = what
        self.several: dict[str, int] = {}

    def put(self, name: str, value: Any) -> None:
        """Under a name; one that several have is none."""
        if not name:
            return
        count = self.several.get(name, 0) + (name in self)
        if count:
            self.several[name] = count + 1 if name not in self else 2
            self.pop(name, None)
        else:
            self[name] = value

    def __missing__(self, name: str) -> Any:
        if name in self.several:
            count = self.several[name]
            raise KeyError(f"{count} {self.what}s are named {name!r}: take level.object(id) or level.of_class")
        raise KeyError(f"no {self.what} is named {name!r}{did_you_mean(str(name), self)}")


class Classes(dict[str, list[int]]):
    """Entities by class; those of a class that nothing has are none."""

    def __missing__(self, name: str) -> list[int]:
        return []


@dataclass
class LevelObject:
    """An object of the map as its game sees it.

    place
        (x, y) m, y up: the middle of what was drawn; of a point where it is
    size
        (width, height) m
    angle
        rad, counter-clockwise
    properties
        by name, as they were written; fields of classes as dictionaries
    entity, entities
        what was made of it, None and () if nothing; several for chains and bodies of parts, the body first
    points
        (n, 2) m of a polygon or polyline in the world, else None
    """

    id: Any
    name: str
    kinds: tuple[str, ...]
    place: tuple[float, float]
    size: tuple[float, float]
    angle: float
    properties: dict[str, Any]
    entity: int | None = None
    entities: tuple[int, ...] = ()
    points: np.ndarray | None = None


class Tiles(NamedTuple):
    """Pictures of a tile layer, in the order to draw.

    place
        (n, 2) m, lower left corners, y up
    picture
        (n,) numbers of ``level.pictures``
    flips
        (n,) bits: 1 horizontally, 2 vertically, 4 along the diagonal, which comes first
    cell
        (n, 2) row and column; -1 of what is in no cell
    """

    place: np.ndarray
    picture: np.ndarray
    flips: np.ndarray
    cell: np.ndarray


class LevelSprite(NamedTuple):
    """The picture of an object with an entity, or of a point in the level without one.

    entity
        None: it stands still, with its middle at ``offset``, turned by ``angle``
    size
        (width, height) m
    offset
        (2,) m, the picture's middle from the entity's position, along its axes
    angle
        rad, of the picture against the entity's rotation
    """

    entity: int | None
    picture: int
    size: tuple[float, float]
    offset: tuple[float, float]
    angle: float
    flips: int
    visible: bool


@dataclass
class LevelLayer:
    """A layer, with what its groups give it.

    kind
        tiles, objects or image
    entities
        all that were made of it
    offset
        (x, y) m, y up, by which it is drawn and its bodies are moved
    parallax
        (x, y), how far it moves with the camera; 1 with the world
    """

    name: str
    kind: str
    kinds: tuple[str, ...]
    properties: dict[str, Any]
    offset: tuple[float, float]
    parallax: tuple[float, float]
    opacity: float
    visible: bool
    tint: str
    entities: list[int] = field(default_factory=list)
    tiles: Tiles | None = None
    sprites: list[LevelSprite] = field(default_factory=list)
    picture: int = -1
    repeat: tuple[bool, bool] = (False, False)


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
        self._pictures: Any = None

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

    def _pictures_with_pygame(self) -> Any:
        if self._pictures is None:
            from .pictures import Pictures  # only here: games without a window have no pygame

            self._pictures = Pictures(self)
        return self._pictures

    def __repr__(self) -> str:
        size = f"{self.size[0]:g} x {self.size[1]:g} m"
        return f"<Level {self.file.name}, {size}, {len(self.layers)} layers, {len(self.objects)} objects>"

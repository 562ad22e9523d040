"""What a level consists of: its objects and layers, and the pictures that these show."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ..framework.names import did_you_mean


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

"""A map as it was read, from whichever editor: layers, tiles and objects in pixels, y down. No world is known here."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .reading import Property

HORIZONTAL, VERTICAL, DIAGONAL = 1, 2, 4  # bits of a flip; the diagonal one comes first


class Picture(NamedTuple):
    """What a tile, an object or a layer shows: a part of an image file.

    path
        of the file; None: an image was not given
    rectangle
        (x, y, width, height) pixels of the file, y down; None: all of it
    size
        (width, height) pixels of the map that it fills, before it is scaled
    frames
        of an animation: (seconds, number of the picture) each
    """

    path: Path | None
    rectangle: tuple[int, int, int, int] | None
    size: tuple[float, float]
    frames: tuple[tuple[float, int], ...] = ()


@dataclass
class MapObject:
    """An object as it was drawn; ``place`` (2,) and ``size`` in pixels, y down, ``angle`` in degrees, clockwise.

    shape: rectangle, ellipse, capsule, point, polygon, polyline, text or tile; its points, (n, 2), are from its place
    """

    id: Any
    name: str
    kinds: str  # class, or several with commas
    shape: str
    place: np.ndarray
    size: tuple[float, float] = (0.0, 0.0)
    angle: float = 0.0
    points: np.ndarray | None = None
    properties: dict[str, Property] = field(default_factory=dict)
    visible: bool = True
    tile: Tile | None = None
    flips: int = 0
    origin: tuple[float, float] = (0.0, 0.0)  # of its place in its size, as fractions


@dataclass
class Tile:
    """A tile of a tileset: ``where`` for findings, ``size`` in pixels, shapes of the collision editor in its pixels."""

    where: str
    kinds: str
    size: tuple[float, float]
    properties: dict[str, Property] = field(default_factory=dict)
    shapes: list[MapObject] = field(default_factory=list)
    picture: int = -1
    offset: tuple[float, float] = (0.0, 0.0)


@dataclass
class MapLayer:
    """A layer with what its groups give it: offset (x, y) pixels, parallax, opacity, visible, tint.

    groups: in which it is, the outermost first: they have classes and properties too
    kind: tiles, objects or image
    cells: (rows, columns) of tiles, whole numbers: which of the map's tiles, 0 none
    flips: (rows, columns), bits of the flips
    painted: pictures of a layer that are no cells: (n, 2) pixels of their upper left corners, their numbers and flips
    """

    name: str
    kind: str
    kinds: str
    properties: dict[str, Property]
    offset: tuple[float, float]
    parallax: tuple[float, float]
    opacity: float
    visible: bool
    tint: str
    cells: np.ndarray | None = None
    flips: np.ndarray | None = None
    objects: list[MapObject] = field(default_factory=list)
    picture: int = -1
    repeat: tuple[bool, bool] = (False, False)
    painted: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
    groups: tuple[MapLayer, ...] = ()


@dataclass
class MapData:
    """All of a map; ``tiles`` by the numbers in the cells of layers."""

    file: Path
    rows: int
    columns: int
    tile: float  # pixels
    layers: list[MapLayer] = field(default_factory=list)
    tiles: dict[int, Tile] = field(default_factory=dict)
    pictures: list[Picture] = field(default_factory=list)
    properties: dict[str, Property] = field(default_factory=dict)
    background: str = ""

"""Levels of LDtk projects, .ldtk, read from their JSON into the model."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import Findings, RefusedError
from .model import HORIZONTAL, VERTICAL, MapData, MapLayer, MapObject, Picture, Tile
from .reading import Node, Property, above_0, document, nodes, number, whole, word
from .tiled import LARGEST

SHAPES = {"Rectangle": "rectangle", "Ellipse": "ellipse", "Cross": "point", "Tile": "tile"}
MARKS = {"oneway": "OneWay", "one_way": "OneWay", "decoration": "Decoration"}


def is_ldtk(node: Node) -> bool:
    return "levels" in node and "defs" in node


def read_ldtk(
    path: Path, node: Node, level: str | None, findings: Findings, is_class: Callable[[str], bool],
    materials: Collection[str],
) -> MapData:  # fmt: skip
    """The level of that name; the only one if None. RefusedError if there is none.

    is_class
        whether a name is one of a component or prefab: other points are named by it
    materials
        names of materials: values of IntGrid layers with other names, no classes either, are plain solid
    """
    return Reader(path, node, findings, is_class, materials).level(_level_of(path, node, level))


def level_names(node: Node) -> list[str]:
    return [word(each, "identifier") for each in _levels(node)]


def _levels(node: Node) -> list[Node]:
    return nodes(node, "levels") + [each for world in nodes(node, "worlds") for each in nodes(world, "levels")]


def _level_of(path: Path, node: Node, name: str | None) -> Node:
    levels, names = _levels(node), level_names(node)
    if name is None and len(levels) != 1:
        choice = f"choose one, level=..., of {', '.join(names)}" if names else "there is nothing to load"
        raise RefusedError(f"the project has {len(levels)} levels: {choice}")
    if name is not None and name not in names:
        raise RefusedError(f"no level is named {name!r}; there are {', '.join(names) or 'none'}")
    found = levels[0 if name is None else names.index(name)]
    if found.get("layerInstances") is None and found.get("externalRelPath"):
        found = document(path.parent / str(found["externalRelPath"]))
    return found


class Reader:
    def __init__(
        self, path: Path, node: Node, findings: Findings, is_class: Callable[[str], bool], materials: Collection[str]
    ) -> None:
        self.path, self.findings, self.is_class, self.node = path, findings, is_class, node
        self.materials = materials
        defs = node["defs"]
        if not isinstance(defs, dict):
            raise RefusedError("'defs' must be an object")
        self.layer_defs = {whole(each, "uid"): each for each in nodes(defs, "layers")}
        self.entity_defs = {whole(each, "uid"): each for each in nodes(defs, "entities")}
        self.tilesets = {whole(each, "uid"): each for each in nodes(defs, "tilesets")}
        self.numbers: dict[Any, int] = {}  # of pictures

    def level(self, node: Node) -> MapData:
        layers = nodes(node, "layerInstances")
        grids = [each for each in layers if each.get("intGridCsv")] or layers
        tile = above_0(grids[0], "__gridSize") if grids else above_0(self.node, "defaultGridSize", 16)
        width, height = above_0(node, "pxWid"), above_0(node, "pxHei")
        columns, rows = int(-(-width // tile)), int(-(-height // tile))
        if columns * rows > LARGEST:
            raise RefusedError(f"the level has {columns} x {rows} = {columns * rows:,} cells; at most {LARGEST:,}")
        self.data = MapData(self.path, rows, columns, tile, background=word(node, "__bgColor"))
        self.data.properties = self.fields(node, tile, (0.0, 0.0))
        for each in reversed(layers):  # the first is the one in front
            with self.findings.at(f"layer {word(each, '__identifier')!r}"):
                self.layer(each)
        return self.data

    def layer(self, node: Node) -> None:
        of = self.layer_defs.get(whole(node, "layerDefUid", -1), {})
        offset = number(node, "__pxTotalOffsetX", 0), number(node, "__pxTotalOffsetY", 0)
        parallax = 1.0 - number(of, "parallaxFactorX", 0), 1.0 - number(of, "parallaxFactorY", 0)
        name, grid = word(node, "__identifier"), number(node, "__gridSize")
        made = MapLayer(name, "tiles", "", {}, offset, parallax, number(node, "__opacity", 1),
                        bool(node.get("visible", True)), "")  # fmt: skip
        made.painted = self.painted(node)
        shape = self.data.rows, self.data.columns
        made.cells, made.flips = np.zeros(shape, np.int64), np.zeros(shape, np.uint8)
        if node.get("__type") == "Entities":
            made.kind, made.painted = "objects", None
            for each in nodes(node, "entityInstances"):
                with self.findings.at(f"object {each.get('iid', '?')} {each.get('__identifier', '')!r}"):
                    made.objects.append(self.object(each, grid, offset))
        if node.get("intGridCsv"):
            if grid != self.data.tile:
                raise RefusedError(f"its cells are {grid:g} pixels, those of the level {self.data.tile:g}")
            made.cells = self.cells(node, of)
        self.data.layers.append(made)

    def cells(self, node: Node, of: Node) -> np.ndarray:
        """Numbers of tiles, one for each value of the layer."""
        rows, columns = self.data.rows, self.data.columns
        try:
            values = np.array([int(each) for each in node["intGridCsv"]], np.int64)
        except (TypeError, ValueError, OverflowError) as error:
            raise RefusedError(f"its cells are no whole numbers: {error}") from error
        if values.size != rows * columns:
            raise RefusedError(f"its data has {values.size} cells, and the level {columns} x {rows} = {rows * columns}")
        names = {whole(each, "value"): word(each, "identifier") for each in nodes(of, "intGridValues")}
        first = max(self.data.tiles, default=0)
        numbers = {0: 0}
        for k, value in enumerate(sorted({*values.tolist()} - {0})):
            name, numbers[value] = names.get(value, ""), first + 1 + k
            where, size = f"IntGrid value {value}" + f" {name!r}" * bool(name), (self.data.tile, self.data.tile)
            self.data.tiles[numbers[value]] = Tile(where, self.kind_of(name), size)
        known, which = np.unique(values, return_inverse=True)
        return np.array([numbers[value] for value in known.tolist()])[which].reshape(rows, columns)

    def kind_of(self, name: str) -> str:
        """The class of an IntGrid value of that name."""
        known = name in self.materials or self.is_class(name)
        return MARKS.get(name.casefold(), name if known else "Solid")

    def painted(self, node: Node) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What a layer shows, rules and painted tiles."""
        tiles = nodes(node, "autoLayerTiles") + nodes(node, "gridTiles")
        if not tiles:
            return np.zeros((0, 2)), np.zeros(0, np.int64), np.zeros(0, np.uint8)
        uid = whole(node, "__tilesetDefUid", -1)
        size = above_0(self.tilesets.get(uid, {}), "tileGridSize", self.data.tile)
        parts = [(*map(int, _pair(each, "src")), int(size), int(size)) for each in tiles]
        flips = np.array([whole(each, "f", 0) & (HORIZONTAL | VERTICAL) for each in tiles], np.uint8)
        return (
            np.array([_pair(each, "px") for each in tiles]),
            np.array([self.picture(uid, part) for part in parts], np.int64), flips,
        )  # fmt: skip

    def picture(self, uid: int, part: tuple[int, ...]) -> int:
        """The number of a part of a tileset's image."""
        if (uid, part) not in self.numbers:
            file = word(self.tilesets.get(uid, {}), "relPath")
            self.numbers[uid, part] = len(self.data.pictures)
            x, y, width, height = part
            self.data.pictures.append(
                Picture(self.path.parent / file if file else None, (x, y, width, height), (width, height))
            )
        return self.numbers[uid, part]

    def object(self, node: Node, grid: float, offset: tuple[float, float]) -> MapObject:
        of = self.entity_defs.get(whole(node, "defUid", -1), {})
        kind = word(node, "__identifier")
        (x, y), (across, down) = _pair(node, "px"), _pair(node, "__pivot")
        properties = self.fields(node, grid, offset)
        given = properties.pop("name", None)
        shape = SHAPES.get(word(of, "renderMode"), "rectangle")
        part, tile = node.get("__tile"), None
        if shape == "tile" and isinstance(part, dict):
            w, h = above_0(part, "w"), above_0(part, "h")
            place = whole(part, "x"), whole(part, "y"), int(w), int(h)
            picture = self.picture(whole(part, "tilesetUid", -1), place)
            tile = Tile(f"entity {kind!r}", "", (w, h), picture=picture)
        elif shape == "tile":
            shape = "rectangle"
        return MapObject(
            word(node, "iid"), kind if given is None else str(given.value),
            "" if shape == "point" and not self.is_class(kind) else kind, shape, np.array((x, y)),
            (number(node, "width"), number(node, "height")), properties=properties, tile=tile, origin=(across, down),
        )  # fmt: skip

    def fields(self, node: Node, grid: float, offset: tuple[float, float]) -> dict[str, Property]:
        """Of an entity or a level; those that are not set are left out."""
        found = {}
        for each in nodes(node, "fieldInstances"):
            kind, value, name = word(each, "__type"), each.get("__value"), word(each, "__identifier")
            if value is None or value == []:
                continue
            if kind == "EntityRef":
                found[name] = Property("object", word(value, "entityIid"))
            elif kind in ("Point", "Array<Point>"):
                given = nodes({name: [value] if kind == "Point" else value}, name)
                cells = np.array([(number(each, "cx"), number(each, "cy")) for each in given]).reshape(-1, 2)
                found[name] = Property("places", (cells + 0.5) * grid + offset)
            elif not isinstance(value, dict):  # a tile is only a picture
                found[name] = Property(kind, value)
        return found


def _pair(node: Node, name: str) -> tuple[float, float]:
    given = node.get(name)
    if not isinstance(given, list) or len(given) != 2:
        raise RefusedError(f"{name!r} must be two numbers, got {given!r}")
    return number({name: given[0]}, name), number({name: given[1]}, name)

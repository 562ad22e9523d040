"""Maps of Tiled, .tmx and .tmj, with external tilesets and templates of objects, read into the model."""

from __future__ import annotations

import base64
import binascii
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import Findings, RefusedError
from .model import DIAGONAL, HORIZONTAL, VERTICAL, MapData, MapLayer, MapObject, Picture, Tile
from .reading import Node, above_0, document, flag, nodes, number, points, properties, whole, word

LARGEST = 4_000_000  # cells
FLIPS = ((0x80000000, HORIZONTAL), (0x40000000, VERTICAL), (0x20000000, DIAGONAL))  # bits of a number in a cell
SHAPES = ("ellipse", "point", "capsule", "polygon", "polyline", "text")
ALL_FLIPS = 0xF0000000  # a fourth is of hexagonal maps
# Where an object's place is in its tile, as fractions of its size from the upper left corner.
ALIGNMENTS = {
    "unspecified": (0.0, 1.0), "topleft": (0.0, 0.0), "top": (0.5, 0.0), "topright": (1.0, 0.0), "left": (0.0, 0.5),
    "center": (0.5, 0.5), "right": (1.0, 0.5), "bottomleft": (0.0, 1.0), "bottom": (0.5, 1.0),
    "bottomright": (1.0, 1.0),
}  # fmt: skip


def read_tiled(path: Path, node: Node, findings: Findings) -> MapData:
    """The map; what is wrong goes to ``findings``, and what cannot be passed over is RefusedError."""
    return Reader(path, findings).map(node)


class Reader:
    def __init__(self, path: Path, findings: Findings) -> None:
        self.path, self.findings = path, findings
        self.firsts: dict[Path, int] = {}  # of tilesets in files: the number of their first tile
        self.alignments: dict[int, tuple[float, float]] = {}  # by that number
        self.templates: dict[Path, Node] = {}
        self.next_first = 1

    def map(self, node: Node) -> MapData:
        if node.get("") not in (None, "map") or node.get("type", "map") != "map" or "orientation" not in node:
            raise RefusedError("this is no map of Tiled")
        orientation = word(node, "orientation")
        if orientation != "orthogonal":
            raise RefusedError(f"the map is {orientation}; only orthogonal maps have square tiles")
        if flag(node, "infinite", False):
            raise RefusedError("the map is infinite; clear Map > Map Properties > Infinite in Tiled")
        columns, rows = whole(node, "width"), whole(node, "height")
        if columns < 1 or rows < 1:
            raise RefusedError(f"the map is {columns} x {rows} tiles")
        if columns * rows > LARGEST:
            raise RefusedError(f"the map has {columns} x {rows} = {columns * rows:,} tiles; at most {LARGEST:,}")
        width, height = number(node, "tilewidth"), number(node, "tileheight")
        if width != height or width <= 0.0:
            raise RefusedError(f"tiles are {width:g} x {height:g} pixels; they must be square")
        self.data = MapData(self.path, rows, columns, width, properties=properties(node))
        self.data.background = word(node, "backgroundcolor")
        for each in nodes(node, "tilesets"):
            with self.findings.at(f"tileset {word(each, 'name', 'source')!r}"):
                self.tileset(each, self.path.parent)
        for each in nodes(node, "layers"):
            self.layer(each, None)
        return self.data

    # -- tilesets --------------------------------------------------------------------------------------

    def tileset(self, node: Node, folder: Path, first: int | None = None) -> None:
        first = whole(node, "firstgid") if first is None else first
        self.next_first = max(self.next_first, first + 1)
        if "source" in node:
            file = folder / str(node["source"])
            self.firsts[file.resolve()] = first
            node, folder = document(file), file.parent
            if node.get("") not in (None, "tileset") or "tilewidth" not in node:
                raise RefusedError(f"{file.name} is no tileset")
        width, height = above_0(node, "tilewidth"), above_0(node, "tileheight")
        count = whole(node, "tilecount", 0)
        own = {whole(each, "id"): each for each in nodes(node, "tiles")}
        if min(own, default=0) < 0:
            raise RefusedError(f"a tile has the id {min(own)}")
        count = max(count, 1 + max(own, default=-1))
        if count > LARGEST:
            raise RefusedError(f"it has {count:,} tiles")
        self.next_first = max(self.next_first, first + count)
        offset = node.get("tileoffset") or {}
        aside = number(offset, "x", 0), number(offset, "y", 0)
        alignment = word(node, "objectalignment") or "unspecified"
        if alignment not in ALIGNMENTS:
            raise RefusedError(f"unknown objectalignment {alignment!r}")
        self.alignments[first] = ALIGNMENTS[alignment]
        columns = max(1, whole(node, "columns", 0))
        margin, spacing = whole(node, "margin", 0), whole(node, "spacing", 0)
        image = folder / str(node["image"]) if node.get("image") else None
        pictures, name = len(self.data.pictures), word(node, "name")
        for k in range(count):
            x, y = margin + (k % columns) * (int(width) + spacing), margin + (k // columns) * (int(height) + spacing)
            self.data.pictures.append(Picture(image, (x, y, int(width), int(height)), (width, height)))
            where = f"tileset {name!r}, tile {k}"
            self.data.tiles[first + k] = Tile(where, "", (width, height), picture=pictures + k, offset=aside)
        for k, each in own.items():
            with self.findings.at(f"tile {k}"):
                self.tile(self.data.tiles[first + k], each, folder, pictures + k, pictures)

    def tile(self, tile: Tile, node: Node, folder: Path, picture: int, first: int) -> None:
        tile.kinds, tile.properties = word(node, "class", "type"), properties(node)
        if node.get("image"):  # a collection of images, each with its own size
            width, height = above_0(node, "imagewidth", tile.size[0]), above_0(node, "imageheight", tile.size[1])
            part = None
            if "width" in node:
                width, height = above_0(node, "width"), above_0(node, "height")
                part = (whole(node, "x", 0), whole(node, "y", 0), int(width), int(height))
            tile.size = width, height
            self.data.pictures[picture] = Picture(folder / str(node["image"]), part, tile.size)
        frames = tuple((number(each, "duration") / 1e3, first + whole(each, "tileid"))
                       for each in nodes(node, "animation"))  # fmt: skip
        if frames:
            self.data.pictures[picture] = self.data.pictures[picture]._replace(frames=frames)
        for each in nodes(node.get("objectgroup") or {}, "objects"):
            with self.findings.at(_title(each)):
                tile.shapes.append(self.object(each, folder))

    # -- layers ----------------------------------------------------------------------------------------

    def layer(self, node: Node, group: MapLayer | None) -> None:
        with self.findings.at(f"layer {word(node, 'name')!r}"):
            offset = np.array((number(node, "offsetx", 0), number(node, "offsety", 0)))
            parallax = np.array((number(node, "parallaxx", 1), number(node, "parallaxy", 1)))
            opacity, visible = number(node, "opacity", 1), flag(node, "visible", True)
            tint, kinds = word(node, "tintcolor"), word(node, "class")
            if group is not None:
                offset, parallax, opacity = offset + group.offset, parallax * group.parallax, opacity * group.opacity
                visible, tint = visible and group.visible, tint or group.tint
            layer = MapLayer(
                word(node, "name"), "", kinds, properties(node), tuple(offset.tolist()), tuple(parallax.tolist()),
                opacity, visible, tint, groups=() if group is None else (*group.groups, group),
            )  # fmt: skip
            kind = node.get("type")
            if kind == "group":
                for each in nodes(node, "layers"):
                    self.layer(each, layer)
                return
            if kind == "tilelayer":
                layer.kind = "tiles"
                layer.cells, layer.flips = self.cells(node)
            elif kind == "objectgroup":
                layer.kind = "objects"
                for each in nodes(node, "objects"):
                    with self.findings.at(_title(each)):
                        layer.objects.append(self.object(each, self.path.parent))
            elif kind == "imagelayer":
                layer.kind = "image"
                if node.get("image"):
                    size = number(node, "imagewidth", 0), number(node, "imageheight", 0)
                    layer.picture = len(self.data.pictures)
                    self.data.pictures.append(Picture(self.path.parent / str(node["image"]), None, size))
                layer.repeat = flag(node, "repeatx", False), flag(node, "repeaty", False)
            else:
                raise RefusedError(f"a layer of kind {kind!r}")
            self.data.layers.append(layer)

    def cells(self, node: Node) -> tuple[np.ndarray, np.ndarray]:
        """Which tile is in each cell, and how it is flipped."""
        rows, columns = self.data.rows, self.data.columns
        if node.get("chunks"):
            raise RefusedError("its data is in chunks, as of infinite maps")
        data, encoding = node.get("data", ""), word(node, "encoding")
        try:
            if encoding == "base64":
                unpacked = _unpacked(str(data), word(node, "compression"), 4 * rows * columns + 1)
                numbers = np.frombuffer(unpacked, "<u4")
            elif isinstance(data, str):
                texts = data.strip().rstrip(",").split(",")
                numbers = np.array(texts if texts != [""] else [], np.uint32)
            else:
                numbers = np.array([int(each) for each in data], np.uint32)
        except (ValueError, TypeError, OverflowError) as error:
            raise RefusedError(f"its data cannot be read: {str(error)[:80]}") from error
        if numbers.shape != (rows * columns,):
            raise RefusedError(f"its data has {numbers.size} cells, and the map {columns} x {rows} = {rows * columns}")
        numbers = numbers.reshape(rows, columns).astype(np.int64)
        flips = np.zeros((rows, columns), np.uint8)
        if (numbers > ~ALL_FLIPS & 0xFFFFFFFF).any():
            for bit, ours in FLIPS:
                flips |= np.where(numbers & bit, ours, 0).astype(np.uint8)
            numbers &= ~ALL_FLIPS
        for gid in np.unique(numbers).tolist():
            if gid and gid not in self.data.tiles:
                row, column = np.argwhere(numbers == gid)[0].tolist()
                self.findings.add(f"row {row}, column {column} has tile {gid}, which is in no tileset of the map")
        return numbers, flips

    # -- objects ---------------------------------------------------------------------------------------

    def object(self, node: Node, folder: Path) -> MapObject:
        if node.get("template"):
            node = self.of_template(node, folder)
        shape = next((name for name in SHAPES if node.get(name)), "rectangle")
        made = MapObject(
            whole(node, "id", 0), word(node, "name"), word(node, "class", "type"), shape,
            np.array((number(node, "x"), number(node, "y"))),
            (number(node, "width", 0), number(node, "height", 0)), number(node, "rotation", 0),
            properties=properties(node), visible=flag(node, "visible", True),
        )  # fmt: skip
        if shape in ("polygon", "polyline"):
            made.points = points(node, shape)
        if "gid" in node:
            gid = whole(node, "gid")
            made.shape, made.flips = "tile", sum(ours for bit, ours in FLIPS if gid & bit)
            gid &= ~ALL_FLIPS
            made.tile = self.data.tiles.get(gid)
            if made.tile is None:
                raise RefusedError(f"it shows tile {gid}, which is in no tileset of the map")
            made.origin = self.alignments[max(first for first in self.alignments if first <= gid)]
            if not any(made.size):
                made.size = made.tile.size
        return made

    def of_template(self, node: Node, folder: Path, seen: tuple[Path, ...] = ()) -> Node:
        """An object with what its template has given it; its own fields and properties come first."""
        file = (folder / str(node["template"])).resolve()
        if file in seen:
            names = " uses ".join(each.name for each in (*seen[seen.index(file):], file))
            raise RefusedError(f"templates in a circle: {names}")
        if file not in self.templates:
            self.templates[file] = document(file)
        template = self.templates[file]
        given: Any = template.get("object")
        if not isinstance(given, dict):
            raise RefusedError(f"{file.name} is no template of an object")
        if given.get("template"):
            given = self.of_template(given, file.parent, (*seen, file))
        elif "gid" in given:
            given = {**given, "gid": self.gid_of_template(whole(given, "gid"), template, file)}
        merged = {**given, **node}
        by_name = {each["name"]: each for each in (*_named(given), *_named(node))}
        return {**merged, "properties": list(by_name.values()), "template": None}

    def gid_of_template(self, gid: int, template: Node, file: Path) -> int:
        """The number that the tile of a template has in this map, whose tilesets may get one more."""
        node = template.get("tileset")
        if not isinstance(node, dict) or "source" not in node:
            raise RefusedError(f"{file.name} shows a tile and names no tileset")
        source = (file.parent / str(node["source"])).resolve()
        if source not in self.firsts:
            self.tileset(node, file.parent, self.next_first)
        return gid & ALL_FLIPS | ((gid & ~ALL_FLIPS) - whole(node, "firstgid", 1) + self.firsts[source])


def _named(node: Node) -> list[Node]:
    return [each for each in nodes(node, "properties") if "name" in each]


def _title(node: Node) -> str:
    return f"object {node.get('id', '?')}" + (f" {node['name']!r}" if node.get("name") else "")


def _unpacked(data: str, compression: str, most: int) -> bytes:
    """The bytes, ``most`` of them at most, however many there are."""
    try:
        raw = base64.b64decode(data.strip())
        if compression in ("zlib", "gzip"):
            return zlib.decompressobj(wbits=47).decompress(raw, most)  # either of the two
    except (zlib.error, binascii.Error) as error:
        raise ValueError(str(error)) from error
    if compression:
        raise ValueError(f"compression {compression}; choose CSV or zlib as Map > Tile Layer Format in Tiled")
    return raw

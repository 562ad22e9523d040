"""Tile layers: cells of tile grids, one-way runs, polygons, entities of single tiles, and what there is to draw."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..plugins.tile_grid import TileGridCollider, TileMaterial, TileShape
from .bodies import Bodies
from .contents import LevelLayer, Tiles
from .errors import Findings, RefusedError
from .fields import ONE_WAY, Fields
from .formats.model import DIAGONAL, MapData, MapLayer, MapObject, Tile
from .plan import Planned, transform
from .shapes import Shape

DIGITS = 6  # of a tile: corners that are nearer to those of a shape of the grid are these
CORNERS = {frozenset(shape.corners): shape for shape in TileShape if shape.corners}  # in tiles
IN_CELLS = ("friction", "restitution", "surface_velocity")  # of a material; others are those of the whole grid
MOST = 255  # materials of a grid


@dataclass
class Meaning:
    """What a tile is in a tile layer, however it is flipped: decoration if it is not solid and has no entity."""

    tile: Tile
    fields: Fields
    solid: bool
    is_entity: bool


class Grid:
    """Cells of one grid: numbers of their materials, and their shapes.

    common
        fields of the collider for all its cells
    """

    def __init__(self, shape: tuple[int, ...], common: dict[str, Any]) -> None:
        self.common, self.materials = common, dict[Any, int]()
        self.numbers, self.shapes = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)

    def add(self, cells: np.ndarray, material: dict[str, Any], shape: int) -> None:
        number = self.materials.setdefault(_key(material), 1 + len(self.materials))
        if number > MOST:
            raise RefusedError(f"more than {MOST} different materials in a layer")
        self.numbers[cells], self.shapes[cells] = number, shape

    def colliders(self, metres: float) -> list[TileGridCollider]:
        """Floors, walls and one-way cells, as far as there are any; plain grids if all cells are alike."""
        given: dict[str, Any] = {"lower": (0, 0), **self.common}
        if len(self.materials) == 1 and not self.shapes.any():
            given |= dict(next(iter(self.materials)))
        else:
            given["materials"] = {number: TileMaterial(**dict(key)) for key, number in self.materials.items()}
            given["shapes"] = self.shapes
        one_way = self.shapes == TileShape.ONE_WAY
        if not one_way.any():
            return [*TileGridCollider.floors_and_walls(self.numbers, metres, **given)]
        made = TileGridCollider.with_one_way(self.numbers, metres, **given)
        return [*made] if self.numbers[~one_way].any() else [made[-1]]


class Grids:
    """The grids of a layer: one for all tiles whose layers, masks and other common fields are the same."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.shape, self.by_key = shape, dict[Any, Grid]()

    def add(self, cells: np.ndarray, material: dict[str, Any], shape: int = 0) -> None:
        own = {name: value for name, value in material.items() if name in IN_CELLS}
        common = {name: value for name, value in material.items() if name not in IN_CELLS}
        self.by_key.setdefault(_key(common), Grid(self.shape, common)).add(cells, own, shape)


def _key(material: dict[str, Any]) -> tuple[Any, ...]:
    """The same for equal fields."""
    plain = {n: tuple(v) if isinstance(v, (list, tuple, np.ndarray)) else v for n, v in material.items()}
    return tuple(sorted(plain.items()))


class TileLayers:
    """Makes plans of tile layers; ``metres``: the side of a tile."""

    def __init__(self, data: MapData, metres: float, bodies: Bodies, findings: Findings) -> None:
        self.data, self.metres, self.scale = data, metres, metres / data.tile
        self.bodies, self.sorter, self.findings = bodies, bodies.sorter, findings

    def planned(self, layer: MapLayer, base: Fields, out: LevelLayer) -> list[Planned]:
        out.tiles = self.pictures(layer)
        if base.is_solid is False:
            return []
        meanings = self._meanings(layer, base)
        if not meanings:
            return []
        if tuple(layer.parallax) != (1.0, 1.0):
            raise RefusedError(f"solid tiles with parallax {layer.parallax}: class Decoration makes the layer pictures")
        if base.prefabs:
            raise RefusedError("a prefab as the class of a tile layer; give it to its tiles")
        place = f"layer {layer.name!r}"
        lower = np.array((layer.offset[0], -layer.offset[1])) * self.scale
        made: list[Planned] = []
        grids = Grids((self.data.rows, self.data.columns))
        for gid, meaning in meanings.items():
            with self.findings.at(meaning.tile.where):
                here = layer.cells == gid
                if meaning.is_entity:
                    made += self._entities(here, meaning, layer, out)
                elif meaning.tile.shapes:
                    made += self._shaped(here, meaning, layer, out, lower, place, grids)
                elif ONE_WAY in meaning.fields.marks:
                    grids.add(here, meaning.fields.material, TileShape.ONE_WAY)
                else:
                    grids.add(here, meaning.fields.material)
        for grid in grids.by_key.values():
            for faces in grid.colliders(self.metres):
                body = [transform(lower), faces, *self._components(base)]
                made.append(Planned(place, out, list(base.kinds), bodies=[body]))
        return made

    def _meanings(self, layer: MapLayer, base: Fields) -> dict[int, Meaning]:
        """Of the tiles that are more than pictures, by their numbers."""
        found: dict[int, Meaning] = {}
        for gid in np.unique(layer.cells).tolist() if layer.cells is not None else ():
            tile = self.data.tiles.get(gid)
            if tile is None:
                continue
            with self.findings.at(tile.where):
                fields = self.sorter.sort(tile.kinds, tile.properties)
                fields.material = {**base.material, **fields.material}
                is_entity = bool(fields.of or fields.prefabs)
                solid = fields.is_solid
                if solid is None:
                    solid = bool(base.is_solid or tile.shapes)
                fields.marks = fields.marks or base.marks
                if solid or is_entity:
                    found[gid] = Meaning(tile, fields, solid, is_entity)
        return found

    def _components(self, fields: Fields) -> list[Any]:
        if fields.references:
            raise RefusedError("properties of a tile layer cannot refer to objects")
        return self.bodies._components(fields)

    # -- bodies ----------------------------------------------------------------------------------------

    def _entities(self, here: np.ndarray, meaning: Meaning, layer: MapLayer, out: LevelLayer) -> list[Planned]:
        """An entity for each cell with a tile that has a class of its own, and its picture a sprite."""
        assert layer.flips is not None
        assert out.tiles is not None
        tile, made = meaning.tile, []
        base = Fields(material=dict(meaning.fields.material))
        for row, column in np.argwhere(here).tolist():
            flips = int(layer.flips[row, column])
            size = (tile.size[1], tile.size[0]) if flips & DIAGONAL else tile.size
            corner = np.array((column, row + 1.0)) * self.data.tile + tile.offset
            thing = MapObject(None, "", "", "tile", corner, size, tile=tile, flips=flips, origin=(0.0, 1.0))
            place = f"layer {layer.name!r}, row {row}, column {column}"
            planned = self.bodies.planned(place, thing, layer, base, out, None)
            made += [planned] if planned is not None else []
        cells = out.tiles.cell
        out.tiles = Tiles(*(each[~here[cells[:, 0], cells[:, 1]]] for each in out.tiles))
        return made

    def _shaped(
        self, here: np.ndarray, meaning: Meaning, layer: MapLayer, out: LevelLayer, lower: np.ndarray, place: str,
        grids: Grids,
    ) -> list[Planned]:  # fmt: skip
        """Tiles with shapes of the collision editor: cells of a grid, or what a grid does not have as bodies."""
        made: list[Planned] = []
        assert layer.flips is not None
        for flips in np.unique(layer.flips[here]).tolist():
            cells = here & (layer.flips == flips)
            shapes = self.shapes(meaning.tile, flips)
            material = dict(meaning.fields.material)
            if ONE_WAY in meaning.fields.marks:
                material.setdefault("one_way", (0.0, 1.0))
            elif len(shapes) == 1 and (named := self._named(shapes[0])) is not None:
                grids.add(cells, material, named)
                continue
            elif not shapes:
                continue
            for row, column in np.argwhere(cells).tolist():
                corner = lower + self.corner(row, column)
                planned = Planned(f"{place}, {meaning.tile.where}", out, [])
                self.bodies.static(planned, shapes, replace(meaning.fields, material=material), 0.0, corner)
                made.append(planned)
        return made

    def shapes(self, tile: Tile, flips: int) -> list[Shape]:
        """Of a tile as it lies in a cell, from the cell's lower left corner, m."""
        width, height = tile.size[::-1] if flips & DIAGONAL else tile.size
        aside = np.array((tile.offset[0], -tile.offset[1])) * self.scale
        found = self.bodies.tile_shapes(tile, flips, (width * self.scale, height * self.scale))
        return [shape.moved(lambda points: points + aside) for shape in found]

    def _named(self, shape: Shape) -> TileShape | None:
        """The shape of a grid that has these corners."""
        if shape.kind not in ("box", "polygon"):
            return None
        corners = np.round(shape.points / self.metres, DIGITS) + 0.0
        return CORNERS.get(frozenset(map(tuple, corners.tolist())))

    def corner(self, row: int, column: int) -> np.ndarray:
        """(2,) m, the lower left one of a cell."""
        return self.metres * np.array((column, self.data.rows - 1 - row), float)

    # -- pictures --------------------------------------------------------------------------------------

    def pictures(self, layer: MapLayer) -> Tiles:
        """What a tile layer shows: tiles stand on the lower side of their cells."""
        if layer.painted is not None:
            place, picture, flips = layer.painted
            sizes = np.array([each.size for each in self.data.pictures], float).reshape(-1, 2)[picture]
            places = np.stack((place[:, 0], self.data.rows * self.data.tile - place[:, 1] - sizes[:, 1]), axis=1)
            places += np.array((layer.offset[0], -layer.offset[1]))
            return Tiles(places * self.scale, picture, flips, np.full((len(picture), 2), -1))
        assert layer.cells is not None
        assert layer.flips is not None
        rows, columns = np.nonzero(layer.cells)
        gids = layer.cells[rows, columns]
        known, which = np.unique(gids, return_inverse=True)
        tiles = [self.data.tiles.get(gid) for gid in known.tolist()]
        picture = np.array([-1 if tile is None else tile.picture for tile in tiles], np.int64)
        aside = np.array([(0.0, 0.0) if tile is None else tile.offset for tile in tiles], float).reshape(-1, 2)
        place = np.stack((columns, self.data.rows - 1 - rows), axis=1) * self.data.tile
        place = place + (aside[which] + layer.offset) * (1.0, -1.0)
        seen = picture[which] >= 0
        return Tiles((place * self.scale)[seen], picture[which][seen], layer.flips[rows, columns][seen],
                     np.stack((rows, columns), axis=1)[seen])  # fmt: skip

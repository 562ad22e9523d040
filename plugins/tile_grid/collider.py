"""The collider."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Self, Unpack

import numpy as np

from ...components.colliders import Collider, ColliderFields
from ...framework import array_column, column
from ...framework.data.arrays.column import ArrayColumn
from ...framework.data.columns import Column, or_no_rows
from ...framework.outlines import runs_outline
from ...framework.typing import ArrayField, Vector
from .cells import (
    SHAPE,
    SHAPES,
    array_of,
    cell_of_packed,
    cells_of_packed,
    change_of,
    is_plain,
    leading_of,
    numbers_of,
    packed_of,
    shape_of,
    table_of_packed,
    tiles_of_packed,
    with_shapes,
    wrong_with,
)
from .faces import FACES, Faces, plugin
from .materials import MOST, TileMaterial, TileShape, materials_of, table_of
from .straight import face_touched
from .surface import material_touched

ONE_WAY_STRIP = (0.0, 0.875), (1.0, 0.875), (1.0, 1.0), (0.0, 1.0)  # how pictures show a one-way cell, in tiles

# Arguments, checked like fields.
LOWER = Column(item="vector", owner="TileGridCollider", name="lower")


@plugin.shape(cost=20)
class TileGridCollider(Collider):
    """A map of square tiles in a 2D world. It does not turn with the Transform.

    cells
        (rows, columns), true or not zero for a tile, or text, see :func:`cells_of_text`; the first row is the top one,
        as maps are drawn. With ``materials`` or ``shapes``: the number of a material, 1 to 255, 0 for an empty cell
    tile_size
        m, side length of a tile
    faces
        ``"all"``; ``"floors"``: floors and ceilings only; ``"walls"``: walls and slopes
        only, see :meth:`floors_and_walls`; ``"one_way"``: the upper sides of one-way cells, see :meth:`with_one_way`
    lower
        (2,) m, the map's lower left corner relative to the Transform's position, in place of ``offset``: ValueError for
        both; None: the map's centre is at ``offset``
    materials
        TileMaterial by number; cells with other numbers are as the collider says. The collider's own ``restitution``
        and ``surface_velocity`` are then the most that any of its cells has
    shapes
        (rows, columns) of TileShape; None: all tiles are full
    """

    __slots__ = ()

    dimensions: ClassVar[tuple[int, ...]] = (2,)
    convex: ClassVar[bool] = False

    packed: ArrayField = array_column(1, rows=(7, 2**31), check=wrong_with, leading=leading_of)
    tile_size: float = column(positive=True, unit="m")
    faces: Faces = column(default="all", choices=FACES)

    def __init__(
        self,
        cells: Any,
        tile_size: float,
        *,
        faces: Faces = "all",
        lower: Vector | None = None,
        materials: Mapping[int, TileMaterial] | None = None,
        shapes: Any = None,
        **common: Unpack[ColliderFields],
    ) -> None:
        plain = materials is None and shapes is None
        if faces == "one_way":
            if shapes is None:
                raise ValueError("TileGridCollider: faces='one_way' needs shapes, which say where one-way cells are")
            common.setdefault("one_way", (0.0, 1.0))
        tiles = numbers_of(cells, plain=plain)
        if shapes is not None:
            tiles = with_shapes(tiles, shapes)
            if faces != "one_way" and (tiles // SHAPE == TileShape.ONE_WAY).any():
                raise ValueError(f"TileGridCollider: one-way cells are none of faces={faces!r}, and need a collider of "
                                 f"their own: TileGridCollider.with_one_way makes all of them")  # fmt: skip
        table = None if plain else table_of(materials or {}, common)  # type: ignore[arg-type]
        size = self.columns["tile_size"].checked(tile_size)
        if lower is not None:
            if np.any(common.get("offset", 0.0)):
                raise ValueError(
                    f"TileGridCollider: lower says where the map lies, and offset too, got {common.get('offset')!r}"
                )
            common["offset"] = np.broadcast_to(LOWER.checked(lower), 2) + 0.5 * size * np.array(tiles.shape[::-1])
        self._fill({"packed": packed_of(tiles, table), "tile_size": size, "faces": faces, **common})

    @classmethod
    def floors_and_walls(
        cls,
        cells: Any,
        tile_size: float,
        *,
        lower: Vector | None = None,
        materials: Mapping[int, TileMaterial] | None = None,
        shapes: Any = None,
        **common: Unpack[ColliderFields],
    ) -> tuple[Self, Self]:
        """The map of ``cells`` and ``tile_size`` as two colliders, for two entities: floors and ceilings, and walls;
        ``lower``, ``materials`` and ``shapes`` as of one.

        Two bodies have only one contact. A body that is pushed against a wall and stands on the floor needs two, so
        that it stands still; two entities provide them. Both colliders share their memory.
        """
        floors, walls = (
            cls(cells, tile_size, faces=faces, lower=lower, materials=materials, shapes=shapes, **common)
            for faces in ("floors", "walls")
        )
        return floors, walls

    @classmethod
    def with_one_way(
        cls, cells: Any, tile_size: float, *, shapes: Any, walls: bool = True, **common: Any
    ) -> tuple[Self, ...]:
        """The map of ``cells``, ``tile_size`` and ``shapes`` as colliders for as many entities, the last one of its
        one-way cells: bodies may stand on one of these and pass another, which one contact does not tell.

        walls
            whether floors and walls are two as well, see :meth:`floors_and_walls`
        common
            all other arguments, of each
        """
        one_way = cls(cells, tile_size, faces="one_way", shapes=shapes, **common)
        solid = [one_way.copy() for _ in range(2 if walls else 1)]
        for each, faces in zip(solid, ("floors", "walls") if walls else ("all",), strict=True):
            each.faces, each.one_way = faces, 0.0
        return (*solid, one_way)

    @classmethod
    def sample(cls, **common: Any) -> Self:
        return cls(((1, 0), (1, 1)), 0.5, **common)

    @staticmethod
    def outline(shape, dimensions):
        cells = cells_of_packed(shape.packed)
        kinds, one_ways = cells // SHAPE, shape.faces == FACES.index("one_way")
        full = (cells != 0) & (kinds == TileShape.FULL) & (not one_ways)
        corners, faces = runs_outline(full, shape.tile_size)
        corners, faces = [corners], list(faces)
        for kind in range(1, len(TileShape)):
            part = np.array(TileShape(kind).corners or ONE_WAY_STRIP)
            row, x = np.nonzero((kinds == kind) & (one_ways == (kind == TileShape.ONE_WAY)))
            places = np.stack((x, len(cells) - 1 - row), axis=1) - np.array(cells.shape[::-1]) / 2
            rows = sum(map(len, corners)) + np.arange(len(part) * len(places)).reshape(-1, len(part))
            corners.append(shape.tile_size * (places[:, None] + part).reshape(-1, 2))
            faces.extend(rows)
        return np.concatenate(corners), faces

    @property
    def cells(self) -> np.ndarray:
        """(rows, columns), the top row first; a copy: of bool, of the numbers of materials if the map has materials or
        shapes. Assign another, whose tiles keep their shapes where they have the same number, or :meth:`set` cells."""
        packed = self._view()
        return tiles_of_packed(packed) if is_plain(packed) else (cells_of_packed(packed) % SHAPE).astype(np.uint8)

    @cells.setter
    def cells(self, cells: Any) -> None:
        before = cells_of_packed(self._view())
        numbers = numbers_of(cells, plain=is_plain(self._view()))
        if numbers.shape != before.shape:
            raise ValueError(f"TileGridCollider.cells must keep its shape {before.shape}, got {numbers.shape}")
        others = np.argwhere(numbers != before % SHAPE)
        self._change(others, numbers[others[:, 0], others[:, 1]])

    @property
    def shapes(self) -> np.ndarray:
        """(rows, columns) of TileShape; a copy."""
        return (cells_of_packed(self._view()) // SHAPE).astype(np.uint8)

    @property
    def materials(self) -> dict[int, TileMaterial]:
        """By number, those that differ from cells without a material."""
        table = table_of_packed(self._view())
        return {} if table is None else materials_of(table)

    def material_of(self, row: int, column: int) -> int:
        """The number of the cell at ``row`` (0 is the top one) and ``column``, 0 if it is empty; ValueError outside of
        the map."""
        self._check_cell("material_of", row, column)
        return cell_of_packed(self._view(), row, column) % SHAPE

    def set(self, cell: Any, value: Any, shape: Any = TileShape.FULL) -> None:
        """Make a cell a tile, or empty it: only what is near that cell is touched.

        cell
            (row, column), row 0 is the top one; or several of them, (k, 2)
        value
            true or not zero for a tile, with materials or shapes the number of its material; one for all cells, or k of
            them
        shape
            TileShape; one for all cells, or k of them. Another one than FULL needs a map that was made with
            ``materials`` or ``shapes``
        """
        places, values = array_of(or_no_rows(cell, 2)), array_of(or_no_rows(value))
        shapes = array_of(or_no_rows(shape))
        if places.shape == (2,):
            places = places[None]
        if places.ndim != 2 or places.shape[1] != 2 or places.dtype.kind not in "iu":
            raise self._wrong(f"cell must be (row, column), or several of them, of integers, got {cell!r}")
        plain, fits = is_plain(self._view()), ((), (len(places),))
        if values.dtype.kind not in "biu" or values.shape not in fits:
            raise self._wrong(f"value must be True or False, or {len(places)} of them, got {value!r}")
        if shapes.dtype.kind not in "iu" or shapes.shape not in fits or ((shapes < 0) | (shapes >= SHAPES)).any():
            raise self._wrong(f"shape must be a TileShape, or {len(places)} of them, got {shape!r}")
        if plain and shapes.any():
            raise self._wrong(f"a map without shapes has full tiles only: make it with shapes=, got shape {shape!r}")
        if not plain and ((values < 0) | (values > MOST)).any():
            raise self._wrong(f"value must be 0, or the number of a material, 1 to {MOST}, got {value!r}")
        rows, columns = shape_of(self._view())
        for row, x in places.tolist():
            if not (0 <= row < rows and 0 <= x < columns):
                raise self._wrong(f"the map has {rows} rows and {columns} columns, got row {row}, column {x}")
        numbers = (values != 0).astype(np.int64) if plain else values.astype(np.int64)
        self._change(places, np.full(len(places), np.where(numbers > 0, numbers + SHAPE * shapes.astype(np.int64), 0)))

    def _change(self, places: np.ndarray, cells: np.ndarray) -> None:
        column: ArrayColumn = self.columns["packed"]  # type: ignore[assignment]
        packed, size = column.view(self), self.tile_size
        change = change_of(packed, places, cells)
        if change is not None:
            (write, boxes), (rows, columns) = change, shape_of(packed)
            x, y = (np.zeros(2) + self.offset).tolist()
            left, lower = x - 0.5 * columns * size, y - 0.5 * rows * size
            column.change(self, write, boxes * size + (left, lower, left, lower))

    def _view(self) -> np.ndarray:
        """The array of the map, for reading at once."""
        column: ArrayColumn = self.columns["packed"]  # type: ignore[assignment]
        return column.view(self)

    def _wrong(self, rule: str) -> ValueError:
        whose = "" if self.entity is None else f"entity {self.entity}: "
        return ValueError(f"{whose}TileGridCollider.set: {rule}")

    def _check_cell(self, method: str, row: int, column: int) -> None:
        rows, columns = shape_of(self._view())
        if not (0 <= row < rows and 0 <= column < columns):
            raise ValueError(f"TileGridCollider.{method}: the map has {rows} rows and {columns} columns, "
                             f"got row {row}, column {column}")  # fmt: skip

    def centre_of(self, row: int, column: int) -> np.ndarray:
        """(2,) m, the centre of the cell at ``row`` (0 is the top one) and ``column``, relative to the Transform's
        position; ValueError outside of the map."""
        self._check_cell("centre_of", row, column)
        rows, columns = shape_of(self._view())
        cell = np.array((column + 0.5 - 0.5 * columns, 0.5 * rows - row - 0.5))
        return np.broadcast_to(self.offset, 2) + cell * self.tile_size

    def __repr__(self) -> str:
        tiles = tiles_of_packed(self._view())
        shared = ", ".join(f"{name}={value!r}" for name, value in self._shown() if name in self.stacked_columns)
        return (
            f"<TileGridCollider of {tiles.shape[0]} rows and {tiles.shape[1]} columns, {int(tiles.sum())} tiles, "
            f"tile_size={self.tile_size!r}, {shared}>"
        )

    @staticmethod
    def material(shape, point, normal):
        return material_touched(shape, point, normal)

    @staticmethod
    def edge(shape, direction, point):
        return face_touched(shape, direction, point)

    @staticmethod
    def bounds(shape, dimensions):
        columns, rows = shape.packed[0, 0], shape.packed[1, 0]
        return 0.5 * columns * shape.tile_size, 0.5 * rows * shape.tile_size

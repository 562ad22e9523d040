"""The plugin and its collider."""

from __future__ import annotations

from typing import Any, ClassVar, Literal, Self, Unpack

import numpy as np

from ...components.colliders import Collider, ColliderFields
from ...framework import Plugin, array_column, column
from ...framework.data.arrays.column import ArrayColumn
from ...framework.data.columns import Column
from ...framework.outlines import runs_outline
from ...framework.typing import ArrayField, Vector
from .cells import array_of, change_of, leading_of, packed_of, shape_of, tiles_of, tiles_of_packed, wrong_with

plugin = Plugin("tile_grid", version="1.0")

Faces = Literal["all", "floors", "walls"]
FACES = ("all", "floors", "walls")
ALL, FLOORS, WALLS = range(3)

# Arguments, checked like fields.
LOWER = Column(item="vector", owner="TileGridCollider", name="lower")


@plugin.shape(cost=20)
class TileGridCollider(Collider):
    """A map of square tiles in a 2D world. It does not turn with the Transform.

    cells
        (rows, columns), true or not zero for a tile, or text, see :func:`cells_of_text`; the first row is the top one,
        as maps are drawn
    tile_size
        m, side length of a tile
    faces
        ``"all"``; ``"floors"``: floors and ceilings only; ``"walls"``: walls only, see :meth:`floors_and_walls`
    lower
        (2,) m, the map's lower left corner relative to the Transform's position, in place of ``offset``: ValueError for
        both; None: the map's centre is at ``offset``
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
        **common: Unpack[ColliderFields],
    ) -> None:
        tiles = tiles_of(cells)
        size = self.columns["tile_size"].checked(tile_size)
        if lower is not None:
            if np.any(common.get("offset", 0.0)):
                raise ValueError(
                    f"TileGridCollider: lower says where the map lies, and offset too, got {common.get('offset')!r}"
                )
            common["offset"] = np.broadcast_to(LOWER.checked(lower), 2) + 0.5 * size * np.array(tiles.shape[::-1])
        self._fill({"packed": packed_of(tiles), "tile_size": size, "faces": faces, **common})

    @classmethod
    def floors_and_walls(cls, cells: Any, tile_size: float, **common: Unpack[ColliderFields]) -> tuple[Self, Self]:
        """The map of ``cells`` and ``tile_size`` as two colliders, for two entities: floors and ceilings, and walls.

        Two bodies have only one contact. A body that is pushed against a wall and stands on the floor needs two, so
        that it stands still; two entities provide them. Both colliders share their memory.
        """
        return cls(cells, tile_size, faces="floors", **common), cls(cells, tile_size, faces="walls", **common)

    @classmethod
    def sample(cls, **common: Any) -> Self:
        return cls(((1, 0), (1, 1)), 0.5, **common)

    @staticmethod
    def outline(shape, dimensions):
        return runs_outline(tiles_of_packed(shape.packed), shape.tile_size)

    @property
    def cells(self) -> np.ndarray:
        """(rows, columns) of bool, the top row first; a copy. Assign another, or :meth:`set` cells of the map."""
        return tiles_of_packed(self.packed)

    @cells.setter
    def cells(self, cells: Any) -> None:
        tiles, before = tiles_of(cells), self.cells
        if tiles.shape != before.shape:
            raise ValueError(f"TileGridCollider.cells must keep its shape {before.shape}, got {tiles.shape}")
        others = np.argwhere(tiles != before)
        self._change(others, tiles[others[:, 0], others[:, 1]])

    def set(self, cell: Any, value: Any) -> None:
        """Make a cell a tile, or empty it: only what is near that cell is touched.

        cell
            (row, column), row 0 is the top one; or several of them, (k, 2)
        value
            true or not zero for a tile; one for all cells, or k of them
        """
        places, tiles = array_of(cell), array_of(value)
        if places.shape == (2,):
            places = places[None]
        if places.ndim != 2 or places.shape[1] != 2 or places.dtype.kind not in "iu":
            raise self._wrong(f"cell must be (row, column), or several of them, of integers, got {cell!r}")
        if tiles.dtype.kind not in "biu" or tiles.shape not in ((), (len(places),)):
            raise self._wrong(f"value must be True or False, or {len(places)} of them, got {value!r}")
        rows, columns = self._shape()
        for row, x in places.tolist():
            if not (0 <= row < rows and 0 <= x < columns):
                raise self._wrong(f"the map has {rows} rows and {columns} columns, got row {row}, column {x}")
        self._change(places, np.full(len(places), tiles != 0))

    def _change(self, cells: np.ndarray, tiles: np.ndarray) -> None:
        column: ArrayColumn = self.columns["packed"]  # type: ignore[assignment]
        packed, size = column.view(self), self.tile_size
        change = change_of(packed, cells, tiles)
        if change is not None:
            (write, boxes), (rows, columns) = change, shape_of(packed)
            x, y = (np.zeros(2) + self.offset).tolist()
            left, lower = x - 0.5 * columns * size, y - 0.5 * rows * size
            column.change(self, write, boxes * size + (left, lower, left, lower))

    def _shape(self) -> tuple[int, int]:
        """The numbers of rows and columns."""
        column: ArrayColumn = self.columns["packed"]  # type: ignore[assignment]
        return shape_of(column.view(self))

    def _wrong(self, rule: str) -> ValueError:
        whose = "" if self.entity is None else f"entity {self.entity}: "
        return ValueError(f"{whose}TileGridCollider.set: {rule}")

    def centre_of(self, row: int, column: int) -> np.ndarray:
        """(2,) m, the centre of the cell at ``row`` (0 is the top one) and ``column``, relative to the Transform's
        position; ValueError outside of the map."""
        rows, columns = self._shape()
        if not (0 <= row < rows and 0 <= column < columns):
            raise ValueError(f"TileGridCollider.centre_of: the map has {rows} rows and {columns} columns, "
                             f"got row {row}, column {column}")  # fmt: skip
        cell = np.array((column + 0.5 - 0.5 * columns, 0.5 * rows - row - 0.5))
        return np.broadcast_to(self.offset, 2) + cell * self.tile_size

    def __repr__(self) -> str:
        cells = self.cells
        shared = ", ".join(f"{name}={value!r}" for name, value in self._shown() if name in self.stacked_columns)
        return (
            f"<TileGridCollider of {cells.shape[0]} rows and {cells.shape[1]} columns, {int(cells.sum())} tiles, "
            f"tile_size={self.tile_size!r}, {shared}>"
        )

    @staticmethod
    def bounds(shape, dimensions):
        columns, rows = shape.packed[0, 0], shape.packed[1, 0]
        return 0.5 * columns * shape.tile_size, 0.5 * rows * shape.tile_size

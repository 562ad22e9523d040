"""The plugin and its collider."""

from __future__ import annotations

from typing import Any, ClassVar, Literal, Self, Unpack

import numpy as np

from ...components.colliders import Collider, ColliderFields
from ...framework import Plugin, array_column, column
from ...framework.data.columns import Column
from ...framework.typing import ArrayField, Vector
from .cells import sums_of, tiles_of, tiles_of_sums, wrong_with

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
        (2,) m, the map's lower left corner relative to the Transform's position; None: the map's centre is at
        ``offset``
    """

    __slots__ = ()

    dimensions: ClassVar[tuple[int, ...]] = (2,)
    convex: ClassVar[bool] = False

    sums: ArrayField = array_column(1, rows=(5, 2**31), check=wrong_with, lengths=False)
    tile_size: float = column(positive=True)
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
        self._fill({"sums": sums_of(tiles), "tile_size": size, "faces": faces, **common})

    @classmethod
    def floors_and_walls(cls, cells: Any, tile_size: float, **common: Unpack[ColliderFields]) -> tuple[Self, Self]:
        """The map as two colliders, for two entities: its floors and ceilings, and its walls.

        Two bodies have only one contact. A body that is pushed against a wall and stands on the floor needs two, so
        that it stands still; two entities provide them. Both colliders share their memory.
        """
        return cls(cells, tile_size, faces="floors", **common), cls(cells, tile_size, faces="walls", **common)

    @classmethod
    def sample(cls, **common: Any) -> Self:
        return cls(((1, 0), (1, 1)), 0.5, **common)

    @property
    def cells(self) -> np.ndarray:
        """(rows, columns) of bool, the top row first; a copy. Assign another to change the map."""
        return tiles_of_sums(self.sums[:, 0])

    @cells.setter
    def cells(self, cells: Any) -> None:
        tiles = tiles_of(cells)
        if tiles.shape != self.cells.shape:
            raise ValueError(f"TileGridCollider.cells must keep its shape {self.cells.shape}, got {tiles.shape}")
        self.sums = sums_of(tiles)

    def centre_of(self, row: int, column: int) -> np.ndarray:
        """(2,) m, the centre of a cell, relative to the Transform's position; row 0 is the top one."""
        rows, columns = self.cells.shape
        if not (0 <= row < rows and 0 <= column < columns):
            raise ValueError(f"TileGridCollider.centre_of: the map has {rows} rows and {columns} columns, "
                             f"got row {row}, column {column}")  # fmt: skip
        cell = np.array((column + 0.5 - 0.5 * columns, 0.5 * rows - row - 0.5))
        return np.broadcast_to(self.offset, 2) + cell * self.tile_size

    def __repr__(self) -> str:
        cells = self.cells
        shared = ", ".join(f"{name}={getattr(self, name)!r}" for name in self.stacked_columns)
        return (
            f"<TileGridCollider of {cells.shape[0]} rows and {cells.shape[1]} columns, {int(cells.sum())} tiles, "
            f"tile_size={self.tile_size!r}, {shared}>"
        )

    @staticmethod
    def bounds(shape, dimensions):
        columns = shape.sums[0, 0]
        rows = (len(shape.sums) - 1) / (columns + 1.0) - 1.0
        return 0.5 * columns * shape.tile_size, 0.5 * rows * shape.tile_size

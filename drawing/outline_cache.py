"""The outlines of all shapes of a world, each made once: shapes with equal fields share one."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..framework.outlines import Outline
from ..framework.plugins.registry import Shape
from .lists import Floats
from .outlines import fields_of, outline_of, pieces_of

Rows = NDArray[np.int64]


class Kind(NamedTuple):
    """Pieces of so many corners, ``round`` ones with a radius: balls of one corner, capsules of two."""

    corners: int
    round: bool


class Pieces:
    """The pieces of one kind of all outlines."""

    def __init__(self, dimensions: int, corners: int) -> None:
        self._rings, self._radii = np.zeros((0, corners, dimensions)), np.zeros(0)
        self._new: list[tuple[Floats, float]] = []
        self._total = 0
        self._first, self._count = np.zeros(64, np.int64), np.zeros(64, np.int64)  # by outline

    def add(self, outline: int, rings: Floats, radius: float) -> None:
        """An outline with these rings (p, k, d)."""
        if outline >= len(self._first):
            room = np.zeros(outline + 1, np.int64)
            self._first, self._count = np.concatenate((self._first, room)), np.concatenate((self._count, room))
        self._new.append((rings, radius))
        self._first[outline], self._count[outline] = self._total, len(rings)
        self._total += len(rings)

    def of(self, outlines: Rows) -> tuple[Rows, Floats, Floats]:
        """Of shapes with these outlines (n,) all pieces: which shape each is of, (p,), ring (p, k, d), radius (p,)."""
        if self._new:
            self._rings = np.concatenate((self._rings, *(rings for rings, _ in self._new)))
            self._radii = np.concatenate((self._radii, *(np.full(len(rings), radius) for rings, radius in self._new)))
            self._new = []
        known = np.minimum(outlines, len(self._first) - 1)
        count = np.where(outlines < len(self._first), self._count[known], 0).astype(np.intp)  # as repeat wants it
        shape = np.repeat(np.arange(len(outlines)), count)
        piece = np.arange(len(shape)) + np.repeat(self._first[known] - np.cumsum(count) + count, count)
        return shape, self._rings[piece], self._radii[piece]


class OutlineCache:
    """``outlines``: of each number, with its rounding. ``pieces``: of each kind."""

    def __init__(self, dimensions: int) -> None:
        self.dimensions = dimensions
        self.outlines: list[tuple[Outline, float]] = []
        self.pieces: dict[Kind, Pieces] = {}
        self._known: dict[Any, dict[bytes, int]] = {}

    def numbers_of(self, shape: Shape, columns: dict[str, Any], count: int) -> Rows:
        """The numbers of the outlines of so many shapes with these fields, by name each (count, ...)."""
        known = self._known.setdefault(shape, {})
        table = np.column_stack([np.zeros(count), *(np.reshape(array, (count, -1)) for array in columns.values())])
        keys = table.view(np.dtype((np.void, table.shape[1] * table.itemsize))).ravel().tolist()
        for row, key in enumerate(keys):
            if key not in known:
                fields = fields_of(shape.component, columns, row, self.dimensions)
                known[key] = self._add(*outline_of(shape, fields, self.dimensions))
        return np.array([known[key] for key in keys], np.int64)

    def _add(self, outline: Outline, rounding: float) -> int:
        for rings, radius in pieces_of(outline, rounding):
            kind = Kind(rings.shape[1], rings.shape[1] == 1 or radius > 0.0)
            if kind not in self.pieces:
                self.pieces[kind] = Pieces(self.dimensions, kind.corners)
            self.pieces[kind].add(len(self.outlines), rings, radius)
        self.outlines.append((outline, rounding))
        return len(self.outlines) - 1

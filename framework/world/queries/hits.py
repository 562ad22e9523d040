"""Answers to queries: lists of ids for many queries at once, and hits with a place.

Columns named ``row`` and ``rows`` are places in the columns of ``world.bodies``; they hold until the next structural
change, as views do.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np


class Hits(Sequence[np.ndarray]):
    """``hits[i]`` are the ids that query i found, ascending; as columns: ``entities[offsets[i]:offsets[i + 1]]``.

    ``rows`` are the places of ``entities`` in the columns of ``world.bodies``.
    """

    def __init__(self, offsets: np.ndarray, entities: np.ndarray, rows: np.ndarray) -> None:
        self.offsets = offsets
        self.entities = entities
        self.rows = rows

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @overload
    def __getitem__(self, index: int) -> np.ndarray: ...
    @overload
    def __getitem__(self, index: slice) -> list[np.ndarray]: ...
    def __getitem__(self, index: int | slice) -> np.ndarray | list[np.ndarray]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        if not -len(self) <= index < len(self):
            raise IndexError(f"query {index} of {len(self)}")
        index %= len(self)
        return self.entities[self.offsets[index] : self.offsets[index + 1]]

    def __iter__(self) -> Iterator[np.ndarray]:
        return (self[i] for i in range(len(self)))

    @property
    def counts(self) -> np.ndarray:
        """(m,) how many each query found."""
        return np.diff(self.offsets)


class Neighbours(Hits):
    """Entities that are near others: ``hits[i]`` are the neighbours of ``askers[i]``, in row ``asker_rows[i]``."""

    def __init__(
        self, askers: np.ndarray, asker_rows: np.ndarray, offsets: np.ndarray, entities: np.ndarray, rows: np.ndarray
    ) -> None:
        super().__init__(offsets, entities, rows)
        self.askers = askers
        self.asker_rows = asker_rows

    def of(self, entity: int) -> np.ndarray:
        """(k,) the ids of the neighbours of an entity, ascending; KeyError if it is not among ``askers``."""
        found = np.flatnonzero(self.askers == entity)
        if not len(found):
            raise KeyError(entity)
        return self[int(found[0])]

    def pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """(k,) rows of askers and (k,) rows of their neighbours, one of each per pair: for sums over all at once."""
        return np.repeat(self.asker_rows, self.counts), self.rows


class OverlapHits(Hits):
    """What touches each of m colliders, ``hits[i]`` the ids, deepest first, then ascending; columns, a row for each of
    ``entities``: depths (k,), points and normals (k, d), as of :class:`OverlapHit`."""

    def __init__(
        self,
        offsets: np.ndarray,
        entities: np.ndarray,
        rows: np.ndarray,
        depths: np.ndarray,
        points: np.ndarray,
        normals: np.ndarray,
    ) -> None:
        super().__init__(offsets, entities, rows)
        self.depths = depths
        self.points = points
        self.normals = normals


@dataclass(frozen=True, eq=False, slots=True)
class OverlapHit:
    """What a collider overlaps.

    depth
        m, how far they are in each other; 0 if they just touch
    point, normal
        (d,) the middle of the overlap, and the unit vector from the other one to the collider: moved by ``depth`` along
        it, the collider just touches
    """

    entity: int
    depth: float
    point: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True, eq=False, slots=True)
class NearestHit:
    """The surface nearest to a point.

    distance
        m, from the point to the surface; negative inside: how deep
    point, normal
        (d,) the place on the surface, and the unit vector that points out of the collider there
    """

    entity: int
    distance: float
    point: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True, eq=False, slots=True)
class CastHit:
    """What a ray or a moving shape meets.

    distance
        m, travelled until it touches; 0 if it does at the start
    fraction
        the same as a part of the whole way: ``position + fraction * displacement`` is where a shape stops (of a ray
        without end 0)
    point, normal
        (d,) where they touch, and the unit vector that points out of the collider that was hit
    """

    entity: int
    distance: float
    fraction: float
    point: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True, eq=False)
class NearestHits:
    """Per query the nearest, as columns; where there is none: entity and row -1, distance inf, the others nan.

    entity, row, distance (m,); point, normal (m, d): as of :class:`NearestHit`.
    """

    entity: np.ndarray
    row: np.ndarray
    distance: np.ndarray
    point: np.ndarray
    normal: np.ndarray

    @property
    def found(self) -> np.ndarray:
        """(m,) mask of the queries that found something."""
        return self.row >= 0

    def __len__(self) -> int:
        return len(self.entity)


@dataclass(frozen=True, eq=False)
class CastHits(NearestHits):
    """Per cast the first hit, as columns; where there is none, the fraction (m,) is 1: all of the way is free."""

    fraction: np.ndarray

"""Entities that were created together and have no Python objects of their own until they are asked for.

Most bodies of a large world are never looked at one by one: their values go from the arrays they were given as into the
columns. A dict of components and a handle for each of them are made on demand, for one entity.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .component import Component, RowStore

Stores = Mapping[type[Component], RowStore]
MakeHandle = Callable[[type[Component], int], Component]


class Batch:
    """Consecutive entities, each with one component of the same types.

    first, count
        their ids
    inside
        (count,) which of them have no objects yet and exist; the others are entities like any other, or deleted
    left
        how many these are
    stores
        the values, until a world has adopted them
    make_handle
        makes a handle of an entity whose values the world's table has; None before they are adopted
    """

    __slots__ = ("count", "first", "inside", "left", "make_handle", "stores", "types")

    def __init__(self, first: int, count: int, stores: Stores) -> None:
        self.first, self.count, self.left = first, count, count
        self.types = tuple(stores)
        self.stores = stores
        self.inside = np.ones(count, bool)
        self.make_handle: MakeHandle | None = None

    def rows(self) -> Any:
        """Places of those inside: a slice if it is all of them."""
        return slice(None) if self.left == self.count else np.flatnonzero(self.inside)

    def ids(self) -> np.ndarray:
        """(left,) those inside, ascending."""
        if self.left == self.count:
            return np.arange(self.first, self.first + self.count)
        return np.flatnonzero(self.inside) + self.first

    def among(self, entities: np.ndarray) -> np.ndarray:
        """(n,) mask of these ids (n,) that are inside."""
        places = entities - self.first
        here = (places >= 0) & (places < self.count)
        here[here] = self.inside[places[here]]
        return here

    def take_out(self, entity: int) -> dict[type[Component], Component]:
        """The components of an entity that is inside; it is not inside any more."""
        place = entity - self.first
        self.inside[place] = False
        self.left -= 1
        if self.make_handle is not None:
            return {component: self.make_handle(component, entity) for component in self.types}
        handles = {}
        for component in self.types:
            handle = handles[component] = component.__new__(component)
            handle._bind(self.stores[component], None, place, RowStore.version)
        return handles

    def take_out_many(self, entities: np.ndarray) -> np.ndarray:
        """Those of these ids that are inside, without making anything: they are gone."""
        found = entities[self.among(entities)]
        self.inside[found - self.first] = False
        self.left -= len(found)
        return found

    def adopted(self, make_handle: MakeHandle) -> None:
        """The table of a world has all values."""
        self.make_handle, self.stores = make_handle, {}


class Batches:
    """The batches of one world, by ascending ids."""

    def __init__(self) -> None:
        self.all: list[Batch] = []
        self.stop = 0  # their ids are smaller
        self._firsts: list[int] = []

    def __bool__(self) -> bool:
        return bool(self.all)

    def add(self, batch: Batch) -> None:
        """The ids of a batch are larger than those of the batches before it."""
        self.all = [*(one for one in self.all if one.left), batch]
        self._firsts = [one.first for one in self.all]
        self.stop = batch.first + batch.count

    def put(self, batches: list[Batch]) -> None:
        """These instead of all there are."""
        self.all, self._firsts = batches, [one.first for one in batches]
        self.stop = batches[-1].first + batches[-1].count if batches else 0

    def of(self, entity: Any) -> Batch | None:
        """The batch that an entity is inside of; None for whatever else."""
        try:
            place = bisect_right(self._firsts, entity) - 1
            number = int(entity)
        except (TypeError, ValueError, OverflowError):
            return None
        if place < 0 or number != entity:
            return None
        batch = self.all[place]
        at = number - batch.first
        return batch if at < batch.count and batch.inside[at] else None

    def around(self, entities: list[int]) -> list[Batch]:
        """The batches that may have some of these ids inside, ascending."""
        places = {bisect_right(self._firsts, entity) - 1 for entity in entities}
        return [self.all[place] for place in sorted(places) if place >= 0]

    def clear(self) -> None:
        self.all, self._firsts, self.stop = [], [], 0

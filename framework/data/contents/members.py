"""What a world has in place of esper's sets of the entities with each component, and of its count of ids."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from .change_log import Arrival
from .entities import Entities


class Members:
    """The entities with one component, for esper: those with objects are listed, the table's masks have the others."""

    __slots__ = ("_component", "_entities", "listed", "ours")

    def __init__(self, component: type[Any], entities: Entities, ours: bool) -> None:
        self.listed: set[int] = set()
        self._component, self._entities, self.ours = component, entities, ours

    def add(self, entity: int) -> None:
        self._entities.changes(entity, self._component, self.ours)
        self.listed.add(entity)

    def discard(self, entity: int) -> None:
        self._entities.changes(entity, self._component, self.ours)
        self.listed.discard(entity)

    def _rows(self) -> np.ndarray:
        """Ids of the rows without objects that have the component."""
        return self._entities.without_objects(self._component)

    def _arrivals(self) -> list[Arrival]:
        return [one for one in self._entities.log.arrivals if self._component in one.stores]

    def __contains__(self, entity: Any) -> bool:
        return entity in self.listed or (self.ours and self._component in self._entities.types_of(entity))

    def __len__(self) -> int:
        return len(self.listed) + (len(self.unlisted()) if self.ours else 0)

    def __bool__(self) -> bool:
        return bool(self.listed) or (self.ours and bool(self._arrivals() or len(self._rows())))

    def unlisted(self) -> list[int]:
        """Those that have no objects."""
        entities, ids = self._entities, self._rows().tolist()
        for one in self._arrivals():
            ids += range(one.first, one.stop)
        gone = set(entities.log.deleted)
        return [entity for entity in ids if entity not in gone] if gone else ids

    def __iter__(self) -> Iterator[int]:
        """By ascending id: the order of the set would depend on what has come and gone before."""
        return iter(sorted((*self.listed, *(self.unlisted() if self.ours else ()))))


class WatchedComponents(dict[type[Any], Members]):
    """esper's dict of those sets."""

    def __init__(self, content: dict[type[Any], set[int]], entities: Entities, counter: Counter) -> None:
        super().__init__()
        self.entities, self.counter, self.log = entities, counter, entities.log
        entities.members = self
        for component, members in content.items():
            self[component] = members

    def __setitem__(self, component: type[Any], listed: Iterable[int]) -> None:
        ours = isinstance(component, type) and issubclass(component, self.log.base)
        members = Members(component, self.entities, ours)
        members.listed.update(listed)
        if ours and members.listed:
            self.log.dirty = True
            self.log.touched |= members.listed
        super().__setitem__(component, members)

    def clear(self) -> None:
        self.entities.forget_all()
        self.counter.install(1)  # esper has put one of its own there
        super().clear()


class Counter:
    """In place of esper's count of ids."""

    __slots__ = ("install_in", "next")

    def __init__(self, number: int, install_in: Any) -> None:
        self.next, self.install_in = number, install_in

    def __next__(self) -> int:
        number = self.next
        self.next = number + 1
        return number

    def install(self, number: int) -> None:
        self.next, self.install_in._entity_count = number, self

"""What a world has in place of esper's containers: they log which components come and go, and know of batches.

esper notes every change of components in one place, the set of entities it keeps per component type. Those sets are
watched, so finding what has changed costs as much as there is of it, however many entities there are.
"""

from __future__ import annotations

import itertools
import weakref
from collections import deque
from collections.abc import Collection, ItemsView, Iterable, Iterator, KeysView, ValuesView
from typing import Any

import numpy as np

from .batches import Batch, Batches

TRAIL = 32  # snapshots: a game over a network goes back by fewer


class ChangeLog:
    """The entities that gained, lost or replaced one of carom's own components.

    touched: their ids, those that have gone too. batches: those that have come. deleted: ids of entities that were
    deleted while in a batch.
    """

    __slots__ = ("base", "batches", "cleared", "deleted", "dirty", "touched")

    def __init__(self, base: type[Any]) -> None:
        self.base = base  # only types derived from it are watched
        self.cleared = False  # by esper.clear_database(): everything before it has gone
        self.dirty = False  # something has been logged since the last time
        self.touched: set[int] = set()
        self.batches: list[Batch] = []
        self.deleted: list[np.ndarray] = []

    def take(self) -> tuple[set[int], list[Batch], list[np.ndarray], bool]:
        """What has been logged since the last time: touched, batches, deleted, cleared."""
        taken = self.touched, self.batches, self.deleted, self.cleared
        self.touched, self.batches, self.deleted, self.cleared, self.dirty = set(), [], [], False, False
        return taken

    def touch(self, entities: Iterable[int]) -> None:
        self.dirty = True
        self.touched.update(entities)


class Members:
    """The entities with one component: those that are listed, and those of batches.

    Logs entities that are added, removed and replaced.
    """

    __slots__ = ("_component", "_entities", "_log", "listed")

    def __init__(self, component: type[Any], listed: Iterable[int], entities: Entities, log: ChangeLog | None) -> None:
        self.listed = set(listed)
        self._component, self._entities, self._log = component, entities, log
        if log is not None and self.listed:
            log.touch(self.listed)

    def add(self, entity: int) -> None:
        log, entities = self._log, self._entities
        if log is not None:
            log.dirty = True
            log.touched.add(entity)
        if entity < entities.batches.stop:
            entities.take_out(entity)
        if entities.unshared is not None:
            entities.unshare(entity)
        self.listed.add(entity)

    def discard(self, entity: int) -> None:
        entities = self._entities
        if self._log is not None:
            self._log.touch((entity,))
        if entity < entities.batches.stop:
            entities.take_out(entity)
        if entities.unshared is not None:
            entities.unshare(entity)
        self.listed.discard(entity)

    def discard_many(self, entities: list[int]) -> None:
        """Entities that are listed and have gone."""
        if self._log is not None:
            self._log.touch(entities)
        self.listed.difference_update(entities)

    def settle(self, entity: int, log: bool) -> None:
        """An entity leaves its batch and keeps the component."""
        if log and self._log is not None:
            self._log.touch((entity,))
        self.listed.add(entity)

    def _batches(self) -> list[Batch]:
        return [batch for batch in self._entities.batches.all if batch.left and self._component in batch.types]

    def __contains__(self, entity: Any) -> bool:
        if entity in self.listed:
            return True
        batch = self._entities.batches.of(entity)
        return batch is not None and self._component in batch.types

    def __len__(self) -> int:
        return len(self.listed) + sum(batch.left for batch in self._batches())

    def __bool__(self) -> bool:
        return bool(self.listed) or bool(self._batches())

    def __iter__(self) -> Iterator[int]:
        """By ascending id, as they are now: walking through them may take them out of their batches.

        In the order of the set it would depend on what has come and gone before, and a restored world may have another
        history than the one it repeats.
        """
        ids = list(self.listed)
        for batch in self._batches():
            ids += batch.ids().tolist()
        ids.sort()
        return iter(ids)

    def mask(self, entities: np.ndarray) -> np.ndarray:
        """(n,) which of these ids (n,) have the component."""
        mask = among(entities, self.listed)
        for batch in self._batches():
            mask |= batch.among(entities)
        return mask


class WatchedComponents(dict[type[Any], Members]):
    """esper's dict of those sets; of types that are not carom's they are not logged."""

    def __init__(self, content: dict[type[Any], set[int]], entities: Entities, log: ChangeLog) -> None:
        super().__init__()
        self.entities, self.log = entities, log
        entities.members = self
        for component, members in content.items():
            self[component] = members

    def __setitem__(self, component: type[Any], entities: Iterable[int]) -> None:
        ours = isinstance(component, type) and issubclass(component, self.log.base)
        super().__setitem__(component, Members(component, entities, self.entities, self.log if ours else None))

    def clear(self) -> None:
        self.log.take()
        self.log.cleared = self.log.dirty = True
        super().clear()


class Entities(dict[int, dict[type[Any], Any]]):
    """esper's dict of the components of each entity; those of an entity in a batch are made when they are looked up.

    saved
        what snapshots hold of it, while nothing has come or gone since; else None
    unshared
        what has come, gone or changed since a snapshot has held all dicts of components: these may be changed; None
        while there are no snapshots
    """

    def __init__(self, content: dict[int, dict[type[Any], Any]]) -> None:
        super().__init__(content)
        self.batches = Batches()
        self.members: dict[type[Any], Members] = {}
        self.saved: Any = None
        self.unshared: set[int] | None = None
        self._trail: deque[tuple[Any, set[int]]] = deque(maxlen=TRAIL)  # what was shared, and what changed before it

    # -- snapshots --------------------------------------------------------------------------------

    def share(self, saved: Any, also_changed: Iterable[int] = (), apart: Iterable[int] = ()) -> None:
        """A snapshot holds all dicts of components that there are now.

        also_changed: entities that have been changed without a word since the last time. apart: those that it has in a
        batch.
        """
        self._trail.append((weakref.ref(saved), (self.unshared or set()).union(also_changed)))
        self.saved, self.unshared = saved, set(apart)

    def changed_since(self, saved: Any) -> set[int] | None:
        """What has come, gone or changed since then, and maybe more; None if that is not known."""
        changed = set(self.unshared or ())
        for reference, before in reversed(self._trail):
            if reference() is saved:
                return changed
            changed |= before
        return None

    def unshare(self, entity: int) -> None:
        """An entity is about to gain or lose a component: what a snapshot holds stays as it is."""
        self.saved = None
        if entity not in self.unshared:  # type: ignore[operator]
            self.unshared.add(entity)  # type: ignore[union-attr]
            components = dict.get(self, entity)
            if components is not None:
                dict.__setitem__(self, entity, components.copy())

    def note(self, entities: Iterable[int]) -> None:
        """These come or go."""
        self.saved = None
        if self.unshared is not None:
            self.unshared.update(entities)

    # -- as esper uses it -------------------------------------------------------------------------

    def __setitem__(self, entity: int, components: dict[type[Any], Any]) -> None:
        self.note((entity,))
        dict.__setitem__(self, entity, components)

    def __delitem__(self, entity: int) -> None:
        self.note((entity,))
        dict.__delitem__(self, entity)

    def __missing__(self, entity: Any) -> dict[type[Any], Any]:
        batch = self.batches.of(entity)
        if batch is None:
            raise KeyError(entity)
        number = int(entity)
        components: dict[type[Any], Any] = batch.take_out(number)
        dict.__setitem__(self, number, components)  # nothing has come or gone
        if self.unshared is not None:
            self.unshared.add(number)
        for component in batch.types:
            self.members[component].settle(number, batch.make_handle is None)
        return components

    def take_out(self, entity: Any) -> None:
        """Make the components of an entity if it is in a batch."""
        if self.batches.of(entity) is not None:
            self.__missing__(entity)

    def types_of(self, entity: int) -> Collection[type[Any]]:
        """The types of its components, () for what is no entity."""
        components = dict.get(self, entity)
        if components is not None:
            return components
        batch = self.batches.of(entity)
        return () if batch is None else batch.types

    def __contains__(self, entity: object) -> bool:
        return dict.__contains__(self, entity) or self.batches.of(entity) is not None

    def get(self, entity: Any, default: Any = None) -> Any:
        components = dict.get(self, entity)
        if components is not None:
            return components
        return default if self.batches.of(entity) is None else self.__missing__(entity)

    def __len__(self) -> int:
        return dict.__len__(self) + sum(batch.left for batch in self.batches.all)

    def __bool__(self) -> bool:
        return len(self) > 0

    def __iter__(self) -> Iterator[int]:
        """By ascending id, which is the order in which they were created."""
        return iter(sorted(itertools.chain(dict.__iter__(self), *(batch.ids().tolist() for batch in self.batches.all))))

    def keys(self) -> Any:
        return KeysView(self)

    def values(self) -> Any:
        return ValuesView(self)

    def items(self) -> Any:
        return ItemsView(self)

    def clear(self) -> None:
        self.saved = None
        self._trail.clear()
        self.batches.clear()
        super().clear()


def among(entities: np.ndarray, members: set[int]) -> np.ndarray:
    """(n,) mask of the ids that are members; takes as long as the fewer of the two."""
    if len(members) + _SORTING < len(entities):
        return np.isin(entities, np.fromiter(members, np.int64, len(members)))
    return np.fromiter(map(members.__contains__, entities.tolist()), bool, len(entities))


_SORTING = 500  # look-ups in a set take as long as one call of np.isin

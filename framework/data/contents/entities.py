"""What a world has in place of esper's containers: a view of the table, and a log of what the table does not know yet.

An entity has objects (a dict of components, as esper wants it) or it has none; then it is a row whose masks say which
components it has, or one of an arrival that has got no rows yet. Objects are made on demand, and stay.
"""

from __future__ import annotations

import itertools
import weakref
from collections import deque
from collections.abc import Collection, ItemsView, Iterable, Iterator, KeysView, ValuesView
from typing import Any

import numpy as np

from ..component import Component, RowStore
from ..table import FEW, HAS_OBJECTS
from .change_log import Arrival, ChangeLog, Stores

TRAIL = 32  # snapshots: a game over a network goes back by fewer


class Entities(dict[int, dict[type[Any], Any]]):
    """esper's dict of the components of each entity; those without objects are made when they are looked up.

    table
        where they are; None before there is physics
    stop
        entities without objects have smaller ids
    saved
        what snapshots hold of it, while nothing has come or gone since; else None
    unshared
        what has come, gone or changed since a snapshot has held all dicts of components: these may be changed; None
        while there are no snapshots
    version
        changes whenever an entity that is there goes, or gains, loses or replaces a component
    """

    def __init__(self, content: dict[int, dict[type[Any], Any]], log: ChangeLog) -> None:
        super().__init__(content)
        self.log, self.table, self.stop, self.version = log, None, 0, 0
        self.members: dict[type[Any], Any] = {}  # see members.WatchedComponents
        self.saved: Any = None
        self.unshared: set[int] | None = None
        self._trail: deque[tuple[Any, set[int]]] = deque(maxlen=TRAIL)  # what was shared, and what changed before it

    # -- those without objects --------------------------------------------------------------------

    def _row(self, entity: Any) -> int:
        """Its row if it has no objects; -1: it has, or is no body."""
        if self.table is None:
            return -1
        row = self.table.row_of(entity)
        return -1 if row < 0 or self.table.arrays[HAS_OBJECTS][row] or entity in self.log.deleted else row

    def _arrival(self, entity: Any) -> Arrival | None:
        for one in self.log.arrivals:
            if one.first <= entity < one.stop and entity not in self.log.deleted:
                return one
        return None

    def without_objects(self, component: type[Any] | None = None) -> np.ndarray:
        """(n,) ids of the rows that have none, and that component."""
        table = self.table
        if table is None or not table.count or (component is not None and component not in table.mask_names):
            return _NO_IDS
        mask = ~table.column(HAS_OBJECTS)
        if component is not None:
            mask &= table.has_mask(component)[: table.count]
        return table.column("entity")[mask]

    def _have_no_objects(self, entities: np.ndarray) -> np.ndarray:
        """(n,) which of these ids (n,) are entities without objects, or were deleted as such."""
        there = np.zeros(len(entities), bool)
        if self.table is not None and len(entities):
            rows = self.table.rows_of(entities)
            there = (rows >= 0) & ~self.table.arrays[HAS_OBJECTS][rows]
        for one in self.log.arrivals:
            there |= (entities >= one.first) & (entities < one.stop)
        return there

    def missing(self, entities: Iterable[Any]) -> list[Any]:
        """Those of these ids that no entity has."""
        others = [entity for entity in entities if not dict.__contains__(self, entity)]
        if len(others) > FEW and set(map(type, others)) == {int} and min(others) >= 0 and max(others) < self.stop:
            numbers = np.array(others, np.int64)
            there = self._have_no_objects(numbers) & ~among(numbers, self.log.deleted)
            return numbers[~there].tolist()
        return [entity for entity in others if entity not in self]

    def mask(self, entities: np.ndarray, component: type[Any]) -> np.ndarray:
        """(n,) which of these ids (n,) have that component."""
        of, table, log = self.members.get(component), self.table, self.log
        if of is None or not of.ours:
            return among(entities, () if of is None else of.listed)
        mask, unsure = np.zeros(len(entities), bool), np.ones(len(entities), bool)
        if table is not None and component in table.mask_names and not log.cleared:
            rows = table.rows_of(entities)
            mask = table.has_mask(component)[rows]
            unsure = rows < 0
            if log.dirty:
                unsure |= among(entities, log.touched) | among(entities, log.deleted)
        for index in unsure.nonzero()[0].tolist():
            mask[index] = component in self.types_of(entities.item(index))
        return mask

    def types_of(self, entity: Any) -> Collection[type[Any]]:
        """The types of its components, () for what is no entity."""
        components = dict.get(self, entity)
        if components is not None:
            return components
        number = entity if type(entity) is int else _number(entity)
        table = self.table
        if number is None or number >= self.stop:
            return ()
        if table is not None:
            row = table.row_of(number)
            if row >= 0 and number not in self.log.deleted and not table.arrays[HAS_OBJECTS].item(row):
                return table.types_in(row)
        one = self._arrival(number)
        return () if one is None else one.stores.keys()

    def __missing__(self, entity: Any) -> dict[type[Any], Any]:
        number = _number(entity)
        if number is not None and number < self.stop:
            row = self._row(number)
            if row >= 0:
                components: dict[type[Any], Any] = {}
                for component in self.table.types_in(row):
                    handle = components[component] = component.__new__(component)
                    handle._bind(self.table, number)
                self.table.arrays[HAS_OBJECTS][row] = True
                self._settle(number, components)
                return components
            one = self._arrival(number)
            if one is not None:
                self._settle_all(one)
                return dict.__getitem__(self, number)
        raise KeyError(entity)

    def _settle(self, entity: int, components: dict[type[Any], Any]) -> None:
        """Nothing has come or gone, but there are objects now."""
        dict.__setitem__(self, entity, components)
        if self.unshared is not None:
            self.unshared.add(entity)
        for component in components:
            self.members[component].listed.add(entity)

    def _settle_all(self, one: Arrival) -> None:
        """Entities that have no rows yet become entities like any other."""
        log = self.log
        log.arrivals.remove(one)
        log.touched.update(range(one.first, one.stop))
        log.touched.difference_update(log.deleted)
        for entity in range(one.first, one.stop):
            if entity in log.touched:
                components: dict[type[Any], Any] = {}
                for component, store in one.stores.items():
                    handle = components[component] = component.__new__(component)
                    handle._bind(store, None, entity - one.first, RowStore.version)
                self._settle(entity, components)

    def handle(self, entity: int, component: type[Component]) -> Component:
        """That component of an entity, to be read now: what has no objects gets none by it."""
        components = dict.get(self, entity)
        if components is not None:
            return components[component]
        handle, one = component.__new__(component), self._arrival(entity)
        if one is None:
            handle._bind(self.table, entity)
        else:
            handle._bind(one.stores[component], None, entity - one.first, RowStore.version)
        return handle

    # -- what changes -----------------------------------------------------------------------------

    def changes(self, entity: int, component: type[Any], ours: bool) -> None:
        """An entity is about to gain, lose or replace a component."""
        self.version += 1
        if entity < self.stop and not dict.__contains__(self, entity) and entity in self:
            self.__missing__(entity)
        if ours:
            log = self.log
            log.dirty = True
            log.touched.add(entity)
            components = dict.get(self, entity)
            handle = None if components is None else components.get(component)
            if handle is not None:
                log.lost.append(handle)
        if self.unshared is not None:
            self.unshare(entity)

    def create(self, entity: int, components: dict[type[Any], Any]) -> None:
        """What esper.create_entity does."""
        members, ours = self.members, False
        for component in components:
            of = members.get(component)
            if of is None:
                members[component] = ()  # type: ignore[assignment]
                of = members[component]
            of.listed.add(entity)
            ours = ours or of.ours
        if ours:
            self.log.dirty = True
            self.log.touched.add(entity)
        self.saved = None
        if self.unshared is not None:
            self.unshared.add(entity)
        dict.__setitem__(self, entity, components)

    def create_many(self, first: int, count: int, stores: Stores) -> None:
        self.note(())
        for component in stores:
            if component not in self.members:
                self.members[component] = ()  # type: ignore[assignment]
        self.stop = first + count
        one = Arrival(first, count, stores)
        self.log.arrivals.append(one)
        if any(component.makes_body for component in stores):
            self.log.dirty = True
        else:
            self._settle_all(one)

    def delete(self, entities: Iterable[Any]) -> None:
        """What esper does for its dead; what does not exist (any more) is no error."""
        self.version += 1
        log, members = self.log, self.members
        handles: list[weakref.ref[Any]] = []
        gone: list[int] = []
        components = handle = None
        others: list[Any] = []
        for entity in entities:
            components = dict.pop(self, entity, None)
            if components is None:
                others.append(entity)
                continue
            gone.append(entity)
            ours = False
            for component, handle in components.items():
                of = members[component]
                of.listed.discard(entity)
                if of.ours:
                    ours = True
                    if isinstance(handle, Component):
                        handles.append(weakref.ref(handle))
            if ours:  # the table does not know of others
                log.dirty = True
                log.touched.add(entity)
        self.note(gone)
        if others:
            log.dirty = True
            self._delete_without_objects(others)
        components = handle = None
        log.lost += [handle for one in handles if (handle := one()) is not None]  # those that somebody holds
        for component in [component for component, of in members.items() if not (of.listed or of)]:
            del members[component]

    def _delete_without_objects(self, entities: list[Any]) -> None:
        numbers = np.array(entities)
        if numbers.dtype != np.int64 or numbers.ndim != 1:
            numbers = np.array([number for number in map(_number, entities) if number is not None], np.int64)
        gone = numbers[self._have_no_objects(numbers)].tolist()
        self.log.deleted.update(gone)
        self.note(gone)  # a snapshot may be of a time at which they had objects

    def forget_all(self) -> None:
        """esper.clear_database()."""
        self.version += 1
        lost = [h for components in dict.values(self) for h in components.values() if isinstance(h, Component)]
        lost += self.log.lost
        self.log.touched.update(dict.keys(self))
        self.log.clear()
        self.log.cleared = self.log.dirty = True
        self.log.lost = lost
        if self.table is not None:
            self.table.arrays[HAS_OBJECTS][:] = True  # none of its rows is an entity
        self.saved, self.stop = None, 0
        self._trail.clear()

    # -- snapshots --------------------------------------------------------------------------------

    def share(self, saved: Any, also_changed: Iterable[int] = (), apart: Iterable[int] = ()) -> None:
        """A snapshot holds all dicts of components that there are now.

        also_changed: entities that have been changed without a word since the last time. apart: those that have no
        objects in it.
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
        self.saved = None
        if self.unshared is not None:
            self.unshared.add(entity)
        dict.__setitem__(self, entity, components)

    def __delitem__(self, entity: int) -> None:
        self.note((entity,))
        dict.__delitem__(self, entity)

    def __contains__(self, entity: object) -> bool:
        if dict.__contains__(self, entity):
            return True
        number, table = entity if type(entity) is int else _number(entity), self.table
        if number is None or number >= self.stop:
            return False
        if table is not None:  # as _row, which takes twice as long
            row = table.row_of(number)
            if row >= 0 and number not in self.log.deleted and not table.arrays[HAS_OBJECTS].item(row):
                return True
        return self._arrival(number) is not None

    def get(self, entity: Any, default: Any = None) -> Any:
        components = dict.get(self, entity)
        if components is not None:
            return components
        return self.__missing__(entity) if entity in self else default

    def __len__(self) -> int:
        return dict.__len__(self) + len(self.unlisted())

    def unlisted(self) -> list[int]:
        ids = self.without_objects().tolist()
        for one in self.log.arrivals:
            ids += range(one.first, one.stop)
        gone = set(self.log.deleted)
        return [entity for entity in ids if entity not in gone] if gone else ids

    def __bool__(self) -> bool:
        return dict.__len__(self) > 0 or bool(self.unlisted())

    def __iter__(self) -> Iterator[int]:
        """By ascending id, which is the order in which they were created."""
        return iter(sorted(itertools.chain(dict.__iter__(self), self.unlisted())))

    def keys(self) -> Any:
        return KeysView(self)

    def values(self) -> Any:
        return ValuesView(self)

    def items(self) -> Any:
        return ItemsView(self)


def among(entities: np.ndarray, members: Collection[int]) -> np.ndarray:
    """(n,) mask of the ids that are members; takes as long as the fewer of the two."""
    if not members:
        return np.zeros(len(entities), bool)
    if len(members) + _SORTING < len(entities):
        return np.isin(entities, np.fromiter(members, np.int64, len(members)))
    return np.fromiter(map(members.__contains__, entities.tolist()), bool, len(entities))


def _number(entity: Any) -> int | None:
    """The id as an int; None for what can be none."""
    if type(entity) is int:
        return entity
    try:
        number = int(entity)
    except (TypeError, ValueError, OverflowError):
        return None
    return number if number == entity else None


_NO_IDS = np.empty(0, np.int64)
_SORTING = 500  # look-ups in a set take as long as one call of np.isin

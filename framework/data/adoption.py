"""Keeping the table in step with esper: which entities have come, gone or changed since the last look.

esper's changes are logged as they happen (see watched), so the work here is in proportion to what has changed: the
handles of the entities concerned are compared with those the table knows, everything is checked, and only then written.
Entities that were created in bulk (batches) come as arrays and have no handles.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Set
from dataclasses import dataclass, field
from itertools import compress
from typing import Any

import numpy as np

from ..errors import MissingComponentError
from . import esper_bridge
from .batches import Batch
from .component import Component
from .handles import bind_handles, write_handles
from .table import STATIC, Table
from .watched import ChangeLog

Ids = set[int]
Handles = dict[int, Component]
ByType = Mapping[type[Any], tuple[list[int], list[Any]]]  # entities that have one of the type, and these
OTHER, OURS, PARTNER = range(3)  # component types: not carom's; with columns; such that make a body with the anchor


@dataclass
class Changes:
    """What has to be done so that the table knows what esper has.

    come, left
        ids that become bodies, ids that cease to be; ascending
    fresh
        handles to adopt, by type and ascending id
    gone
        ids that lose a handle, by type
    batches, deleted
        whose entities become bodies; ids that cease to be and have no handles
    """

    come: list[int] = field(default_factory=list)
    left: list[int] = field(default_factory=list)
    fresh: dict[type[Component], Handles] = field(default_factory=dict)
    gone: dict[type[Component], Ids] = field(default_factory=dict)
    batches: list[Batch] = field(default_factory=list)
    deleted: list[np.ndarray] = field(default_factory=list)


class Adoption:
    """Adopts the components of entities that form a body: those with ``anchor`` and any that ``makes_body``.

    check_together
        may refuse, with a ValueError, what does not go together on one entity, see
        :class:`~carom.systems.shapes.geometry_levels.LevelCheck`
    """

    def __init__(self, table: Table, anchor: type[Component], check_together: Any) -> None:
        self.table = table
        self.anchor = anchor
        self._check_together = check_together
        self._roles: dict[Any, int] = {}  # by component type
        # Handles of the bodies in the table, but for those of batches that are not in use.
        self._members: dict[type[Component], Handles] = {}
        self._contents: esper_bridge.Contents | None = None  # of this world's context
        # Changes that have not been taken in yet, as the log has them.
        self._touched: Ids = set()
        self._batches: list[Batch] = []
        self._deleted: list[np.ndarray] = []
        self._cleared = False

    def settled(self) -> bool:
        """Whether nothing has changed since the last synchronize."""
        return not (self._contents is None or self._contents.log.dirty or self._waiting())

    def _waiting(self) -> bool:
        return bool(self._touched or self._batches or self._deleted or self._cleared or self.table.kind_changed)

    def synchronize(self, contents: esper_bridge.Contents) -> bool:
        """Bring the table up to date with what is in the world's context; True if anything has changed.

        Raises MissingComponentError or ValueError, naming the entity, before anything has been written; what is amiss
        is looked at again the next time.
        """
        self._contents = contents
        if self.settled():
            return False
        self._gather(contents.log)
        changes = self._find_changes()
        self._check(changes)
        cleared = self._cleared
        self._touched, self._batches, self._deleted, self._cleared = set(), [], [], False
        return self._apply(changes, cleared)

    def register(self, components: Iterable[type[Component]]) -> None:
        """Columns of these types exist from now on, whether a body has them or not; ValueError for taken names."""
        for component in components:
            self.table.check_component_type(component)
            self.table.add_component_type(component)

    def release(self) -> None:
        """Let all handles go: the world closes, they keep their last values, and so do arrays of columns."""
        for component, members in self._members.items():
            entities = set(members)
            self._let_go(component, entities, entities)

    # -- going back to what was -------------------------------------------------------------------

    def know(self, component: type[Component]) -> None:
        """There are columns for that type from now on."""
        if component not in self._members:
            self.table.add_component_type(component)
            self.table.members_version += 1
            self._members[component] = {}

    def loose(self, component: type[Component], listed: Ids) -> Collection[int]:
        """Those of the entities with handles of a component that are no bodies."""
        adopted = self._members.get(component, {})
        return () if len(adopted) == len(listed) else listed - adopted.keys()

    def pending(self, log: ChangeLog) -> Ids:
        """Entities that have changed since the last synchronize."""
        if log.cleared or self._cleared:
            return set().union(*self._members.values(), self._touched, log.touched)
        return self._touched | log.touched

    def forget_pending(self, log: ChangeLog) -> None:
        """What has changed since the last synchronize does not count."""
        log.take()
        self._touched, self._batches, self._deleted, self._cleared = set(), [], [], False

    def keep_only(self, by_type: ByType, wanted: Mapping[int, Mapping[type[Any], Any]], others: Ids) -> None:
        """Let go of all other handles of these entities, of all if they are to be no bodies; the rows stay.

        others: entities of which no handles are wanted.
        """
        bodies = self._bodies_of(by_type)
        for component, members in self._members.items():
            gone = members.keys() & others
            for entity in members.keys() & wanted.keys():
                if entity not in bodies or wanted[entity].get(component) is not members[entity]:
                    gone.add(entity)
            if gone:
                self._let_go(component, gone, gone)

    def adopt_again(self, by_type: ByType) -> None:
        """Bind those of these handles that belong to bodies: the table has their rows."""
        bodies = self._bodies_of(by_type)
        for component, (entities, handles) in by_type.items():
            role = self._role(component)
            if role == OURS and not bodies.issuperset(entities):
                are = list(map(bodies.__contains__, entities))
                entities, handles = list(compress(entities, are)), list(compress(handles, are))
            if role != OTHER:
                self._members[component].update(zip(entities, handles, strict=True))
                bind_handles(self.table, entities, handles)

    def _bodies_of(self, by_type: ByType) -> Ids:
        return set().union(*(entities for c, (entities, _) in by_type.items() if self._role(c) == PARTNER))

    # -- what has changed -------------------------------------------------------------------------

    def _gather(self, log: ChangeLog) -> None:
        touched, batches, deleted, cleared = log.take()
        if cleared:
            self.table.generation += 1
            self._touched, self._batches, self._deleted, self._cleared = set(), [], [], True
        self._touched = self._touched | touched if self._touched else touched
        self._batches += batches
        self._deleted += deleted

    def _role(self, component: Any) -> int:
        role = self._roles.get(component)
        if role is None:
            ours = isinstance(component, type) and issubclass(component, Component)
            role = self._roles[component] = OTHER if not ours else PARTNER if component.makes_body else OURS
        return role

    def _find_changes(self) -> Changes:
        changes = Changes(deleted=self._deleted)
        known = self._members
        if self._cleared:  # whatever has been, the ids mean other entities now
            changes.gone = {component: set(members) for component, members in known.items() if members}
            known = {}
        for entity in sorted(self._touched):
            self._compare(entity, self._contents.components_of(entity), known, changes)
        for batch in self._batches:
            partners = [component for component in batch.types if self._role(component) == PARTNER]
            if batch.left and partners:
                if self.anchor not in batch.types:
                    self._refuse_without_anchor(int(batch.ids()[0]), partners[0])
                changes.batches.append(batch)
        return changes

    def _compare(
        self, entity: int, now: Mapping[type[Any], Any], known: dict[type[Component], Handles], changes: Changes
    ) -> None:
        """Of one entity, the components that esper has with the handles that the table has."""
        roles, anchors = self._roles, known.get(self.anchor)
        was, partner = anchors is not None and entity in anchors, None
        for component in now:
            role = roles.get(component)
            if role == PARTNER or (role is None and self._role(component) == PARTNER):
                partner = component
        if partner is None:
            if was:
                changes.left.append(entity)
                self._lose(entity, (), known, changes)
            return
        if self.anchor not in now:
            self._refuse_without_anchor(entity, partner)
        if was:
            self._lose(entity, now, known, changes)
        else:
            changes.come.append(entity)
        for component, handle in now.items():
            if roles[component] == OTHER:
                continue
            old = known[component].get(entity) if was and component in known else None
            if old is not handle:
                changes.fresh.setdefault(component, {})[entity] = handle
                if old is not None:
                    changes.gone.setdefault(component, set()).add(entity)

    def _lose(
        self, entity: int, kept: Collection[type[Any]], known: dict[type[Component], Handles], changes: Changes
    ) -> None:
        """The handles that a body has lost: all but those of the types that are kept."""
        for component, members in known.items():
            if component not in kept and entity in members:
                changes.gone.setdefault(component, set()).add(entity)

    def _refuse_without_anchor(self, entity: int, component: type[Component]) -> None:
        raise MissingComponentError(
            f"entity {entity} has {component.__name__} but no {self.anchor.__name__}: "
            f"add {self.anchor.__name__}(...) or remove {component.__name__}"
        )

    # -- checks: every error is found before anything is written ----------------------------------

    def _check(self, changes: Changes) -> None:
        table, dimensions = self.table, self.table.dimensions
        for component, handles in changes.fresh.items():
            table.check_component_type(component)
            if len(handles) > 1 and len(set(map(id, handles.values()))) < len(handles):
                self._refuse_second_use(component, handles)
            for entity, handle in handles.items():
                if type(handle) is not component:
                    self._refuse_other_type(component, handle, entity)
                if handle._entity is not None:
                    self._check_owner(component, handle, entity)
                handle.check_dimensions(dimensions, entity)
        self._check_together(changes.fresh, self._members, changes.gone)
        for batch in changes.batches:
            for component in batch.types:
                table.check_component_type(component)
            self._check_together.batch(batch.stores, batch.ids(), batch.rows())

    def _refuse_second_use(self, component: type[Component], handles: Handles) -> None:
        seen: dict[int, int] = {}
        for entity, handle in handles.items():
            other = seen.setdefault(id(handle), entity)
            if other != entity:
                raise ValueError(_second_use(component, f"entities {other} and {entity}"))

    def _refuse_other_type(self, component: type[Component], handle: Component, entity: int) -> None:
        raise ValueError(
            f"entity {entity} has a {type(handle).__name__} under the type {component.__name__}: carom's components "
            f"are final and cannot be added under another type"
        )

    def _check_owner(self, component: type[Component], handle: Component, entity: int) -> None:
        """A handle that is bound to a row may come here only if its entity does not have it any more."""
        owner = handle._entity
        if handle._store is not self.table:
            raise ValueError(_second_use(component, f"entity {owner} of another world and to entity {entity}"))
        if owner != entity and self._contents.components_of(owner).get(component) is handle:
            raise ValueError(_second_use(component, f"entities {owner} and {entity}"))

    # -- bringing the table up to date ------------------------------------------------------------

    def _apply(self, changes: Changes, cleared: bool) -> bool:
        table, fresh, gone, batches = self.table, changes.fresh, changes.gone, changes.batches
        for component in (*fresh, *(component for batch in batches for component in batch.types)):
            self.know(component)
        leaving = set().union(*gone.values()) if cleared else set(changes.left)
        for component, entities in gone.items():
            self._let_go(component, entities, leaving)
        kinds_changed = self._other_kinds(fresh, changes.come)
        places: dict[int, int] = {}
        if changes.come or changes.left or batches or changes.deleted or cleared or kinds_changed:
            places = self._move_rows(changes, cleared)
        stays = False  # some body that stays has other components
        for component, handles in fresh.items():
            stays = stays or not handles.keys() <= places.keys()
            self._adopt(component, handles, places)
        for batch in batches:
            self._adopt_batch(batch)
        if stays or any(not entities <= leaving for entities in gone.values()):
            table.members_version += 1
            table.static_version += 1
        return True

    def _other_kinds(self, fresh: dict[type[Component], Handles], come: list[int]) -> bool:
        """Write the kinds of bodies that stay and get another carrier of it; True if any has to move for it."""
        table = self.table
        carriers = fresh.get(table.kind_carrier, {})
        if len(carriers) > len(come) or not carriers.keys() <= set(come):
            staying = [entity for entity in carriers if entity not in come]
            rows = np.array([table.find(entity) for entity in staying])
            table.set_kinds(rows, np.array([_kind_of(carriers[entity]) for entity in staying]))
        return table.kind_changed

    def _move_rows(self, changes: Changes, cleared: bool) -> dict[int, int]:
        """Rows leave and others come; returns the rows of bodies that come one by one, by id."""
        table, come, carriers = self.table, changes.come, changes.fresh.get(self.table.kind_carrier, {})
        added = np.array(come, np.int64)
        kinds = np.array([_kind_of(carriers[e]) if e in carriers else STATIC for e in come], np.int64)
        removed = np.arange(table.count) if cleared else table.rows_of(np.array(changes.left, np.int64))
        if changes.deleted:
            removed = np.concatenate((removed, *(table.rows_of(ids) for ids in changes.deleted)))
        if changes.batches:
            added = np.concatenate((added, *(batch.ids() for batch in changes.batches)))
            kinds = np.concatenate((kinds, *(self._kinds_of(batch) for batch in changes.batches)))
        added, rows = table.rebuild(removed, added, kinds)
        if not come:
            return {}
        if len(added) > len(come):
            added, rows = np.array(come), table.rows_of(np.array(come))
        return dict(zip(added.tolist(), rows.tolist(), strict=True))

    def _kinds_of(self, batch: Batch) -> np.ndarray:
        """(left,) kinds of the bodies of a batch."""
        carrier = self.table.kind_carrier
        if carrier not in batch.types:
            return np.full(batch.left, STATIC, np.int64)
        return batch.stores[carrier].values(carrier.columns["kind"].key, batch.rows()).astype(np.int64)

    def _let_go(self, component: type[Component], entities: Ids, leaving: Set[int] = frozenset()) -> None:
        """Handles of removed components keep their last values; the rows fall back to the defaults.

        leaving: entities whose rows go anyway.
        """
        members, table = self._members[component], self.table
        ids = _array(entities)
        rows = table.rows_of(ids)
        store = table.take_out(component, rows)
        version = store.version
        for index, entity in enumerate(ids.tolist()):
            handle = members.pop(entity)
            if handle._store is table and handle._entity == entity:
                handle._store = store
                handle._entity = None
                handle._row = index
                handle._version = version
        if entities <= leaving:
            return
        for column in component.columns.values():
            if column.key in table.arrays:
                table.arrays[column.key][rows] = column.empty_value(table.dimensions)
        table.has_mask(component)[rows] = False
        if component is table.kind_carrier:
            table.set_kinds(rows, np.full(len(rows), STATIC))

    def _adopt(self, component: type[Component], handles: Handles, places: dict[int, int]) -> None:
        """Write the handles' values into their rows and bind the handles; places: rows that hold the defaults."""
        table, version = self.table, self.table.version
        rows = [places[entity] if entity in places else table.find(entity) for entity in handles]
        write_handles(table, component, list(handles.values()), rows, handles.keys() <= places.keys())
        at: Any = rows[0] if len(rows) == 1 else np.array(rows)  # one is much faster by its number
        if component is self.anchor and "previous_position" in table.arrays:
            table.arrays["previous_position"][at] = table.arrays["position"][at]
        table.has_mask(component)[at] = True
        for (entity, handle), row in zip(handles.items(), rows, strict=True):
            handle._store = table
            handle._entity = entity
            handle._row = row
            handle._version = version
            handle._values = None
        self._members[component].update(handles)

    def _adopt_batch(self, batch: Batch) -> None:
        """Write the values of a batch into the table; handles are made on demand."""
        table, inside = self.table, batch.rows()
        rows = table.run_of(batch.ids())
        for component, store in batch.stores.items():
            for column in component.columns.values():
                if column.key in store.arrays:
                    table.write(column.key, rows, store.arrays[column.key][inside])
                else:
                    table.write_one(column.key, rows, store.constants[column.key][1])
            table.has_mask(component)[rows] = True
        if self.anchor in batch.types and "previous_position" in table.arrays:
            table.arrays["previous_position"][rows] = table.arrays["position"][rows]
        batch.adopted(self.make_handle)

    def make_handle(self, component: type[Component], entity: int) -> Component:
        """A handle of a body in the table that has had none."""
        handle = self._members[component][entity] = component.__new__(component)
        handle._bind(self.table, entity)
        return handle


def _kind_of(carrier: Component) -> int:
    """The kind as it is stored."""
    column = type(carrier).columns["kind"]
    store = carrier._store
    return carrier._values["kind"] if store is None else int(store.values(column.key, carrier._row))


def _array(entities: Any) -> np.ndarray:
    return np.array(sorted(entities), np.int64)


def _second_use(component: type[Component], owners: str) -> str:
    return f"one {component.__name__} was given to {owners}: use copy() for the second"

"""Keeping the table in step with esper: who has come, gone or changed since the last look.

esper's changes are logged as they happen (see esper_bridge), so the work here is in proportion to what has changed: the
handles of the entities concerned are compared with those the table knows, everything is checked, and only then written.
Entities that were created in bulk (batches) come as arrays and have no handles.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set
from typing import Any

import numpy as np

from ..errors import MissingComponentError
from . import esper_bridge
from .batches import Batch, Stores
from .component import Component
from .handles import Sources
from .table import STATIC, Table
from .watched import ChangeLog

Ids = set[int]
Handles = dict[int, Component]


class TogetherCheck:
    """May refuse, with a ValueError, what does not go together on one entity."""

    def __call__(
        self,
        fresh: Mapping[type[Component], Handles],
        members: Mapping[type[Component], Handles],
        gone: Mapping[type[Component], Ids],
    ) -> None:
        """fresh, members: the handles to adopt and those adopted, by type and entity; gone: who loses them."""

    def batch(self, stores: Stores, entities: np.ndarray, rows: Any) -> None:
        """entities (n,) have all these components, with the values of these rows of the stores."""


class Adoption:
    """Adopts the components of entities that form a body: those with ``anchor`` and any of the partners."""

    def __init__(
        self,
        table: Table,
        anchor: type[Component],
        is_partner: Callable[[type[Any]], bool],
        check_together: TogetherCheck | None = None,
    ) -> None:
        self.table = table
        self.anchor = anchor
        self._check_together = check_together or TogetherCheck()
        self._is_partner = is_partner  # component type -> whether it makes a body together with the anchor
        # Handles of the bodies in the table, but for those of batches that nobody has asked for.
        self._members: dict[type[Component], Handles] = {}
        self._log: ChangeLog | None = None  # of this world's context
        # Changes that have not been taken in yet, as the log has them.
        self._pending: dict[type[Any], Ids] = {}
        self._batches: list[Batch] = []
        self._deleted: list[np.ndarray] = []
        self._cleared = False
        self._looked_up: tuple[Any, Any] = (None, None)  # ids and their rows, within one synchronize

    def settled(self) -> bool:
        """Whether nothing has changed since the last synchronize; needs no switch of contexts to find out."""
        return not (self._log is None or self._log.dirty or self._waiting())

    def _waiting(self) -> bool:
        return bool(self._pending or self._batches or self._deleted or self._cleared or self.table.kind_changed)

    def synchronize(self) -> bool:
        """Bring the table up to date; True if anything has changed.

        Raises MissingComponentError or ValueError, naming the entity, before anything has been written; what is amiss
        is looked at again the next time.
        """
        log = self._log = esper_bridge.changes()
        if not log.dirty and not self._waiting():
            return False
        self._gather(log)
        touched = self._pending
        types = list(dict.fromkeys((*self._members, *(t for t in touched if t in esper_bridge.component_types()))))
        come, left = self._bodies(touched)
        batches = [batch for batch in self._batches if batch.left and self._is_body(batch)]
        gone, fresh = self._differences(types, touched, come, left)
        self._check(fresh)
        self._check_together(fresh, self._members, gone)
        for batch in batches:
            for component in batch.types:
                self.table.check_component_type(component)
            self._check_together.batch(batch.stores, batch.ids(), batch.rows())
        deleted, cleared = self._deleted, self._cleared
        self._pending, self._batches, self._deleted, self._cleared = {}, [], [], False
        return self._apply(gone, come, _array(left), fresh, batches, deleted, cleared)

    def release(self) -> None:
        """Let all handles go: the world closes, they keep their last values."""
        for component, members in self._members.items():
            self._let_go(component, set(members))

    # -- what has changed -------------------------------------------------------------------------

    def _gather(self, log: ChangeLog) -> None:
        touched, cleared = log.take()
        batches, deleted = log.take_many()
        if cleared:
            self.table.generation += 1
            self._pending, self._batches, self._deleted, self._cleared = {}, [], [], True
        for component, entities in self._pending.items():
            touched.setdefault(component, set()).update(entities)
        self._pending = touched
        self._batches += batches
        self._deleted += deleted

    def _bodies(self, touched: dict[type[Any], Ids]) -> tuple[Ids, Ids]:
        """Ids that become bodies, ids that cease to be."""
        affected = set().union(*touched.values())
        anchored = affected & esper_bridge.listed_with(self.anchor)
        bodies: Ids = set()
        for component in esper_bridge.component_types():
            if self._is_partner(component):
                entities = affected & esper_bridge.listed_with(component)
                if not entities <= anchored:
                    self._refuse_without_anchor(min(entities - anchored), component)
                bodies |= entities
        if self._cleared:
            return bodies, set()
        known = self._members.get(self.anchor, {}).keys() & affected
        return bodies - known, known - bodies

    def _is_body(self, batch: Batch) -> bool:
        """Whether the entities of a batch become bodies."""
        partners = [component for component in batch.types if self._is_partner(component)]
        if partners and self.anchor not in batch.types:
            self._refuse_without_anchor(int(batch.ids()[0]), partners[0])
        return bool(partners)

    def _refuse_without_anchor(self, entity: int, component: type[Component]) -> None:
        raise MissingComponentError(
            f"entity {entity} has {component.__name__} but no {self.anchor.__name__}: "
            f"add {self.anchor.__name__}(...) or remove {component.__name__}"
        )

    def _differences(
        self, types: list[type[Any]], touched: dict[type[Any], Ids], come: Ids, left: Ids
    ) -> tuple[dict[type[Component], Ids], dict[type[Component], Handles]]:
        """Per component type, ids whose handle goes and handles to adopt, by ascending id."""
        known = {} if self._cleared else self._members
        anchors = known.get(self.anchor, {})
        everything = esper_bridge.all_components()
        gone: dict[type[Component], Ids] = {}
        fresh: dict[type[Component], Handles] = {}
        # A body that comes brings all its components, also those that it has had for long.
        types = [*types, *(t for t in esper_bridge.component_types() if come and t not in types and _is_ours(t))]
        for component in types:
            members = known.get(component, {})
            changed = touched.get(component, set())
            present = esper_bridge.listed_with(component)
            staying = {entity for entity in changed - come - left if entity in anchors}
            leaving = (members.keys() & left) | {e for e in staying - present if e in members}
            new: Handles = {}
            for entity in sorted((come & present) | (staying & present)):
                handle = everything[entity][component]
                if members.get(entity) is not handle:
                    new[entity] = handle
            if members:
                leaving |= members.keys() & new.keys()
            if leaving:
                gone[component] = leaving
            if new:
                fresh[component] = new
        if self._cleared:
            gone = {component: set(members) for component, members in self._members.items() if members}
        return gone, fresh

    # -- checks: every error is found before anything is written ----------------------------------

    def _check(self, fresh: dict[type[Component], Handles]) -> None:
        dimensions = self.table.dimensions
        for component, handles in fresh.items():
            self.table.check_component_type(component)
            values = handles.values()
            if len(set(map(id, values))) < len(handles):
                self._refuse_second_use(component, handles)
            if set(map(type, values)) != {component}:
                self._refuse_other_types(component, handles)
            for entity in [entity for entity, handle in handles.items() if handle._entity is not None]:
                self._check_owner(component, handles[entity], entity)
            for entity in [e for e, h in handles.items() if h._store is None or h._store.dimensions != dimensions]:
                handles[entity].check_dimensions(dimensions, entity)

    def _refuse_second_use(self, component: type[Component], handles: Handles) -> None:
        seen: dict[int, int] = {}
        for entity, handle in handles.items():
            other = seen.setdefault(id(handle), entity)
            if other != entity:
                raise ValueError(_second_use(component, f"entities {other} and {entity}"))

    def _refuse_other_types(self, component: type[Component], handles: Handles) -> None:
        entity, handle = next((e, h) for e, h in handles.items() if type(h) is not component)
        raise ValueError(
            f"entity {entity} has a {type(handle).__name__} under the type {component.__name__}: carom's components "
            f"are final and cannot be added under another type"
        )

    def _check_owner(self, component: type[Component], handle: Component, entity: int) -> None:
        """A handle that is bound to a row may come here only if its entity does not have it any more."""
        owner = handle._entity
        if handle._store is not self.table:
            raise ValueError(_second_use(component, f"entity {owner} of another world and to entity {entity}"))
        if owner != entity and esper_bridge.all_components().get(owner, {}).get(component) is handle:
            raise ValueError(_second_use(component, f"entities {owner} and {entity}"))

    # -- bringing the table up to date ------------------------------------------------------------

    def _apply(
        self,
        gone: dict[type[Component], Ids],
        come: Ids,
        left: np.ndarray,
        fresh: dict[type[Component], Handles],
        batches: list[Batch],
        deleted: list[np.ndarray],
        cleared: bool,
    ) -> bool:
        table = self.table
        for component in dict.fromkeys((*fresh, *(component for batch in batches for component in batch.types))):
            if component not in self._members:
                table.add_component_type(component)
                table.members_version += 1
                self._members[component] = {}
        leaving = set().union(*gone.values()) if cleared else set(left.tolist())
        for component, entities in gone.items():
            self._let_go(component, entities, leaving)
        sources = {component: Sources(component, list(handles.values())) for component, handles in fresh.items()}
        added = _array(come)
        kinds = self._kinds(added, fresh, sources)
        left = np.concatenate((left, *deleted)) if deleted else left
        moved = bool(len(left) or len(added) or batches or table.kind_changed or cleared)
        if moved:
            for batch in batches:
                added, kinds = np.append(added, batch.ids()), np.append(kinds, self._kinds_of(batch))
            table.rebuild(np.arange(table.count) if cleared else self._rows_of(left), added, kinds)
        for component, handles in fresh.items():
            self._adopt(component, handles, sources[component])
        for batch in batches:
            self._adopt_batch(batch)
        changed = any(not handles.keys() <= come for handles in fresh.values())
        if changed or any(not entities <= leaving for entities in gone.values()):
            table.members_version += 1  # bodies that stay have other components
            table.static_version += 1
        self._looked_up = (None, None)
        return moved or bool(fresh or gone)

    def _kinds(
        self, added: np.ndarray, fresh: dict[type[Component], Handles], sources: dict[type[Component], Sources]
    ) -> np.ndarray:
        """Kinds of the bodies that come, and new kinds written for those that got another carrier of it."""
        kinds = np.full(len(added), STATIC, np.int64)
        carrier = self.table.kind_carrier
        if carrier in fresh:
            entities = _array(fresh[carrier])
            values = sources[carrier].values(carrier.columns["kind"], self.table.dimensions)
            places = np.searchsorted(added, entities)
            here = np.append(added, -1)[places] == entities
            kinds[places[here]] = values[here]
            if not here.all():
                self.table.set_kinds(self.table.rows_of(entities[~here]), values[~here])
        return kinds

    def _kinds_of(self, batch: Batch) -> np.ndarray:
        """(left,) kinds of the bodies of a batch."""
        carrier = self.table.kind_carrier
        if carrier not in batch.types:
            return np.full(batch.left, STATIC, np.int64)
        return batch.stores[carrier].values(carrier.columns["kind"].key, batch.rows()).astype(np.int64)

    def _rows_of(self, ids: np.ndarray) -> np.ndarray:
        """Their rows, looked up once for component types that have come or gone together."""
        key = self.table.version, ids.tobytes()
        if key != self._looked_up[0]:
            self._looked_up = key, self.table.rows_of(ids)
        return self._looked_up[1]

    def _let_go(self, component: type[Component], entities: Ids, leaving: Set[int] = frozenset()) -> None:
        """Handles of removed components keep their last values; the rows fall back to the defaults.

        leaving: entities whose rows go anyway.
        """
        members, table = self._members[component], self.table
        ids = _array(entities)
        rows = self._rows_of(ids)
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

    def _adopt(self, component: type[Component], handles: Handles, sources: Sources) -> None:
        """Write the handles' values into their rows and bind the handles."""
        table = self.table
        rows = self._rows_of(np.fromiter(handles, np.int64, len(handles)))
        sources.write(table, rows)
        if component is self.anchor and "previous_position" in table.arrays:
            table.arrays["previous_position"][rows] = table.arrays["position"][rows]
        table.has_mask(component)[rows] = True
        version = table.version
        for (entity, handle), row in zip(handles.items(), rows.tolist(), strict=True):
            handle._store = table
            handle._entity = entity
            handle._row = row
            handle._version = version
            handle._values = None
        self._members[component].update(handles)

    def _adopt_batch(self, batch: Batch) -> None:
        """Write the values of a batch into the table; handles are made when somebody asks for them."""
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
        batch.adopted(self._make_handle)

    def _make_handle(self, component: type[Component], entity: int) -> Component:
        """A handle of a body in the table that has had none."""
        handle = self._members[component][entity] = component.__new__(component)
        handle._bind(self.table, entity)
        return handle


def _is_ours(component: type[Any]) -> bool:
    return isinstance(component, type) and issubclass(component, Component)


def _array(entities: Any) -> np.ndarray:
    return np.array(sorted(entities), np.int64)


def _second_use(component: type[Component], owners: str) -> str:
    return f"one {component.__name__} was given to {owners}: use copy() for the second"

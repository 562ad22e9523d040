"""Keeping the table in step with esper: who has come, gone or changed since the last look.

One cheap question first (did anything structural happen at all?); only then sets of ids are compared. Replaced
components do not show in the sets: a component made and not adopted yet is the only thing that can replace one, so
only while such components exist are identities compared.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from . import esper_bridge
from .component import Component, RowStore
from .errors import MissingComponentError
from .table import Table


class Adoption:
    """Adopts the components of entities that form a body: those with ``anchor`` and any of ``partners``."""

    def __init__(self, table: Table, anchor: type[Component], is_partner: Any, kind_of: Any) -> None:
        self.table = table
        self.anchor = anchor
        self._is_partner = is_partner  # component type -> whether it makes a body together with the anchor
        self._kind_of = kind_of  # components of an entity -> kind of body
        self._token: object = None
        self._members: dict[type[Component], dict[int, Component]] = {}

    def in_step_with_esper(self) -> bool:
        """Whether nothing structural has happened since the last synchronize."""
        return self._token is esper_bridge.change_token() and not self.table.kind_changed

    def synchronize(self) -> bool:
        """Bring the table up to date; True if rows were added, removed or moved.

        Raises MissingComponentError or ValueError, naming the entity, before anything has been changed.
        """
        token = esper_bridge.change_token()
        if token is self._token and not self.table.kind_changed:
            return False
        types = [t for t in esper_bridge.component_types() if isinstance(t, type) and issubclass(t, Component)]
        bodies = self._bodies(types)
        gone, come, fresh = self._differences(types, bodies)
        self._check(fresh)
        changed = self._apply(gone, come, fresh)
        self._token = token
        return changed

    # -- what has changed -------------------------------------------------------------------------------------------

    def _bodies(self, types: list[type[Component]]) -> set[int]:
        """Ids of the entities that form a body."""
        anchored = esper_bridge.entities_with(self.anchor)
        partnered: set[int] = set()
        for component in types:
            if self._is_partner(component):
                entities = esper_bridge.entities_with(component)
                if not entities <= anchored:
                    entity = min(entities - anchored)
                    raise MissingComponentError(
                        f"entity {entity} has {component.__name__} but no {self.anchor.__name__}: "
                        f"add {self.anchor.__name__}(...) or remove {component.__name__}"
                    )
                partnered |= entities
        return partnered

    def _differences(
        self, types: list[type[Component]], bodies: set[int]
    ) -> tuple[dict[type[Component], set[int]], set[int], dict[type[Component], dict[int, Component]]]:
        """Ids whose handle goes, per type; ids that become bodies; handles to adopt, per type."""
        known = self._members.get(self.anchor, {})
        come = bodies - known.keys()
        gone: dict[type[Component], set[int]] = {}
        fresh: dict[type[Component], dict[int, Component]] = {}
        for component in {*types, *self._members}:
            members = self._members.get(component, {})
            present = esper_bridge.entities_with(component) & bodies
            left = members.keys() - present
            new = present - members.keys()
            if component.unadopted:
                new |= {
                    entity
                    for entity in present & members.keys()
                    if esper_bridge.components_of(entity)[component] is not members[entity]
                }
            left |= new & members.keys()
            if left:
                gone[component] = left
            if new:
                fresh[component] = {e: esper_bridge.components_of(e)[component] for e in sorted(new)}
        return gone, come, fresh

    def _check(self, fresh: dict[type[Component], dict[int, Component]]) -> None:
        """Every error is found before anything is written."""
        seen: dict[int, int] = {}
        for component, handles in fresh.items():
            members = self._members.get(component, {})
            for entity, handle in handles.items():
                handle.check_dimensions(self.table.dimensions, entity)
                owner = handle.entity
                if id(handle) in seen or (
                    owner is not None and owner != entity and members.get(owner) is handle
                    and esper_bridge.known_entity(owner)
                    and esper_bridge.components_of(owner).get(component) is handle
                ):  # fmt: skip
                    other = seen.get(id(handle), owner)
                    raise ValueError(
                        f"one {component.__name__} was given to entities {other} and {entity}: use copy() for the second"
                    )
                seen[id(handle)] = entity

    # -- bringing the table up to date --------------------------------------------------------------------------------

    def _apply(
        self,
        gone: dict[type[Component], set[int]],
        come: set[int],
        fresh: dict[type[Component], dict[int, Component]],
    ) -> bool:
        table = self.table
        for component in fresh:
            table.add_component_type(component)
            self._members.setdefault(component, {})
        for component, entities in gone.items():
            self._let_go(component, entities)
        left = np.array(sorted(gone.get(self.anchor, set()) - come - fresh.get(self.anchor, {}).keys()), np.int64)
        added = np.array(sorted(come), np.int64)
        self._refresh_kinds(gone, come, fresh)
        kinds = np.array([self._kind_of(esper_bridge.components_of(entity)) for entity in added.tolist()], np.int64)
        changed = bool(len(left) or len(added) or table.kind_changed)
        if changed:
            rows = table.rebuild(table.rows_of(left), added, kinds)
            table.arrays["kind"][rows] = kinds
        for component, handles in fresh.items():
            self._adopt(component, handles)
        if fresh or gone:
            table.members_version += 1
            table.static_version += 1
        return changed or bool(fresh or gone)

    def _refresh_kinds(self, gone: Any, come: set[int], fresh: Any) -> None:
        """A body that gained or lost a component may be of another kind now."""
        entities = {e for ids in gone.values() for e in ids} | {e for handles in fresh.values() for e in handles}
        members = self._members.get(self.anchor, {})
        for entity in sorted((entities - come) & members.keys()):
            if not esper_bridge.known_entity(entity):
                continue
            kind = self._kind_of(esper_bridge.components_of(entity))
            row = self.table.find(entity)
            if self.table.arrays["kind"][row] != kind:
                self.table.arrays["kind"][row] = kind
                self.table.kind_changed = True

    def _let_go(self, component: type[Component], entities: set[int]) -> None:
        """Handles of removed components keep their last values; the rows fall back to the defaults."""
        members = self._members[component]
        ids = np.array(sorted(entities), np.int64)
        rows = self.table.rows_of(ids)
        store = self.table.take_out(component, rows)
        for index, entity in enumerate(ids.tolist()):
            handle = members.pop(entity)
            if handle._store is self.table and handle._entity == entity:
                handle._bind(store, None, index, store.version)
        for column in component.columns.values():
            self.table.arrays[column.key][rows] = column.empty_value(self.table.dimensions)
        self.table.has_mask(component)[rows] = False

    def _adopt(self, component: type[Component], handles: dict[int, Component]) -> None:
        """Write the handles' values into their rows, column by column, and bind the handles."""
        table = self.table
        rows = table.rows_of(np.fromiter(handles, np.int64, len(handles)))
        stores: dict[int, RowStore] = {}
        groups: dict[int, list[int]] = {}
        loose: list[int] = []
        sources = list(handles.values())
        for index, handle in enumerate(sources):
            store = handle._store
            if store is None:
                loose.append(index)
            else:
                stores[id(store)] = store
                groups.setdefault(id(store), []).append(index)
        for name, column in component.columns.items():
            array = table.arrays[column.key]
            if loose:
                values = [sources[index]._values[name] for index in loose]
                _write_values(array, rows[loose], values, column.empty_value(table.dimensions))
            for key, members in groups.items():
                taken = [sources[index]._row for index in members]
                array[rows[members]] = stores[key].arrays[column.key][taken]
        if "previous_position" in table.arrays and component is self.anchor:
            table.arrays["previous_position"][rows] = table.arrays["position"][rows]
        table.has_mask(component)[rows] = True
        for entity, handle in handles.items():
            handle._bind(table, entity)
        component.unadopted.difference_update(sources)
        self._members[component].update(handles)


def _write_values(array: np.ndarray, rows: np.ndarray, values: list[Any], empty: Any) -> None:
    """``array[rows] = values``, where a single number stands for a whole vector (0: no rotation)."""
    if array.ndim == 1:
        array[rows] = values
        return
    for row, value in zip(rows.tolist(), values, strict=True):
        array[row] = empty if np.ndim(value) == 0 and array.shape[1] == 4 else value

"""Bringing the table up to date with what has come, gone or changed since the last time.

Changes are logged as they happen (see entities), so the work here is in proportion to what has changed: it is looked
at, everything is checked, and only then written. Between two looks the table is the truth about all that is not in the
log.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from itertools import compress
from typing import Any

import numpy as np

from ..errors import MissingComponentError
from .component import Component
from .contents.change_log import Arrival
from .contents.changes import Archetype, Changes
from .esper_bridge import Contents
from .handles import Contained, bind_handles, write_handles
from .interpolation import restart
from .table import FEW, HAS_OBJECTS, STATIC, Table

Ids = set[int]
ByType = Mapping[type[Any], tuple[list[int], list[Any]]]  # entities that have one of the type, and these


class Adoption:
    """Adopts the components of entities that form a body: those with ``anchor`` and any that ``makes_body``.

    check_together
        may refuse, with a ValueError, what does not go together on one entity, see
        :class:`~carom.systems.shapes.geometry_levels.LevelCheck`
    on_losing
        called with a type and rows before these lose it
    """

    def __init__(self, table: Table, anchor: type[Component], contents: Contents, check_together: Any) -> None:
        self.table, self.anchor = table, anchor
        self._contents, self._log, self._entities = contents, contents.log, contents.entities
        self._check_together = check_together
        self._archetypes: dict[tuple[Any, ...], Archetype] = {}  # by the types of all components
        self.on_losing: Callable[[type[Component], np.ndarray], None] = lambda component, rows: None
        contents.entities.table = table

    def settled(self) -> bool:
        """Whether nothing has changed since the last synchronize."""
        return not (self._log.dirty or self.table.kind_changed)

    def synchronize(self) -> bool:
        """Bring the table up to date with what is in the world's context; True if anything has changed.

        Raises MissingComponentError or ValueError, naming the entity, before anything has been written; what is amiss
        is looked at again the next time.
        """
        if self.settled():
            return False
        self._contents.complete(self.table.dimensions)
        changes = self._find_changes()
        self._check(changes)
        self._apply(changes)
        return True

    def register(self, components: Iterable[type[Component]]) -> None:
        """Columns of these types exist from now on, whether a body has them or not; ValueError for taken names."""
        components = tuple(components)
        self.table.check_component_types(components)
        for component in components:
            self.table.add_component_type(component)

    def release(self) -> None:
        """Let all handles go: the world closes, they keep their last values, and so do arrays of columns."""
        self._let_go([*self._log.lost, *(h for own in dict.values(self._entities) for h in own.values())])

    # -- going back to what was -------------------------------------------------------------------

    def know(self, component: type[Component]) -> None:
        """There are columns for that type from now on."""
        if component not in self.table.mask_names:
            self.table.add_component_type(component)
            self.table.members_version += 1

    def loose(self, component: type[Component], listed: Ids) -> Collection[int]:
        """Those of the entities with handles of a component that are no bodies."""
        table = self.table
        if component in table.mask_names:
            adopted = table.has_mask(component)[: table.count] & table.column(HAS_OBJECTS)
            if np.count_nonzero(adopted) == len(listed):
                return ()
        return [entity for entity in listed if self._entities[entity][component]._store is not table]

    def pending(self) -> Ids:
        """Entities that have changed since the last synchronize."""
        return self._log.touched | self._log.deleted

    def forget_pending(self) -> None:
        """What has changed since the last synchronize does not count."""
        self._log.clear()

    def keep_only(self, by_type: ByType, wanted: Mapping[int, Mapping[type[Any], Any]], others: Ids) -> None:
        """Let go of all other handles of these entities, of all if they are to be no bodies; the rows stay.

        others: entities of which no handles are wanted.
        """
        bodies = self._bodies_of(by_type)
        kept = {id(h) for entities, handles in by_type.values() for e, h in zip(entities, handles, strict=True)
                if e in bodies}  # fmt: skip
        now = [*self._log.lost]
        for entity in (*others, *wanted):
            now += dict.get(self._entities, entity, {}).values()
        self._let_go([handle for handle in now if id(handle) not in kept])

    def adopt_again(self, by_type: ByType) -> None:
        """Bind those of these handles that belong to bodies: the table has their rows."""
        bodies = self._bodies_of(by_type)
        for component, (entities, handles) in by_type.items():
            alone = self._archetype((component,))
            if alone.columns and not alone.partner and not bodies.issuperset(entities):
                are = list(map(bodies.__contains__, entities))
                entities, handles = list(compress(entities, are)), list(compress(handles, are))
            if alone.columns:
                bind_handles(self.table, entities, handles)

    def _bodies_of(self, by_type: ByType) -> Ids:
        return set().union(*(entities for c, (entities, _) in by_type.items() if self._archetype((c,)).partner))

    # -- what has changed -------------------------------------------------------------------------

    def _archetype(self, types: tuple[Any, ...]) -> Archetype:
        known = self._archetypes.get(types)
        if known is None:
            columns = tuple(c for c in types if isinstance(c, type) and issubclass(c, Component))
            partner = next((component for component in reversed(columns) if component.makes_body), None)
            stacks = [stack for component in columns if (stack := getattr(component, "stack", None))]
            stacked = len(set(stacks)) < len(stacks)
            known = self._archetypes[types] = Archetype(columns, partner, self.anchor in columns, stacked)
        return known

    def _find_changes(self) -> Changes:
        changes, log, table, entities = Changes(), self._log, self.table, self._entities
        known, touched, given = self._archetypes, sorted(log.touched), changes.given
        rows = [-1] * len(touched)
        if touched and table.count and not log.cleared:  # else the ids mean other entities now
            few = len(touched) <= FEW
            rows = list(map(table.row_of, touched)) if few else table.rows_of(np.array(touched, np.int64)).tolist()
        for entity, row in zip(touched, rows, strict=True):
            now: Any = dict.get(entities, entity, ())
            types = tuple(now)
            archetype = known.get(types) or self._archetype(types)
            if archetype.partner is None:
                if row >= 0:
                    changes.left.append(row)
                    changes.detached += now and now.values()
                continue
            if not archetype.anchored:
                self._refuse_without_anchor(entity, archetype.partner)
            if not archetype.known:
                changes.archetypes.append((archetype, entity))
            if row < 0:
                own = changes.come.get(archetype)
                if own is None:
                    own = changes.come[archetype] = ([], [])
                own[0].append(entity)
                own[1].append(now)
                given += [(component, entity, now[component]) for component in archetype.columns]
            else:
                fresh = self._compare(changes, archetype.columns, entity, row, now)
            if archetype.stacked and (row < 0 or any(getattr(c, "stack", None) for c in fresh)):
                changes.several[entity] = now
        for arrival in log.arrivals:
            ids = np.arange(arrival.first, arrival.stop)
            if log.deleted:
                gone = np.fromiter(log.deleted, np.int64) - arrival.first
                ids = np.delete(ids, gone[(gone >= 0) & (gone < len(ids))])
            if len(ids):
                if self.anchor not in arrival.stores:
                    self._refuse_without_anchor(int(ids[0]), next(c for c in arrival.stores if c.makes_body))
                changes.arrivals.append((arrival, ids))
        return changes

    def _compare(
        self, changes: Changes, columns: tuple[type[Component], ...], entity: int, row: int, now: Contained
    ) -> list[type[Component]]:
        """What a body that stays has lost, and what it has got: returns the types of the latter."""
        table = self.table
        for component in table.types_in(row):
            if component not in now:
                changes.missing.setdefault(component, []).append(row)
        fresh = [c for c in columns if now[c]._store is not table or now[c]._entity != entity]
        for component in fresh:
            changes.fresh.setdefault(component, []).append((entity, now[component]))
            changes.given.append((component, entity, now[component]))
        return fresh

    def _refuse_without_anchor(self, entity: int, component: type[Component]) -> None:
        raise MissingComponentError(
            f"entity {entity} has {component.__name__} but no {self.anchor.__name__}: "
            f"add {self.anchor.__name__}(...) or remove {component.__name__}"
        )

    # -- checks: every error is found before anything is written ----------------------------------

    def _check(self, changes: Changes) -> None:
        table, dimensions, fits, given = self.table, self.table.dimensions, -self.table.dimensions, changes.given
        table.check_component_types(changes.types())
        for archetype, entity in changes.archetypes:
            self._check_together.check_types(archetype.columns, entity)
        if len(given) > 1 and len({id(handle) for _, _, handle in given}) < len(given):
            self._refuse_second_use(given)
        for component, entity, handle in given:
            if type(handle) is not component:
                self._refuse_other_type(component, handle, entity)
            if handle._entity is not None:
                self._check_owner(component, handle, entity)
            if handle._version != fits:
                handle.check_dimensions(dimensions, entity)
            if component._layers:
                handle.take_bits(handle.bits_by_name(table.layer_names, entity))
        if changes.several:
            self._check_together(changes.several)
        for arrival, ids in changes.arrivals:
            self._check_together.batch(arrival.stores, ids, ids - arrival.first)

    def _refuse_second_use(self, given: list[tuple[type[Component], int, Any]]) -> None:
        seen: dict[int, int] = {}
        for component, entity, handle in given:
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

    def _apply(self, changes: Changes) -> None:
        table, log, fresh = self.table, self._log, changes.fresh
        lost, deleted, cleared = log.lost, log.deleted, log.cleared
        log.clear()
        for component in changes.types():
            self.know(component)
        for archetype, _ in changes.archetypes:
            archetype.known = True
        if lost or changes.detached:
            self._let_go([*changes.detached, *(handle for handle in lost if cleared or not self._has(handle))])
        for component, losing in changes.missing.items():
            self.on_losing(component, np.array(losing))
            self._empty(component, np.array(losing))
        if table.on_written is not None:
            staying = [table.find(entity) for own in fresh.values() for entity, _ in own]
            for row in {*staying, *(row for losing in changes.missing.values() for row in losing)}:
                table.on_written(row, "", None)
        carriers = fresh.get(table.kind_carrier)  # type: ignore[arg-type]
        if carriers is not None:
            rows = table.rows_of(np.array([entity for entity, _ in carriers]))
            table.set_kinds(rows, np.array([_kind_of(handle) for _, handle in carriers]))
        if changes.come or changes.left or changes.arrivals or deleted or cleared or table.kind_changed:
            self._move_rows(changes, deleted, cleared)
        for component, own in fresh.items():
            alone = self._archetype((component,))
            entities = [entity for entity, _ in own]
            contents = [{component: handle} for _, handle in own]
            self._adopt(alone, entities, list(map(table.find, entities)), contents, False)
        for arrival, ids in changes.arrivals:
            self._adopt_arrival(arrival, ids)
        if fresh or changes.missing:  # bodies that stay have other components
            table.members_version += 1
            table.static_version += 1

    def _has(self, handle: Any) -> bool:
        """Whether the entity that a handle is bound to has it (again)."""
        return self._contents.components_of(handle._entity).get(type(handle)) is handle

    def _empty(self, component: type[Component], rows: np.ndarray) -> None:
        """Rows that lose a component fall back to the defaults."""
        table = self.table
        for column in component.columns.values():
            if column.key in table.arrays:
                table.arrays[column.key][rows] = column.empty_value(table.dimensions)
        table.has_mask(component)[rows] = False
        if component is table.kind_carrier:
            table.set_kinds(rows, np.full(len(rows), STATIC))

    def _move_rows(self, changes: Changes, deleted: Ids, cleared: bool) -> None:
        """Rows leave and others come, and those that come one by one get their values."""
        table, come, carrier = self.table, changes.come, self.table.kind_carrier
        ids: list[int] = []
        kinds: Any = []
        for archetype, (entities, contents) in come.items():
            ids += entities
            moves = carrier in archetype.columns
            kinds += [_kind_of(now[carrier]) if moves else STATIC for now in contents]
        added: Any = ids
        removed = changes.left
        if cleared:
            removed = np.arange(table.count)
            table.generation += 1  # ids mean other entities now
        elif deleted:
            rows = table.rows_of(np.fromiter(deleted, np.int64, len(deleted)))
            removed = np.concatenate((np.array(removed, np.int64), rows[rows >= 0]))
        if changes.arrivals:
            of_arrivals = [self._kinds_of(*each) for each in changes.arrivals]
            kinds = np.concatenate((np.array(kinds, np.int64), *of_arrivals))
            added = np.concatenate((np.array(ids, np.int64), *(each for _, each in changes.arrivals)))
        moved, rows = table.rebuild(removed, added, kinds)
        if not come:
            return
        if len(moved) > len(ids):
            moved, rows = ids, table.rows_of(np.array(ids, np.int64))
        row_of = dict(zip(map(int, moved), rows.tolist(), strict=True))
        for archetype, (entities, contents) in come.items():
            self._adopt(archetype, entities, [row_of[entity] for entity in entities], contents, True)

    def _kinds_of(self, arrival: Arrival, ids: np.ndarray) -> np.ndarray:
        """(n,) kinds of the bodies of an arrival."""
        carrier = self.table.kind_carrier
        if carrier not in arrival.stores:
            return np.full(len(ids), STATIC, np.int64)
        return arrival.stores[carrier].values(carrier.columns["kind"].key, ids - arrival.first).astype(np.int64)

    def _let_go(self, handles: Iterable[Any]) -> None:
        """Handles that are bound to rows keep their last values, and belong to no entity."""
        table = self.table
        by_type: dict[type[Component], dict[int, Component]] = {}
        for handle in handles:
            if isinstance(handle, Component) and handle._store is table:
                by_type.setdefault(type(handle), {})[id(handle)] = handle
        for component, own in by_type.items():
            entities = np.array([handle._entity for handle in own.values()], np.int64)
            store = table.take_out(component, table.rows_of(entities))
            for index, handle in enumerate(own.values()):
                handle._bind(store, None, index, store.version)

    def _adopt(
        self, archetype: Archetype, entities: list[int], rows: list[int], contents: list[Contained], fresh: bool
    ) -> None:
        """Write the values of handles into rows and bind them; fresh: the rows hold the defaults."""
        table, version, columns = self.table, self.table.version, archetype.columns
        for component in columns:
            write_handles(table, component, contents, rows, fresh)
        at: Any = rows[0] if len(rows) == 1 else rows  # one is much faster by its number
        for mask in archetype.masks:
            table.arrays[mask][at] = True
        if archetype.anchored:
            restart(table, at)
        for entity, row, now in zip(entities, rows, contents, strict=True):
            for component in columns:
                handle = now[component]
                handle._store = table
                handle._entity = entity
                handle._row = row
                handle._version = version
                handle._values = handle._saved = None

    def _adopt_arrival(self, arrival: Arrival, ids: np.ndarray) -> None:
        """Write the values of an arrival into the table; handles are made when somebody asks for them."""
        table, inside = self.table, slice(None)
        rows = table.run_of(ids)
        if len(ids) < arrival.stop - arrival.first:
            inside = ids - arrival.first  # type: ignore[assignment]
        for component, store in arrival.stores.items():
            for column in component.columns.values():
                if column.key in store.arrays:
                    table.write(column.key, rows, store.arrays[column.key][inside])
                else:
                    table.write_one(column.key, rows, store.constants[column.key][1])
            table.has_mask(component)[rows] = True
        restart(table, rows)


def _kind_of(carrier: Component) -> int:
    """The kind as it is stored."""
    column, store = type(carrier).columns["kind"], carrier._store
    if store is None:
        return carrier._values.get("kind", column.stored_default)  # type: ignore[union-attr]
    return int(store.values(column.key, carrier._row))


def _second_use(component: type[Component], owners: str) -> str:
    return f"one {component.__name__} was given to {owners}: use copy() for the second"

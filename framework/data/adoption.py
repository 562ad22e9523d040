"""Bringing the table up to date with what has come, gone or changed since the last time.

Changes are logged as they happen (see entities), so the work here is in proportion to what has changed: it is looked
at, everything is checked, and only then written. Between two looks the table is the truth about all that is not in the
log.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import compress
from typing import Any

import numpy as np

from ..errors import MissingComponentError
from .change_log import Arrival
from .component import Component
from .esper_bridge import Contents
from .handles import bind_handles, write_handles
from .table import FEW, HAS_OBJECTS, STATIC, Table

Ids = set[int]
ByType = Mapping[type[Any], tuple[list[int], list[Any]]]  # entities that have one of the type, and these
OTHER, OURS, PARTNER = range(3)  # component types: not carom's; with columns; such that make a body with the anchor


@dataclass
class Fresh:
    """Handles of one type to adopt: their entities, and these one's rows (-1: it is no body yet)."""

    entities: list[int] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)
    handles: list[Any] = field(default_factory=list)


@dataclass
class Changes:
    """What has to be done so that the table knows what esper has.

    come, left
        ids that become bodies, ascending; rows of those that cease to be
    fresh, missing
        handles to adopt, and rows that stay and lose the component, by type
    detached
        handles of entities that cease to be bodies and keep them
    arrivals
        with the ids of those of them that are to become bodies
    """

    come: list[int] = field(default_factory=list)
    left: list[int] = field(default_factory=list)
    fresh: dict[type[Component], Fresh] = field(default_factory=dict)
    missing: dict[type[Component], list[int]] = field(default_factory=dict)
    detached: list[Component] = field(default_factory=list)
    arrivals: list[tuple[Arrival, np.ndarray]] = field(default_factory=list)


class Adoption:
    """Adopts the components of entities that form a body: those with ``anchor`` and any that ``makes_body``.

    check_together
        may refuse, with a ValueError, what does not go together on one entity, see
        :class:`~carom.systems.shapes.geometry_levels.LevelCheck`
    """

    def __init__(self, table: Table, anchor: type[Component], contents: Contents, check_together: Any) -> None:
        self.table, self.anchor = table, anchor
        self._contents, self._log, self._entities = contents, contents.log, contents.entities
        self._check_together = check_together
        self._roles: dict[Any, int] = {}  # by component type
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
        changes = self._find_changes()
        self._check(changes)
        self._apply(changes)
        return True

    def register(self, components: Iterable[type[Component]]) -> None:
        """Columns of these types exist from now on, whether a body has them or not; ValueError for taken names."""
        for component in components:
            self.table.check_component_type(component)
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
            role = self._role(component)
            if role == OURS and not bodies.issuperset(entities):
                are = list(map(bodies.__contains__, entities))
                entities, handles = list(compress(entities, are)), list(compress(handles, are))
            if role != OTHER:
                bind_handles(self.table, entities, handles)

    def _bodies_of(self, by_type: ByType) -> Ids:
        return set().union(*(entities for c, (entities, _) in by_type.items() if self._role(c) == PARTNER))

    # -- what has changed -------------------------------------------------------------------------

    def _role(self, component: Any) -> int:
        role = self._roles.get(component)
        if role is None:
            ours = isinstance(component, type) and issubclass(component, Component)
            role = self._roles[component] = OTHER if not ours else PARTNER if component.makes_body else OURS
        return role

    def _find_changes(self) -> Changes:
        changes, log, table, entities, roles = Changes(), self._log, self.table, self._entities, self._roles
        touched = sorted(log.touched)
        rows = [-1] * len(touched)
        if touched and table.count and not log.cleared:  # else the ids mean other entities now
            few = len(touched) <= FEW
            rows = [table.row_of(e) for e in touched] if few else table.rows_of(np.array(touched, np.int64)).tolist()
        for entity, row in zip(touched, rows, strict=True):
            now: Any = dict.get(entities, entity, ())
            partner = None
            for component in now:
                role = roles.get(component)
                if role == PARTNER or (role is None and self._role(component) == PARTNER):
                    partner = component
            if partner is None:
                if row >= 0:
                    changes.left.append(row)
                    changes.detached += now and now.values()
                continue
            if self.anchor not in now:
                self._refuse_without_anchor(entity, partner)
            if row < 0:
                changes.come.append(entity)
            else:
                for component in table.types_in(row):
                    if component not in now:
                        changes.missing.setdefault(component, []).append(row)
            for component, handle in now.items():
                if roles[component] != OTHER and (row < 0 or handle._store is not table or handle._entity != entity):
                    fresh = changes.fresh.get(component)
                    if fresh is None:
                        fresh = changes.fresh[component] = Fresh()
                    fresh.entities.append(entity)
                    fresh.rows.append(row)
                    fresh.handles.append(handle)
        for arrival in log.arrivals:
            ids = np.arange(arrival.first, arrival.stop)
            if log.deleted:
                ids = np.setdiff1d(ids, np.fromiter(log.deleted, np.int64), assume_unique=True)
            if len(ids):
                if self.anchor not in arrival.stores:
                    self._refuse_without_anchor(int(ids[0]), next(c for c in arrival.stores if c.makes_body))
                changes.arrivals.append((arrival, ids))
        return changes

    def _refuse_without_anchor(self, entity: int, component: type[Component]) -> None:
        raise MissingComponentError(
            f"entity {entity} has {component.__name__} but no {self.anchor.__name__}: "
            f"add {self.anchor.__name__}(...) or remove {component.__name__}"
        )

    # -- checks: every error is found before anything is written ----------------------------------

    def _check(self, changes: Changes) -> None:
        table, dimensions, fits = self.table, self.table.dimensions, -self.table.dimensions
        for component, fresh in changes.fresh.items():
            table.check_component_type(component)
            handles = fresh.handles
            if len(handles) > 1 and len(set(map(id, handles))) < len(handles):
                self._refuse_second_use(component, fresh)
            for entity, handle in zip(fresh.entities, handles, strict=True):
                if type(handle) is not component:
                    self._refuse_other_type(component, handle, entity)
                if handle._entity is not None:
                    self._check_owner(component, handle, entity)
                if handle._version != fits:
                    handle.check_dimensions(dimensions, entity)
        if changes.fresh:
            self._check_together(changes.fresh, self._contents.components_of)
        for arrival, ids in changes.arrivals:
            for component in arrival.stores:
                table.check_component_type(component)
            self._check_together.batch(arrival.stores, ids, ids - arrival.first)

    def _refuse_second_use(self, component: type[Component], fresh: Fresh) -> None:
        seen: dict[int, int] = {}
        for entity, handle in zip(fresh.entities, fresh.handles, strict=True):
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
        for component in (*fresh, *(component for arrival, _ in changes.arrivals for component in arrival.stores)):
            self.know(component)
        if lost or changes.detached:
            self._let_go([*changes.detached, *(handle for handle in lost if cleared or not self._has(handle))])
        for component, rows in changes.missing.items():
            self._empty(component, np.array(rows))
        if table.on_written is not None:
            for row in {
                row for rows in (*changes.missing.values(), *(own.rows for own in fresh.values())) for row in rows
            }:
                if row >= 0:
                    table.on_written("", row)
        carriers = fresh.get(table.kind_carrier)
        if carriers is not None and max(carriers.rows) >= 0:
            self._other_kinds(carriers)
        stays = bool(changes.missing)  # some body that stays has other components
        places: dict[int, int] = {}
        if changes.come or changes.left or changes.arrivals or deleted or cleared or table.kind_changed:
            places = self._move_rows(changes, carriers, deleted, cleared)
        for component, own in fresh.items():
            stay = max(own.rows) >= 0
            own.rows = [places[e] if e in places else table.find(e) for e in own.entities]
            self._adopt(component, own, not stay)
            stays = stays or stay
        made = table.arrays[HAS_OBJECTS]
        for row in places.values():
            made[row] = True
        for arrival, ids in changes.arrivals:
            self._adopt_arrival(arrival, ids)
        if stays:
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

    def _other_kinds(self, carriers: Fresh) -> None:
        """Write the kinds of bodies that stay and get another carrier of it."""
        staying = [(row, _kind_of(h)) for row, h in zip(carriers.rows, carriers.handles, strict=True) if row >= 0]
        self.table.set_kinds(*map(np.array, zip(*staying, strict=True)))

    def _move_rows(self, changes: Changes, carriers: Fresh | None, deleted: Ids, cleared: bool) -> dict[int, int]:
        """Rows leave and others come; returns the rows of bodies that come one by one, by id."""
        table, come = self.table, changes.come
        kind_of = {} if carriers is None else dict(zip(carriers.entities, map(_kind_of, carriers.handles), strict=True))
        added, kinds = np.array(come, np.int64), np.array([kind_of.get(e, STATIC) for e in come], np.int64)
        removed = np.array(changes.left, np.int64)
        if cleared:
            removed = np.arange(table.count)
            table.generation += 1  # ids mean other entities now
        elif deleted:
            rows = table.rows_of(np.fromiter(deleted, np.int64, len(deleted)))
            removed = np.concatenate((removed, rows[rows >= 0]))
        if changes.arrivals:
            added = np.concatenate((added, *(ids for _, ids in changes.arrivals)))
            kinds = np.concatenate((kinds, *(self._kinds_of(*each) for each in changes.arrivals)))
        added, rows = table.rebuild(removed, added, kinds)
        if not come:
            return {}
        if len(added) > len(come):
            added, rows = np.array(come), table.rows_of(np.array(come))
        return dict(zip(added.tolist(), rows.tolist(), strict=True))

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

    def _adopt(self, component: type[Component], own: Fresh, fresh: bool) -> None:
        """Write the handles' values into their rows and bind the handles; fresh: the rows hold the defaults."""
        table, version, handles, rows = self.table, self.table.version, own.handles, own.rows
        write_handles(table, component, handles, rows, fresh)
        at: Any = rows[0] if len(rows) == 1 else rows  # one is much faster by its number
        if component is self.anchor and "previous_position" in table.arrays:
            table.arrays["previous_position"][at] = table.arrays["position"][at]
        table.has_mask(component)[at] = True
        for handle, entity, row in zip(handles, own.entities, rows, strict=True):
            handle._store = table
            handle._entity = entity
            handle._row = row
            handle._version = version
            handle._values = None

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
        if "previous_position" in table.arrays:
            table.arrays["previous_position"][rows] = table.arrays["position"][rows]


def _kind_of(carrier: Component) -> int:
    """The kind as it is stored."""
    column, store = type(carrier).columns["kind"], carrier._store
    if store is None:
        return carrier._values.get("kind", column.stored_default)  # type: ignore[union-attr]
    return int(store.values(column.key, carrier._row))


def _second_use(component: type[Component], owners: str) -> str:
    return f"one {component.__name__} was given to {owners}: use copy() for the second"

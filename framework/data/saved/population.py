"""Which entities a world has and which components each has, as snapshots hold it, and going back to that.

Snapshots of a world in which nothing has come or gone share one population. It holds esper's own dicts of components,
which are copied before one of them changes; so it costs little to take, however many entities there are.
"""

from __future__ import annotations

import itertools
import operator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..adoption import Adoption
from ..arrays.column import hold_arrays
from ..arrays.pool import Held
from ..batches import Batch
from ..component import Component, RowStore
from ..esper_bridge import Contents
from ..watched import Entities
from .table import numbers_of, with_arrays, with_numbers

Components = dict[type[Any], Any]


@dataclass
class SavedBatch:
    """A batch as it was.

    stores
        the values of entities that are no bodies; None if the table has them
    """

    first: int
    count: int
    types: tuple[type[Component], ...]
    inside: np.ndarray
    stores: dict[type[Component], RowStore] | None

    @classmethod
    def of(cls, batch: Batch) -> SavedBatch:
        stores = None if batch.make_handle is not None else dict(batch.stores)
        return cls(batch.first, batch.count, batch.types, batch.inside.copy(), stores)

    def has(self, entity: int) -> bool:
        place = entity - self.first
        return 0 <= place < self.count and bool(self.inside[place])


@dataclass
class Population:
    """Entities with their components; those in batches, by batch.

    entities
        the components of each. A handle of one of carom's components may be None: then it is the one that the entity
        has, or a new one
    loose
        components of carom that belong to no body: their values are not in the table
    types, others
        carom's components that any of the entities has; the other types
    unmade
        entities some of whose handles are None
    """

    entities: dict[int, Components]
    batches: list[SavedBatch]
    loose: list[tuple[int, type[Component]]]
    types: list[type[Component]]
    others: list[type[Any]]
    unmade: set[int] = field(default_factory=set)

    @classmethod
    def of(cls, entities: Entities, adoption: Adoption) -> Population:
        """Of a world whose table is up to date; the same object as before if nothing has come or gone since."""
        if entities.saved is None:
            loose = [
                (entity, component)
                for component, members in entities.members.items()
                if is_ours(component)
                for entity in sorted(adoption.loose(component, members.listed))
            ]
            batches = [SavedBatch.of(batch) for batch in entities.batches.all if batch.left]
            present = [component for component, members in entities.members.items() if members]
            types = [component for component in present if is_ours(component)]
            others = [component for component in present if not is_ours(component)]
            # dict.copy() would call entities.keys(), which has those in batches too
            entities.share(cls(dict(dict.items(entities)), batches, loose, types, others))
        saved: Population = entities.saved  # type: ignore[assignment]
        return saved

    def without_handles(self) -> Population:
        """The same for another world or process."""
        entities = {
            entity: {c: None if is_ours(c) else value for c, value in components.items()}
            for entity, components in self.entities.items()
        }
        batches = [SavedBatch(b.first, b.count, b.types, b.inside, b.stores and {}) for b in self.batches]
        return Population(entities, batches, list(self.loose), self.types, self.others, set(entities))


def is_ours(component: Any) -> bool:
    """Whether it is a type of components whose values snapshots copy."""
    return isinstance(component, type) and issubclass(component, Component)


@dataclass
class LooseValues:
    """The values that no table has: of the loose handles by field, of batches by type and key.

    held
        keeps the arrays that columns have numbers of
    """

    handles: list[dict[str, Any]]
    batches: list[dict[type[Component], dict[str, np.ndarray]]]
    held: list[Held]

    @classmethod
    def of(cls, population: Population, entities: Entities) -> LooseValues:
        handles = [_values_of(entities[entity][component]) for entity, component in population.loose]
        batches = [_columns_of(batch.stores or {}) for batch in population.batches]
        held = [numbers_of(arrays, [component]) for each in batches for component, arrays in each.items()]
        return cls(handles, batches, held)

    def put_into_handles(self, population: Population, entities: Entities) -> None:
        """Write them into the handles of that population, which the world has."""
        for (entity, component), values in zip(population.loose, self.handles, strict=True):
            handle = entities[entity][component]
            handle._hold(values)

    def put_into_batches(self, population: Population, dimensions: int) -> None:
        """Write them into the batches of that population, whether the world has them or not."""
        for batch, columns in zip(population.batches, self.batches, strict=True):
            for component, arrays in columns.items():
                store = batch.stores.setdefault(component, RowStore({}, dimensions, {}, batch.count))  # type: ignore[union-attr]
                hold_arrays(store, component._pooled)
                for key, array in arrays.items():
                    if key in store.arrays or key in store.constants:
                        store.make(key)[...] = array
                    else:
                        store.arrays[key] = array.copy()

    def __getstate__(self) -> dict[str, Any]:
        batches = [{c: with_arrays(arrays, [c]) for c, arrays in each.items()} for each in self.batches]
        return {"handles": self.handles, "batches": batches}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.handles, self.batches, self.held = state["handles"], [], []
        for each in state["batches"]:
            self.batches.append({})
            for component, portable in each.items():
                self.batches[-1][component], held = with_numbers(portable, [component])
                self.held += held


def _values_of(handle: Component) -> dict[str, Any]:
    values = {name: column.value_of(handle) for name, column in handle.columns.items()}
    return {name: value.copy() if isinstance(value, np.ndarray) else value for name, value in values.items()}


def _columns_of(stores: dict[type[Component], RowStore]) -> dict[type[Component], dict[str, np.ndarray]]:
    return {
        component: {c.key: np.array(store.values(c.key, slice(None))) for c in component.columns.values()}
        for component, store in stores.items()
    }


class PopulationRestore:
    """Takes one world back to a population. Between :meth:`release` and :meth:`apply` the table gets its rows.

    wanted
        by entity that has come, gone or changed since, the components it is to have
    gone
        those that are to have none of their own: they are no entities, or in a batch
    out
        those of ``wanted`` that were in a batch at the snapshot; their components have become objects since
    """

    def __init__(self, population: Population, contents: Contents, adoption: Adoption) -> None:
        self._population, self._adoption = population, adoption
        self._entities, self._log = contents.entities, contents.log
        self._wanted: dict[int, Components] = {}
        self._gone: set[int] = set()
        self._out: dict[int, Components] = {}
        self._by_type: dict[type[Any], tuple[list[int], list[Any]]] = {}  # of ``wanted``: entities, their handles
        self._needed = self._entities.saved is not population
        if self._needed:
            self._find_wanted()

    def _find_wanted(self) -> None:
        entities, population = self._entities, self._population
        own, unmade = population.entities, population.unmade
        found = entities.changed_since(population)
        if found is None:
            other = map(operator.is_not, map(own.get, dict.keys(entities)), dict.values(entities))
            found = set(itertools.compress(dict.keys(entities), other))
            found |= set(own).difference(dict.keys(entities))
        found |= self._adoption.pending(self._log)
        back = set(filter(own.__contains__, found))
        self._gone = found - back
        self._wanted = wanted = dict(zip(back, map(own.__getitem__, back), strict=True))
        for entity in unmade & back:
            components = wanted[entity]
            components.update({c: self._handle(c, entity) for c, handle in components.items() if handle is None})
        unmade -= back
        if population.batches:
            for entity in [entity for entity in self._gone if dict.__contains__(entities, entity)]:
                batch = next((batch for batch in population.batches if batch.has(entity)), None)
                if batch is not None:  # the objects may be in use
                    self._out[entity] = {component: self._handle(component, entity) for component in batch.types}
            self._gone -= self._out.keys()
            wanted.update(self._out)
        for component in (*population.types, *population.others):
            entities_having, handles = _having(component, wanted)
            if handles:
                self._by_type[component] = entities_having, handles

    def _handle(self, component: type[Component], entity: int) -> Component:
        """The one that the entity has, else a new one."""
        now = dict.get(self._entities, entity, {}).get(component)
        if type(now) is component:
            return now
        handle = component.__new__(component)
        handle._bind(None, None)
        return handle

    def release(self) -> None:
        """Handles that are not wanted keep the values that they have now."""
        self._adoption.keep_only(self._by_type, self._wanted, self._gone)

    def apply(self) -> None:
        """Give esper the entities, and bind the handles; called in the world's context."""
        entities, members = self._entities, self._entities.members
        if not self._needed:
            return
        for entity in self._gone:
            dict.pop(entities, entity, None)
        dict.update(entities, self._wanted)
        entities.batches.put([self._batch(saved) for saved in self._population.batches])
        for component in (*self._by_type, *(c for batch in self._population.batches for c in batch.types)):
            if component not in members:
                members[component] = ()  # type: ignore[assignment]
        for component, own in list(members.items()):
            own.listed.difference_update(self._gone)
            having = self._by_type.get(component, ((), ()))[0]
            if len(having) < len(self._wanted):
                own.listed.difference_update(self._wanted)
            own.listed.update(having)
            if not own:
                del members[component]
        self._adoption.adopt_again(self._by_type)
        self._adoption.forget_pending(self._log)
        entities.share(self._population, self._gone | self._wanted.keys(), self._out)

    def _batch(self, saved: SavedBatch) -> Batch:
        """As it was, but for what has become objects."""
        batch = Batch(saved.first, saved.count, dict.fromkeys(saved.types))  # type: ignore[arg-type]
        batch.inside = saved.inside.copy()
        for entity, components in self._out.items():
            if saved.has(entity):
                batch.inside[entity - saved.first] = False
                for component in saved.types if saved.stores else ():
                    components[component]._bind(saved.stores[component], None, entity - saved.first, RowStore.version)  # type: ignore[index]
        batch.left = int(np.count_nonzero(batch.inside))
        if saved.stores is None:
            batch.adopted(self._adoption.make_handle)
        else:
            batch.stores = saved.stores
        return batch


def _having(component: type[Any], wanted: dict[int, Components]) -> tuple[list[int], list[Any]]:
    """The entities that have one of that type, and what each has."""
    try:
        return list(wanted), list(map(operator.itemgetter(component), wanted.values()))
    except KeyError:  # not all of them
        entities = [entity for entity, components in wanted.items() if component in components]
        return entities, [wanted[entity][component] for entity in entities]

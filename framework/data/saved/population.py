"""Which entities a world has and which components each has, as snapshots hold it, and going back to that.

Snapshots of a world in which nothing has come or gone share one population. It holds esper's own dicts of components,
which are copied before one of them changes; so it costs little to take, however many entities there are.
"""

from __future__ import annotations

import itertools
import operator
from dataclasses import dataclass, field
from typing import Any

from ..adoption import Adoption
from ..component import Component
from ..contents.entities import Entities, among
from ..esper_bridge import Contents
from ..table import HAS_OBJECTS
from .table import SavedTable

Components = dict[type[Any], Any]


@dataclass
class Population:
    """Entities with their components; the table's masks have those that have no objects.

    entities
        the components of each that has objects. A handle of one of carom's components may be None: then it is the one
        that the entity has, or a new one
    loose
        components of carom that belong to no body: their values are not in the table
    types, others
        carom's components that any of the entities has; the other types
    unmade
        entities some of whose handles are None
    """

    entities: dict[int, Components]
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
            present = [component for component, members in entities.members.items() if members]
            types = [component for component in present if is_ours(component)]
            others = [component for component in present if not is_ours(component)]
            # dict.copy() would call entities.keys(), which has those without objects too
            entities.share(cls(dict(dict.items(entities)), loose, types, others))
        saved: Population = entities.saved  # type: ignore[assignment]
        return saved

    def without_handles(self) -> Population:
        """The same for another world or process."""
        entities = {
            entity: {c: None if is_ours(c) else value for c, value in components.items()}
            for entity, components in self.entities.items()
        }
        return Population(entities, list(self.loose), self.types, self.others, set(entities))


def is_ours(component: Any) -> bool:
    """Whether it is a type of components whose values snapshots copy."""
    return isinstance(component, type) and issubclass(component, Component)


@dataclass
class LooseValues:
    """The values that no table has, of the loose handles by field; snapshots share those that were not set between."""

    handles: list[dict[str, Any]]

    @classmethod
    def of(cls, population: Population, entities: Entities) -> LooseValues:
        handles = (entities[entity][component] for entity, component in population.loose)
        return cls([handle._as_saved() or handle._to_save() for handle in handles])

    def put_into_handles(self, population: Population, entities: Entities) -> None:
        """Write them into the handles of that population, which the world has."""
        for (entity, component), values in zip(population.loose, self.handles, strict=True):
            handle = entities[entity][component]
            if handle._as_saved() is not values:  # something was set since
                handle._go_back(values)


class PopulationRestore:
    """Takes one world back to a population. Between :meth:`release` and :meth:`apply` the table gets its rows.

    wanted
        by entity that has come, gone or changed since, the components it is to have
    gone
        those that are to have no objects
    out
        those of ``wanted`` that had no objects at the snapshot and have some now
    """

    def __init__(self, population: Population, table: SavedTable, contents: Contents, adoption: Adoption) -> None:
        self._population, self._table, self._adoption = population, table, adoption
        self._entities = contents.entities
        self._wanted: dict[int, Components] = {}
        self._gone: set[int] = set()
        self._out: dict[int, Components] = {}
        self._by_type: dict[type[Any], tuple[list[int], list[Any]]] = {}  # of ``wanted``: entities, their handles
        self._changed = self._entities.unshared  # since then; None: any of them
        self._needed = self._entities.saved is not population
        if self._needed:
            self._find_wanted()

    def _find_wanted(self) -> None:
        entities, population = self._entities, self._population
        own, unmade = population.entities, population.unmade
        found = entities.changed_since(population)
        if found is None:
            self._changed = None
            other = map(operator.is_not, map(own.get, dict.keys(entities)), dict.values(entities))
            found = set(itertools.compress(dict.keys(entities), other))
            found |= set(own).difference(dict.keys(entities))
        else:
            self._changed = found
        found |= self._adoption.pending()
        back = set(filter(own.__contains__, found))
        self._gone = found - back
        self._wanted = wanted = dict(zip(back, map(own.__getitem__, back), strict=True))
        for entity in unmade & back:
            components = wanted[entity]
            components.update({c: self._handle(c, entity) for c, handle in components.items() if handle is None})
        unmade -= back
        for entity in [entity for entity in self._gone if dict.__contains__(entities, entity)]:
            types = self._table.types_of(entity)
            if types:  # the objects may be in use
                self._out[entity] = {component: self._handle(component, entity) for component in types}
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
        """Give esper the entities, and bind the handles."""
        entities, members = self._entities, self._entities.members
        entities.version += 1
        self._adoption.forget_pending()
        for entity in self._gone:
            dict.pop(entities, entity, None)
        dict.update(entities, self._wanted)
        table = self._adoption.table
        made = table.column(HAS_OBJECTS)
        if self._changed is None:
            made[:] = among(table.column("entity"), dict.keys(entities))
        else:
            for entity in self._changed:
                row = table.row_of(entity)
                if row >= 0:
                    made[row] = dict.__contains__(entities, entity)
        if not self._needed:
            return
        for component in (*self._by_type, *(c for c in self._population.types)):
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
        entities.share(self._population, self._gone | self._wanted.keys(), self._out)


def _having(component: type[Any], wanted: dict[int, Components]) -> tuple[list[int], list[Any]]:
    """The entities that have one of that type, and what each has."""
    try:
        return list(wanted), list(map(operator.itemgetter(component), wanted.values()))
    except KeyError:  # not all of them
        entities = [entity for entity, components in wanted.items() if component in components]
        return entities, [wanted[entity][component] for entity in entities]

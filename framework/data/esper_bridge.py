"""All use of esper's private names, in one place; esper keeps one context per world in module globals."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from typing import Any

import esper
import numpy as np

_NAMES = (
    "_components", "_context_map", "_dead_entities", "_entities", "_entity_count", "_processors", "_processors_dict",
)  # fmt: skip
for _name in _NAMES:
    if not hasattr(esper, _name):
        raise ImportError(f"carom cannot work with esper {esper.version}: it has no {_name}")


# -- contexts ------------------------------------------------------------------------------------


def context_exists(name: str) -> bool:
    return name in esper._context_map


class context:  # noqa: N801
    """Make that esper world the current one for a while."""

    __slots__ = ("_before", "_name")

    def __init__(self, name: str) -> None:
        self._name = name

    def __enter__(self) -> None:
        self._before = esper.current_world
        if self._before != self._name:
            esper.switch_world(self._name)

    def __exit__(self, *_: object) -> None:
        if self._before != self._name:
            leave(self._before)


def leave(before: str) -> None:
    """Back to the context that was current before, or to the default one if it has been deleted meanwhile."""
    esper.switch_world(before if context_exists(before) else "default")


# -- what has changed ----------------------------------------------------------------------------


class ChangeLog:
    """The entities that gained, lost or replaced a component, by component type; carom's own types only.

    esper notes every such change in one place, the set of entities it keeps per component type. Those sets are watched,
    so finding what has changed costs as much as there is of it, however many entities there are.
    """

    def __init__(self, base: type[Any]) -> None:
        self.base = base  # only types derived from it are watched
        self.cleared = False  # by esper.clear_database(): everything before it has gone
        self.dirty = False  # something has been logged since the last time
        self._touched: dict[type[Any], _Touched] = {}

    def of(self, component: type[Any]) -> _Touched:
        return self._touched.setdefault(component, _Touched(self))

    def take(self) -> tuple[dict[type[Any], set[int]], bool]:
        """What has been logged since the last time."""
        touched = {component: entry.entities for component, entry in self._touched.items() if entry.entities}
        for component in touched:
            self._touched[component].entities = set()
        cleared, self.cleared = self.cleared, False
        self.dirty = False
        return touched, cleared


class _Touched:
    """Where the sets of one component type log into; the set inside is exchanged when the log is read."""

    __slots__ = ("entities", "log")

    def __init__(self, log: ChangeLog) -> None:
        self.entities: set[int] = set()
        self.log = log


class _Members(set[int]):
    """esper's set of the entities with one component; logs who enters and leaves, and who enters again (replaced)."""

    __slots__ = ("_touched",)

    def __init__(self, entities: Iterable[int], touched: _Touched) -> None:
        super().__init__(entities)
        self._touched = touched
        touched.log.dirty = True
        touched.entities.update(self)

    def add(self, entity: int) -> None:
        self._touched.log.dirty = True
        self._touched.entities.add(entity)
        super().add(entity)

    def discard(self, entity: int) -> None:
        self._touched.log.dirty = True
        self._touched.entities.add(entity)
        super().discard(entity)

    def update(self, *entities: Iterable[int]) -> None:
        self._touched.log.dirty = True
        self._touched.entities.update(*entities)
        super().update(*entities)


class _WatchedComponents(dict[type[Any], set[int]]):
    """esper's dict of those sets."""

    def __init__(self, content: dict[type[Any], set[int]], log: ChangeLog) -> None:
        super().__init__()
        self.log = log
        for component, entities in content.items():
            self[component] = entities

    def __setitem__(self, component: type[Any], entities: set[int]) -> None:
        if isinstance(component, type) and issubclass(component, self.log.base):
            entities = _Members(entities, self.log.of(component))
        super().__setitem__(component, entities)

    def clear(self) -> None:
        self.log.cleared = self.log.dirty = True
        super().clear()


def watch(base: type[Any]) -> None:
    """Log changes of components derived from ``base`` in the current context; what is there already counts as new."""
    esper._components = _WatchedComponents(esper._components, ChangeLog(base))


def watched() -> bool:
    """Whether the current context is."""
    return isinstance(esper._components, _WatchedComponents)


def unwatch() -> None:
    """Give esper plain containers back."""
    esper._components = {
        component: set(entities) if isinstance(entities, _Members) else entities
        for component, entities in esper._components.items()
    }


def changes() -> ChangeLog:
    """The log of the current context."""
    return esper._components.log  # type: ignore[attr-defined]


def _check_that_nothing_escapes() -> None:
    """ImportError if this esper changes components in a way that the log does not see."""

    class Probe:
        pass

    def expect(action: Any, *entities: int) -> None:
        action()
        touched, cleared = log.take()
        if touched.get(Probe, set()) != set(entities) or cleared != (not entities):
            raise ImportError(f"carom cannot work with esper {esper.version}: it hides changes of components")

    with context("carom is looking at esper"):
        watch(Probe)
        log = changes()
        expect(lambda: esper.create_entity(Probe()), 1)
        expect(lambda: esper.create_entity(Probe()), 2)
        expect(lambda: esper.add_component(1, Probe()), 1)
        expect(lambda: esper.remove_component(1, Probe), 1)
        expect(lambda: esper.add_component(1, Probe()), 1)
        expect(lambda: esper.delete_entity(1, immediate=True), 1)
        esper.delete_entity(2)
        expect(esper.process, 2)
        expect(lambda: esper.create_entity(Probe()), 3)
        expect(esper.clear_database)
    esper.delete_world("carom is looking at esper")


_check_that_nothing_escapes()


# -- entities ------------------------------------------------------------------------------------


def create_many(types: list[type[Any]], columns: list[list[Any]], count: int) -> range:
    """``count`` entities with one component of each type, as ``esper.create_entity`` makes them one by one."""
    ids = list(itertools.islice(esper._entity_count, count))
    rows: list[dict[type[Any], Any]] = [{} for _ in ids]
    for component, handles in zip(types, columns, strict=True):
        for row, handle in zip(rows, handles, strict=True):
            row[component] = handle
    esper._entities.update(zip(ids, rows, strict=True))
    for component in types if ids else ():
        if component not in esper._components:
            esper._components[component] = set()
        esper._components[component].update(ids)
    esper.clear_cache()
    return range(ids[0], ids[-1] + 1) if ids else range(0)


def component_types() -> list[type[Any]]:
    return list(esper._components)


def entities_with(component: type[Any]) -> set[int]:
    """esper's own set of the entities that have the component: do not change it."""
    return esper._components.get(component, set())


def all_components() -> dict[int, dict[type[Any], Any]]:
    """esper's own dict of all entities' components: do not change it."""
    return esper._entities


def known_entity(entity: int) -> bool:
    """Whether the entity is in the database, dead or not."""
    return entity in esper._entities


class Membership:
    """Which entities of the current context have which components; later too, without switching to that context.

    components
        esper's own dict of all entities' components: do not change it
    dead
        esper's own set of the entities whose deletion is pending: do not change it
    """

    __slots__ = ("_members", "components", "dead")

    def __init__(self) -> None:
        self._members: dict[type[Any], set[int]] = esper._components
        self.components: dict[int, dict[type[Any], Any]] = esper._entities
        self.dead: set[int] = esper._dead_entities

    def mask(self, entities: np.ndarray, component: type[Any]) -> np.ndarray:
        """(n,) which of these ids (n,) are living entities that have the component."""
        mask = _among(entities, self._members.get(component, set()))
        if self.dead:
            mask &= ~_among(entities, self.dead)
        return mask


def _among(entities: np.ndarray, members: set[int]) -> np.ndarray:
    """(n,) mask of the ids that are members; takes as long as the fewer of the two."""
    if len(members) + _SORTING < len(entities):
        return np.isin(entities, np.fromiter(members, np.int64, len(members)))
    return np.fromiter(map(members.__contains__, entities.tolist()), bool, len(entities))


_SORTING = 500  # look-ups in a set take as long as one call of np.isin


def forget_death(entity: int) -> None:
    """Take back a deferred deletion: after an immediate one esper would fail on it in every later process."""
    esper._dead_entities.discard(entity)


def forget_unknown_dead() -> None:
    """The same for deletions that plain esper calls have left behind: of entities that do not exist (any more)."""
    unknown = [entity for entity in esper._dead_entities if entity not in esper._entities]
    esper._dead_entities.difference_update(unknown)


# -- processors and events -----------------------------------------------------------------------


class Processors(list[esper.Processor]):
    """esper's list of the processors of one world, which the first of them runs by itself.

    esper's ``process()`` walks through the list; once the first processor has run the whole step (``step_done``), the
    walk ends. So the world decides how each is called, and no processor has to be changed for it.
    """

    def __init__(self, content: Iterable[esper.Processor]) -> None:
        super().__init__(content)
        self.changed = True  # since the world has looked last
        self.step_done = False

    def __iter__(self) -> Iterator[esper.Processor]:
        for processor in super().__iter__():
            yield processor
            if self.step_done:
                self.step_done = False
                return

    def append(self, processor: esper.Processor) -> None:
        self.changed = True
        super().append(processor)

    def remove(self, processor: esper.Processor) -> None:
        self.changed = True
        super().remove(processor)

    def clear(self) -> None:
        self.changed = True
        super().clear()


def take_over_processors() -> Processors:
    """Put our list in place of esper's in the current context."""
    esper._processors = Processors(esper._processors)
    return esper._processors  # type: ignore[return-value]


def give_back_processors() -> None:
    """Put a plain list back."""
    esper._processors = [*esper._processors]


def dead_entities() -> set[int]:
    """esper's own set of the entities of the current context whose deletion is pending."""
    return esper._dead_entities


def remove_processor_instance(processor: esper.Processor) -> None:
    """Remove that very processor; esper's own removal is by type and loses sight of a second instance."""
    esper._processors[:] = [p for p in esper._processors if p is not processor]
    if isinstance(esper._processors, Processors):
        esper._processors.changed = True
    kind = type(processor)
    rest = [p for p in esper._processors if type(p) is kind]
    if rest:
        esper._processors_dict[kind] = rest[-1]
    else:
        esper._processors_dict.pop(kind, None)


def event_handlers(name: str) -> Iterator[Any]:
    """The live handlers set with esper.set_handler; safe against handlers that remove themselves or others."""
    for reference in tuple(esper.event_registry.get(name, ())):
        handler = reference()
        if handler is not None and reference in esper.event_registry.get(name, ()):
            yield handler


def event_registry() -> dict[str, Any]:
    """esper's own dict of the handlers of the current context: do not change it."""
    return esper.event_registry


# -- steps ---------------------------------------------------------------------------------------

running: set[str] = set()  # the contexts that are inside a step


def step_is_running() -> bool:
    """Whether the current context is inside a step; for components that no world has adopted yet."""
    return esper.current_world in running

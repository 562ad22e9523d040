"""All use of esper's private names, in one place; esper keeps one context per world in module globals."""

from __future__ import annotations

import itertools
import threading
import weakref
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Any

import esper
import numpy as np

from .contents.change_log import ChangeLog, Stores
from .contents.entities import Entities, among
from .contents.members import Counter, WatchedComponents

_NONE: dict[type[Any], Any] = {}
_NAMES = (
    "_components", "_context_map", "_dead_entities", "_entities", "_entity_count", "_get_component_cache",
    "_get_components_cache", "_processors", "_processors_dict",
)  # fmt: skip
for _name in _NAMES:
    if not hasattr(esper, _name):
        raise ImportError(f"carom cannot work with esper {esper.version}: it has no {_name}")


# -- contexts ------------------------------------------------------------------------------------


class OwnContext:
    """A world's esper context while it is not the current one; the world owns it, esper's registry does not.

    parts
        the containers, as esper's registry would hold them
    """

    __slots__ = ("__weakref__", "parts")

    def __init__(self) -> None:
        self.parts: Any = None


class Contexts(dict[str, Any]):
    """esper's registry of contexts; it holds those of worlds weakly, so that a world that is dropped is collected and
    takes its context with it."""

    def __init__(self, content: dict[str, Any]) -> None:
        super().__init__(content)
        self._owned: dict[str, weakref.ref[OwnContext]] = {}

    def let_own(self, name: str) -> OwnContext:
        """From now on that context lives as long as what this returns."""
        owned = OwnContext()
        owned.parts = self[name]
        self._owned[name] = weakref.ref(owned, lambda reference: self._drop(name, reference))
        dict.__setitem__(self, name, None)
        return owned

    def _drop(self, name: str, reference: weakref.ref[OwnContext]) -> None:
        if self._owned.get(name) is reference:
            del self[name]

    def __getitem__(self, name: str) -> Any:
        reference = self._owned.get(name)
        return dict.__getitem__(self, name) if reference is None else reference().parts  # type: ignore[union-attr]

    def __setitem__(self, name: str, parts: Any) -> None:
        reference = self._owned.get(name)
        if reference is None:
            dict.__setitem__(self, name, parts)
        else:
            reference().parts = parts  # type: ignore[union-attr]

    def __delitem__(self, name: str) -> None:
        self._owned.pop(name, None)
        dict.__delitem__(self, name)


_contexts = esper._context_map = Contexts(esper._context_map)


def own_context(name: str) -> OwnContext | None:
    """What keeps that context alive, for its world to hold; None for the default context, which esper always has."""
    return None if name == "default" else _contexts.let_own(name)


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


def watch(base: type[Any]) -> None:
    """Log changes of components derived from ``base`` in the current context; what is there already counts as new."""
    counter = Counter(next(esper._entity_count), esper)
    esper._entities = Entities(esper._entities, ChangeLog(base))
    esper._components = WatchedComponents(esper._components, esper._entities, counter)  # type: ignore[assignment]
    counter.install(counter.next)


def watched() -> bool:
    """Whether the current context is."""
    return isinstance(esper._components, WatchedComponents)


def unwatch() -> None:
    """Give esper plain containers back."""
    esper._components = {component: set(entities) for component, entities in esper._components.items()}
    esper._entities = dict(esper._entities.items())
    esper._entity_count = itertools.count(esper._entity_count.next)  # type: ignore[attr-defined]


class Contents:
    """What is in the current context, later too: it can be read and changed without switching to that context.

    entities, dead
        esper's own dict of all entities' components, and its set of those whose deletion is pending
    members
        esper's own dict of the entities that have each component: do not change it
    log
        what has changed
    """

    __slots__ = ("_caches", "counter", "dead", "entities", "log", "members")

    def __init__(self) -> None:
        self.entities: Entities = esper._entities  # type: ignore[assignment]
        self.dead: set[int] = esper._dead_entities
        self.members: Mapping[type[Any], Any] = esper._components
        self.log: ChangeLog = self.entities.log
        self.counter: Counter = esper._components.counter  # type: ignore[attr-defined]
        self._caches = esper._get_component_cache, esper._get_components_cache

    def forget_queries(self) -> None:
        """What esper has looked up before does not hold any more."""
        for cache in self._caches:
            cache.clear()

    def components_of(self, entity: int) -> Mapping[type[Any], Any]:
        """Those of an entity with objects, empty for what is none."""
        return dict.get(self.entities, entity, _NONE)

    def create(self, components: dict[type[Any], Any]) -> int:
        entity = next(self.counter)
        self.entities.create(entity, components)
        self.forget_queries()
        return entity

    def create_many(self, stores: Stores, count: int) -> range:
        """``count`` entities with one component of each type; their objects are made on demand."""
        first = self.counter.next
        if count:
            self.counter.next = first + count
            self.entities.create_many(first, count, stores)
            self.forget_queries()
        return range(first, first + count)

    def complete(self, dimensions: int) -> None:
        """Entities that have changed get what their components bring with them."""
        members: Any = self.members
        for component in [component for component in members if getattr(component, "brings", None)]:
            for entity in sorted(self.log.touched.intersection(members[component])):
                for other, values in component.brings.items():
                    if other not in self.components_of(entity):
                        if other not in members:
                            members[other] = ()
                        members[other].add(entity)  # before the dict, which it may replace
                        dict.__getitem__(self.entities, entity)[other] = other(**values(dimensions))
                        self.forget_queries()

    def delete(self, entities: Iterable[int]) -> None:
        self.forget_queries()
        self.entities.delete(entities)

    def clear_dead(self) -> None:
        """What ``esper.clear_dead_entities`` does, for all at once."""
        if self.dead:
            self.delete(self.dead)
            self.dead.clear()

    def go_on_from(self, number: int) -> None:
        """Give the next entity that id; what esper has looked up before no longer holds."""
        self.counter.next = self.entities.stop = number
        self.forget_queries()


class Membership:
    """Which entities of a context have which components."""

    __slots__ = ("dead", "entities", "types_of")

    def __init__(self, contents: Contents) -> None:
        self.entities = contents.entities
        self.types_of: Callable[[int], Collection[type[Any]]] = contents.entities.types_of
        self.dead: set[int] = contents.dead

    def lives(self, entity: int) -> bool:
        """Whether it exists and is not marked for deletion."""
        return entity in self.entities and entity not in self.dead

    def mask(self, entities: np.ndarray, component: type[Any]) -> np.ndarray:
        """(n,) which of these ids (n,) are living entities that have the component."""
        mask = self.entities.mask(entities, component)
        if self.dead:
            mask &= ~among(entities, self.dead)
        return mask


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
stepping = threading.RLock()  # the thread that takes a step: esper's current context is one for all threads


def step_is_running() -> bool:
    """Whether the current context is inside a step; for components that no world has adopted yet."""
    return esper.current_world in running


# -- what esper must do --------------------------------------------------------------------------


def _check_that_nothing_escapes() -> None:
    """ImportError if this esper changes components in a way that the log does not see."""

    class Probe:
        makes_body = True

        def _bind(self, *_: Any) -> None:
            pass

    def expect(action: Any, *entities: int) -> None:
        action()
        touched, cleared = log.touched, log.cleared
        log.clear()
        if touched != set(entities) or cleared != (not entities):
            raise ImportError(f"carom cannot work with esper {esper.version}: it hides changes of components")

    with context("carom is looking at esper"):
        watch(Probe)
        log = Contents().log
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
        _check_arrivals(Probe)
    esper.delete_world("carom is looking at esper")



def _check_arrivals(probe: Any) -> None:
    """ImportError if this esper looks at its containers in a way that does not see what has no objects."""
    contents = Contents()
    first = contents.create_many({probe: None}, 4)[0]  # type: ignore[dict-item]
    seen = [esper.entity_exists(first), len(list(esper.get_entities())) == 4, bool(esper.try_component(first, probe))]
    esper.delete_entity(first, immediate=True)
    esper.delete_entity(first + 1)
    contents.clear_dead()
    esper.add_component(first + 2, 1.0)
    left = [entity for entity, _ in esper.get_components(probe, float)], [e for e, _ in esper.get_component(probe)]
    if not all(seen) or left != ([first + 2], [first + 2, first + 3]):
        raise ImportError(f"carom cannot work with esper {esper.version}: it does not see entities created in bulk")


_check_that_nothing_escapes()

"""All use of esper's private names, in one place; esper keeps one context per world in module globals."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import esper


class _NoEntityHasThis:
    """The marker: esper caches an empty list for it and makes a new one after any structural change."""


for _name in ("_components", "_entities", "_dead_entities", "_processors", "_processors_dict", "_context_map"):
    if not hasattr(esper, _name):
        raise ImportError(f"carom cannot work with esper {esper.version}: it has no {_name}")


def context_exists(name: str) -> bool:
    return name in esper.list_worlds()


@contextlib.contextmanager
def context(name: str) -> Iterator[None]:
    """Make that esper world the current one for a while."""
    before = esper.current_world
    if before == name:
        yield
        return
    esper.switch_world(name)
    try:
        yield
    finally:
        if before in esper._context_map:
            esper.switch_world(before)


def change_token() -> object:
    """An object that stays the same until components or entities are added or removed (under a microsecond)."""
    return esper.get_component(_NoEntityHasThis)


def component_types() -> list[type[Any]]:
    return list(esper._components)


def entities_with(component: type[Any]) -> set[int]:
    """esper's own set of the entities that have the component: do not change it."""
    return esper._components.get(component, set())


def components_of(entity: int) -> dict[type[Any], Any]:
    """esper's own dict of an entity's components: do not change it."""
    return esper._entities[entity]


def known_entity(entity: int) -> bool:
    """Whether the entity is in the database, dead or not."""
    return entity in esper._entities


def forget_death(entity: int) -> None:
    """Take back a deferred deletion: after an immediate one esper would fail on it in every later process."""
    esper._dead_entities.discard(entity)


def processors() -> list[esper.Processor]:
    return list(esper._processors)


def remove_processor_instance(processor: esper.Processor) -> None:
    """Remove that very processor; esper's own removal is by type and loses sight of a second instance."""
    esper._processors[:] = [p for p in esper._processors if p is not processor]
    kind = type(processor)
    rest = [p for p in esper._processors if type(p) is kind]
    if rest:
        esper._processors_dict[kind] = rest[-1]
    else:
        esper._processors_dict.pop(kind, None)


def event_handlers(name: str) -> list[Any]:
    """The live handlers set with esper.set_handler, as a copy, so that a handler may remove itself or others."""
    found = (reference() for reference in tuple(esper.event_registry.get(name, ())))
    return [handler for handler in found if handler is not None]

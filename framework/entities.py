"""The verbs of esper on a world: same names, same meanings, without the traps."""

from __future__ import annotations

import gc
import itertools
from collections.abc import Iterable
from typing import Any, TypeVar

import esper

from . import esper_bridge
from .component import Component, Many, RowStore, components_in

C = TypeVar("C")


class EntityVerbs:
    """What esper's module functions do, for one world; mixed into :class:`World`."""

    name: str

    @property
    def dimensions(self) -> int | None:
        """2 or 3; None before physics is in the world."""
        raise NotImplementedError

    def create_entity(self, *components: Any) -> int:
        """A new entity with these components; its id.

        ValueError if a component's vectors do not fit the world's dimensions; nothing is created then.
        """
        self._check(components, None)
        with esper_bridge.context(self.name):
            return esper.create_entity(*components)

    def create_entities(self, count: int, *many: Many) -> range:
        """``count`` new entities with components from arrays (``Component.many``); their ids, which are consecutive.

        ValueError names field and row of a bad value; nothing is created then.
        """
        if isinstance(count, bool) or not isinstance(count, int) or count < 0:
            raise ValueError(f"count must be a whole number from 0, got {count!r}")
        for one in many:
            if not isinstance(one, Many):
                raise TypeError(f"create_entities takes what Component.many(...) makes, got {one!r}")
        dimensions = self.dimensions
        if dimensions is None:
            raise ValueError("create_entities needs a world with physics: World(Physics(...))")
        columns = []
        collecting = gc.isenabled()
        gc.disable()  # a hundred thousand new objects would start it again and again for nothing
        try:
            for one in many:
                store = RowStore({k: a.copy() for k, a in one.arrays(count, dimensions).items()}, dimensions)
                columns.append(_handles(one.component, store, count))
            with esper_bridge.context(self.name):
                ids = [esper.create_entity(*row) for row in zip(*columns, strict=True)] if columns else [
                    esper.create_entity() for _ in range(count)
                ]  # fmt: skip
        finally:
            if collecting:
                gc.enable()
        return range(ids[0], ids[-1] + 1) if ids else range(0)

    def delete_entity(self, entity: int, immediate: bool = False) -> None:
        """Delete at the start of the next step, or at once; KeyError if there is no such entity."""
        with esper_bridge.context(self.name):
            if not esper_bridge.known_entity(entity):
                raise KeyError(f"no entity {entity!r} in this world")
            esper.delete_entity(entity, immediate=immediate)
            if immediate:
                esper_bridge.forget_death(entity)

    def entity_exists(self, entity: int) -> bool:
        """False for unknown entities and those marked for deletion."""
        with esper_bridge.context(self.name):
            return esper.entity_exists(entity)

    def add_component(self, entity: int, component: Any, type_alias: type[Any] | None = None) -> None:
        """Add a component, or replace the one of its type; seen by the next step."""
        self._check((component,), entity)
        with esper_bridge.context(self.name):
            self._known(entity)
            esper.add_component(entity, component, type_alias)

    def remove_component(self, entity: int, component_type: type[C]) -> C:
        """Remove and return a component; KeyError if the entity or the component does not exist."""
        with esper_bridge.context(self.name):
            self._known(entity)
            if not esper.has_component(entity, component_type):
                raise KeyError(f"entity {entity} has no {component_type.__name__}")
            return esper.remove_component(entity, component_type)

    def has_component(self, entity: int, component_type: type[Any]) -> bool:
        with esper_bridge.context(self.name):
            self._known(entity)
            return esper.has_component(entity, component_type)

    def has_components(self, entity: int, *component_types: type[Any]) -> bool:
        with esper_bridge.context(self.name):
            self._known(entity)
            return esper.has_components(entity, *component_types)

    def component_for_entity(self, entity: int, component_type: type[C]) -> C:
        """The entity's component of that type; KeyError if either does not exist."""
        with esper_bridge.context(self.name):
            self._known(entity)
            found = esper.try_component(entity, component_type)
            if found is None:
                raise KeyError(f"entity {entity} has no {component_type.__name__}")
            return found

    def components_for_entity(self, entity: int) -> tuple[Any, ...]:
        with esper_bridge.context(self.name):
            self._known(entity)
            return esper.components_for_entity(entity)

    def try_component(self, entity: int, component_type: type[C]) -> C | None:
        with esper_bridge.context(self.name):
            return esper.try_component(entity, component_type)

    def try_components(self, entity: int, *component_types: type[Any]) -> tuple[Any, ...] | None:
        with esper_bridge.context(self.name):
            return esper.try_components(entity, *component_types)

    def get_component(self, component_type: type[C]) -> list[tuple[int, C]]:
        """(entity, component) of all entities that have it; a list of its own, so deleting meanwhile is safe."""
        with esper_bridge.context(self.name):
            return esper.get_component(component_type)

    def get_components(self, *component_types: type[Any]) -> list[tuple[int, tuple[Any, ...]]]:
        """(entity, components) of all entities that have them all."""
        with esper_bridge.context(self.name):
            return esper.get_components(*component_types)

    def _known(self, entity: int) -> None:
        if not esper_bridge.known_entity(entity):
            raise KeyError(f"no entity {entity!r} in this world")

    def _check(self, components: Iterable[Any], entity: int | None) -> None:
        dimensions = self.dimensions
        if dimensions is not None:
            for component in components_in(components):
                component.check_dimensions(dimensions, entity)


def _handles(component: type[Component], store: RowStore, count: int) -> list[Component]:
    """Handles into the rows of a store, in order."""
    make = component.__new__
    handles = [make(component) for _ in itertools.repeat(None, count)]
    for row, handle in enumerate(handles):
        handle._store = store
        handle._values = None
        handle._entity = None
        handle._row = row
        handle._version = 0
    return handles

"""The verbs of esper on a world: same names, same meanings, without the traps."""

from __future__ import annotations

import operator
from collections.abc import Callable, Collection, Iterable
from contextlib import AbstractContextManager
from typing import Any, TypeVar

import esper
import numpy as np

from ..data import esper_bridge
from ..data.component import Component, Many
from ..data.layers import LayerNames
from ..errors import NoPhysicsError
from ..plugins.registry import Registry
from .services import PhysicsServices

C = TypeVar("C")


def whole_number(name: str, value: Any, least: int = 0) -> int:
    """The value of an argument as an int; ValueError with its name unless it is a whole number from ``least`` on."""
    if isinstance(value, bool) or not hasattr(value, "__index__") or operator.index(value) < least:
        raise ValueError(f"{name} must be a whole number from {least}, got {value!r}")
    return operator.index(value)


class EntityVerbs:
    """What esper's module functions do, for one world; mixed into :class:`World`."""

    _context: Callable[[], AbstractContextManager[None]]  # the world's esper context, made the current one for a while
    _contents: Callable[[], esper_bridge.Contents]  # what is in it, to read without making it the current one
    physics: PhysicsServices | None
    registry: Registry
    _layer_names: LayerNames | None

    @property
    def dimensions(self) -> int | None:
        """2 or 3; None before physics is in the world."""
        return None if self.physics is None else self.physics.dimensions

    def create_entity(self, *components: Any) -> int:
        """A new entity with these components; its id.

        ValueError if a component's vectors do not fit the world's dimensions, or if there are two of a type; nothing is
        created then.
        """
        contents = self._contents()
        self._check(components, None)
        by_type = dict(zip(map(type, components), components, strict=True))
        if len(by_type) < len(components):
            types = [type(component).__name__ for component in components]
            twice = next(name for name in types if types.count(name) > 1)
            raise ValueError(f"create_entity: one component of each type, got {types.count(twice)} {twice}")
        return contents.create(by_type)

    def create_entities(self, count: int, *many: Many) -> range:
        """``count`` new entities with components from arrays (``Component.many``); their ids, which are consecutive.

        ValueError names field and row of a bad value; nothing is created then.
        """
        count = whole_number("count", count)
        for one in many:
            if not isinstance(one, Many):
                raise TypeError(f"create_entities takes what Component.many(...) makes, got {one!r}")
        types = [one.component for one in many]
        if len(set(types)) < len(types):
            raise ValueError(f"create_entities: one component of each type, got {', '.join(t.__name__ for t in types)}")
        for component in types:
            self.registry.require(component)
        dimensions = self.dimensions
        if dimensions is None:
            raise NoPhysicsError("no physics in this world: World(Physics(...))")
        for one in many:
            for other, values in one.component.brings.items():
                if other not in types:
                    many = *many, other.many(**values(dimensions))
        stores = {one.component: one.store(count, dimensions, self._layer_names) for one in many}
        return self._contents().create_many(stores, count)

    def delete_entity(self, entity: int, immediate: bool = False) -> None:
        """Delete at the start of the next step, or at once if ``immediate``; KeyError if there is no such entity."""
        contents = self._contents()
        if entity not in contents.entities:
            raise KeyError(f"no entity {entity!r} in this world")
        if not immediate:
            contents.dead.add(entity)
            return
        contents.delete((entity,))
        contents.dead.discard(entity)  # else esper would fail on it in every later process

    def delete_entities(self, entities: Iterable[int]) -> None:
        """Delete all ``entities`` at the start of the next step; KeyError, and none is deleted, if one is missing."""
        contents = self._contents()
        ids = entities.tolist() if isinstance(entities, np.ndarray) else list(entities)
        for entity in contents.entities.missing(ids):
            raise KeyError(f"no entity {entity!r} in this world")
        contents.dead.update(map(int, ids))

    def entity_exists(self, entity: int) -> bool:
        """False for unknown entities and those marked for deletion."""
        contents = self._contents()
        return entity in contents.entities and entity not in contents.dead

    def get_entities(self) -> list[int]:
        """The ids of all entities but those marked for deletion, ascending."""
        contents = self._contents()
        return sorted(entity for entity in contents.entities if entity not in contents.dead)

    def add_component(self, entity: int, component: Any, type_alias: type[Any] | None = None) -> None:
        """Add a component, or replace the one of its type; seen by the next step.

        carom's components are final, so ``type_alias`` is for others: TypeError.
        """
        if isinstance(component, Component) and type_alias not in (None, type(component)):
            raise TypeError(f"{type(component).__name__} is final and cannot be added as {type_alias!r}")
        self._check((component,), entity)
        with self._context():
            self._known(entity)
            esper.add_component(entity, component, type_alias)

    def remove_component(self, entity: int, component_type: type[C]) -> C:
        """Remove and return a component; KeyError if the entity or the component does not exist."""
        with self._context():
            self._known(entity)
            if not esper.has_component(entity, component_type):
                raise KeyError(f"entity {entity} has no {component_type.__name__}")
            return esper.remove_component(entity, component_type)

    def try_remove_component(self, entity: int, component_type: type[C]) -> C | None:
        """Remove and return a component; None if the entity or the component does not exist."""
        if component_type not in self._contents().entities.types_of(entity):
            return None
        return self.remove_component(entity, component_type)

    def has_component(self, entity: int, component_type: type[Any]) -> bool:
        """Whether the entity has a component of that type; KeyError if there is no such entity."""
        return component_type in self._types_of(entity)

    def has_components(self, entity: int, *component_types: type[Any]) -> bool:
        """Whether the entity has components of all these types; KeyError if there is no such entity."""
        types = self._types_of(entity)
        return all(component_type in types for component_type in component_types)

    def component_for_entity(self, entity: int, component_type: type[C]) -> C:
        """The entity's component of that type; KeyError if either does not exist."""
        found = self._components_of(entity).get(component_type)
        if found is None:
            raise KeyError(f"entity {entity} has no {component_type.__name__}")
        return found

    def components_for_entity(self, entity: int) -> tuple[Any, ...]:
        """All components of the entity; KeyError if there is no such entity."""
        return tuple(self._components_of(entity).values())

    def try_component(self, entity: int, component_type: type[C]) -> C | None:
        """The entity's component of that type; None if either does not exist."""
        return self._contents().entities.get(entity, {}).get(component_type)

    def try_components(self, entity: int, *component_types: type[Any]) -> tuple[Any, ...] | None:
        """The entity's components of these types, in their order; None if it or one of them does not exist."""
        components = self._contents().entities.get(entity)
        if not components or not all(component_type in components for component_type in component_types):
            return None
        return tuple(components[component_type] for component_type in component_types)

    def get_component(self, component_type: type[C]) -> list[tuple[int, C]]:
        """(entity, component) of all entities that have it, in no particular order; deleting meanwhile is safe."""
        with self._context():
            return esper.get_component(component_type)

    def get_components(self, *component_types: type[Any]) -> list[tuple[int, tuple[Any, ...]]]:
        """(entity, components) of all entities that have them all."""
        with self._context():
            return esper.get_components(*component_types)

    def _known(self, entity: int) -> None:
        if entity not in self._contents().entities:
            raise KeyError(f"no entity {entity!r} in this world")

    def _types_of(self, entity: int) -> Collection[type[Any]]:
        """The types of an entity's components; KeyError if there is no such entity."""
        types = self._contents().entities.types_of(entity)
        if not types:
            self._known(entity)
        return types

    def _components_of(self, entity: int) -> dict[type[Any], Any]:
        """All components of an entity by type; KeyError if there is no such entity."""
        try:
            return self._contents().entities[entity]
        except KeyError:
            raise KeyError(f"no entity {entity!r} in this world") from None

    def _check(self, components: Collection[Any], entity: int | None) -> None:
        dimensions, contents, beside = self.dimensions, self._contents(), {type(each): each for each in components}
        for component in components:
            if isinstance(component, Component):
                if component.plugin:
                    self.registry.require(type(component), entity)
                if dimensions is not None:
                    component.fit(dimensions, entity)
                component.check_in(contents, entity, beside)
            elif isinstance(component, type):
                raise TypeError(f"components are instances: {component.__name__}(...), got the class itself")
            elif component is None or isinstance(component, (list, tuple, Many)):
                raise TypeError(f"components are given one by one, got {component!r}")
        named = [c for c in components if isinstance(c, Component) and c._layers]
        for component, bits in [(c, c.bits_by_name(self._layer_names, entity)) for c in named]:
            component.take_bits(bits)  # all are known

"""Entities to be made: nothing of a map is in the world before all of it was checked, or if one of them is refused."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..components import Collider, Transform
from ..framework import CaromError, Component, World
from ..plugins.parts import PartOf
from ..plugins.terrain import ChainSegmentCollider, create_chain
from .contents import LevelLayer, LevelObject, LevelSprite
from .errors import Finding, MapError
from .fields import Reference
from .level import Level


@dataclass
class Chain:
    """A polyline to be made."""

    points: np.ndarray
    loop: bool
    thickness: float
    material: dict[str, Any]
    one_way: bool = False  # each segment from its own front


@dataclass
class Late:
    """A component that holds the entities of other objects; of a prefab, ``like`` that one."""

    kind: type[Component]
    values: dict[str, Any]
    references: list[Reference]
    like: Component | None = None

    def made(self, entities: dict[str, int | None]) -> Component:
        """With these entities; in place of those that are not there yet any others, no two of them the same."""
        known = {name: k if entity is None else entity for k, (name, entity) in enumerate(entities.items(), 1)}
        if self.like is None:
            return self.kind(**self.values, **known)
        made = self.like.copy()
        for name, value in (self.values | known).items():
            setattr(made, name, value)
        return made


@dataclass
class Planned:
    """What is made of an object, or of a part of a tile layer.

    bodies
        components of each entity, the first one that of the object
    parts
        (position, angle, mass, collider) of parts of the first one
    beside
        components that all of them have, and segments of chains too
    """

    place: str
    layer: LevelLayer
    kinds: list[str]
    object: LevelObject | None = None
    bodies: list[list[Any]] = field(default_factory=list)
    chains: list[Chain] = field(default_factory=list)
    parts: list[tuple[np.ndarray, float, float | None, Collider]] = field(default_factory=list)
    beside: list[Any] = field(default_factory=list)
    sprite: LevelSprite | None = None

    @property
    def references(self) -> list[Reference]:
        late = [each for body in (*self.bodies, self.beside) for each in body if isinstance(each, Late)]
        return [reference for each in late for reference in each.references]

    @property
    def types(self) -> Iterator[type[Component]]:
        """Of all components."""
        given: list[Any] = [*(c for body in self.bodies for c in body), *self.beside, *(part[3] for part in self.parts)]
        for each in given:
            yield each.kind if isinstance(each, Late) else type(each)
        if self.chains:
            yield ChainSegmentCollider
        if self.parts:
            yield PartOf


class Maker:
    """Makes what was planned, all or nothing."""

    def __init__(self, world: World, level: Level) -> None:
        self.world, self.level = world, level
        self.made: list[int] = []
        self.unset: list[tuple[Component, Reference]] = []  # of objects that refer to each other

    def make(self, planned: list[Planned]) -> None:
        """MapError for what the world refuses; it is as before then."""
        by_id = {each.object.id: each for each in planned if each.object is not None}
        done: set[int] = set()
        try:
            for each in planned:
                self._with_what_it_needs(each, by_id, done)
            for component, (_, name, id) in self.unset:
                setattr(component, name, self.level.objects[id].entity)
        except BaseException:
            for entity in reversed(self.made):
                if self.world.entity_exists(entity):
                    self.world.delete_entity(entity, immediate=True)
            raise

    def _with_what_it_needs(self, planned: Planned, by_id: dict[Any, Planned], done: set[int]) -> None:
        """First what its components refer to, as far as these do not refer to each other."""
        stack = [planned]
        while stack:
            each = stack[-1]
            if id(each) in done:
                stack.pop()
                continue
            others = [by_id[reference.id] for reference in each.references]
            waits = [other for other in others if id(other) not in done and other not in stack]
            if waits:
                stack.append(waits[0])
                continue
            done.add(id(stack.pop()))
            try:
                self._one(each)
            except (ValueError, TypeError, ImportError, CaromError) as error:
                raise MapError([Finding(self.level.file, each.place, str(error))]) from error

    def _one(self, planned: Planned) -> None:
        world, entities = self.world, []
        for k, body in enumerate(planned.bodies):
            entity = world.create_entity(*map(self._component, (*body, *self._beside(planned, k))))
            self.made.append(entity)
            entities.append(entity)
        for position, angle, mass, collider in planned.parts:
            entity = world.create_entity(PartOf(entities[0], position, angle, mass=mass), collider)
            self.made.append(entity)
            entities.append(entity)
        for chain in planned.chains:
            ids = create_chain(world, chain.points, loop=chain.loop, thickness=chain.thickness, **chain.material)
            self.made += ids
            for entity in ids:
                for k, each in enumerate(planned.beside):
                    world.add_component(entity, self._component(each if not entities and k == 0 else _copy(each)))
                if chain.one_way:
                    segment = world.component_for_entity(entity, ChainSegmentCollider)
                    x, y = (segment.end - segment.start).tolist()
                    segment.one_way = (-y, x)
            entities += ids
        self._note(planned, entities)

    def _beside(self, planned: Planned, k: int) -> list[Any]:
        return planned.beside if k == 0 else [_copy(each) for each in planned.beside]

    def _component(self, given: Any) -> Any:
        if not isinstance(given, Late):
            return given
        entities = {name: self.level.objects[id].entity for _, name, id in given.references}
        component = given.made(entities)
        self.unset += [(component, each) for each in given.references if entities[each.field] is None]
        return component

    def _note(self, planned: Planned, entities: list[int]) -> None:
        level, entity, thing = self.level, entities[0], planned.object
        planned.layer.entities += entities
        for name in planned.kinds:
            level.of_class.setdefault(name, []).append(entity)
        if thing is not None:
            thing.entity, thing.entities = entity, tuple(entities)
            level.entities.put(thing.name, entity)  # type: ignore[attr-defined]
        if planned.sprite is not None:
            planned.layer.sprites.append(planned.sprite._replace(entity=entity))


def _copy(given: Any) -> Any:
    return given if isinstance(given, Late) else given.copy()


def transform(place: np.ndarray, angle: float = 0.0) -> Transform:
    return Transform(place.tolist(), angle)

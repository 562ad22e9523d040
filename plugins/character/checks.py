"""What can be a character, and what cannot."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ...components import Collider, RigidBody, Transform
from ...components.part_of import PartOf
from ...components.spin import Spin


def refusal(entity: int | None, types: Iterable[type[Any]], kind: str) -> str:
    """Why an entity with these components and that kind of body cannot be a character; "" if it can."""
    types = set(types)
    colliders = sorted(each.__name__ for each in types if issubclass(each, Collider))
    why = ""
    if not {Transform, RigidBody} <= types or kind != "kinematic":
        own = f"this one is {kind}" if RigidBody in types else "its entity has none"
        why = f"takes a Transform and a RigidBody(kind='kinematic'), {own}"
    elif len(colliders) != 1:
        why = f"takes one collider, its entity has {', '.join(colliders) or 'none'}"
    elif PartOf in types:
        why = "walks by itself, and its entity is a PartOf another body"
    elif Spin in types:
        why = "does not turn, and its entity has a Spin"
    return f"{'' if entity is None else f'entity {entity}: '}Character {why}" if why else ""


class CharacterCheck:
    """Before a step, when bodies or their components have changed: ValueError for what became of a character."""

    def __init__(self, character: type[Any]) -> None:
        self._character, self._seen = character, ("", -1, -1)

    def __call__(self, world: Any) -> None:
        table = world.physics.table
        version = world.name, table.version, table.members_version
        if version == self._seen:
            return
        count, (first, stop) = table.count, table.stops[:2]
        mine = table.has_mask(self._character)[:count]
        bad = mine.copy()
        bad[first:stop] = False
        colliders = np.zeros(count, np.int64)
        for component in table.stacked_types(Collider.stack):
            colliders += table.has_mask(component)[:count]
        bad |= mine & (colliders != 1)
        for component in (PartOf, Spin):
            if component in table.mask_names:
                bad |= mine & table.has_mask(component)[:count]
        for row in np.flatnonzero(bad).tolist():
            entity = int(table.column("entity")[row])
            types = world._contents().entities.types_of(entity)
            body = world.try_component(entity, RigidBody)
            raise ValueError(refusal(entity, types, "static" if body is None else body.kind))
        self._seen = version

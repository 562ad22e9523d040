"""Prefab: components of which entities are made, as often as wanted."""

from __future__ import annotations

from typing import Any

from ..framework import Component, World
from ..framework.data.component import Many
from ..framework.names import did_you_mean, snake_case
from .transform import Transform


class Prefab:
    """Components of which entities are made: ``Prefab(RigidBody(mass=40.0), SphereCollider(2.0))``.

    components
        copies of them are held, which no spawn changes: TypeError for what is none of carom's, ValueError for two of a
        type
    """

    def __init__(self, *components: Component) -> None:
        self._components: dict[type[Component], Component] = {}
        for each in components:
            kind: Any = type(each)
            if not isinstance(each, Component):
                raise TypeError(f"Prefab takes carom components, instances of them, got {each!r}")
            if kind in self._components:
                raise ValueError(f"Prefab: one component of each type, got two {kind.__name__}")
            self._components[kind] = each.copy()
        kinds = list(self._components)
        self._lacks_place = any(kind.makes_body for kind in kinds) and not any(
            kind is Transform or Transform in kind.brings for kind in kinds
        )
        if self._lacks_place:
            kinds.insert(0, Transform)
        # By each name that says which: of the column in world.bodies, with its component's, alone.
        self._fields: dict[str, list[tuple[type[Component], str]]] = {}
        own = {}
        for kind in kinds:
            for name, field in kind._arguments.items():
                self._fields.setdefault(name, []).append((kind, name))
                own[field.key] = own[f"{snake_case(kind.__name__)}.{name}"] = [(kind, name)]
        self._fields.update(own)

    def spawn(self, world: World, *, position: Any = None, **changes: Any) -> int:
        """One more entity in ``world``; its id.

        position
            (d,) m; may be left out if the prefab has a Transform, or makes no body
        changes
            other values of fields: ``mass=2.0``, or with the component ``**{"sphere_collider.radius": 0.5}``

        TypeError for a field that no component has, or several have; ValueError for a value that cannot be.
        """
        changed = self._changed("spawn", position, changes)
        made = {kind: component.copy() for kind, component in self._components.items()}
        if self._lacks_place:
            made = {Transform: Transform(**changed.pop(Transform)), **made}
        for kind, values in changed.items():
            for name, value in values.items():
                setattr(made[kind], name, value)
        return world.create_entity(*made.values())

    def spawn_many(self, world: World, n: int, *, position: Any = None, **changes: Any) -> range:
        """``n`` more entities in ``world`` at once; their ids, which are consecutive.

        position, changes
            as of :meth:`spawn`, each one value for all or one per entity: positions (n, d) m

        Errors as of :meth:`spawn`, and of :meth:`World.create_entities`.
        """
        changed = self._changed("spawn_many", position, changes)
        many = [Many(kind, changed.pop(kind, {}), like) for kind, like in self._components.items()]
        return world.create_entities(n, *(Many(kind, values) for kind, values in changed.items()), *many)

    def _changed(self, verb: str, position: Any, changes: dict[str, Any]) -> dict[type[Component], dict[str, Any]]:
        """The values to change by component and field."""
        if position is not None:
            changes = {"position": position, **changes}
        found: dict[type[Component], dict[str, Any]] = {}
        for word, value in changes.items():
            fields = self._fields.get(word)
            if fields is None:
                also = {other: name for kind in self._components for name, of in kind._arguments.items()
                        for other in of.also}  # fmt: skip
                near = did_you_mean(word, self._fields, also)
                names = ", ".join(dict.fromkeys(name for named in self._fields.values() for _, name in named))
                raise TypeError(f"Prefab.{verb}: no field {word!r}{near}; its components have {names or 'none'}")
            if len(fields) > 1:
                names = " or ".join(f'**{{"{snake_case(kind.__name__)}.{name}": ...}}' for kind, name in fields)
                raise TypeError(f"Prefab.{verb}: {len(fields)} components have a field {word!r}: {names}")
            ((kind, name),) = fields
            if name in found.setdefault(kind, {}):
                raise TypeError(f"Prefab.{verb} got {kind.__name__}.{name} twice")
            found[kind][name] = value
        if self._lacks_place and "position" not in found.get(Transform, {}):
            raise TypeError(f"Prefab.{verb} needs position=, because the prefab makes a body and has no Transform")
        return found

    def __repr__(self) -> str:
        return f"Prefab({', '.join(map(repr, self._components.values()))})"

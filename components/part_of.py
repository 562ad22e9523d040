"""PartOf: an entity with a collider that is a part of a body."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np

from ..framework.data.columns import special_column
from ..framework.data.component import NOTHING, Component
from ..framework.typing import RotationField, VectorField
from .rigid_body import RigidBody
from .transform import Transform

FARTHEST = 1e15  # m: further away a body of 1 m has no digits beside the arm


class Changes:
    """How often a field of any part has been set: worlds look again when that is another number."""

    count = 0


def _note(table: Any, row: int) -> None:
    Changes.count += 1


class PartOf(Component):
    """Makes an entity with a collider a part of a body, in a world with the plugin ``Parts``.

    body
        its entity; a part's: its body
    position
        (d,) m, where the part is from the body's position, along the body's own axes
    rotation
        of the part against the body: rad, in 3D a unit quaternion (w, x, y, z)
    mass
        kg, which the part adds to RigidBody.mass of the body; None: 1, and 0 if it is a sensor
    """

    __slots__ = ()
    makes_body: ClassVar[bool] = True
    plugin: ClassVar[str] = "parts"
    brings: ClassVar[Mapping[type[Component], Callable[[int], dict[str, Any]]]] = {
        Transform: lambda dimensions: {"position": (0.0,) * dimensions},
        RigidBody: lambda dimensions: {},
    }

    body: int = special_column(dtype=int, minimum=1, on_write=_note)
    position: VectorField = special_column(unit="m", default=0.0, item="vector", largest=FARTHEST, on_write=_note)
    rotation: RotationField = special_column(unit="rad or 1", default=0.0, item="rotation", on_write=_note)
    mass: float | None = special_column(
        unit="kg", default=None, optional=True, minimum=0.0, kw_only=True, on_write=_note
    )
    # Not for the constructor: what it adds to which body, and its rotation against that; 0: it has no place yet.
    added: float = special_column(unit="kg", default=0.0, init=False)
    holder: int = special_column(default=0, dtype=int, init=False)
    turn: RotationField = special_column(unit="rad or 1", default=0.0, item="rotation", init=False)
    # As in Spin: of the collider that it had last.
    gyration: float | np.ndarray | None = special_column(
        unit="m^2", default=None, item="angular", optional=True, init=False
    )
    gyration_products: float | np.ndarray = special_column(unit="m^2", default=0.0, item="angular", init=False)

    def check_in(self, contents: Any, entity: int | None, beside: Mapping[type[Any], Any] = NOTHING) -> None:
        """ValueError if its body is none, or is a part of this entity."""
        name, types_of = "PartOf" if entity is None else f"entity {entity}: PartOf", contents.entities.types_of
        if self.body not in contents.entities or self.body in contents.dead:
            raise ValueError(f"{name}: there is no entity {self.body} in this world")
        if not {Transform, PartOf}.intersection(types_of(self.body)):
            raise ValueError(f"{name}: entity {self.body} is no body, it has no Transform")
        if _closes(entity, self.body, lambda e: contents.entities[e][PartOf].body if PartOf in types_of(e) else None):
            raise ValueError(f"{name}: entity {self.body} is a part of entity {entity}")

    def __setattr__(self, name: str, value: Any) -> None:
        store: Any = self._store if name == "body" else None
        before = self.body if store is not None else 0
        super().__setattr__(name, value)
        if store is None or not hasattr(store, "row_of"):
            return

        def body_of(entity: int) -> int | None:
            row = store.row_of(entity)
            return int(store.column("part_of.body")[row]) if row >= 0 and store.has_mask(PartOf)[row] else None

        new, why = self.body, ""
        if store.row_of(new) < 0:
            why = f"there is no body {new} in this world"
        elif _closes(self._entity, new, body_of):
            why = f"entity {new} is a part of it"
        if why:
            super().__setattr__(name, before)
            raise ValueError(f"entity {self._entity}: PartOf.body: {why}")


def _closes(entity: int | None, body: int | None, body_of: Callable[[int], int | None]) -> bool:
    """Whether a body is a part of an entity, or of parts of it, and so on."""
    seen = [entity]
    while body is not None and body not in seen:
        seen.append(body)
        body = body_of(body)
    return body is not None


def rows_of_parts(store: Any, entity: int) -> np.ndarray:
    """(k,) the rows of all parts of a body, parts of parts among them."""
    if PartOf not in store.mask_names:
        return np.empty(0, np.int64)
    return np.flatnonzero(store.has_mask(PartOf)[: store.count] & (store.column("part_of.holder") == entity))

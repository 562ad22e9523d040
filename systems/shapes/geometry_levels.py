"""Levels of geometry: several colliders on one body, the cheap one tested first, the precise one only if that hits.

Levels are ordered by the registered cost of their shapes, ties by name. The cheaper one encloses the costlier one, so
that it never hides a contact; that is checked here when the colliders are adopted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from typing import Any

import numpy as np

from ...components import AABBCollider, Collider, SphereCollider
from ...framework.data.component import Component
from ...framework.data.contents.change_log import Stores
from ...framework.data.handles import as_column, stored
from ...framework.data.table import Table
from ...framework.errors import UnhandledPairError
from ...framework.plugins.registry import Registry
from .linking.linked_shape import half_extents_of
from .linking.linked_shapes import LinkedShapes

# Of the outer level's size, which may stick out: sizes that were computed or stored in single precision still enclose.
TOLERANCE = 1e-6

Values = dict[str, np.ndarray]  # columns by name, a row for each of some entities


def in_order(registry: Registry, colliders: Iterable[type[Component]]) -> list[type[Component]]:
    """These collider types, cheapest first; UnhandledPairError for one that no plugin has registered."""
    colliders = list(colliders)
    for collider in colliders:
        if collider not in registry.shapes:
            room, _, shipped = collider.__module__.partition("carom.plugins.")
            cure = "register it with @plugin.shape(cost=...) and give the plugin to the world"
            if shipped and not room:
                name = shipped.partition(".")[0]
                whole = hasattr(import_module(f"carom.plugins.{name}"), "plugin")
                cure = f"World(Physics(...), {f'{name}.plugin' if whole else f'{name.capitalize()}()'}), "
                cure += f"from carom.plugins import {name}" if whole else f"from carom.plugins.{name}"
            raise UnhandledPairError(
                f"{collider.__name__} is a collider that no plugin of this world has registered: {cure}"
            )
    return sorted(colliders, key=lambda c: (registry.shapes[c].cost, c.__name__))


def arrange(has: np.ndarray) -> np.ndarray:
    """(levels, n) indices of types, cheapest first, the last one repeated where a body has fewer; -1 for none.

    has (types, n): which of the types each has, these being in order.
    """
    place = np.zeros(has.shape[1], np.int8)  # of the next type among the body's own
    count = max(1, int(has.sum(axis=0, dtype=np.int8).max(initial=0)))
    levels = np.full((count, has.shape[1]), -1, np.int8)
    for index in range(len(has)):
        bodies = np.flatnonzero(has[index])
        levels[place[bodies], bodies] = index
        place[bodies] += 1
    for k in range(1, count):
        levels[k] = np.where(levels[k] < 0, levels[k - 1], levels[k])
    return levels


def check_beside(component: type[Component], types: Iterable[type[Component]], who: str) -> None:
    """ValueError if it cannot be with these others, or needs another one; ``who`` has them, for the message."""
    for other in component.needs:
        if other not in types:
            name = component.__name__
            raise ValueError(f"{who} has {name}, but no {other.__name__}, which {name} needs")
    for other, cure in component.excludes.items():
        if other in types:
            raise ValueError(f"{who} has {component.__name__}, which no {other.__name__} can have: {cure}")


class LevelCheck:
    """Called before colliders are adopted: ValueError if those of one entity cannot be its levels."""

    def __init__(self, table: Table, registry: Registry) -> None:
        self._table = table
        self._registry = registry

    def check_types(self, types: Iterable[type[Component]], entity: int) -> None:
        """Whether these may be together, and colliders are shapes of this world; the entity is for messages."""
        for component in types:
            check_beside(component, types, f"entity {entity}")
            self._registry.require(component, entity)
            if issubclass(component, Collider):
                self._check_dimensions(component, entity)

    def __call__(self, several: Mapping[int, Mapping[type[Any], Any]]) -> None:
        """several: the components of entities with more than one collider."""
        types = {c for own in several.values() for c in own if isinstance(c, type) and issubclass(c, Collider)}
        ordered = in_order(self._registry, types)
        entities = np.array(sorted(several), np.int64)
        has = np.array([[c in several[e] for e in entities.tolist()] for c in ordered], bool)

        def values(collider: type[Component], chosen: np.ndarray) -> Values:
            sources = [stored(several[e][collider]) for e in entities[chosen].tolist()]
            columns = collider.columns.items()
            dimensions = self._table.dimensions
            return {name: as_column([s[name] for s in sources], column, dimensions) for name, column in columns}

        self._check_levels(ordered, has, entities, values)

    def batch(self, stores: Stores, entities: np.ndarray, rows: Any) -> None:
        self.check_types(stores, int(entities[0]))
        types = [component for component in stores if issubclass(component, Collider)]
        if len(types) < 2:
            return

        def values(collider: type[Component], chosen: np.ndarray) -> Values:
            columns = collider.columns.items()
            return {name: stores[collider].values(column.key, rows)[chosen] for name, column in columns}

        types = in_order(self._registry, types)
        self._check_levels(types, np.ones((len(types), len(entities)), bool), entities, values)

    def _check_dimensions(self, collider: type[Any], entity: int) -> None:
        if self._table.dimensions not in collider.dimensions:
            worlds = " and ".join(f"{d}D" for d in collider.dimensions)
            raise ValueError(
                f"entity {entity}: {collider.__name__} is a shape of {worlds} worlds, this world is "
                f"{self._table.dimensions}D"
            )

    def _check_levels(
        self,
        types: list[type[Component]],
        has: np.ndarray,
        entities: np.ndarray,
        values: Callable[[type[Component], np.ndarray], Values],
    ) -> None:
        """has (types, n): which of these entities have which colliders; values: of a collider, for those of a mask."""
        levels = arrange(has)
        for k in range(1, len(levels)):
            for outer, inner in sorted(set(zip(levels[k - 1].tolist(), levels[k].tolist(), strict=True))):
                if outer != inner:
                    chosen = (levels[k - 1] == outer) & (levels[k] == inner)
                    one, two = (values(types[index], chosen) for index in (outer, inner))
                    self._check_pair(types[outer], types[inner], entities[chosen], one, two)

    def _check_pair(
        self, outer: type[Any], inner: type[Any], entities: np.ndarray, one: Values, two: Values
    ) -> None:
        mixed = one["sensor"] != two["sensor"]
        if mixed.any():
            entity = int(entities[np.argmax(mixed)])
            raise ValueError(_mixed(entity, outer, inner, bool(one["sensor"][np.argmax(mixed)])))
        out, size = self._sticking_out(outer, inner, one, two)
        beyond = out > TOLERANCE * size
        if beyond.any():
            worst = int(np.argmax(beyond))
            more = int(beyond.sum()) - 1
            raise ValueError(
                f"entity {entities[worst]}: its {outer.__name__} is the cheaper level and must enclose its "
                f"{inner.__name__}, which sticks out by {out[worst]:.4g}: make the {outer.__name__} larger, or use a "
                f"second entity for a shape of its own" + (f" ({more} more entities likewise)" if more else "")
            )

    def _sticking_out(
        self, outer: type[Any], inner: type[Any], one: Values, two: Values
    ) -> tuple[np.ndarray, np.ndarray]:
        """How far the inner shape reaches beyond the outer one, unrotated, and the size to measure it by; (n,) each.

        Exact for the built-in shapes. Of others the boxes around them are compared: what sticks out of those does
        stick out, but a corner that a round shape leaves open is not found.
        """
        apart = np.abs(two["offset"] - one["offset"])
        inside = self._half_extents(inner, two)
        if outer is SphereCollider and inner is AABBCollider:
            return np.linalg.norm(apart + inside, axis=1) - one["radius"], one["radius"]
        outside = self._half_extents(outer, one)
        return (apart + inside - outside).max(axis=1), outside.max(axis=1)

    def _half_extents(self, collider: type[Any], values: Values) -> np.ndarray:
        """(n, d) of the boxes around the shapes."""
        count, dimensions = len(values["offset"]), self._table.dimensions
        if collider is AABBCollider:
            return values["half_extents"]
        if collider is SphereCollider:
            return np.repeat(values["radius"][:, None], dimensions, axis=1)
        shape = self._registry.shapes[collider]
        unrotated = np.broadcast_to(np.eye(dimensions), (count, dimensions, dimensions)).copy()
        return half_extents_of(shape, values, unrotated)


def check_sensors(linked: LinkedShapes, levels: np.ndarray, slots: np.ndarray, table: Table) -> None:
    """ValueError if, of the levels of some body, some are sensors by now and some are not.

    levels (levels, n): shapes of each body; slots: of the shapes in the stacks of the table.
    """
    sensors = table.stack(f"{Collider.stack}.sensor")
    rows = np.flatnonzero(levels[0, : table.count] != levels[-1, : table.count])
    decides = sensors[slots[levels[-1, rows]], rows]
    for level in levels[:-1]:
        mixed = sensors[slots[level[rows]], rows] != decides
        if mixed.any():
            row = rows[np.argmax(mixed)]
            shapes = [linked.shapes[index].component for index in (level[row], levels[-1, row])]
            raise ValueError(_mixed(int(table.arrays["entity"][row]), *shapes, not decides[np.argmax(mixed)]))


def _mixed(entity: int, one: type[Component], other: type[Component], one_is_sensor: bool) -> str:
    sensor, solid = (one, other) if one_is_sensor else (other, one)
    return (
        f"entity {entity}: its {sensor.__name__} is a sensor and its {solid.__name__} is solid, but colliders of one "
        f"entity are levels of one shape: use a second entity for the sensor"
    )


# -- whether a plugin says how two shapes meet, for all that can meet in a scene ---------------------


def check_pairs(
    linked: LinkedShapes, levels: np.ndarray, collider_slot: np.ndarray, table: Table, registry: Registry
) -> None:
    """UnhandledPairError if two bodies can meet whose shapes no plugin has a pair for.

    Two bodies can meet if one of them moves and each one's layer is in the other's mask, unless both are of one
    group. Levels of geometry meet level by level. Costs nothing in a scene whose shapes all have pairs, and little in
    one where those without rest, such as tile grids.
    """
    for i, j in linked.unhandled:
        for level in levels:
            moving = level[: table.stops[1]]
            if not ((moving == i) | (moving == j)).any():
                continue  # what rests meets nothing that rests
            found = _that_can_meet(table, collider_slot, level, i, j)
            if found is not None:
                first, second = (linked.shapes[index].component for index in (i, j))
                entity = table.arrays["entity"]
                where = f", entity {entity[found[0]]} and entity {entity[found[1]]} for instance"
                raise UnhandledPairError(registry.unhandled(first, second, where))


def _that_can_meet(
    table: Table, collider_slot: np.ndarray, level: np.ndarray, i: int, j: int
) -> tuple[int, int] | None:
    """Rows of two bodies that can meet, the first of shape i in that level, the second of shape j."""
    for layer_a, mask_a, group_a, moves_a, rows_a in _alike(table, collider_slot, level, i):
        for layer_b, mask_b, group_b, moves_b, rows_b in _alike(table, collider_slot, level, j):
            others, together = rows_b[rows_b != rows_a[0]], group_a == group_b != 0
            if (moves_a or moves_b) and layer_a & mask_b and layer_b & mask_a and not together and len(others):
                return int(rows_a[0]), int(others[0])
    return None


def _alike(
    table: Table, collider_slot: np.ndarray, level: np.ndarray, shape: int
) -> list[tuple[int, int, int, int, np.ndarray]]:
    """(layer, mask, group, whether it moves, the first two rows) of each kind of body with that shape."""
    rows = np.flatnonzero(level[: table.count] == shape)
    slots = collider_slot[rows]
    filters = [table.stack(f"{Collider.stack}.{name}")[slots, rows] for name in ("layer", "mask", "group")]
    kinds, which = np.unique(np.stack((*filters, rows < table.stops[1])), axis=1, return_inverse=True)
    return [(*kind, rows[which.ravel() == index][:2]) for index, kind in enumerate(kinds.T.tolist())]

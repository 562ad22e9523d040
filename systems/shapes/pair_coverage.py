"""Whether a plugin says how two shapes meet, for all that can meet in a scene."""

from __future__ import annotations

import numpy as np

from ...components import Collider
from ...framework.data.table import Table
from ...framework.errors import UnhandledPairError
from ...framework.plugins.registry import Registry
from .linking.linked_shapes import LinkedShapes


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

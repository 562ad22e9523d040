"""Whether a plugin says how two shapes meet, for all that can meet in a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...components import Collider
from ...framework.errors import UnhandledPairError

if TYPE_CHECKING:
    from ..state import PhysicsState


def check_pairs(state: PhysicsState) -> None:
    """UnhandledPairError if two bodies can meet whose shapes no plugin has a pair for.

    Two bodies can meet if one of them moves and each one's layer is in the other's mask. Levels of geometry meet level
    by level. Costs nothing in a scene whose shapes all have pairs.
    """
    if state.code is None or not state.code.unhandled or state.preparing:
        return
    for i, j in state.code.unhandled:
        for level in state.levels:
            found = _that_can_meet(state, level, i, j)
            if found is not None:
                first, second = (state.code.shapes[index].component for index in (i, j))
                entity = state.table.arrays["entity"]
                where = f", entity {entity[found[0]]} and entity {entity[found[1]]} for instance"
                raise UnhandledPairError(state.world.registry.unhandled(first, second, where))


def _that_can_meet(state: PhysicsState, level: np.ndarray, i: int, j: int) -> tuple[int, int] | None:
    """Rows of two bodies that can meet, the first of shape i in that level, the second of shape j."""
    for layer_a, mask_a, moves_a, rows_a in _alike(state, level, i):
        for layer_b, mask_b, moves_b, rows_b in _alike(state, level, j):
            others = rows_b[rows_b != rows_a[0]]
            if (moves_a or moves_b) and layer_a & mask_b and layer_b & mask_a and len(others):
                return int(rows_a[0]), int(others[0])
    return None


def _alike(state: PhysicsState, level: np.ndarray, shape: int) -> list[tuple[int, int, int, np.ndarray]]:
    """(layer, mask, whether it moves, the first two rows) of each kind of body with that shape."""
    table = state.table
    rows = np.flatnonzero(level[: table.count] == shape)
    slots = state.scratch["material"][rows]
    layer, mask = (table.stacks[f"{Collider.stack}.{name}"][slots, rows] for name in ("layer", "mask"))
    kinds, which = np.unique(np.stack((layer, mask, rows < table.stops[1])), axis=1, return_inverse=True)
    return [(*kind, rows[which.ravel() == index][:2]) for index, kind in enumerate(kinds.T.tolist())]

"""Which bodies are near which: distances between their positions, whatever their shapes."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...framework.compilation import kernel
from ...framework.vectors import length, row, sub
from ...framework.world.hits import Neighbours
from ..broad_phase.brute_force import FEW, FewBoxes
from ..broad_phase.tree.build import REACH
from ..broad_phase.tree.tree import SpatialTree

if TYPE_CHECKING:
    from ..state import PhysicsState


@kernel
def within_radius(askers, radius, offsets, candidates, entity, position, wanted, found, bounds, like):
    """Rows of the candidates that are near each asker, by id; returns how many.

    askers (m,) rows; the candidates of asker q are candidates[offsets[q]:offsets[q + 1]]; wanted (n,): rows that may
    be found; bounds (m + 1,): where each asker's rows in ``found`` end.
    """
    count = 0
    for q in range(len(askers)):
        i = askers[q]
        centre = row(position, i, like)
        begin = count
        for c in range(offsets[q], offsets[q + 1]):
            j = candidates[c]
            if j == i or not wanted[j] or not length(sub(row(position, j, like), centre)) <= radius:
                continue
            place = count  # candidates come nearly in order of their ids
            while place > begin and entity[found[place - 1]] > entity[j]:
                found[place] = found[place - 1]
                place -= 1
            found[place] = j
            count += 1
        bounds[q + 1] = count
    return count


class NeighbourSearch:
    """A tree of all bodies' positions, built when first asked after they have moved."""

    def __init__(self, state: PhysicsState) -> None:
        self._state = state
        self._stamp: Any = None
        self._points: SpatialTree | FewBoxes = FewBoxes(state.dimensions)

    @cached_property
    def _tree(self) -> SpatialTree:
        return SpatialTree(self._state.dimensions)

    def find(self, radius: float, mask: int, askers: np.ndarray | None, stamp: Any) -> Neighbours:
        """The neighbours of some entities or of all; ``stamp`` changes whenever bodies may have moved."""
        state, table = self._state, self._state.table
        entity, position = table.column("entity"), table.column("position")
        if stamp != self._stamp:
            self._points = FewBoxes(state.dimensions) if table.count <= FEW else self._tree
            self._points.build(position, position, 0, table.count)
            self._stamp = stamp
        if askers is None:
            rows = np.argsort(entity, kind="stable")
        else:
            rows = table.rows_of(askers)
            if (rows < 0).any():
                raise KeyError(f"neighbours: entity {int(askers[rows < 0][0])} is no body")
        places = position[rows]
        reach = radius * (1.0 + REACH) + REACH * np.abs(places)
        with np.errstate(invalid="ignore"):  # a body at infinity has no neighbours
            offsets, candidates = self._points.query(places - reach, places + reach)
        found, bounds = np.empty(len(candidates), np.int64), np.zeros(len(rows) + 1, np.int64)
        wanted = np.ones(table.count, bool)
        if mask != -1 and state.code is not None:
            layers, collider = table.stacks["collider.layer"], state.scratch["material"][: table.count]
            shaped = state.scratch["shape"][: table.count] >= 0
            wanted = shaped & (layers[collider, np.arange(table.count)] & mask != 0)
        elif mask != -1:
            wanted[:] = False
        count = within_radius(
            rows, radius, offsets, candidates, entity, position, wanted, found, bounds, state.like
        )
        found = found[:count]
        return Neighbours(entity[rows], rows, bounds, entity[found], found)

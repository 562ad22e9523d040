"""A step in several rounds: when a blow sends a body farther than its neighbours are known, all are looked for again.

The boxes of the broad phase hold each body's foreseen motion and some room for what blows make of it. The event loop
stops when a body leaves its room. Then candidates are made for the rest of the step from the paths as they are now, and
the loop goes on. In most scenes that never happens; where everything is fast, a step takes several rounds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..framework.compilation import kernel
from .impacts import LOGGED, UNTIL
from .pair_filters import filtered
from .pair_order import sort_pairs

if TYPE_CHECKING:
    from .event_queue import EventQueue
    from .state import PhysicsState


@kernel
def merge_pairs(
    new_a, new_b, count, old_a, old_b, pairs, needed, rank, material, layers, masks, merged_a, merged_b, source, place
):  # fmt: skip
    """Join two lists in canonical order: new candidates whose layers meet, and the pairs that are still ``needed``.

    source (m,): the old place of each pair, or -1; place (pairs,): the new place of each old one, or -1. Returns how
    many.
    """
    n, found, i, j = len(rank), 0, 0, 0
    for c in range(pairs):
        place[c] = -1
    while i < count or j < pairs:
        new_key, old_key = n * n, n * n
        if i < count:
            new_key = rank[new_a[i]] * n + rank[new_b[i]]
        if j < pairs:
            old_key = rank[old_a[j]] * n + rank[old_b[j]]
        if old_key <= new_key:
            if needed[j] or old_key == new_key:
                merged_a[found], merged_b[found], source[found], place[j] = old_a[j], old_b[j], j, found
                found += 1
            i += 1 if old_key == new_key else 0
            j += 1
            continue
        a, b = new_a[i], new_b[i]
        i += 1
        slot_a, slot_b = material[a], material[b]
        if layers[slot_a, a] & masks[slot_b, b] != 0 and layers[slot_b, b] & masks[slot_a, a] != 0:
            merged_a[found], merged_b[found], source[found] = a, b, -1
            found += 1
    return found


class Rounds:
    """Begins the rounds after the first."""

    def __init__(self, state: PhysicsState) -> None:
        self._state = state

    def begin(
        self, dt: float, queue: EventQueue, disabled: np.ndarray, crossed: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Make pairs for the rest of the step; returns ``disabled`` and ``crossed`` as they count then."""
        state = self._state
        now = float(queue.clock[UNTIL])
        (first, second), until = state.broad_phase.pairs_on_the_way(now, dt)
        state.pair_counters["candidates"] += len(first)
        state.pair_counters["rounds"] += 1
        first, second = filtered(state, *self._sorted(first, second))
        source, place = self._merge(first, second, crossed)
        logged = queue.counts[LOGGED]
        queue.log_pair[:logged] = place[queue.log_pair[:logged]]
        state.hits[: state.found] = place[state.hits[: state.found]]
        known = source >= 0
        now_crossed = np.zeros(len(source), bool)
        now_crossed[known] = crossed[source[known]]
        queue.begin_round(now, until, len(source))
        return place[disabled], now_crossed

    def _sorted(self, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """In canonical order."""
        rank, count = self._state.rank, len(first)
        starts = np.empty(len(rank) + 1, np.int64)
        half_a, half_b, sorted_a, sorted_b = (np.empty(count, np.int64) for _ in range(4))
        sort_pairs(first, second, rank, starts, half_a, half_b, sorted_a, sorted_b)
        return sorted_a, sorted_b

    def _merge(self, first: np.ndarray, second: np.ndarray, crossed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Put these in place of the pairs that nothing has come of; returns (source, place), see merge_pairs."""
        state, stacks = self._state, self._state.table.stacks
        pairs, room = state.pairs, state.pairs + len(first)
        needed = crossed | (state.pair_impulse[:pairs] > 0.0)
        needed[state.hits[: state.found]] = True
        merged_a, merged_b, source = (np.empty(room, np.int64) for _ in range(3))
        place = np.empty(pairs, np.int64)
        count = merge_pairs(
            first, second, len(first), state.pair_a, state.pair_b, pairs, needed, state.rank,
            state.scratch["material"], stacks["collider.layer"], stacks["collider.mask"], merged_a, merged_b, source,
            place,
        )  # fmt: skip
        state.replace_pairs(merged_a[:count], merged_b[:count], source[:count])
        return source[:count], place

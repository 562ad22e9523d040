"""A step in several rounds: when a blow sends a body farther than its neighbours are known, all are looked for again.

The boxes of the broad phase hold each body's foreseen motion and some room for what blows make of it. The event loop
stops when a body leaves its room. Then candidates are made for the rest of the step from the paths as they are now, and
the loop goes on. In most scenes that never happens; where everything is fast, a step takes several rounds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...framework.compilation import kernel
from ...framework.vectors import row, store
from ..impacts.impulses import LOGGED, UNTIL
from ..narrow_phase.filters import filtered
from ..narrow_phase.order import sort_pairs

if TYPE_CHECKING:
    from ..impacts.queue import EventQueue
    from ..state import PhysicsState


@kernel
def merge_pairs(
    new_a, new_b, count, old, pairs, crossed, rank, material, layers, masks, sensors, inverse_mass, merged, now_crossed,
    place, hits, disabled, log_pair, like,
):  # fmt: skip
    """Join two lists in canonical order: new candidates whose layers meet, and the pairs that something has come of.

    old, merged: the arrays of the pairs (pairs,) until now and from now on; crossed, now_crossed: see ``impacts``.
    What names pairs by their place, hits, disabled and log_pair, gets the new ones; place (pairs,): room. Returns how
    many there are.
    """
    old_a, old_b, responds, involved, depth, impulse, parts, normal, point = old
    a, b, now_responds, now_involved, now_depth, now_impulse, now_parts, now_normal, now_point = merged
    n, found, i, j = len(rank), 0, 0, 0
    for c in range(pairs):
        place[c] = 0 if crossed[c] or impulse[c] > 0.0 else -1
    for h in range(len(hits)):
        place[hits[h]] = 0
    while i < count or j < pairs:
        new_key, old_key = n * n, n * n
        if i < count:
            new_key = rank[new_a[i]] * n + rank[new_b[i]]
        if j < pairs:
            old_key = rank[old_a[j]] * n + rank[old_b[j]]
        if old_key <= new_key:
            if place[j] >= 0:
                a[found], b[found], place[j] = old_a[j], old_b[j], found
                now_responds[found], now_involved[found], now_crossed[found] = responds[j], involved[j], crossed[j]
                now_depth[found], now_impulse[found], now_parts[found] = depth[j], impulse[j], parts[j]
                store(now_normal, found, row(normal, j, like))
                store(now_point, found, row(point, j, like))
                found += 1
                i += 1 if old_key == new_key else 0
            j += 1
            continue
        p, q = new_a[i], new_b[i]
        i += 1
        slot_p, slot_q = material[p], material[q]
        if layers[slot_p, p] & masks[slot_q, q] != 0 and layers[slot_q, q] & masks[slot_p, p] != 0:
            a[found], b[found] = p, q
            passive = sensors[slot_p, p] or sensors[slot_q, q]
            now_responds[found] = not passive and inverse_mass[p] + inverse_mass[q] > 0.0
            now_involved[found], now_crossed[found] = True, False  # how they stand at the end is not known yet
            now_depth[found], now_impulse[found] = 0.0, 0.0
            found += 1
    for h in range(len(hits)):
        hits[h] = place[hits[h]]
    for h in range(len(disabled)):
        disabled[h] = place[disabled[h]]
    for h in range(len(log_pair)):
        log_pair[h] = place[log_pair[h]]
    return found


class Rounds:
    """Begins the rounds after the first."""

    def __init__(self, state: PhysicsState) -> None:
        self._state = state

    def begin(self, dt: float, queue: EventQueue, disabled: np.ndarray, crossed: np.ndarray) -> np.ndarray:
        """Make pairs for the rest of the step; ``disabled`` is changed, and who ``crossed`` is returned."""
        state, table = self._state, self._state.table
        now = float(queue.clock[UNTIL])
        first, second = state.broad_phase.pairs_on_the_way(now, dt)
        state.pair_counters["candidates"] += len(first)
        state.pair_counters["rounds"] += 1
        first, second = filtered(state, *self._sorted(first, second))
        old, merged = state.other_pairs(state.pairs + len(first))
        now_crossed = np.empty(state.pairs + len(first), bool)
        stacks = table.stacks
        count = merge_pairs(
            first, second, len(first), old, state.pairs, crossed, state.rank, state.scratch["material"],
            stacks["collider.layer"], stacks["collider.mask"], stacks["collider.sensor"], table.arrays["inverse_mass"],
            merged, now_crossed, np.empty(state.pairs, np.int64), state.hits[: state.found], disabled,
            queue.log_pair[: queue.counts[LOGGED]], state.like,
        )  # fmt: skip
        state.take_others(count)
        queue.begin_round(now, state.known_until, count)
        return now_crossed

    def _sorted(self, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """In canonical order."""
        rank, count = self._state.rank, len(first)
        starts = np.empty(len(rank) + 1, np.int64)
        half_a, half_b, sorted_a, sorted_b = (np.empty(count, np.int64) for _ in range(4))
        sort_pairs(first, second, rank, starts, half_a, half_b, sorted_a, sorted_b)
        return sorted_a, sorted_b

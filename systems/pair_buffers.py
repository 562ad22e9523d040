"""The buffers between the collision phases: candidates, pairs, contacts. They only grow."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..framework.contacts import Contacts, empty_columns
from .impacts import CAPPED, LOGGED
from .pair_order import collect_contacts, sort_pairs

if TYPE_CHECKING:
    from ..framework.table import Table


class PairBuffers:
    """Mixed into the physics state.

    candidates: rows (first, second) from the broad phase. pair_a, pair_b, responds (m,): the pairs whose layers meet,
    a's entity id the smaller. hits (found,): indices of the pairs that touch at the end of their motion, with depths,
    normals, points. pair_impulse, pair_normal, pair_point, pair_depth, pair_parts (see ``resting``): per pair, what
    the response made of it.
    """

    table: Table
    contacts: Contacts
    rank: np.ndarray
    dimensions: int
    world: Any

    def __init__(self, dimensions: int) -> None:
        self.no_pairs = np.empty(0, np.int32)
        self.candidates = (self.no_pairs, self.no_pairs)
        self.candidates_ready = self.contacts_ready = False
        self.pairs = self.found = 0
        self._starts = np.empty(0, np.int64)
        self.resting = np.empty(0, np.int64)
        self.impact_pairs = np.empty(0, np.int64)
        self.step_impacts: dict[str, np.ndarray] | None = None
        self._no_contacts = empty_columns(dimensions, enabled=True)
        self.contact_columns = self._no_contacts
        self._contact_pairs = np.empty(0, np.int64)  # the pair behind each row of the contacts
        names = ("candidates", "pairs", "contacts", "impacts", "capped_impacts", "resting_contacts")
        self.pair_counters = dict.fromkeys(names, 0)
        self._allocate(64)

    def _allocate(self, size: int) -> None:
        d = self.dimensions
        self.pair_a, self.pair_b = np.empty(size, np.int64), np.empty(size, np.int64)
        self._half_a, self._half_b = np.empty(size, np.int64), np.empty(size, np.int64)
        self.responds = np.empty(size, bool)
        self.hits, self.depths = np.empty(size, np.int64), np.empty(size)
        self.normals, self.points = np.empty((size, d)), np.empty((size, d))
        self.pair_impulse, self.pair_depth = np.empty(size), np.empty(size)
        self.pair_parts = np.empty(size, np.uint8)
        self.pair_normal, self.pair_point = np.empty((size, d)), np.empty((size, d))

    def begin_pairs(self) -> None:
        """A new step: nothing is known yet."""
        self.candidates_ready = self.contacts_ready = False
        self.pairs = self.found = 0
        self.step_impacts = None
        self.resting = self.impact_pairs = np.empty(0, np.int64)

    def set_candidates(self, first: np.ndarray, second: np.ndarray) -> None:
        self.candidates = (first, second)
        self.candidates_ready = True
        self.contacts_ready = False
        self.pair_counters["candidates"] += len(first)

    def sort_candidates(self) -> tuple[np.ndarray, np.ndarray]:
        """The candidates in canonical order, at the start of pair_a and pair_b, where all have room."""
        first, second = self.candidates
        count = len(first)
        if count > len(self.pair_a):
            self._allocate(max(count, 2 * len(self.pair_a)))
        if len(self._starts) != len(self.rank) + 1:
            self._starts = np.empty(len(self.rank) + 1, np.int64)
        sort_pairs(first, second, self.rank, self._starts, self._half_a, self._half_b, self.pair_a, self.pair_b)
        return self.pair_a[:count], self.pair_b[:count]

    def set_pairs(self, pairs: int, found: int) -> None:
        """The narrow phase is done."""
        self.pairs, self.found = pairs, found
        self.contacts_ready = True
        self.pair_counters["pairs"] += pairs

    def take_enabled(self) -> np.ndarray:
        """Pairs whose contact a system has disabled push no more in this step; returns which they are."""
        enabled = self.contact_columns["enabled"]
        if enabled.all():
            return self.no_pairs
        disabled = self._contact_pairs[~enabled]
        self.responds[disabled] = False
        return disabled

    def publish_found(self) -> None:
        """The contacts' columns after NARROW: what overlaps where free flight leads, or is near."""
        if not self.found:
            self._publish(self.no_pairs, self._no_contacts)
            return
        pairs = self.hits[: self.found].copy()
        depth, normal, point = (array[: self.found].copy() for array in (self.depths, self.normals, self.points))
        self._publish(pairs, self._columns(pairs, depth, normal, point, np.zeros(self.found)))

    def publish_final(self, pairs: np.ndarray, disabled: np.ndarray) -> None:
        """The contacts' columns after RESPONSE; disabled: the pairs that were not to push."""
        self.pair_counters["contacts"] += len(pairs)
        self.pair_counters["resting_contacts"] += len(self.resting)
        if not len(pairs):
            self._publish(self.no_pairs, self._no_contacts)
            return
        d, count = self.dimensions, len(pairs)
        depth, normal, point, impulse = np.empty(count), np.empty((count, d)), np.empty((count, d)), np.empty(count)
        columns = self._columns(pairs, depth, normal, point, impulse)
        collect_contacts(
            pairs, self.pair_depth, self.pair_normal, self.pair_point, self.pair_impulse, depth, normal, point, impulse
        )
        if len(disabled):
            columns["enabled"][np.isin(pairs, disabled)] = False
        self._publish(pairs, columns)

    def _columns(
        self, pairs: np.ndarray, depth: np.ndarray, normal: np.ndarray, point: np.ndarray, impulse: np.ndarray
    ) -> dict[str, np.ndarray]:
        entity = self.table.arrays["entity"]
        return {
            "entity_a": entity[self.pair_a[pairs]],
            "entity_b": entity[self.pair_b[pairs]],
            "point": point,
            "normal": normal,
            "depth": depth,
            "normal_impulse": impulse,
            "step": np.full(len(pairs), self.world.step_count),
            "enabled": np.ones(len(pairs), bool),
        }

    def _publish(self, pairs: np.ndarray, columns: dict[str, np.ndarray]) -> None:
        self._contact_pairs, self.contact_columns = pairs, columns
        self.contacts.set_current(columns)

    def log_impacts(self, pairs: np.ndarray, values: np.ndarray, counts: np.ndarray) -> None:
        """Record the impacts of the step, in the order of their times; values: time, impulse, normal, point."""
        logged, capped = int(counts[LOGGED]), int(counts[CAPPED])
        pair, value = pairs[:logged].copy(), values[:logged]
        self.impact_pairs = pair
        self.pair_counters["impacts"] += logged
        self.pair_counters["capped_impacts"] += capped
        if capped:
            limit = self.world.settings.max_impacts_per_step
            self.world.report_fault(
                f"step {self.world.step_count}: {capped} impacts beyond {limit} of a body in one step"
            )
        if not logged:
            return
        entity, d = self.table.arrays["entity"], self.dimensions
        self.step_impacts = {
            "entity_a": entity[self.pair_a[pair]],
            "entity_b": entity[self.pair_b[pair]],
            "point": value[:, 2 + d :].copy(),
            "normal": value[:, 2 : 2 + d].copy(),
            "depth": np.zeros(len(pair)),
            "normal_impulse": value[:, 1].copy(),
            "step": np.full(len(pair), self.world.step_count),
            "time_of_impact": value[:, 0].copy(),
        }
        self.contacts.record("impacts", self.step_impacts)

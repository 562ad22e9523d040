"""The buffers between the collision phases: candidates, pairs, contacts. They only grow."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...framework.world.contacts import Contacts, empty_columns
from ..impacts.impulses import CAPPED, LOGGED
from .order import collect_contacts, sort_pairs

if TYPE_CHECKING:
    from ...framework.data.table import Table

Columns = dict[str, np.ndarray]
NONE = np.empty(0, np.int64)
PER_PAIR = (
    "pair_a", "pair_b", "responds", "involved", "pair_depth", "pair_impulse", "pair_parts", "pair_normal", "pair_point"
)  # fmt: skip


class LateColumns(Columns):
    """Columns that are made when somebody asks for one."""

    def __init__(self, make: Callable[[], Columns]) -> None:
        super().__init__()
        self._make = make

    def __missing__(self, key: str) -> np.ndarray:
        if self:
            raise KeyError(key)
        self.fill()
        return self[key]

    def fill(self) -> None:
        """Make them now, if they are not there yet."""
        if not self:
            self.update(self._make())

    def __reduce__(self) -> tuple[type, tuple[Columns]]:  # so that copies are plain
        self.fill()
        return dict, (dict(self),)


class PairBuffers:
    """Mixed into the physics state.

    candidates: rows (first, second) from the broad phase. pair_a, pair_b, responds (m,): the pairs whose layers meet,
    a's entity id the smaller. hits (found,): indices of the pairs that touch or nearly do at the end of their motion,
    with their entities; involved (m,): whether a pair may have to do with the response. pair_depth, pair_normal,
    pair_point: per pair, how it touches; pair_impulse, pair_parts (see ``resting``): what the response made of it.
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
        self._starts = NONE
        self.resting = self.impact_pairs = NONE
        self.step_impacts: Columns | None = None
        self._no_contacts = empty_columns(dimensions, enabled=True)
        self.contact_columns = self._no_contacts
        names = ("candidates", "pairs", "contacts", "impacts", "capped_impacts", "rounds", "resting_contacts")
        self.pair_counters = dict.fromkeys(names, 0)
        self._others: tuple[np.ndarray, ...] = ()
        self._allocate(0)

    def _allocate(self, size: int) -> None:
        d = self.dimensions
        self.pair_a, self.pair_b = np.empty(size, np.int64), np.empty(size, np.int64)
        self._half_a, self._half_b = np.empty(size, np.int64), np.empty(size, np.int64)
        self.responds, self.involved = np.empty(size, bool), np.empty(size, bool)
        self.hits, self.hit_a, self.hit_b = (np.empty(size, np.int64) for _ in range(3))
        self.pair_impulse, self.pair_depth = np.empty(size), np.empty(size)
        self.pair_parts = np.empty(size, np.uint8)
        self.pair_normal, self.pair_point = np.empty((size, d)), np.empty((size, d))

    def begin_pairs(self) -> None:
        """A new step: nothing is known yet."""
        self.candidates_ready = self.contacts_ready = False
        self.pairs = self.found = 0
        self.step_impacts = None
        self.resting = self.impact_pairs = NONE

    def set_candidates(self, first: np.ndarray, second: np.ndarray) -> None:
        self.candidates = (first, second)
        self.candidates_ready = True
        self.contacts_ready = False
        self.pair_counters["candidates"] += len(first)

    def sort_candidates(self) -> tuple[np.ndarray, np.ndarray]:
        """The candidates in canonical order, at the start of pair_a and pair_b, where all have room."""
        if isinstance(self.contact_columns, LateColumns):  # no response has replaced them: they are read any time
            self.contact_columns.fill()
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

    def other_pairs(self, room: int) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
        """The arrays of the pairs, and as many to make others in, with room for so many."""
        if room > len(self.pair_a):
            before = {name: getattr(self, name) for name in (*PER_PAIR, "hits", "hit_a", "hit_b")}
            self._allocate(2 * room)
            for name, array in before.items():
                getattr(self, name)[: len(array)] = array
        arrays = tuple(getattr(self, name) for name in PER_PAIR)
        if len(self._others) != len(PER_PAIR) or len(self._others[0]) != len(self.pair_a):
            self._others = tuple(np.empty_like(array) for array in arrays)
        return arrays, self._others

    def take_others(self, count: int) -> None:
        """The pairs made there are the pairs from now on."""
        others, self._others = self._others, tuple(getattr(self, name) for name in PER_PAIR)
        for name, array in zip(PER_PAIR, others, strict=True):
            setattr(self, name, array)
        self.pairs = count

    def take_enabled(self) -> np.ndarray:
        """Pairs whose contact a system has disabled push no more in this step; returns which they are."""
        if "enabled" not in self.contact_columns:  # nobody has looked at the contacts
            return NONE
        enabled = self.contact_columns["enabled"]
        if enabled.all():
            return NONE
        disabled = self.hits[: self.found][~enabled]
        self.responds[disabled] = False
        return disabled

    def publish_found(self) -> None:
        """The contacts' columns after NARROW: what overlaps where free flight leads, or is near."""
        late = partial(self._found_columns, self.found, self.world.step_count)
        self._publish(LateColumns(late) if self.found else self._no_contacts)

    def _found_columns(self, found: int, step: int) -> Columns:
        pairs = self.hits[:found]
        return {
            "entity_a": self.hit_a[:found].copy(),
            "entity_b": self.hit_b[:found].copy(),
            "point": self.pair_point[pairs],
            "normal": self.pair_normal[pairs],
            "depth": self.pair_depth[pairs],
            "normal_impulse": np.zeros(found),
            "step": np.full(found, step),
            "enabled": np.ones(found, bool),
        }

    def publish_final(self, pairs: np.ndarray, disabled: np.ndarray) -> None:
        """The contacts' columns after RESPONSE; disabled: the pairs that were not to push."""
        d, count = self.dimensions, len(pairs)
        self.pair_counters["contacts"] += count
        self.pair_counters["resting_contacts"] += len(self.resting)
        if not count:
            self._publish(self._no_contacts)
            return
        columns = {
            "entity_a": np.empty(count, np.int64),
            "entity_b": np.empty(count, np.int64),
            "point": np.empty((count, d)),
            "normal": np.empty((count, d)),
            "depth": np.empty(count),
            "normal_impulse": np.empty(count),
            "step": np.empty(count, np.int64),
            "enabled": np.empty(count, bool),
        }
        collect_contacts(
            pairs, self.table.arrays["entity"], self.pair_a, self.pair_b, self.pair_depth, self.pair_normal,
            self.pair_point, self.pair_impulse, self.world.step_count, *columns.values(),
        )  # fmt: skip
        if len(disabled):
            columns["enabled"][np.isin(pairs, disabled)] = False
        self._publish(columns)

    def _publish(self, columns: Columns) -> None:
        self.contact_columns = columns
        self.contacts.set_current(columns)

    def log_impacts(self, pairs: np.ndarray, values: np.ndarray, counts: np.ndarray) -> None:
        """Record the impacts of the step, in the order of their times; values: time, impulse, normal, point."""
        logged, capped = int(counts[LOGGED]), int(counts[CAPPED])
        self.pair_counters["impacts"] += logged
        self.pair_counters["capped_impacts"] += capped
        if capped:
            limit = self.world.settings.impact_cap
            self.world.report_fault(
                f"step {self.world.step_count}: {capped} impacts beyond {limit} of a body in one step"
            )
        if not logged:
            return
        self.impact_pairs = pair = pairs[:logged].copy()
        value = values[:logged]
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

"""What is kept of pairs of which both bodies are still: their contacts, and the impulses of contacts at rest.

They are taken out of the records, which hold what is awake, and put back when one of the two wakes. Both lists are in
canonical order.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...framework.jit.records.record import Record

Columns = dict[str, np.ndarray]

CONTACTS = ("entity_a", "entity_b", "point", "normal", "depth", "impulse", "enabled", "rested")
IMPULSES = ("entity_a", "entity_b", "normal", "impulse", "tangent", "push", "closing")


def merged(one: Columns, other: Columns) -> tuple[Columns, np.ndarray]:
    """Two lists of pairs as one in canonical order; mask of the rows that are of the first."""
    count, more = len(one["entity_a"]), len(other["entity_a"])
    if not count or not more:  # usual, for whole piles
        return dict(one if count else other), np.full(max(count, more), count > 0)
    joined = {name: np.concatenate((column, other[name])) for name, column in one.items()}
    order = np.lexsort((joined["entity_b"], joined["entity_a"]))
    return {name: column[order] for name, column in joined.items()}, order < count


class Stored:
    """The rows of one record, ``[now, i]``, that are kept elsewhere.

    columns
        copies that are never written to, so that a reference to them is a copy
    """

    def __init__(self, record: Record, names: tuple[str, ...], reserve: Callable[[int], None]) -> None:
        self._record, self._names, self._reserve = record, names, reserve
        self._lists_stays = "stayed" in record.schema.fields  # the rows that were there in the step before, too
        self.columns: Columns = {}
        self.clear()

    def clear(self) -> None:
        """Keep none."""
        self.columns = {name: column[:0] for name, column in self._live().items()}

    def __len__(self) -> int:
        return len(self.columns["entity_a"])

    def _live(self) -> Columns:
        record, now = self._record, self._record.now
        count = int(record.counts[now])
        return {name: getattr(record, name)[now, :count].copy() for name in self._names}

    def exchange(self, both_still: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> None:
        """Keep the pairs of which both are still, and no others; the record gets the rest."""
        live = self._live()
        if not len(self) and not len(live["entity_a"]):
            return
        joined, was_live = merged(live, self.columns)
        still = both_still(joined["entity_a"], joined["entity_b"])
        if np.array_equal(still, ~was_live):
            return
        stays = self._stays(was_live)[~still]
        self.columns = {name: column[still] for name, column in joined.items()}
        self._write({name: column[~still] for name, column in joined.items()})
        if self._lists_stays:
            record, rows = self._record, np.flatnonzero(stays)
            record.stayed[record.now, : len(rows)], record.stays[record.now] = rows, len(rows)

    def _stays(self, was_live: np.ndarray) -> np.ndarray:
        """Mask of what was there in the step before, too: all that sleeps, and what the record says."""
        stays = ~was_live
        if self._lists_stays:
            record, now = self._record, self._record.now
            stays[np.flatnonzero(was_live)[record.stayed[now, : record.stays[now]]]] = True
        return stays

    def _write(self, columns: Columns) -> None:
        record, count = self._record, len(columns["entity_a"])
        self._reserve(count)
        now = record.now
        for name, column in columns.items():
            getattr(record, name)[now, :count] = column
        record.counts[now] = count

    def saved(self) -> Columns:
        return dict(self.columns)

    def take_back(self, saved: Any) -> None:
        self.columns = {name: np.array(saved[name], self.columns[name].dtype) for name in self._names}

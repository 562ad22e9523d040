"""What is kept of pairs of which both bodies are still: their contacts, the impulses of contacts at rest, and what
cannot be moved and bears them.

They are taken out of the records, which hold what is awake, and put back when one of the two wakes. Both lists are in
canonical order.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...framework.jit.records.record import Record
from ...framework.jit.records.schema import Section
from .stages import FALLING_ASLEEP

Columns = dict[str, np.ndarray]

CONTACT_COLUMNS = ("entity_a", "entity_b", "point", "normal", "depth", "impulse", "enabled", "rested")
IMPULSE_COLUMNS = ("entity_a", "entity_b", "place", "impulse", "tangent", "total")


def merged(one: Columns, other: Columns) -> tuple[Columns, np.ndarray]:
    """Two lists of pairs as one in canonical order; mask of the rows that are of the first."""
    count, more = len(one["entity_a"]), len(other["entity_a"])
    if not count or not more:  # usual, for whole piles
        return dict(one if count else other), np.full(max(count, more), count > 0)
    joined = {name: np.concatenate((column, other[name])) for name, column in one.items()}
    first, second = joined["entity_a"], joined["entity_b"]
    if max(first.max(), second.max()) >> 31:
        order = np.lexsort((second, first))
    else:
        order = np.argsort(first << 31 | second, kind="stable")  # fast, as both are in order
    return {name: column[order] for name, column in joined.items()}, order < count


def _part_of(columns: Columns, mask: np.ndarray) -> Columns:
    return {name: column[mask] for name, column in columns.items()}


class Stored:
    """The rows of one record, ``[now, i]``, that are kept elsewhere.

    columns
        copies that are never written to, so that a reference to them is a copy
    """

    def __init__(self, record: Record, names: tuple[str, ...], rows: Section) -> None:
        self._record, self._names, self._rows = record, names, rows
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
        live, kept = self._live(), self.columns
        sleeps, falls = (both_still(each["entity_a"], each["entity_b"]) for each in (kept, live))
        if sleeps.all() and not falls.any():
            return
        record, now = self._record, self._record.now
        stays = np.zeros(len(falls), bool)  # of the live ones, those that were there in the step before, too
        if self._lists_stays:
            stays[record.stayed[now, : record.stays[now]]] = True
        self.columns, _ = merged(_part_of(kept, sleeps), _part_of(live, falls))
        live, was_live = merged(_part_of(live, ~falls), _part_of(kept, ~sleeps))
        self._write(live)
        if self._lists_stays:
            stayed = ~was_live  # and all that slept
            stayed[was_live] = stays[~falls]
            rows = np.flatnonzero(stayed)
            record.stayed[now, : len(rows)], record.stays[now] = rows, len(rows)

    def _write(self, columns: Columns) -> None:
        record, count = self._record, len(columns["entity_a"])
        record.reserve(count, *self._rows)
        now = record.now
        for name, column in columns.items():
            getattr(record, name)[now, :count] = column
        record.counts[now] = count

    def saved(self) -> Columns:
        return dict(self.columns)

    def take_back(self, saved: Any) -> None:
        self.columns = {name: np.array(saved[name], self.columns[name].dtype) for name in self._names}


def links_with_falling(state: Record, links: np.ndarray) -> np.ndarray:
    """(k, 2) ids of what cannot be moved, each with an island that stands on it: those known, and those of what falls
    asleep."""
    bodies, pairs, joints, dynamic = state.bodies, state.pairs, state.solver.joints, state.dynamic
    near = pairs.near_contact[: pairs.count] & pairs.is_solid[: pairs.count]
    held = joints.order[: joints.active]
    a = np.concatenate((pairs.a[: pairs.count][near], joints.row_a[held]))
    b = np.concatenate((pairs.b[: pairs.count][near], joints.row_b[held]))
    fixed, body = np.maximum(a, b), np.minimum(a, b)
    some = (fixed >= dynamic) & (body >= 0) & (body < dynamic)
    fixed, body = fixed[some], body[some]
    due = bodies.sleep_state[body] == FALLING_ASLEEP
    found = np.stack((bodies.entity[fixed[due]], bodies.island[body[due]]), axis=1)
    links = np.concatenate((links, found))
    links = links[np.lexsort((links[:, 1], links[:, 0]))]
    return links[np.append(True, (links[1:] != links[:-1]).any(axis=1))[: len(links)]]

"""RESPONSE: what began to touch, what still does, what ceased; and telling those who listen."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ...framework.compilation import kernel
from ...framework.schedule.phases import Phase, System
from ...framework.schedule.plan import PlannedKernel
from ...framework.world.contacts import ContactRows, empty_columns

if TYPE_CHECKING:
    from ..state import PhysicsState

Columns = dict[str, np.ndarray]
EVENTS = ("contact_begin", "contact_stay", "contact_end", "impact")


@kernel
def compare_pairs(a0, b0, a1, b1, ended, began, stayed):
    """Rows of the pairs that stand in the first list only, and of those in the second only and in both.

    Both in canonical order. Returns how many rows are written to each.
    """
    i, j, ends, begins, stays = 0, 0, 0, 0, 0
    while i < len(a0) or j < len(a1):
        if j == len(a1) or (i < len(a0) and (a0[i] < a1[j] or (a0[i] == a1[j] and b0[i] < b1[j]))):
            ended[ends] = i
            ends += 1
            i += 1
        elif i == len(a0) or a0[i] != a1[j] or b0[i] != b1[j]:
            began[begins] = j
            begins += 1
            j += 1
        else:
            stayed[stays] = j
            stays += 1
            i += 1
            j += 1
    return ends, begins, stays


class ContactEvents(System):
    """Compares the pairs that touch with those of the step before; an end is always delivered.

    Reads the contacts; writes ``contacts.begin``, ``stay``, ``end``; calls the handlers of contact_begin,
    contact_stay, contact_end and impact, in canonical order.
    """

    phase = Phase.RESPONSE

    def __init__(self, state: PhysicsState) -> None:
        self._state = state
        self._nothing = empty_columns(state.dimensions)
        self.touching: Columns = self._nothing
        self._generation = state.table.generation

    def process(self, dt: float) -> None:
        self._state.queries.forget()  # the response has moved bodies
        before, now = self.touching, self._touching_now()
        olds, news = len(before["entity_a"]), len(now["entity_a"])
        if not olds and not news:
            return
        known = olds if self._generation == self._state.table.generation else 0
        ended, began, stayed = np.empty(olds, np.int64), np.empty(news, np.int64), np.empty(news, np.int64)
        ends, begins, stays = compare_pairs(
            before["entity_a"][:known], before["entity_b"][:known], now["entity_a"], now["entity_b"], ended, began,
            stayed,
        )  # fmt: skip
        self._generation = self._state.table.generation
        begin, stay = self._select(now, began[:begins]), self._select(now, stayed[:stays])
        end = self._select(before, ended[:ends]) if known else before
        ends = len(end["entity_a"])
        if ends:
            end = {**end, "step": np.full(ends, self.world.step_count), "normal_impulse": np.zeros(ends)}
        self.touching = now
        contacts = self._state.contacts
        contacts.record("begin", begin)
        contacts.record("end", end)
        contacts.set_stay(stay)
        for columns, event in zip((begin, stay, end, self._state.step_impacts), EVENTS, strict=True):
            self._tell(columns, event)

    def _touching_now(self) -> Columns:
        """The contacts that are enabled."""
        columns = self._state.contact_columns
        enabled = columns["enabled"]
        if enabled.all():
            return {key: column for key, column in columns.items() if key != "enabled"}
        return {key: column[enabled] for key, column in columns.items() if key != "enabled"}

    def _select(self, columns: Columns, rows: np.ndarray) -> Columns:
        """Those rows, ascending; columns of which all are taken are not copied."""
        if not len(rows):
            return self._nothing
        if len(rows) == len(columns["entity_a"]):
            return columns
        return {key: column.take(rows, axis=0) for key, column in columns.items()}

    def _tell(self, columns: Columns | None, event: str) -> None:
        if columns is None or not len(columns["entity_a"]) or not self.world.events.wanted(event):
            return
        self.world.events.dispatch_many(event, ContactRows(columns, self._state.lookup))

    def kernels(self) -> Iterator[PlannedKernel]:
        if self._state.collides or len(self.touching["entity_a"]):
            yield PlannedKernel("compare_pairs", "contacts of this step and the last", "bodies touch, or did")

    def reason(self) -> str:
        if not self._state.collides:
            return "no colliders: nothing to do"
        wanted = [event for event in EVENTS if self.world.events.wanted(event)]
        return f"handlers of {', '.join(wanted)}" if wanted else "begin, stay, end; nobody listens to events"

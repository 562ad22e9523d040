"""RESPONSE: what began to touch, what still does, what ceased; and telling those who listen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..framework.compilation import kernel
from ..framework.contacts import ContactRows, empty_columns
from ..framework.schedule import Phase, System

if TYPE_CHECKING:
    from .state import PhysicsState

Columns = dict[str, np.ndarray]
EVENTS = ("contact_begin", "contact_stay", "contact_end", "impact")


@kernel
def compare_pairs(a0, b0, a1, b1, stayed0, stayed1):
    """Mark the pairs that stand in both lists, each in canonical order; returns how many."""
    i, j, count = 0, 0, 0
    while i < len(a0) and j < len(a1):
        if a0[i] == a1[j] and b0[i] == b1[j]:
            stayed0[i] = stayed1[j] = True
            i += 1
            j += 1
            count += 1
        elif a0[i] < a1[j] or (a0[i] == a1[j] and b0[i] < b1[j]):
            i += 1
        else:
            j += 1
    return count


class ContactEvents(System):
    """Compares the pairs that touch with those of the step before; an end is always delivered.

    Reads the contacts; writes ``contacts.begin``, ``stay``, ``end``; calls the handlers of contact_begin,
    contact_stay, contact_end and impact, in canonical order.
    """

    phase = Phase.RESPONSE

    def __init__(self, state: PhysicsState) -> None:
        self._state = state
        self.touching: Columns = empty_columns(state.dimensions)
        self._generation = state.table.generation

    def process(self, dt: float) -> None:
        self._state.queries.forget()  # the response has moved bodies
        contacts = self._state.contacts
        now = self._state.contact_columns
        if not len(now["entity_a"]) and not len(self.touching["entity_a"]):
            return
        if len(now["entity_a"]) and not now["enabled"].all():
            now = {key: column[now["enabled"]] for key, column in now.items()}
        before = self.touching
        stayed_before, stayed = np.zeros(len(before["entity_a"]), bool), np.zeros(len(now["entity_a"]), bool)
        if self._generation == self._state.table.generation:
            compare_pairs(
                before["entity_a"], before["entity_b"], now["entity_a"], now["entity_b"], stayed_before, stayed
            )
        self._generation = self._state.table.generation
        begin, stay = _select(now, ~stayed), _select(now, stayed)
        end = _select(before, ~stayed_before)
        end["step"] = np.full(len(end["entity_a"]), self.world.step_count)
        end["normal_impulse"] = np.zeros(len(end["entity_a"]))
        self.touching = {key: column for key, column in now.items() if key != "enabled"}
        contacts.record("begin", begin)
        contacts.record("end", end)
        contacts.set_stay(stay)
        for columns, event in zip((begin, stay, end, self._state.step_impacts), EVENTS, strict=True):
            self._tell(columns, event)

    def _tell(self, columns: Columns | None, event: str) -> None:
        if columns is None or not len(columns["entity_a"]) or not self.world.events.wanted(event):
            return
        self.world.events.dispatch_many(event, ContactRows(columns, self._state.lookup))

    def reason(self) -> str:
        wanted = [event for event in EVENTS if self.world.events.wanted(event)]
        return f"handlers of {', '.join(wanted)}" if wanted else "begin, stay, end; nobody listens to events"


def _select(columns: Columns, mask: np.ndarray) -> Columns:
    """Those rows, without ``enabled``; columns of which all are taken are not copied."""
    rows = np.flatnonzero(mask)
    if len(rows) == len(mask):
        return {key: column for key, column in columns.items() if key != "enabled"}
    return {key: column.take(rows, axis=0) for key, column in columns.items() if key != "enabled"}

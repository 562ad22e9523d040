"""The numbers that ``world.stats()`` shows, by the fields of the state that hold them."""

from __future__ import annotations

from ...framework.jit.records.record import Record

COUNTERS = {
    "bodies": "bodies_counted",
    "candidates": "candidates_counted",
    "pairs": "pairs_counted",
    "contacts": "contacts_counted",
    "impacts": "impacts_counted",
    "capped_impacts": "capped_counted",
    "rounds": "refreshes_counted",
    "resting_contacts": "resting_counted",
    "islands": "islands_counted",
    "refined_islands": "refined_counted",
    "solved_rows": "solved_counted",
    "restrained_islands": "restrained_counted",
    "restrained_energy": "restrained_energy",
    "first_level_tests": "first_level_tests",
    "first_level_hits": "first_level_hits",
    "false_positives": "false_positives",
    "force_evaluations": "force_evaluations",
}


def counters_of(state: Record) -> dict[str, int]:
    """The counters by the names that users read."""
    return {name: getattr(state, field) for name, field in COUNTERS.items()}


def set_counters(state: Record, counters: dict[str, int]) -> None:
    """Count on from these."""
    for name, count in counters.items():
        setattr(state, COUNTERS[name], count)


def reset(state: Record) -> None:
    """Count from 0 again."""
    set_counters(state, dict.fromkeys(COUNTERS, 0))

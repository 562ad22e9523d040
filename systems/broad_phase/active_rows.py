"""Bodies that look for others while all others are still: a list that is made where this is known, and short."""

from __future__ import annotations

from ...framework.compilation import part

# Bodies that look at every other box as fast as a grid of all of them is made; it is made four times as fast where
# boxes overlap little.
MOST_ACTIVE = 16
ALL = -1  # in place of their number: every body looks for others


@part
def add_active(state, i):
    """Body i, whose row is behind those noted before, looks for others; all do if it is one too many."""
    candidates, count = state.candidates, state.candidates.active_count
    if count == MOST_ACTIVE:
        candidates.active_count = ALL
    elif count != ALL:
        candidates.active_rows[count] = i
        candidates.active_count = count + 1

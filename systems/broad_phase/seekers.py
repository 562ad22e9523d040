"""Bodies that look for others while all others are still: a list that is made where this is known, and short."""

from __future__ import annotations

from ...framework.compilation import part

# Bodies that look at every other box as fast as a grid of all of them is made; it is made four times as fast where
# boxes overlap little.
MOST_SEEKERS = 16
ALL = -1  # in place of their number: every body looks for others


@part
def seek(state, i):
    """Body i, whose row is behind those noted before, looks for others; all do if it is one too many."""
    candidates, count = state.candidates, state.candidates.seeker_count
    if count == MOST_SEEKERS:
        candidates.seeker_count = ALL
    elif count != ALL:
        candidates.seekers[count] = i
        candidates.seeker_count = count + 1

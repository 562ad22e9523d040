"""The buffers of the event loop: a queue of impacts to come, a log of those that were, and whose turn it is."""

from __future__ import annotations

import numpy as np

from .find import ALL, HITS
from .impulses import LAST, NOW, UNTIL, WAITING


class EventQueue:
    """events (m, 4): pair, how often each body had been struck when the event was made, its kind; with times and order
    keys.

    values (m, 2 + 3 d): time, change of the speed along the normal, normal, point, change along the surface. heap (m,):
    indices of events. log_pair (k,), log_value (k, 2 + 2 d): time, impulse, normal, point. counts (6,), clock (2,).
    heads, links, looks: whose pairs are looked at, see ``impacts``.
    """

    def __init__(self, dimensions: int) -> None:
        self.counts, self.clock = np.zeros(6, np.int64), np.zeros(2)
        self.events = np.empty((0, 4), np.int64)
        self.times, self.keys = np.empty(0), np.empty(0, np.int64)
        self.values = np.empty((0, 2 + 3 * dimensions))
        self.heap = np.empty(0, np.int64)
        self.log_pair, self.log_value = np.empty(0, np.int64), np.empty((0, 2 + 2 * dimensions))
        self.links, self.looks = np.empty(0, np.int32), np.empty(0, np.int32)
        self.heads = np.empty(0, np.int32)
        self.grow(64)

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """As the kernel takes them."""
        queue = (self.events, self.times, self.keys, self.values, self.heap)
        return *queue, self.log_pair, self.log_value, self.counts, self.clock

    def begin(self, bodies: int, pairs: int, until: float) -> None:
        """A new step: what may have met is looked at first; pairs are known until then."""
        if len(self.heads) != bodies:
            self.heads = np.empty(bodies, np.int32)
        self._fit(pairs)
        self.counts[:] = 0
        self.counts[LAST] = HITS
        self.clock[NOW], self.clock[UNTIL] = 0.0, until

    def begin_round(self, now: float, until: float, pairs: int) -> None:
        """All pairs are looked at anew, from then on."""
        self._fit(pairs)
        self.counts[WAITING] = 0
        self.counts[LAST] = ALL
        self.clock[NOW], self.clock[UNTIL] = now, until

    def _fit(self, pairs: int) -> None:
        if len(self.looks) <= 2 * pairs:  # of a cluster's pairs some are looked at twice
            self.links, self.looks = np.empty(4 * pairs, np.int32), np.empty(4 * pairs + 1, np.int32)

    def grow(self, least: int) -> None:
        """At least double everything, keeping what is there."""
        old = len(self.heap)
        size = max(2 * old, 2 * least)
        for name in ("events", "times", "keys", "values", "heap", "log_pair", "log_value"):
            before = getattr(self, name)
            after = np.empty((size, *before.shape[1:]), before.dtype)
            after[: len(before)] = before
            setattr(self, name, after)
        self.heap[old:] = np.arange(old, size)

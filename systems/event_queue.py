"""The buffers of the event loop: a queue of impacts to come, a log of those that were, and whose turn it is."""

from __future__ import annotations

import numpy as np

from .impacts import LAST


class EventQueue:
    """events (m, 3): pair and how often each body had been struck when the event was made; with times and order keys.

    values (m, 2 + 3 d): time, change of the speed along the normal, normal, point, change along the surface. heap (m,):
    indices of events. log_pair (k,), log_value (k, 2 + 2 d): time, impulse, normal, point. counts (6,). heads,
    links, looks: whose pairs are looked at, see ``impacts``.
    """

    def __init__(self, dimensions: int) -> None:
        self.counts = np.zeros(6, np.int64)
        self.events = np.empty((0, 3), np.int64)
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
        return *queue, self.log_pair, self.log_value, self.counts

    def begin(self, bodies: int, pairs: int) -> None:
        if len(self.heads) != bodies:
            self.heads = np.empty(bodies, np.int32)
        if len(self.looks) <= pairs:
            self.links, self.looks = np.empty(4 * pairs, np.int32), np.empty(2 * pairs + 1, np.int32)
        self.counts[:] = 0
        self.counts[LAST] = -1

    def grow(self, least: int) -> None:
        """At least double everything, keeping what is there."""
        size = max(2 * len(self.heap), 2 * least)
        for name in ("events", "times", "keys", "values", "heap", "log_pair", "log_value"):
            old = getattr(self, name)
            new = np.empty((size, *old.shape[1:]), old.dtype)
            new[: len(old)] = old
            setattr(self, name, new)

"""The past of a world: snapshots in a ring of so many megabytes."""

from __future__ import annotations

import sys
import time
from collections import deque
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

from ...framework import Snapshot, World

EVERY = 0.1  # s simulated between two snapshots, where time and memory allow
SPAN = 10.0  # s simulated that the ring shall hold at least
SHARE = 0.03  # of the process's time that snapshots may take
MEASURED = 10  # each how many-th is measured: that takes longer than the snapshot itself


@dataclass(frozen=True)
class Kept:
    step: int
    size: int  # bytes
    snapshot: Snapshot


class Rewind:
    """Snapshots of a ``world``, taken as it goes on, and the way back and forth between them.

    megabytes
        what they may take; the oldest go first

    A world that was restored or changed by others is followed from where it is. ValueError for no number above 0.
    """

    def __init__(self, world: World, megabytes: float = 100.0) -> None:
        if not megabytes > 0:
            raise ValueError(f"Rewind: megabytes must be a number above 0, got {megabytes!r}")
        self.world, self.most = world, int(megabytes * 1e6)
        self.ring: deque[Kept] = deque()
        self.size = 0  # bytes
        self.seconds = 0.0  # that snapshots have taken, of the process
        self._at: int | None = None  # number in the ring that the world was restored to; None: it is the present
        self._worked = time.process_time()
        self._cost = 0.0
        self._taken = 0

    def keep(self) -> None:
        """Take a snapshot if it is time for one; call it between two steps, once in a frame."""
        step = self.world.step_count
        if self._at is not None and step == self.ring[self._at].step:
            return
        self._forget_future(step)
        newest = self.ring[-1] if self.ring else None
        if newest is not None:
            every = max(EVERY, SPAN * newest.size / self.most)
            soon = (step - newest.step) * self.world.settings.dt < every
            if soon or SHARE * (time.process_time() - self._worked) < self._cost:
                return
        self._take()

    def _forget_future(self, step: int) -> None:
        self._at = None
        while self.ring and self.ring[-1].step >= step:
            self.size -= self.ring.pop().size

    def _take(self) -> None:
        began = time.process_time()
        snapshot = self.world.snapshot()
        fresh = self._taken % MEASURED == 0 or not self.ring
        kept = Kept(self.world.step_count, memory_of(snapshot) if fresh else self.ring[-1].size, snapshot)
        self._taken += 1
        self.ring.append(kept)
        self.size += kept.size
        while self.size > self.most and len(self.ring) > 1:
            self.size -= self.ring.popleft().size
        self._worked = time.process_time()
        self._cost = self._worked - began
        self.seconds += self._cost

    def back(self) -> bool:
        """Restore the snapshot before; False if there is none."""
        if self._at is None:
            step = self.world.step_count
            self._forget_future(step)
            self._take()  # the present, for the way forth
            self._at = len(self.ring) - 1
        return self._go(self._at - 1)

    def forth(self) -> bool:
        """Restore the snapshot after, as far as the world has come; False if there is none."""
        return self._at is not None and self._go(self._at + 1)

    def _go(self, number: int) -> bool:
        if not 0 <= number < len(self.ring):
            return False
        self.world.restore(self.ring[number].snapshot)
        self._at = number
        return True


def memory_of(thing: Any) -> int:
    """Bytes of the arrays in what a snapshot holds, and roughly of what is around them."""
    if isinstance(thing, np.ndarray):
        return thing.nbytes + 100
    if isinstance(thing, Snapshot):
        return sum(memory_of(getattr(thing, field.name)) for field in fields(thing) if field.name != "owner")
    if isinstance(thing, dict):
        return sys.getsizeof(thing) + sum(map(memory_of, thing.values()))
    if isinstance(thing, (list, tuple)):
        return sys.getsizeof(thing) + sum(map(memory_of, thing))
    if is_dataclass(thing) and not isinstance(thing, type):
        return sum(memory_of(getattr(thing, field.name)) for field in fields(thing))
    return 16

"""Where the arrays of array columns stand, and which of them are still in use."""

from __future__ import annotations

import hashlib
import weakref
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...errors import CaromError

ROOM = 64  # rows, and numbers, of a new pool
IN_FLIGHT = 16  # more than one component takes; for many at once there is ``kept``


class Pool:
    """Arrays (k, width), end to end in ``data``; number i is rows starts[i] to starts[i + 1].

    Equal arrays have one number, and no number is ever used for another array. When there is no room left, arrays that
    no holder has are forgotten, and the others move together in new memory: code that works with the old one, which
    stays as it is, may go on.
    """

    def __init__(self, width: int) -> None:
        self.data = np.empty((ROOM, width))
        self._starts, self._digests = np.zeros(ROOM + 1, np.int64), np.zeros(ROOM, np.int64)
        self._count = 1  # number 0 is empty: what rows hold that lack the component
        self._known: dict[bytes, int] = {}  # by a digest of the contents
        self._in_flight: deque[int] = deque(maxlen=IN_FLIGHT)  # given last: their holder may not be known yet
        self._replaced: list[tuple[Any, int, int]] = []  # table, step, number: what a failed step puts back
        self._paused = 0
        # What keeps numbers of arrays: ``numbers_in(pool)`` gives arrays of numbers, or single ones.
        self.holders: weakref.WeakSet[Any] = weakref.WeakSet()

    @property
    def starts(self) -> np.ndarray:
        return self._starts[: self._count + 1]

    @property
    def digests(self) -> np.ndarray:
        """Of the contents: hashes must not depend on their order of arrival."""
        return self._digests[: self._count]

    def number_of(self, array: np.ndarray) -> int:
        """The array's number, a new one if it is not here."""
        if not len(array):
            return 0
        array = array + 0.0  # 0.0 and -0.0 are the same
        digest = hashlib.sha256(array.tobytes()).digest()
        number = self._known.get(digest)
        if number is None:
            number = self._known[digest] = self._add(array, digest)
        self._in_flight.append(number)
        return number

    def array(self, number: int) -> np.ndarray:
        """A copy that cannot be written to; CaromError if it has been forgotten."""
        if number and self._starts[number] == self._starts[number + 1]:
            raise CaromError(f"array {number} is forgotten: what keeps its number must be among the pool's holders")
        array = self.data[self._starts[number] : self._starts[number + 1]].copy()
        array.flags.writeable = False
        return array

    def replaced(self, table: Any, number: int) -> None:
        """A step may still put this number back into the table."""
        self._replaced.append((weakref.ref(table), table.clock.step_count, number))

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Nothing is forgotten meanwhile."""
        self._paused += 1
        try:
            yield
        finally:
            self._paused -= 1

    def _add(self, array: np.ndarray, digest: bytes) -> int:
        if self._starts[self._count] + len(array) > len(self.data):
            if not self._paused:
                self._collect()
            self._reserve(int(self._starts[self._count]) + len(array))
        number, start = self._count, int(self._starts[self._count])
        if number == len(self._digests):
            self._starts = np.concatenate((self._starts, np.zeros(number, np.int64)))
            self._digests = np.concatenate((self._digests, np.zeros(number, np.int64)))
        self.data[start : start + len(array)] = array
        self._starts[number + 1] = start + len(array)
        self._digests[number] = int.from_bytes(digest[:8], "little", signed=True)
        self._count += 1
        return number

    def _reserve(self, rows: int) -> None:
        if rows > len(self.data):
            grown, used = np.empty((2 * rows, self.data.shape[1])), int(self._starts[self._count])
            grown[:used] = self.data[:used]
            self.data = grown

    def _collect(self) -> None:
        """Forget what has no holder."""
        live = np.zeros(self._count, bool)
        self._replaced = [entry for entry in self._replaced if _may_be_put_back(*entry)]
        live[[0, *self._in_flight, *(number for _, _, number in self._replaced)]] = True
        for holder in list(self.holders):
            for numbers in holder.numbers_in(self):
                known = np.atleast_1d(np.asarray(numbers, np.int64))
                live[known[(known > 0) & (known < self._count)]] = True
        lengths, used = np.diff(self.starts), int(self._starts[self._count])
        if lengths[~live].any():
            rows = np.repeat(live, lengths)
            lengths[~live] = 0
            data = np.empty((max(ROOM, 2 * int(lengths.sum())), self.data.shape[1]))
            data[: int(lengths.sum())] = self.data[:used][rows]
            starts = np.zeros_like(self._starts)
            np.cumsum(lengths, out=starts[1 : self._count + 1])
            self.data, self._starts = data, starts
            self._known = {digest: number for digest, number in self._known.items() if live[number]}


def _may_be_put_back(reference: Any, step: int, number: int) -> bool:
    """Whether that step of the table is still going on."""
    table = reference()
    return table is not None and table.in_step and table.clock.step_count == step


class Held:
    """Numbers of arrays that something outside of a table keeps, such as a snapshot, as long as this lives."""

    def __init__(self, numbers: dict[Pool, np.ndarray]) -> None:
        self._numbers = numbers
        for pool in numbers:
            pool.holders.add(self)

    def numbers_in(self, pool: Pool) -> Iterable[Any]:
        return (self._numbers[pool],)

    def __deepcopy__(self, memo: Any) -> Held:
        return self

    def __reduce__(self) -> Any:
        return Held, ({},)  # numbers mean nothing in another process

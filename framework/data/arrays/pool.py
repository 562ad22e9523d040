"""Where the arrays of array columns stand, and which of them are still in use."""

from __future__ import annotations

import hashlib
import weakref
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...errors import CaromError

ROOM = 64  # rows, and numbers, of a new pool
SPARE = 8  # times the room of an array that changes, so that few changes move the others
PART = 512  # rows that are digested at once: a change of one row digests no more
IN_FLIGHT = 16  # more than one component takes; for many at once there is ``kept``


class Pool:
    """Arrays (k, width), end to end in ``data``; number i is rows starts[i] to starts[i + 1].

    Equal arrays have one number, and no number is ever used for another array. When there is no room left, arrays that
    no holder has are forgotten, and the others move together in new memory: code that works with the old one, which
    stays as it is, may go on.

    leading
        how many of the first rows of an array the others follow from: only these are compared
    """

    def __init__(self, width: int, leading: Callable[[np.ndarray], int] = len) -> None:
        self.data = np.empty((ROOM, width))
        self._leading = leading
        self._starts, self._digests = np.zeros(ROOM + 1, np.int64), np.zeros(ROOM, np.int64)
        self._count = 1  # number 0 is empty: what rows hold that lack the component
        self._known: dict[bytes, int] = {}  # by a digest of the contents
        self._parts: dict[int, list[bytes]] = {}  # digests of the parts of arrays that have several
        self._in_flight: deque[int] = deque(maxlen=IN_FLIGHT)  # given last: their holder may not be known yet
        self._replaced: list[tuple[Any, int, int]] = []  # table, step, number: what a failed step puts back
        self._paused = 0
        # What keeps numbers of arrays: ``numbers_in(pool)`` gives arrays of numbers, or single ones.
        self.holders: weakref.WeakSet[Any] = weakref.WeakSet()

    @property
    def starts(self) -> np.ndarray:
        return self._starts[: self._count + 1]

    @property
    def all_starts(self) -> np.ndarray:
        """The same with room for more, so that it is another array in few cases only."""
        return self._starts

    @property
    def digests(self) -> np.ndarray:
        """Of the contents: hashes must not depend on their order of arrival."""
        return self._digests[: self._count]

    def number_of(self, array: np.ndarray) -> int:
        """The array's number, a new one if it is not here."""
        if not len(array):
            return 0
        array = array + 0.0  # 0.0 and -0.0 are the same
        parts = self._parts_of(array, range(0, self._leading(array), PART))
        number = self._known.get(_digest(parts))
        if number is None:
            self._place(len(array), 1)[...] = array
            number = self._add(len(array), parts)
        self._in_flight.append(number)
        return number

    def changed(self, number: int, write: Callable[[np.ndarray], Iterable[int]]) -> int:
        """The number of an array like that one, changed by ``write(array)``, which returns those of the leading rows
        that it wrote to. To be given to a holder at once.
        """
        start, stop = self._starts[number], self._starts[number + 1]
        place = self._place(int(stop - start), SPARE)
        start, stop = self._starts[number], self._starts[number + 1]  # it may have moved
        place[...] = self.data[start:stop]
        touched = sorted({row // PART for row in write(place)})
        parts = list(self._parts.get(number, (b"",)))
        for k, part in zip(touched, self._parts_of(place, [k * PART for k in touched]), strict=True):
            parts[k] = part
        known = self._known.get(_digest(parts))
        return self._add(len(place), parts) if known is None else known

    def _parts_of(self, array: np.ndarray, rows: Iterable[int]) -> list[bytes]:
        """The digests of the parts that begin with these rows."""
        last = self._leading(array)
        return [hashlib.sha256(array[row : min(row + PART, last)].tobytes()).digest() for row in rows]

    def array(self, number: int) -> np.ndarray:
        """A copy that cannot be written to; CaromError if it has been forgotten."""
        if number and self._starts[number] == self._starts[number + 1]:
            raise CaromError(f"array {number} is forgotten: what keeps its number must be among the pool's holders")
        array = self.data[self._starts[number] : self._starts[number + 1]].copy()
        array.flags.writeable = False
        return array

    def view(self, number: int) -> np.ndarray:
        """The array for reading at once: it is that array until others come."""
        view = self.data[self._starts[number] : self._starts[number + 1]]
        view.flags.writeable = False
        return view

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

    def _place(self, rows: int, spare: int) -> np.ndarray:
        """Where the next array stands, of that many rows; if it has to be made, there is room for ``spare`` of them."""
        if self._starts[self._count] + rows > len(self.data):
            if not self._paused:
                self._collect(spare * rows)
            self._reserve(int(self._starts[self._count]) + rows)
        start = int(self._starts[self._count])
        return self.data[start : start + rows]

    def _add(self, rows: int, parts: list[bytes]) -> int:
        """Number the array that has been written to its place."""
        number, digest = self._count, _digest(parts)
        if number == len(self._digests):
            self._starts = np.concatenate((self._starts, np.zeros(number, np.int64)))
            self._digests = np.concatenate((self._digests, np.zeros(number, np.int64)))
        self._starts[number + 1] = self._starts[number] + rows
        self._digests[number] = int.from_bytes(digest[:8], "little", signed=True)
        self._count += 1
        self._known[digest] = number
        if len(parts) > 1:
            self._parts[number] = parts
        return number

    def _reserve(self, rows: int) -> None:
        if rows > len(self.data):
            grown, used = np.empty((2 * rows, self.data.shape[1])), int(self._starts[self._count])
            grown[:used] = self.data[:used]
            self.data = grown

    def _collect(self, more: int) -> None:
        """Forget what has no holder; if there is any, there is room for so many rows more."""
        live = np.zeros(self._count, bool)
        self._replaced = [entry for entry in self._replaced if _may_be_put_back(*entry)]
        live[[0, *self._in_flight, *(number for _, _, number in self._replaced)]] = True
        for holder in list(self.holders):
            for numbers in holder.numbers_in(self):
                known = np.atleast_1d(np.asarray(numbers, np.int64))
                live[known[(known > 0) & (known < self._count)]] = True
        lengths = np.diff(self.starts)
        if lengths[~live].any():
            there = np.flatnonzero(lengths)
            edges = np.flatnonzero(np.diff(live[there].astype(np.int8), prepend=0, append=0))
            ends = np.append(self._starts[there], self._starts[self._count])[edges].reshape(-1, 2)
            lengths[~live] = 0
            kept, at = int(lengths.sum()), 0
            data = np.empty((max(ROOM, 2 * kept, kept + more), self.data.shape[1]))
            for start, stop in ends.tolist():  # arrays next to each other move as one
                data[at : at + stop - start] = self.data[start:stop]
                at += stop - start
            starts = np.zeros_like(self._starts)
            np.cumsum(lengths, out=starts[1 : self._count + 1])
            self.data, self._starts = data, starts
            self._known = {digest: number for digest, number in self._known.items() if live[number]}
            self._parts = {number: parts for number, parts in self._parts.items() if live[number]}


def _digest(parts: list[bytes]) -> bytes:
    """Of an array with these digests of its parts."""
    return parts[0] if len(parts) == 1 else hashlib.sha256(b"".join(parts)).digest()


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

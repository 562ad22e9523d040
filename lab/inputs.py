"""What a player held, recorded by time: a game plays it back with steps of any length."""

from __future__ import annotations

import math
import os
import weakref
from bisect import bisect_right
from collections.abc import Iterable
from numbers import Real
from pathlib import Path
from typing import Self

ROUNDING = 1e-9  # s: times are sums of steps

_read: dict[str, str] = {}  # the files that have been read: what is measured depends on them
_asked: weakref.WeakSet[Inputs] = weakref.WeakSet()  # those that a game has played back since forget_asked()


class Inputs:
    """Keys, or any words, by the second from which on they are held.

    changes: (time, "right jump") and so on, ascending by time. In a file each of them is a line, `1.25 right jump`.
    """

    def __init__(self, changes: Iterable[tuple[float, str]] = ()) -> None:
        self._times: list[float] = []
        self._held: list[frozenset[str]] = []
        for time, words in changes:
            self.record(time, words.split())

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """Inputs from a file; ValueError, with the line, for one that holds something else."""
        text = Path(path).read_text(encoding="utf-8")
        _read[str(path)] = text
        found = cls()
        for number, line in enumerate(text.splitlines(), 1):
            time, *words = line.split() or [""]
            try:
                if time:
                    found.record(float(time), words)
            except ValueError as error:
                raise ValueError(f"{path}, line {number}: {error}") from None
        return found

    def record(self, time: float, held: Iterable[str]) -> None:
        """Call it in each step with what is held then. ValueError for a time that is not finite, or before the last
        one, and for a key that is no single word; TypeError for what is no number, and keys that are no texts."""
        if not isinstance(time, Real):
            raise TypeError(f"time must be a number of seconds, got {time!r}")
        time = float(time)
        if not math.isfinite(time):
            raise ValueError(f"time must be a finite number of seconds, got {time!r}")
        if isinstance(held, str):
            raise TypeError(f"held must be all keys that are held, as {{{held!r}}}, got {held!r}")
        words = frozenset(held)
        for word in words:
            if not isinstance(word, str):
                raise TypeError(f"keys are texts, got {word!r}")
            if word.split() != [word]:
                raise ValueError(f"a key is one word, without spaces, got {word!r}")
        if self._times and time < self._times[-1]:
            raise ValueError(f"{time:g} s is before {self._times[-1]:g} s")
        if not self._held or words != self._held[-1]:
            self._times.append(time)
            self._held.append(words)

    def write(self, path: str | os.PathLike[str]) -> None:
        """A line for each change."""
        lines = [
            f"{time!r} {' '.join(sorted(held))}".rstrip() for time, held in zip(self._times, self._held, strict=True)
        ]
        Path(path).write_text("\n".join([*lines, ""]), encoding="utf-8")

    def held(self, time: float, dt: float = 0.0) -> frozenset[str]:
        """What is held at ``time``, or at any moment of the step that begins then: a longer step misses no key."""
        _asked.add(self)
        first = max(bisect_right(self._times, time + ROUNDING) - 1, 0)
        last = bisect_right(self._times, time + max(dt - ROUNDING, ROUNDING))
        if last == 0:
            return frozenset()
        return frozenset().union(*self._held[first:last])


def texts_read() -> str:
    """The contents of all files of inputs that have been read."""
    return "".join(_read[path] for path in sorted(_read))


def forget_asked() -> None:
    """Begin to note which inputs a game plays back."""
    _asked.clear()


def times_asked(seconds: float) -> tuple[float, ...]:
    """The times, after 0 and before ``seconds``, at which the inputs change that have been played back."""
    return tuple(sorted({time for inputs in _asked for time in inputs._times if ROUNDING < time < seconds - ROUNDING}))

"""The clock of all benchmarks, and what a series of measurements comes to."""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from ...framework.compilation import log

FINE = 1e-6  # s: a coarser clock cannot time a block of steps


def _choose() -> tuple[str, Callable[[], float]]:
    """Processor time where it is fine enough: what other programs do does not count then."""
    if time.get_clock_info("process_time").resolution <= FINE:
        return "processor time", time.process_time
    return "wall time", time.perf_counter


CLOCK, now = _choose()


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Python's collector of garbage stays off inside."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def timed(work: Callable[[], Any]) -> tuple[float, bool, Any]:
    """Seconds that ``work`` took, whether they count (not if a kernel was compiled or loaded), and its result."""
    waited = log.waited
    started = now()
    result = work()
    seconds = now() - started
    return seconds, log.waited == waited, result


@dataclass(frozen=True)
class Spread:
    """Several measurements of one thing: the median, the least and the largest, and all of them."""

    median: float
    low: float
    high: float
    values: tuple[float, ...]

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """Of at least one value."""
        return cls(statistics.median(values), min(values), max(values), tuple(values))

    @classmethod
    def from_dict(cls, plain: dict[str, Any]) -> Spread:
        """From what ``dataclasses.asdict`` and JSON made of one."""
        return cls(**{**plain, "values": tuple(plain["values"])})

"""The clock of all benchmarks, and summary statistics of repeated measurements."""

from __future__ import annotations

import gc
import statistics
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from ...framework import PhysicsWarning
from ...framework.compilation import log
from ..plain import JsonRecord

FINE = 1e-6  # s: a coarser clock cannot time a block of steps


def _choose() -> tuple[str, Callable[[], float]]:
    """Processor time if its resolution is fine enough: it excludes the time of other programs."""
    if time.get_clock_info("process_time").resolution <= FINE:
        return "processor time", time.process_time
    return "wall time", time.perf_counter


CLOCK, now = _choose()


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Switch Python's garbage collector off inside."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def timed(work: Callable[[], Any]) -> tuple[float, bool, Any]:
    """Seconds that ``work`` took, whether they are valid (no kernel was compiled or loaded), and its result."""
    waited = log.waited
    started = now()
    result = work()
    seconds = now() - started
    return seconds, log.waited == waited, result


@dataclass(frozen=True)
class Spread(JsonRecord):
    """Repeated measurements: the median, the least and the largest, and all values."""

    median: float
    low: float
    high: float
    values: tuple[float, ...]

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """From at least one value."""
        return cls(statistics.median(values), min(values), max(values), tuple(values))


@contextmanager
def faults_in_results() -> Iterator[None]:
    """No warnings of faults meanwhile; a decorator, too."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PhysicsWarning)
        yield

"""The clock of all measurements of time."""

from __future__ import annotations

import gc
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from ...framework import PhysicsWarning
from ...framework.compilation import log

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


def timed(work: Callable[[], Any], clock: Callable[[], float] = now) -> tuple[float, bool, Any]:
    """Seconds that ``work`` took, whether they are valid (no kernel was compiled or loaded), and its result."""
    waited = log.waited
    started = clock()
    result = work()
    seconds = clock() - started
    return seconds, log.waited == waited, result


@contextmanager
def faults_in_results() -> Iterator[None]:
    """No warnings of faults meanwhile; a decorator, too."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PhysicsWarning)
        yield

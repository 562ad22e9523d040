"""The clock of a trade: wall time per simulated second of each setting, one after the other and nothing beside it."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator, Sequence

from ..framework.compilation import log
from .bench_clock import Spread, no_garbage_collection
from .bench_progress import Progress
from .cases import Case
from .trade_records import Point
from .trade_tasks import engine_of

REPEATS = 5
BLOCKS = 20  # of a run


def time_points(case: Case, points: Sequence[Point], progress: Progress) -> None:
    """Fill in ``milliseconds`` of the points that did not fail altogether.

    Repeats go round over all points, each time from another one on, so that what disturbs the machine for a while
    does not meet one setting alone.
    """
    wanted = [point for point in points if point.errors]
    found: dict[int, list[float]] = {id(point): [] for point in wanted}
    progress.begin(REPEATS * len(wanted))
    progress.say(f"{case.subject.name}: timing, on one core")
    with _one_core(), no_garbage_collection():
        for repeat in range(REPEATS):
            first = repeat * len(wanted) // REPEATS
            for point in (*wanted[first:], *wanted[:first]):
                found[id(point)].append(1e3 * _seconds(case, point))
                progress.advance(1)
    for point in wanted:
        point.milliseconds = Spread.of(found[id(point)])


def _seconds(case: Case, point: Point) -> float:
    """Wall time per simulated second of a whole run: what it costs may change as things gather and come to rest."""
    engine = engine_of(case, point.cell, 0)
    dt = point.cell.dt
    try:
        left = max(int(case.seconds / dt), 1)
        block = max(left // BLOCKS, 1)
        steps, seconds = 0, 0.0
        while left:
            count = min(block, left)
            left -= count
            waited = log.waited
            started = time.perf_counter()
            engine.advance(count, dt)
            spent = time.perf_counter() - started
            if log.waited == waited or not (left or steps):  # else kernels were compiled or loaded meanwhile
                steps, seconds = steps + count, seconds + spent
        return seconds / (steps * dt)
    finally:
        engine.close()


@contextlib.contextmanager
def _one_core() -> Iterator[None]:
    """This process stays on one core, where the system can do that."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)

"""The clock of a trade: wall time per simulated second of each setting, one after the other and nothing beside it."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator, Sequence

from ...framework.compilation import log
from ..cases.case import Case
from ..jobs.tasks import engine_of
from ..measure.timing import Spread, no_garbage_collection
from ..reporting.progress_bar import Progress
from .records import Point

REPEATS = 5  # at most, of a run
ENOUGH = 1.0  # s of one setting: long runs are not repeated
BLOCKS = 20  # of a run, dealt out to PARTS that each see all of it: as many measurements
PARTS = 5


def time_points(case: Case, points: Sequence[Point], progress: Progress) -> None:
    """Fill in ``milliseconds`` of the points that did not fail altogether.

    Repeats go round over all points, each time from another one on, so that what disturbs the machine for a while
    does not meet one setting alone.
    """
    wanted = [point for point in points if point.errors]
    found: dict[int, list[float]] = {id(point): [] for point in wanted}
    spent = dict.fromkeys(found, 0.0)
    progress.begin(REPEATS * len(wanted))
    progress.say(f"{case.subject.name}: timing, on one core")
    with _one_core(), no_garbage_collection():
        for repeat in range(REPEATS):
            first = repeat * len(wanted) // REPEATS
            for point in (*wanted[first:], *wanted[:first]):
                if spent[id(point)] < ENOUGH:
                    parts = _parts(case, point)
                    found[id(point)] += [1e3 * seconds / (steps * point.cell.dt) for seconds, steps in parts if steps]
                    spent[id(point)] += sum(seconds for seconds, _ in parts)
                progress.advance(1)
    for point in wanted:
        point.milliseconds = Spread.of(found[id(point)])


def _parts(case: Case, point: Point) -> list[tuple[float, int]]:
    """Seconds and steps of each part of a whole run: what steps cost may change as things gather and come to rest."""
    engine = engine_of(case, point.cell, 0)
    dt = point.cell.dt
    seconds, steps = [0.0] * PARTS, [0] * PARTS
    try:
        left = max(int(case.seconds / dt), 1)
        block, part = max(left // BLOCKS, 1), 0
        while left:
            count = min(block, left)
            left -= count
            waited = log.waited
            started = time.perf_counter()
            engine.advance(count, dt)
            took = time.perf_counter() - started
            if log.waited == waited or not (left or any(steps)):  # else kernels were compiled or loaded meanwhile
                seconds[part] += took
                steps[part] += count
                part = (part + 1) % PARTS
        return list(zip(seconds, steps, strict=True))
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

"""The clock of a trade: wall time per simulated second of each setting, measured one after the other on one core."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator, Sequence

from ...framework.compilation import log
from ..cases.case import Case
from ..jobs.tasks import engine_of
from ..measure.timing import Spread, no_garbage_collection
from ..reporting.progress import Progress
from .records import Point

REPEATS = 5  # of a run, at most
ENOUGH = 1.0  # s for one setting: longer runs are not repeated
BLOCKS = 20  # of a run, distributed over PARTS that each sample the whole run, one measurement per part
PARTS = 5


def time_points(case: Case, points: Sequence[Point], progress: Progress) -> None:
    """Fill in ``milliseconds`` of the points that did not fail in all repeats.

    Each repeat covers all points, starting with a different one, so that background load affects all settings.
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
    """Seconds and steps of each part of a whole run: the cost of a step may change as bodies gather and come to
    rest."""
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
            if log.waited == waited or not (left or any(steps)):  # otherwise kernels were compiled or loaded meanwhile
                seconds[part] += took
                steps[part] += count
                part = (part + 1) % PARTS
        return list(zip(seconds, steps, strict=True))
    finally:
        engine.close()


@contextlib.contextmanager
def _one_core() -> Iterator[None]:
    """Keep this process on one core, if the system supports it."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)

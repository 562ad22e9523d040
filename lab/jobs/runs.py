"""Runs tasks on all cores, within the time there is, and keeps their results, so that no run is repeated."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import statistics
import time
import weakref
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Sequence
from typing import Any

from ..cases.case import Case
from ..cli.usage_errors import Problem
from ..engines.cost import work_of
from ..measure.effects import at_worst, effects_of
from ..measure.norms import NORMS, OF_KIND, conserves, errors_of, failure_of, norm_of
from ..measure.observation import Seen, mean_of
from ..measure.timing import Spread
from ..reporting.progress import NO_PROGRESS, Progress
from ..trading.records import CHAOTIC, CUT, Cell, ErrorBar, Point, Reference
from .result_store import Store
from .tasks import Task, perform, stopped
from .workers import Lost, Pool, in_parallel

FEW_SECONDS = 4.0  # of work in all: less takes not much longer than starting workers
PACE = 1e-4  # s per step, until runs have shown a better figure
WORTH_IT = 4.0  # required improvement of the agreement with steps 8 times smaller; less is rounding or chance


OUT_OF_TIME, STOPPED = "time is up", "stopped"


class OutOfTimeError(Exception):
    """The budget is spent, or the user has stopped the study; what is finished is kept."""


class Runs:
    """Performs tasks with ``workers`` processes, or those of a Pool; finished runs are kept in the store.

    until
        on ``time.monotonic``: afterwards nothing runs, and :meth:`all` raises OutOfTimeError; so it does after Ctrl-C
        if the study is ``stoppable``, and the reason is in ``stopped``
    listener
        called after each finished run
    """

    def __init__(
        self, workers: int | Pool | None = None, store: Store | None = None, progress: Progress = NO_PROGRESS,
        until: float = math.inf, stoppable: bool = False,
    ) -> None:  # fmt: skip
        self._pool = workers if isinstance(workers, Pool) else Pool()
        if isinstance(workers, Pool):
            workers = max(getattr(workers, "size", 0), 2)
        if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
            raise ValueError(f"workers must be a whole number from 1, got {workers!r}")
        self.workers, self.progress, self.until, self.stoppable = workers, progress, until, stoppable
        self.listener: Callable[[], None] | None = None
        self.stopped = ""
        self._store = Store() if store is None else store
        self._pace = PACE
        self._spent = self._steps = 0.0
        weakref.finalize(self, self._pool.end)

    def get(self, task: Task) -> Seen | None:
        """What a task showed that has been performed, or None."""
        record = self._store.get(task.key)
        return None if record is None else Seen.from_dict(record)

    def all(self, tasks: Iterable[Task], what: str) -> list[Seen]:
        """What all tasks showed, in order. OutOfTimeError if time is up before all are finished."""
        tasks = list(tasks)
        until = self.until - time.monotonic() + time.time()
        missing = [dataclasses.replace(task, until=until) for task in self._missing(tasks)]
        total = sum(task.cost for task in tasks)
        left = sum(task.cost for task in missing)
        self.progress.begin(total, total - left)
        self.progress.say(what)
        if self.until == math.inf:
            missing.sort(key=lambda task: -task.cost)  # longest first, so that no core is idle at the end
        few = left * self._pace < FEW_SECONDS
        if missing and (self.stopped or time.monotonic() > self.until):
            self._stop("")
        began = time.monotonic()
        try:
            with contextlib.closing(self._results(missing, few)) as results:
                for task, record in results:
                    self._keep(task, _lost(task, record) if isinstance(record, Lost) else record)
        except TimeoutError:
            self._stop("")
        except KeyboardInterrupt:
            if not self.stoppable:
                raise
            self._stop(STOPPED)
        finally:
            self._spent += time.monotonic() - began
        return [seen for task in tasks if (seen := self.get(task)) is not None]

    def _results(self, tasks: Sequence[Task], few: bool) -> Generator[tuple[Task, Any], None, None]:
        return in_parallel(perform, tasks, 1 if few else self.workers, self._pool, self.until)

    def seconds_for(self, tasks: Iterable[Task]) -> float:
        """About how long those that are missing will take, by the time that others took; inf if none has finished."""
        if not self._steps:
            return math.inf
        return sum(task.cost for task in self._missing(tasks)) * self._spent / self._steps

    def _missing(self, tasks: Iterable[Task]) -> list[Task]:
        return [task for task in tasks if task.key not in self._store]

    def each(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> list[Any]:
        """The function's result for each task, in order. Problem for one that ends its process."""
        tasks = list(tasks)
        found: dict[int, Any] = {}
        with contextlib.closing(in_parallel(function, tasks, self.workers, self._pool)) as results:
            for task, result in results:
                if isinstance(result, Lost):
                    raise Problem(f"a trial run was lost: {result.reason}")
                found[id(task)] = result
        return [found[id(task)] for task in tasks]

    def _stop(self, why: str) -> None:
        self.stopped = self.stopped or why or OUT_OF_TIME
        raise OutOfTimeError(self.stopped)

    def _keep(self, task: Task, record: dict) -> None:
        if record["failure"] == CUT:
            self._stop("")
        self._steps += task.cost
        self._store.add(task.key, record)
        self.progress.advance(task.cost)
        if record["milliseconds"]:
            self._pace = max(1e-3 * record["milliseconds"] * task.cell.dt + PACE, PACE)
        if self.listener is not None:
            self.listener()


def _lost(task: Task, lost: Lost) -> dict:
    """The record of a run whose process died twice: a failed run. Problem if it is a reference."""
    if task.reference:
        raise Problem(f"{task.case.subject.name}: the reference run with {task.cell} was lost: {lost.reason}")
    return stopped(task, lost.reason).as_dict()


def with_reference(case: Case, runs: Runs) -> tuple[Case, Reference]:
    """The case with its reference: a closed form, or two own runs and the difference between them."""
    if case.reference is not None:
        return case, Reference(f"closed form: {case.form}" if case.kind != "resting" else case.form)
    tasks = reference_tasks(case)
    seens = runs.all(tasks, f"{case.subject.name}: references")
    both = zip(tasks, seens, strict=True)
    failed = [f"the run with {task.cell} {seen.failure}" for task, seen in both if seen.failure]
    if case.kind == CHAOTIC:
        half = len(seens) // 2
        one, other = ([seen for seen in some if not seen.failure] for some in (seens[:half], seens[half:]))
        if not (one and other):
            raise Problem(f"{case.subject.name} has no reference: {failed[0]}")
        return _with_statistics(case, one, other)
    seens = [seen for seen in seens if not seen.failure]
    if len(seens) < 2:
        raise Problem(f"{case.subject.name} has no reference: {failed[0]}")
    first, *others = seens
    case = _with_usable_norms(case, first)
    names = (*NORMS, *case.norms)
    apart = [errors_of(other, first, names) for other in others]
    agreement = {name: max(abs(errors[name]) for errors in apart) for name in names}
    if conserves(first):
        agreement["energy"] = 0.0  # a conserved energy is known without a reference
    a, b, _ = case.reference_cells
    text = f"own runs with {_words(a)} and with {_words(b)}, steps of {a.dt:.3g} s, and twice that"
    return case.replace(reference=first), Reference(text, {n: agreement[n] for n in case.norms})


def refined_reference(
    case: Case, runs: Runs, enough: Callable[[Case, Reference], bool]
) -> tuple[Case, Reference, bool]:
    """The case with its reference, refined with smaller steps until it is ``enough`` or no longer improves; and whether
    it is enough."""
    before, case = math.inf, case.coarse_reference()
    with_own, reference = with_reference(case, runs)
    while True:
        if enough(with_own, reference):
            return with_own, reference, True
        agreement = reference.agreement.get(case.norms[0], 0.0)
        finer = case.finer_reference() if agreement < before / WORTH_IT else None
        if finer is None:
            return with_own, reference, False
        before, case = agreement, finer
        try:
            with_own, reference = with_reference(case, runs)
        except OutOfTimeError:
            return with_own, reference, False


def reference_tasks(case: Case) -> list[Task]:
    """The tasks of the first method, then as many of the second."""
    repeats = case.ensemble if case.kind == CHAOTIC else 1
    return [Task(case, cell, repeat, True) for cell in case.reference_cells for repeat in range(repeats)]


def _with_statistics(case: Case, one: list[Seen], other: list[Seen]) -> tuple[Case, Reference]:
    """The case with two ensembles as reference: if both are right, their means differ only by noise."""
    signed = [name for name, norm in NORMS.items() if norm.signed]
    seens, means = [*one, *other], (mean_of(one, signed), mean_of(other, signed))
    both = mean_of(seens, signed)
    case = _with_usable_norms(case, both)
    agreement, spread = {}, {}
    for name in case.norms:
        norm = norm_of(name)
        values = [norm.measure(seen, both) for seen in seens]
        agreement[name] = max(abs(norm.measure(mean, both)) for mean in means)
        if norm.signed:
            bar = ErrorBar.of(values, signed=True)
            agreement[name] = max(agreement[name], bar.uncertainty)
            spread[name] = bar.uncertainty * len(values) ** 0.5
    a, b = case.reference_cells
    text = (
        f"statistics of {len(one)} own runs with {_words(a)} and of {len(other)} with {_words(b)}, other seeds, steps "
        f"of {a.dt:.3g} s"
    )
    return case.replace(reference=both), Reference(text, agreement, spread)


def _with_usable_norms(case: Case, reference: Seen) -> Case:
    """The case with the norms that can be computed from the reference; Problem if there are none."""
    usable = tuple(name for name in case.norms if norm_of(name).is_usable_with(reference))
    if not usable:
        others = ", ".join(name for name in OF_KIND[case.kind] if NORMS[name].is_usable_with(reference))
        raise Problem(
            f"{case.subject.name}: {' and '.join(case.norms)} {'are' if len(case.norms) > 1 else 'is'} 0 throughout, "
            f"nothing can be relative to that; what can be measured here: {others}"
        )
    return case.replace(norms=usable)


def _words(cell: Cell) -> str:
    return cell.collision if cell.collision == "event_driven" else f"{cell.integrator}, {cell.collision}"


def run_tasks(case: Case, cells: Iterable[Cell]) -> list[Task]:
    """One task for every repeat of every cell."""
    return [Task(case, cell, repeat) for cell in cells for repeat in range(case.repeats)]


def known_points(case: Case, cells: Iterable[Cell], runs: Runs) -> list[Point]:
    """The points of the cells of which there are finished runs, over those repeats."""
    if case.reference is None:
        return []
    seens = {cell: [seen for task in run_tasks(case, [cell]) if (seen := runs.get(task)) is not None] for cell in cells}
    return [point_of(case, cell, found) for cell, found in seens.items() if found]


def points_of(case: Case, cells: Sequence[Cell], runs: Runs, what: str) -> list[Point]:
    """The points of all cells, over all repeats."""
    runs.all(run_tasks(case, cells), what)
    return known_points(case, cells, runs)


def point_of(case: Case, cell: Cell, seens: Sequence[Seen]) -> Point:
    """The point of one cell from what its repeats showed, against the reference of the case."""
    reference = case.reference
    assert reference is not None
    failures = [failure_of(seen, None if case.kind == CHAOTIC else reference) for seen in seens]
    good = [seen for seen, failure in zip(seens, failures, strict=True) if failure is None]
    found = [errors_of(seen, reference, {**NORMS, **dict.fromkeys(case.norms)}) for seen in good]
    errors = {
        name: ErrorBar.of([errors[name] for errors in found], norm_of(name).signed) for name in (found or [{}])[0]
    }
    known = [seen for seen in seens if seen.counts]
    counts = {
        name: statistics.fmean(seen.counts.get(name, 0.0) / (seen.simulated or seen.seconds) for seen in known)
        for name in (known[0].counts if known else ())
    }
    timed = [seen.milliseconds for seen in good if seen.milliseconds is not None]
    return Point(
        cell, len(seens), errors, dict(Counter(filter(None, failures))), counts, work_of(counts),
        Spread.of(timed) if timed else None, at_worst([effects_of(seen, reference, case.kind) for seen in good]),
    )  # fmt: skip

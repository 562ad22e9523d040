"""Runs tasks on all cores and keeps their results, so that no run is repeated."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Callable, Iterable
from typing import Any

from ..cases.case import Case
from ..commands.usage_errors import Problem
from ..engines.cost import work_of
from ..measure.norms import NORMS, OF_KIND, conserves, errors_of
from ..measure.observation import Seen
from ..reporting.progress import NO_PROGRESS, Progress
from ..trading.records import CHAOTIC, STOPPED, Cell, ErrorBar, Outcome, Point, Reference
from .result_store import Store
from .tasks import Task, mean_of, perform
from .workers import Lost, in_parallel

FEW_STEPS = 20_000  # in total: fewer take less time than starting workers
WORTH_IT = 4.0  # required improvement of the agreement with steps 8 times smaller; less is rounding or chance
ENSEMBLE = 40  # runs of each of the two own references of a chaotic scene


class Runs:
    """Performs tasks with ``workers`` processes; a store keeps the results if the command is interrupted."""

    def __init__(
        self, workers: int | None = None, store: Store | None = None, progress: Progress = NO_PROGRESS
    ) -> None:
        if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
            raise ValueError(f"workers must be a whole number from 1, got {workers!r}")
        self.workers, self.progress = workers, progress
        self._store = Store() if store is None else store
        self.performed = 0

    def get(self, task: Task) -> dict[str, Any] | None:
        """The record of a task already performed, or None."""
        return self._store.get(task.key)

    def all(self, tasks: Iterable[Task], what: str) -> list[dict[str, Any]]:
        """The records of all tasks, in order."""
        tasks = list(tasks)
        missing = [task for task in tasks if self.get(task) is None]
        total = sum(task.cost for task in tasks)
        self.progress.begin(total, total - sum(task.cost for task in missing))
        self.progress.say(what)
        missing.sort(key=lambda task: -task.cost)  # longest first, so that no core is idle at the end
        few = sum(task.cost for task in missing) < FEW_STEPS
        with contextlib.closing(in_parallel(perform, missing, 1 if few else self.workers)) as results:
            for task, record in results:
                self._keep(task, _lost(task, record) if isinstance(record, Lost) else record)
                self.progress.advance(task.cost)
        return [self.get(task) or {} for task in tasks]

    def _keep(self, task: Task, record: dict[str, Any]) -> None:
        self.performed += 1
        self._store.add(task.key, record)


def _lost(task: Task, lost: Lost) -> dict[str, Any]:
    """The record of a run whose process died twice: a failed run. Problem if it is a reference."""
    if task.reference:
        raise Problem(f"{task.case.subject.name}: the reference run with {task.cell} was lost: {lost.reason}")
    return dataclasses.asdict(Outcome(task.cell, task.repeat, {}, STOPPED, {}, task.case.seconds, lost.reason))


def with_reference(case: Case, runs: Runs) -> tuple[Case, Reference]:
    """The case with its reference: a closed form, or two own runs and the difference between them."""
    if case.reference is not None:
        return case, Reference(f"closed form: {case.form}" if case.kind != "resting" else case.form)
    tasks = reference_tasks(case)
    seens = [Seen.from_dict(record) for record in runs.all(tasks, f"{case.subject.name}: references")]
    half = len(seens) // 2
    for task, seen in zip(tasks, seens, strict=True):
        if seen.failure:
            raise Problem(
                f"{case.subject.name} has no reference: the run with {task.cell} failed: {seen.failure}"
            )
    if case.kind == CHAOTIC:
        return _with_statistics(case, seens, half)
    first, *others = seens
    case = _with_usable_norms(case, first)
    apart = [errors_of(other, first, NORMS) for other in others]
    agreement = {name: max(abs(errors[name]) for errors in apart) for name in NORMS}
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
    while True:
        with_own, reference = with_reference(case, runs)
        if enough(with_own, reference):
            return with_own, reference, True
        agreement = reference.agreement.get(case.norms[0], 0.0)
        finer = case.finer_reference() if agreement < before / WORTH_IT else None
        if finer is None:
            return with_own, reference, False
        before, case = agreement, finer


def reference_tasks(case: Case) -> list[Task]:
    """The tasks of the first method, then as many of the second."""
    repeats = ENSEMBLE if case.kind == CHAOTIC else 1
    return [Task(case, cell, repeat, True) for cell in case.reference_cells for repeat in range(repeats)]


def _with_statistics(case: Case, seens: list[Seen], half: int) -> tuple[Case, Reference]:
    """The case with two ensembles as reference: if both are right, their means differ only by noise."""
    means = mean_of(seens[:half]), mean_of(seens[half:])
    both = mean_of(seens)
    case = _with_usable_norms(case, both)
    agreement, spread = {}, {}
    for name in case.norms:
        values = [NORMS[name].measure(seen, both) for seen in seens]
        agreement[name] = max(abs(NORMS[name].measure(mean, both)) for mean in means)
        if NORMS[name].signed:
            bar = ErrorBar.of(values, signed=True)
            agreement[name] = max(agreement[name], bar.uncertainty)
            spread[name] = bar.uncertainty * len(values) ** 0.5
    a, b = case.reference_cells
    text = (
        f"statistics of {half} own runs with {_words(a)} and of {half} with {_words(b)}, other seeds, steps of "
        f"{a.dt:.3g} s"
    )
    return case.replace(reference=both), Reference(text, agreement, spread)


def _with_usable_norms(case: Case, reference: Seen) -> Case:
    """The case with the norms that can be computed from the reference; Problem if there are none."""
    usable = tuple(name for name in case.norms if NORMS[name].is_usable_with(reference))
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


def point_of(outcomes: list[Outcome]) -> Point:
    """The point of one cell, from its repeats."""
    good = [outcome for outcome in outcomes if outcome.failure is None]
    failures: dict[str, int] = {}
    for outcome in outcomes:
        if outcome.failure is not None:
            failures[outcome.failure] = failures.get(outcome.failure, 0) + 1
    names = list(good[0].errors) if good else []
    errors = {
        name: ErrorBar.of([outcome.errors[name] for outcome in good], NORMS[name].signed) for name in names
    }
    counted = [outcome for outcome in outcomes if outcome.counts]
    counts = {
        name: sum(outcome.counts.get(name, 0.0) / outcome.seconds for outcome in counted) / len(counted)
        for name in (counted[0].counts if counted else ())
    }
    return Point(outcomes[0].cell, len(outcomes), errors, failures, counts, work_of(counts))


"""Runs of tasks on all cores, whose results are kept, and what they show: references and points of the grid."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import math
import os
import sqlite3
import statistics
import weakref
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

from ..cases.case import Case
from ..cli.usage_errors import Problem, one_line
from ..engines.adapters import work_of
from ..measure.effects import at_worst, effects_of
from ..measure.norms import NORMS, OF_KIND, conserves, distances, errors_of, failure_of, norm_of
from ..measure.observation import Seen, mean_of
from ..measure.timing import Spread
from ..reporting.progress import NO_PROGRESS, Progress
from ..trading.records import CHAOTIC, Cell, ErrorBar, Point, Reference
from .tasks import Task, perform, stopped
from .workers import Lost, Workers, in_parallel

FEW_SECONDS = 4.0  # of work in all: less takes not much longer than starting workers
WORTH_IT = 4.0  # required improvement of the agreement with steps 8 times smaller; less is rounding or chance


class Runs:
    """Performs tasks with so many processes (None: all cores), or with those of Workers; finished runs are kept in the
    store."""

    def __init__(
        self, workers: int | Workers | None = None, store: Store | None = None, progress: Progress = NO_PROGRESS
    ) -> None:
        self.workers = workers if isinstance(workers, Workers) else Workers(workers)
        self.progress = progress
        self._store = Store() if store is None else store
        weakref.finalize(self, self.workers.end)

    def all(self, tasks: Iterable[Task], what: str) -> list[Seen]:
        """What all tasks showed, in order; those of which the store has the result are not run."""
        tasks = list(tasks)
        missing = [task for key, task in {task.key: task for task in tasks}.items() if key not in self._store]
        total, left = (sum(task.steps for task in some) for some in (tasks, missing))
        self.progress.begin(total, total - left)
        self.progress.say(what)
        missing.sort(key=lambda task: -task.steps)  # longest first, so that no core is idle at the end
        few = sum(task.case.seconds_of(task.cell) for task in missing) < FEW_SECONDS
        with contextlib.closing(in_parallel(perform, missing, 1 if few else self.workers)) as results:
            for task, record in results:
                self._store.add(task.key, _lost(task, record) if isinstance(record, Lost) else record)
                self.progress.advance(task.steps)
        return [Seen.from_dict(self._store.get(task.key) or {}) for task in tasks]

    def each(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> list[Any]:
        """The function's result for each task, in order. Problem for one that ends its process."""
        tasks = list(tasks)
        found: dict[int, Any] = {}
        with contextlib.closing(in_parallel(function, tasks, self.workers)) as results:
            for task, result in results:
                if isinstance(result, Lost):
                    raise Problem(f"a trial run was lost: {result.reason}")
                found[id(task)] = result
        return [found[id(task)] for task in tasks]


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
    first = dataclasses.replace(first, doubt=max(float(distances(one, first)[0].max(initial=0.0)) for one in others))
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
        with_own, reference = with_reference(case, runs)


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


def measure(case: Case, cells: Iterable[Cell], runs: Runs, bare: bool = False) -> list[Point]:
    """The points of the cells over all repeats of the case, which has its reference; bare: timed without observation
    too."""
    cells, repeats = list(cells), range(case.repeats)
    tasks = [Task(case, cell, repeat, bare=bare and not repeat) for repeat in repeats for cell in cells]
    seens = runs.all(tasks, f"{case.subject.name}: {len(cells)} settings, {case.repeats_text}")
    return [point_of(case, cell, seens[number :: len(cells)]) for number, cell in enumerate(cells)]


def inputs_late(case: Case, cell: Cell, runs: Runs) -> dict[str, float]:
    """The effects of inputs that act in whole steps, as in the game, against the same runs in which they act in time;
    none if there are no inputs, or if a run failed."""
    if not case.survey.inputs or case.kind == CHAOTIC:
        return {}
    tasks = [Task(case, cell, repeat, sampled=sampled) for sampled in (False, True) for repeat in range(case.repeats)]
    seens = runs.all(tasks, f"{case.subject.name}: inputs in whole steps")
    pairs = zip(seens[: case.repeats], seens[case.repeats :], strict=True)
    good = [(right, late) for right, late in pairs if not (right.failure or late.failure)]
    return at_worst([effects_of(late, right, case.kind) for right, late in good])


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


# -- finished runs ---------------------------------------------------------------------------------------


PATIENCE = 30.0  # s to wait for another process that writes


class Store:
    """The finished runs in one file, by key; several processes may use it. A context manager.

    A record is a mapping that can be written as JSON (with NaN and infinity); it is returned as read from JSON: tuples
    become lists, keys become strings. path None: in memory. Problem for a file that is no store, and where none can be.
    """

    def __init__(self, path: str | os.PathLike[str] | None = None) -> None:
        self.path = None if path is None else Path(path)
        with self._problems():
            if self.path is not None:
                self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = sqlite3.connect(self.path or ":memory:", timeout=PATIENCE, isolation_level=None)
            self._file.execute("create table if not exists runs (key text primary key, record text not null)")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def __len__(self) -> int:
        return self._file.execute("select count(*) from runs").fetchone()[0]

    def __contains__(self, key: str) -> bool:
        return self._file.execute("select 1 from runs where key = ?", (key,)).fetchone() is not None

    def get(self, key: str) -> dict[str, Any] | None:
        """The record of that run; None if the run is not finished."""
        found = self._file.execute("select record from runs where key = ?", (key,)).fetchone()
        return None if found is None else json.loads(found[0])

    def add(self, key: str, record: Mapping[str, Any]) -> None:
        """Keep a record; it is in the file when this returns. Another record of that key is replaced."""
        with self._problems():
            self._file.execute("insert or replace into runs values (?, ?)", (key, json.dumps(record)))

    @contextmanager
    def _problems(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, OSError) as error:
            raise Problem(f"results cannot be kept in {str(self.path)!r}: {one_line(error)}") from error

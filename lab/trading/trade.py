"""``trade()``: the trade-off between speed and accuracy, measured over a grid of settings."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..bench.results import machine
from ..cases import grid as grids
from ..cases.case import EFFORTS, Case, case_of, check_arguments
from ..cases.subjects import subject_of
from ..cli.usage_errors import Problem
from ..jobs.result_store import Store
from ..jobs.runs import (
    OUT_OF_TIME,
    OutOfTimeError,
    Runs,
    known_points,
    reference_tasks,
    refined_reference,
    run_tasks,
)
from ..jobs.tasks import Task, bare_cost, engine_of
from ..jobs.workers import Pool
from ..measure.norms import NORMS, check_norm, norm_of
from ..measure.timing import CLOCK, Spread
from ..reporting.progress import NO_PROGRESS, Progress
from ..wording import counted
from .answer import clearly_worse, front
from .code_line import python_line
from .records import CAROM, CHAOTIC, PYMUNK, CaseTrade, Cell, Curve, Point, Reference, Trade, by_method, observed_order

ROUNDING = 1e-12  # smaller errors are rounding, which has no order
SURE = 1e-10  # a reference with a better agreement needs no refinement
SMALL = 0.1  # relative errors above this are too large for asymptotic orders
CLEAR = 4.0  # a statistic's error must exceed its own noise by this factor to count for the order
ASYMPTOTIC = 4  # number of finest points used for the order
RUNNING, TIMING = 0.86, 0.95  # of the budget; until then runs, and timing what is told of again; then tables and charts
TURNS, MOST_TIMED = 3, 6  # of the settings timed again
FIRST_LOOK = 4.0  # s: then what is known is shown, if something is

TRIAL = Reference("a first run with all impacts at their true times")

Show = Callable[[CaseTrade], None]


@dataclass(frozen=True)
class Only:
    """The requested part of the grid; empty: all that matters in the scene. TypeError for a name instead of several."""

    integrators: tuple[str, ...] = ()
    collisions: tuple[str, ...] = ()
    substeps: tuple[int, ...] = ()
    geometries: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            if isinstance(getattr(self, field.name), (str, int)):
                raise TypeError(f"Only.{field.name} must be a sequence, got {getattr(self, field.name)!r}")

    def of(self, case: Case) -> tuple[Cell, ...]:
        """The methods of the case; a named field is varied even without effect. Problem if there is none."""
        found = grids.methods(case.survey)
        fields = {
            "integrator": self.integrators,
            "collision": self.collisions,
            "substeps": self.substeps,
            "geometry": self.geometries,
        }
        for field, wanted in fields.items():
            if wanted:
                found = tuple(dataclasses.replace(cell, **{field: value}) for cell in found for value in wanted)
        if self != Only():
            for cell in found:
                case.subject.world(cell.settings(case.survey.settings)).close()  # raises for unknown names
        return tuple(dict.fromkeys(grids.with_own_flight(cell) for cell in found))


def trade(
    *targets: Any,
    norms: Sequence[str] = (),
    seconds: float | None = None,
    repeats: int | None = None,
    steps: Sequence[float] = (),
    only: Only | None = None,
    against_pymunk: bool = False,
    timing: bool = True,
    options: Mapping[str, Any] | None = None,
    seed: int = 0,
    budget: float | None = None,
    workers: int | Pool | None = None,
    store: Store | None = None,
    progress: Progress = NO_PROGRESS,
    command: str = "",
    show: Show | None = None,
) -> Trade:
    """Measure work and error of every setting that matters in each scene.

    targets: names of scenes, files, or functions build(settings, seed=0) -> World. norms: the first is the main one;
    seconds of each run; repeats of each setting (start phases, or seeds of chaotic scenes); steps s. Values not given
    follow from the scene. budget: s for all together, spent on more and more exact looks; None: as long as it takes.
    workers: processes at most, None for all cores (small amounts of work use none), or a Cluster; store: finished runs,
    to be continued. show: called with what is known of a scene, first after FIRST_LOOK s or earlier; then Ctrl-C ends
    the study with what is known. Of several scenes, one that cannot be measured is in the result with the reason.
    ValueError or Problem for wrong arguments, and for a single scene that cannot be measured.
    """
    check_arguments(norms, seconds, repeats, steps)
    subjects = [subject_of(target, options, seed) for target in targets]
    for name in norms:
        check_norm(name, () if name in NORMS else [own for subject in subjects for own in subject.names])
    began = time.monotonic()
    runs = Runs(workers, store, progress, stoppable=show is not None)
    result = Trade({**machine(), "clock": CLOCK}, command, [])
    for number, target in enumerate(targets, 1):
        name = target if isinstance(target, str) else getattr(target, "__name__", "scene")
        if budget is not None:
            runs.until = began + RUNNING * budget * number / len(targets)
        if runs.stopped not in ("", OUT_OF_TIME):
            break
        runs.stopped = ""
        progress.say(f"{name}: survey")
        try:
            case = case_of(
                target, norms=norms, seconds=seconds, repeats=repeats, steps=steps, options=options, seed=seed,
                each=runs.each,
            )  # fmt: skip
            study = Study(case, only or Only(), against_pymunk, timing, runs, show, began)
            result.cases.append(study.measured(range(EFFORTS) if budget is not None else (EFFORTS - 1,)))
        except Problem as problem:
            if len(targets) == 1:
                raise
            result.cases.append(_refused(name, problem.message))
        result.stopped = runs.stopped
    return result


class Study:
    """One scene: its references and its grid, measured with more and more effort."""

    def __init__(
        self, case: Case, only: Only, against_pymunk: bool, timing: bool, runs: Runs, show: Show | None, began: float
    ) -> None:
        self.whole, self.timing, self.runs, self.show = case, timing, runs, show
        self.curves = only.of(case)
        peers = grids.peer_methods() if against_pymunk else ()
        if peers:
            engine_of(case, dataclasses.replace(peers[0], dt=case.steps[0]), 0).close()  # raises, with the reason
        self.curves += peers
        self.own = Cell.of(case.survey.settings)
        self.began = began
        self.costs: dict[Cell, float] = {}  # ms per simulated second, timed again
        self.cells = self._nearest()
        self.looked, self.needed = False, 0.0
        self.rough = case.reference is None  # until there is a better one than the trial run
        self.case, self.reference = case.at(0), Reference(f"closed form: {case.form}")
        if self.rough:
            self.case = self.case.replace(reference=case.survey.trial)
            self.reference = TRIAL

    def measured(self, efforts: Sequence[int] = range(EFFORTS)) -> CaseTrade:
        """What is known when time is up, or when all is done."""
        for effort in efforts:
            case = self.whole.at(effort)
            try:
                self._measure(case)
            except OutOfTimeError:
                if self.rough:
                    self.needed = self._time_needed(case)
                break
            if self.show is not None and effort < efforts[-1]:
                self.show(self._known())
        if self.timing and self.runs.until < math.inf and self.runs.stopped in ("", OUT_OF_TIME):
            self._time_again()
        return self._known()

    def _time_again(self) -> None:
        """Time what the answer may tell of, in turns and with nothing else running: the first times were taken beside
        other runs."""
        told, _ = self._told_and_worse()
        tasks = [Task(self.case, cell, 0) for cell in sorted(told, key=self._distance)[:MOST_TIMED]]
        last = self.runs.until + (TIMING / RUNNING - 1) * (self.runs.until - self.began)
        for _ in range(TURNS):
            for task in tasks:
                if time.monotonic() > last:
                    return
                cost = bare_cost(task)
                if cost is not None:
                    self.costs[task.cell] = min(cost, self.costs.get(task.cell, math.inf))

    def _measure(self, case: Case) -> None:
        runs, name = self.runs, case.subject.name
        if not self.looked and (self.show is not None or runs.until < math.inf):
            self._look(case)
        case, reference, _ = refined_reference(
            case, runs, lambda _, found: max(found.agreement.values(), default=0.0) <= SURE
        )
        self.case, self.reference, self.rough = case, reference, False
        self.cells = grids.grid(self.curves, case.steps)
        tasks = sorted(run_tasks(case, self.cells), key=self._later)
        what = f"{name}: {len(self.cells)} settings, {case.repeats_text}"
        if runs.until < math.inf and case.repeats > 1:
            told, _ = self._told_and_worse()
            runs.all([task for task in tasks if task.cell in told], what)
            runs.all([task for task in tasks if task.repeat == 0], what)
            told, worse = self._told_and_worse()
            runs.all([task for task in tasks if task.cell in told], what)
            tasks = [task for task in tasks if task.cell not in worse]
        runs.all(tasks, what)

    def _look(self, case: Case) -> None:
        """What can be known before there is a reference; shown when it is all there, or after FIRST_LOOK."""
        self.looked, self.runs.listener = True, self._show_first
        self.runs.all(run_tasks(case, self.cells), f"{case.subject.name}: as it is")
        self._show_first(at_once=self.runs.until < math.inf)

    def _show_first(self, at_once: bool = False) -> None:
        if self.runs.listener is not None and (at_once or time.monotonic() > self.began + FIRST_LOOK):
            self.runs.listener = None
            if self.show is not None:
                self.show(self._known())

    def _time_needed(self, case: Case) -> float:
        """About how long it takes to the first results against references, s, from the beginning; 0: not known."""
        tasks = [*reference_tasks(case.coarse_reference()), *run_tasks(case, grids.grid(self.curves, case.steps))]
        left = self.runs.seconds_for(tasks)
        return (time.monotonic() - self.began + left) / RUNNING if left < math.inf else 0.0

    def _told_and_worse(self) -> tuple[set[Cell], set[Cell]]:
        """By what is known: the settings that the answer may tell of, and those of which more runs tell nothing."""
        points = known_points(self.case.replace(repeats=1), self.cells, self.runs)
        best = front([point for point in points if not point.failed])
        worse = clearly_worse(points) - {self.own}
        return {self.own, *(point.cell for point in best)} - worse, worse

    def _nearest(self) -> tuple[Cell, ...]:
        """The scene's own settings, and with twice and half the step: known before there is a reference."""
        steps = [self.own.dt * factor for factor in (1, 2, 0.5)]
        return tuple(dataclasses.replace(self.own, dt=dt) for dt in steps if dt <= self.whole.steps[0])

    def _later(self, task: Task) -> tuple[float, float]:
        """Tasks run in this order: all settings once, the nearest first; of a chaotic scene, of which one run tells
        little, the nearest are repeated before the farthest are tried."""
        distance = self._distance(task.cell)
        return (task.repeat + distance, distance) if task.case.kind == CHAOTIC else (task.repeat, distance)

    def _distance(self, cell: Cell) -> float:
        """How far a setting is from the scene's own: fields that differ, and halvings or doublings of the step; smaller
        steps are farther, because they cost more."""
        fields = ("integrator", "collision", "substeps", "geometry")
        own = grids.with_own_flight(dataclasses.replace(self.own, collision=cell.collision))
        differ = sum(getattr(cell, name) != getattr(own, name) for name in fields)
        differ += cell.collision != self.own.collision
        halvings = math.log2(self.own.dt / cell.dt)
        return differ + (1.5 * halvings if halvings > 0 else -halvings)

    def _known(self) -> CaseTrade:
        points = known_points(self.case, self.cells, self.runs)
        for point in points:
            point.line = python_line(point.cell, self.case.survey.settings)
            if point.cell in self.costs:
                point.milliseconds = Spread.of([self.costs[point.cell]])
            point.milliseconds = point.milliseconds if self.timing else None
        found = summed_up(self.case, self.reference, points)
        missing = len(self.cells) - len(points)
        return dataclasses.replace(
            found, whole=self.whole.repeats, own=self.own, missing=missing, rough=self.rough, needed=self.needed
        )


def summed_up(case: Case, reference: Reference, points: Iterable[Point]) -> CaseTrade:
    """The record of a case."""
    methods = by_method(points)
    curves = []
    for method, found in methods.items():
        curve = Curve(label_of(method, methods), found)
        for norm in case.norms:
            curve.theory[norm] = case.theory(method, norm)
            curve.orders[norm] = order_of(found, norm, reference)
        curves.append(curve)
    return CaseTrade(
        case.subject.name,
        case.subject.target or case.subject.name,
        case.subject.description,
        case.kind,
        case.why,
        {norm: norm_of(norm).text for norm in case.norms},
        case.seconds,
        case.repeats,
        case.repeated,
        reference,
        curves,
    )


def order_of(points: Sequence[Point], norm: str, reference: Reference) -> float | None:
    """The order of the usable points: without failures, above rounding and the reference's own error, and small enough
    for the asymptotic order to hold."""
    usable = [point for point in points if _tells(point, norm, reference)]
    finest = usable[-ASYMPTOTIC:]
    return observed_order([p.cell.dt for p in finest], [p.errors[norm].mean for p in finest])


def _tells(point: Point, norm: str, reference: Reference) -> bool:
    if point.failed or norm not in point.errors:
        return False
    error = point.errors[norm]
    small = norm_of(norm).absolute or error.mean < SMALL
    noise = CLEAR * error.uncertainty if norm_of(norm).signed else 0.0
    return small and error.mean > max(ROUNDING, noise) and reference.trusts(norm, error.mean)


def label_of(method: Cell, others: Iterable[Cell]) -> str:
    """A label that distinguishes the method from the others."""
    if method.engine == PYMUNK:
        return f"pymunk, {method.substeps} iterations"
    own = [other for other in others if other.engine == CAROM]

    def differs(read: Callable[[Cell], Any]) -> bool:
        return len({read(other) for other in own}) > 1

    parts = []
    if method.collision == "event_driven":
        parts.append("event-driven")
    else:
        if differs(lambda cell: cell.integrator) or not differs(lambda cell: cell.collision):
            parts.append(method.integrator.replace("_", " "))
        if differs(lambda cell: cell.collision):
            parts.append(method.collision)
    if differs(lambda cell: cell.substeps):
        parts.append(counted(method.substeps, "substep"))
    if differs(lambda cell: cell.geometry):
        parts.append(method.geometry)
    return ", ".join(parts)


def _refused(name: str, why: str) -> CaseTrade:
    return CaseTrade(name, name, "", "", "", {"": ""}, 0.0, 0, "", Reference(""), [], refused=why)

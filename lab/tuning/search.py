"""``tune()``: the cheapest settings that keep an error limit, found by search instead of by the whole grid.

All methods are in one queue, each with its next step and the work expected for it. The cheapest one is tried with a
single run. If it misses the target it returns to the queue with a smaller step; the number of halvings follows from the
order of its errors. If it meets the target it must do so in all repeats. So the first method that holds is the cheapest
of the grid, and no more expensive one was run. Between its step and the next larger one, which failed, the search then
continues in finer steps.
"""

from __future__ import annotations

import dataclasses
import heapq
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ...framework import CaromError, Settings
from ..cases import grid as grids
from ..cases.case import EFFORTS, Case, case_of
from ..cli.usage_errors import Problem
from ..engines.cost import WEIGHTS
from ..jobs.result_store import Store
from ..jobs.runs import OUT_OF_TIME, OutOfTimeError, Runs, known_points, points_of, refined_reference
from ..jobs.tasks import Task, bare_cost
from ..jobs.workers import Pool
from ..measure.norms import norm_of
from ..measure.timing import Spread
from ..reporting.progress import NO_PROGRESS, Progress
from ..trading.code_line import settings_line
from ..trading.records import CHAOTIC, TRUSTED, Cell, Point, Reference
from ..trading.trade import RUNNING, TRIAL, TURNS, Only
from ..wording import counted

BELOW = 16  # a method's step is at least the smallest step of the case over this
MOST_REPEATS = 400  # of a noisy statistic
NOISE = 4.0  # the standard error of a statistic must be smaller than the target by this factor
LONGEST_JUMP = 4  # halvings at once
FINE = (1.5, 1.25, 1.75)  # factors of the step that holds: the first, then the second or third by its result
ROUNDING = 1e-9  # of a step
SMALLEST = 1e-13  # of the scale: accuracy limit of own runs, ten times the rounding of some hundred steps
FAR_DEARER = 4.0  # times the choice's work: limit of the search for a runner-up
PARTS = (1 / 64, 1 / 8, 1)  # of all repeats, one after the other: what has missed the target in one runs no further
STUCK = 3  # smaller steps in a row without improvement: the error does not depend on the step


class NotExactError(Problem):
    """The references are not exact enough, or the statistics too noisy, for the error asked for."""


class NothingMeetsError(CaromError, ValueError):
    """No settings keep the error limit; the message names the best settings found."""


@dataclass(frozen=True)
class Trial:
    """One cell as tried: ``error`` is inf if it failed; ``repeats``: 1 for a first look."""

    cell: Cell
    error: float
    work: float
    repeats: int
    met: bool
    failure: str = ""


@dataclass
class Tuning:
    """The result of the search.

    target
        relative to the norm's scale, which is ``scale`` in the scene's units
    choice, runner_up
        the cheapest point that holds, and the cheapest of another method; None if there is none
    base
        the scene's own settings, whose other fields are kept
    case
        as searched: with its reference and repeats
    stopped
        why the search ended early, else ""
    """

    scene: str
    norm: str
    text: str
    target: float
    scale: float
    seconds: float
    repeats: int
    repeated: str
    reference: Reference
    base: Settings
    methods: int
    case: Case = field(repr=False)
    choice: Point | None = None
    runner_up: Point | None = None
    trials: list[Trial] = field(default_factory=list)
    stopped: str = ""

    @property
    def rough(self) -> bool:
        """True if there are no references yet."""
        return self.reference is TRIAL

    @property
    def settings(self) -> Settings:
        """The chosen settings; NothingMeetsError if there are none."""
        if self.choice is None:
            raise NothingMeetsError(self.why_not)
        return self.choice.cell.settings(self.base)

    @property
    def line(self) -> str:
        """The line of Python to paste."""
        if self.choice is None:
            raise NothingMeetsError(self.why_not)
        return settings_line(self.choice.cell, self.base)

    @property
    def error(self) -> float:
        """Error of the choice: the worst of all repeats plus the reference's own; inf without a choice."""
        if self.choice is None:
            return math.inf
        return self.choice.errors[self.norm].high + self.reference.agreement.get(self.norm, 0.0)

    @property
    def margin(self) -> float:
        """The target over the error."""
        return self.target / self.error if self.error > 0 else math.inf

    @property
    def why_not(self) -> str:
        """A sentence for a search in which nothing meets the target."""
        best = min(self.trials, key=lambda trial: trial.error, default=None)
        which = "its own settings do not" if self.rough else "no settings"
        text = f"{self.scene}: {which} keep the {self.norm} error below {self.target:.3g}"
        if best is None or not math.isfinite(best.error):
            return f"{text}: every run failed"
        line = settings_line(best.cell, self.base)
        return f"{text}: the best of {counted(len(self.trials), 'trial')} has {best.error:.3g}, {line}"


def tune(build: Any, max_error: float = 1e-3, norm: str | None = None, **options: Any) -> Settings:
    """The cheapest Settings that keep the error of a scene below ``max_error`` in all repeats.

    build: a function build(settings, seed=0) -> World, a scene's name or a file; norm: see docs/trade.md, None for the
    default of the scene; options: as of :func:`search`. NothingMeetsError if there are none.
    """
    return search(build, max_error, norm, **options).settings


def search(
    target: Any,
    max_error: float = 1e-3,
    norm: str | None = None,
    *,
    absolute: bool = False,
    seconds: float | None = None,
    repeats: int | None = None,
    steps: Sequence[float] = (),
    only: Only | None = None,
    options: Mapping[str, Any] | None = None,
    seed: int = 0,
    budget: float | None = None,
    workers: int | Pool | None = None,
    store: Store | None = None,
    progress: Progress = NO_PROGRESS,
    show: Callable[[Tuning], None] | None = None,
) -> Tuning:
    """The result of :func:`tune` with all its trials.

    max_error: relative to the norm's scale, or with ``absolute`` in the scene's units. The rest as in
    :func:`carom.lab.trade`. ValueError for a target that is not a positive number; Problem for a scene that cannot be
    measured, or not with that accuracy.
    """
    number = isinstance(max_error, (int, float)) and not isinstance(max_error, bool)
    if not (number and math.isfinite(max_error) and max_error > 0):
        raise ValueError(f"max_error must be a number above 0, got {max_error!r}")
    until = math.inf if budget is None else time.monotonic() + RUNNING * budget
    runs = Runs(workers, store, progress, until, stoppable=show is not None)
    progress.say("survey")
    case = case_of(
        target, norms=(norm,) if norm else (), seconds=seconds, repeats=repeats, steps=steps, options=options,
        seed=seed, each=runs.each,
    )  # fmt: skip
    found: Tuning | None = None
    if budget is not None:
        found = _rough(case.at(0), float(max_error), absolute, only or Only(), runs)
        if found is not None and show is not None:
            show(found)
    for effort in range(EFFORTS - 1 if budget is None else 0, EFFORTS):
        try:
            known = exact_enough(case.at(effort), case.norms[0], float(max_error), absolute, runs)
            searching = _Search(*known, float(max_error), absolute, only or Only(), runs)
        except OutOfTimeError:
            if found is not None:
                found.stopped = found.stopped or runs.stopped
            break
        except NotExactError:
            if effort < EFFORTS - 1:
                continue
            raise
        tuning = searching.result()
        if not tuning.stopped or found is None or (found.rough and tuning.trials) or tuning.choice is not None:
            found = tuning
        if tuning.stopped:
            found.stopped = tuning.stopped
            break
        if show is not None and effort < EFFORTS - 1:
            show(found)
    if found is None:
        why = runs.stopped or "time is up"
        raise Problem(f"{case.subject.name}: {why} before anything was known: take a larger budget")
    return found


def _rough(case: Case, max_error: float, absolute: bool, only: Only, runs: Runs) -> Tuning | None:
    """The scene's own settings against the trial run, until there are references; None where they are not needed or
    time is up."""
    if case.reference is not None or not norm_of(case.norms[0]).is_usable_with(case.survey.trial):
        return None
    if case.kind == CHAOTIC:
        case = case.replace(repeats=1)  # against one trial, more games tell little more
    searching = _Search(case.replace(reference=case.survey.trial), TRIAL, max_error, absolute, only, runs)
    return searching.own_only()


class _Search:
    def __init__(
        self, case: Case, reference: Reference, max_error: float, absolute: bool, only: Only, runs: Runs
    ) -> None:
        self.runs = runs
        self.norm = norm_of(case.norms[0])
        self.methods = only.of(case)
        self.case, self.reference = case, reference
        self.scale = case.scale(self.norm.name)
        self.target = max_error / self.scale if absolute else max_error
        self.noise = self.reference.spread.get(self.norm.name, 0.0)
        self.case = enough_repeats(self.case, self.norm.name, self.noise, self.target)
        self.own = self.reference.agreement.get(self.norm.name, 0.0)
        self.trials: list[Trial] = []
        self.looks: dict[Cell, tuple[float, float]] = {}  # error and work of single runs
        self.whole: dict[Cell, Point] = {}

    def result(self) -> Tuning:
        held: list[Point] = []
        try:
            self._cheapest_two(held)
            if held:
                held[0] = self._refined(held[0])
        except OutOfTimeError:
            held = held or self._held_once()
        held.sort(key=lambda point: point.work)
        if held and self.runs.until < math.inf and self.runs.stopped in ("", OUT_OF_TIME):
            costs = [bare_cost(Task(self.case, held[0].cell, 0)) for _ in range(TURNS)]  # first it was beside others
            if any(costs):
                held[0].milliseconds = Spread.of([min(filter(None, costs))])
        return self._tuning(held)

    def own_only(self) -> Tuning | None:
        """The scene's own settings, if they hold; None if time is up before that is known."""
        try:
            held = self._hold(Cell.of(self.case.survey.settings))
        except OutOfTimeError:
            return None
        return self._tuning([held] if held else [])

    def _tuning(self, held: list[Point]) -> Tuning:
        case = self.case
        return Tuning(
            case.subject.name, self.norm.name, self.norm.text, self.target, self.scale, case.seconds, case.repeats,
            case.repeated, self.reference, case.survey.settings, len(self.methods), case, held[0] if held else None,
            held[1] if len(held) > 1 else None, self.trials, self.runs.stopped,
        )  # fmt: skip

    def _held_once(self) -> list[Point]:
        """What has met the target in the runs there are."""
        known = known_points(self.case, self.looks, self.runs)
        return [point for point in known if point.meets(self.norm.name, self.target)]

    def _cheapest_two(self, held: list[Point]) -> None:
        """Fill in the first two methods that hold, the cheapest first."""
        queue: list[tuple[float, int, Cell]] = []
        for number, method in enumerate(self.methods):
            cell = dataclasses.replace(method, dt=self.case.steps[0])
            heapq.heappush(queue, (_expected(cell), number, cell))
        while queue and len(held) < 2:
            expected, number, cell = heapq.heappop(queue)
            if held and expected > FAR_DEARER * held[0].work:
                break
            error, work = self._look(cell)
            if queue and work > expected and work > queue[0][0]:  # more expensive than expected: others come first
                heapq.heappush(queue, (work, number, cell))
                continue
            if error <= self.target + 3 * self.noise:
                point = self._hold(cell)
                if point is not None:
                    held.append(self._walked_back(point))
                    continue
                error = max(error, self._worst(cell))
            smaller = self._next(cell, error)
            if smaller is not None:
                heapq.heappush(queue, (work * cell.dt / smaller.dt, number, smaller))

    def _walked_back(self, point: Point) -> Point:
        """The largest step of the grid from which on all smaller ones hold: a jump may have been too long."""
        while True:
            larger = dataclasses.replace(point.cell, dt=2 * point.cell.dt)
            if larger in self.looks or larger.dt > self.case.steps[0] * (1 + ROUNDING):
                return point
            error, _ = self._look(larger)
            found = self._hold(larger) if error <= self.target + 3 * self.noise else None
            if found is None:
                return point
            point = found

    def _look(self, cell: Cell) -> tuple[float, float]:
        """Error and work of a single run, at the first start phase or seed."""
        if cell not in self.looks:
            (point,) = points_of(self.case.replace(repeats=1), [cell], self.runs, _words(self.case, cell))
            error = math.inf if point.failed else point.errors[self.norm.name].mean
            self.looks[cell] = error, point.work or _expected(cell)
            met = error <= self.target
            self.trials.append(Trial(cell, error, point.work, 1, met, ", ".join(point.failures)))
        return self.looks[cell]

    def _hold(self, cell: Cell) -> Point | None:
        """The point over all repeats if it meets the target, including the reference's own error; the repeats go on
        only while it can."""
        for part in PARTS:
            case = self.case.replace(repeats=math.ceil(self.case.repeats * part))
            (point,) = points_of(case, [cell], self.runs, f"{_words(case, cell)}, {case.repeats_text}")
            self.whole[cell] = point
            if self._cannot_hold(point):
                break
        error = self._worst(cell)
        met = error <= self.target
        if point.repeats > 1 or cell not in self.looks:  # otherwise the single run is already recorded
            self.trials.append(Trial(cell, error, point.work, point.repeats, met, ", ".join(point.failures)))
        return point if met else None

    def _cannot_hold(self, point: Point) -> bool:
        """True if more repeats cannot make it hold: one has missed the target, or of a statistic the mean of all, by
        more than chance."""
        if point.failed or not self.noise:
            return self._worst(point.cell) > self.target
        return point.errors[self.norm.name].mean > self.target + 3 * self.noise / math.sqrt(point.repeats)

    def _worst(self, cell: Cell) -> float:
        point = self.whole[cell]
        return math.inf if point.failed else point.errors[self.norm.name].high + self.own

    def _next(self, cell: Cell, error: float) -> Cell | None:
        """The same method with the step expected to meet the target by its order; None to give up the method."""
        history = sorted(
            (dt, e) for (dt, e) in ((c.dt, looked[0]) for c, looked in self.looks.items() if c.method == cell.method)
        )
        halvings = 1
        if math.isfinite(error) and error > self.target and not self.noise:
            order = self.case.theory(cell, self.norm.name) or float(grids.ORDER.get(cell.integrator, 1))
            if len(history) > 1 and all(math.isfinite(e) and e > 0 for _, e in history[:2]):
                (small, fine), (large, coarse) = history[:2]
                order = math.log(coarse / fine) / math.log(large / small)
            if order > 0 and math.isfinite(order):
                halvings = max(1, min(LONGEST_JUMP, int(math.log2(error / self.target) / order)))
        finite = [e for _, e in history if math.isfinite(e)]
        if len(finite) > STUCK and min(finite[:STUCK]) >= 0.9 * max(finite[: STUCK + 1]):
            return None
        dt = cell.dt / 2**halvings
        return dataclasses.replace(cell, dt=dt) if dt >= self.case.steps[-1] / BELOW else None

    def _refined(self, point: Point) -> Point:
        """A larger step of the same method that also holds, between this one and the next of the grid."""
        cell = point.cell
        if cell.dt >= self.case.steps[0]:
            return point
        first, *others = FINE
        middle = self._hold(dataclasses.replace(cell, dt=first * cell.dt))
        last = self._hold(dataclasses.replace(cell, dt=(others[1] if middle else others[0]) * cell.dt))
        return min((p for p in (point, middle, last) if p is not None), key=lambda found: found.work)


def enough_repeats(case: Case, norm: str, noise: float, target: float) -> Case:
    """The case with enough seeds to know a statistic far better than the target; Problem if that needs too many.

    noise: the standard deviation of a single run; 0 if the norm is not a statistic.
    """
    wanted = max(case.repeats, math.ceil((NOISE * noise / target) ** 2))
    if wanted > MOST_REPEATS:
        raise NotExactError(
            f"{case.subject.name}: the {norm} of one run of {case.seconds:g} s scatters by {noise:.2g}, {target:.2g} "
            f"cannot be told from chance by {MOST_REPEATS} runs: take a larger error or longer runs (--seconds)"
        )
    return case.replace(repeats=wanted)


def exact_enough(
    case: Case, norm: str, max_error: float, absolute: bool, runs: Runs
) -> tuple[Case, Reference]:
    """The case with a reference accurate enough for the target; Problem if own runs cannot be made to agree so well."""
    def margin_of(known: Case, reference: Reference) -> float:
        """The target over the accuracy of the reference."""
        target = max_error / known.scale(norm) if absolute else max_error
        if case.reference is None and target < SMALLEST:
            raise Problem(
                f"{case.subject.name}: a {norm} error of {target:.3g} is below rounding, no own runs can tell it: take "
                f"{SMALLEST:g} or more"
            )
        return target / max(reference.agreement.get(norm, 0.0), 1e-300)

    wanted = NOISE if norm_of(norm).signed else TRUSTED
    known, reference, enough = refined_reference(case, runs, lambda case, found: margin_of(case, found) >= wanted)
    if norm not in known.norms:
        others = " or ".join(f"--norm {name}" for name in known.norms)
        raise Problem(f"{case.subject.name}: its {norm} is 0 throughout, nothing can be relative to it: take {others}")
    if enough:
        return known, reference
    agreement = reference.agreement[norm]
    target = margin_of(known, reference) * agreement
    raise NotExactError(
        f"{case.subject.name}: no reference is exact enough for a {norm} error of {target:.3g}: "
        f"{reference.text} agree to {agreement:.2g} only. Take a larger error"
        + (" or longer runs" if norm_of(norm).signed else " or a shorter time")
    )


def _expected(cell: Cell) -> float:
    """Estimated work per simulated second before anything has run."""
    evaluations = {"rk4": 4, "yoshida4": 4, "velocity_verlet": 2}.get(cell.integrator, 1)
    return (WEIGHTS["steps"] + evaluations * WEIGHTS["force_evaluations"]) / cell.dt


def _words(case: Case, cell: Cell) -> str:
    return f"{case.subject.name}: {cell.integrator}, {cell.collision}, {cell.dt:.4g} s"

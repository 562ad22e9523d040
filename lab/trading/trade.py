"""``trade()``: the trade-off between speed and accuracy, measured over a grid of settings."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..bench.report import machine
from ..cases import grid as grids
from ..cases.case import FIRST, FOR_REFERENCES, QUICK, Case, Effort, case_of, check_arguments
from ..cases.subjects import subject_of
from ..cli.usage_errors import Problem
from ..jobs.runs import Runs, Store, inputs_late, measure, refined_reference
from ..jobs.tasks import Task, bare_cost, engine_of
from ..jobs.workers import Workers
from ..measure.norms import NORMS, check_norm, norm_of
from ..measure.timing import Spread
from ..reporting.progress import NO_PROGRESS, Progress
from ..reporting.text import counted
from .answer import Target, clearly_worse, next_choice, price, recommended
from .records import (
    CAROM,
    FIELDS,
    PYMUNK,
    CaseTrade,
    Cell,
    Curve,
    Point,
    Reference,
    Trade,
    by_method,
    observed_order,
    python_line,
)

ROUNDING = 1e-12  # smaller errors are rounding, which has no order
SURE = 1e-10  # a reference with a better agreement needs no refinement
SMALL = 0.1  # relative errors above this are too large for asymptotic orders
CLEAR = 4.0  # a statistic's error must exceed its own noise by this factor to count for the order
ASYMPTOTIC = 4  # number of finest points used for the order
INPUT_PHASES = 8  # start phases, at least, that show how late inputs act
TURNS, MOST_ROUNDS = 3, 4  # of the settings timed again; of choices that the clock may refuse

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
        for field, wanted in zip(FIELDS, dataclasses.astuple(self), strict=True):
            if wanted:
                found = tuple(dataclasses.replace(cell, **{field: value}) for cell in found for value in wanted)
        if self != Only():
            for cell in found:
                case.subject.world(cell.settings(case.survey.settings)).close()  # raises for unknown names
        return tuple(dict.fromkeys(grids.with_own_flight(cell) for cell in found))


def trade(
    *targets: Any, norms: Sequence[str] = (), seconds: float | None = None, repeats: int | None = None,
    steps: Sequence[float] = (), only: Only | None = None, target: Target | None = None, against_pymunk: bool = False,
    timing: bool = True, options: Mapping[str, Any] | None = None, seed: int = 0, quick: bool = False,
    workers: int | Workers | None = None, store: Store | None = None, progress: Progress = NO_PROGRESS,
    command: str = "", show: Show | None = None,
) -> Trade:  # fmt: skip
    """Measure work and error of every setting that matters in each scene.

    targets: names of scenes, files, or functions build(settings, seed=0) -> World. norms: the first is the main one;
    seconds of each run; repeats of each setting (start phases, or seeds of chaotic scenes); steps s. Values not given
    follow from the scene. target: the error or cost asked for. quick: only what fits into a minute, the same each time;
    show is called with a first part of it. workers: processes at most, None for all cores (small amounts of work use
    none), or those of a cluster; store: finished runs, to be continued. Of several scenes, one that cannot be measured
    is in the result with the reason. ValueError or Problem for wrong arguments, and for a single scene that cannot be
    measured.
    """
    check_arguments(norms, seconds, repeats, steps)
    subjects = [subject_of(scene, options, seed) for scene in targets]
    for name in norms:
        check_norm(name, () if name in NORMS else [own for subject in subjects for own in subject.names])
    runs = Runs(workers, store, progress)
    result = Trade(machine(), command, [])
    for scene in targets:
        name = scene if isinstance(scene, str) else getattr(scene, "__name__", "scene")
        progress.say(f"{name}: survey")
        try:
            case = case_of(
                scene, norms=norms, seconds=seconds, repeats=repeats, steps=steps, options=options, seed=seed,
                each=runs.each,
            )  # fmt: skip
            methods = (only or Only()).of(case) + _peers(case, against_pymunk)
            if quick and show is not None:
                show(measured(case, FIRST, methods, target, timing, runs))
            result.cases.append(measured(case, QUICK if quick else None, methods, target, timing, runs))
        except Problem as problem:
            if len(targets) == 1:
                raise
            why = problem.message
            nothing = {"norms": {"": ""}, "seconds": 0.0, "repeats": 0, "repeated": "", "reference": Reference("")}
            result.cases.append(CaseTrade(name, name, "", "", "", **nothing, curves=[], refused=why))
    return result


def _peers(case: Case, wanted: bool) -> tuple[Cell, ...]:
    """pymunk's methods; Problem, with the reason, if it cannot represent the scene."""
    peers = grids.peer_methods() if wanted else ()
    if peers:
        engine_of(case, dataclasses.replace(peers[0], dt=case.steps[0]), 0).close()
    return peers


def measured(
    whole: Case, effort: Effort | None, methods: Sequence[Cell], target: Target | None, timing: bool, runs: Runs
) -> CaseTrade:
    """One scene with that effort; None: all of it."""
    case = whole if effort is None else whole.at(effort)

    def is_enough(known: Case, found: Reference) -> bool:
        apart = max(found.agreement.values(), default=0.0)
        return apart <= SURE or (target is not None and target.is_known_by(known, found))

    case, reference, _ = refined_reference(case, runs, is_enough)
    own = Cell.of(case.survey.settings)
    cells = grids.grid(methods, case.steps)
    if effort is None:
        points = measure(case, cells, runs, bare=timing)
    else:
        points = _measured_quickly(case, effort, sorted(cells, key=lambda cell: _distance(cell, own)), own, runs)
    for point in points:
        point.line = python_line(point.cell, case.survey.settings)
        point.milliseconds = point.milliseconds if timing else None
    found = dataclasses.replace(summed_up(case, reference, points), own=own, scale=case.scale(case.norms[0]))
    if not found.usable:
        return found
    chosen = recommended(found, target)
    for _ in range(MOST_ROUNDS if timing else 0):
        _time_alone(case, [point for point in _answers(found, chosen) if not point.alone])
        chosen = recommended(found, target)
    if chosen is None:
        return found
    case = case.replace(repeats=max(chosen.repeats, INPUT_PHASES))
    steps = dict.fromkeys((own, chosen.cell) if own.dt <= case.steps[0] else (chosen.cell,))
    late = {repr(cell.dt): inputs_late(case, cell, runs) for cell in steps}
    return dataclasses.replace(found, inputs={dt: effects for dt, effects in late.items() if effects})


def _measured_quickly(case: Case, effort: Effort, cells: Sequence[Cell], own: Cell, runs: Runs) -> list[Point]:
    """The nearest settings once, in half of the time; those that the answer may be about as often as fits in the rest.
    """
    half = (1 - FOR_REFERENCES) / 2 * effort.seconds
    fitting, spent = [], 0.0
    for cell in cells:
        spent += case.seconds_of(cell)
        if spent <= half or not fitting:
            fitting.append(cell)
    once = measure(case.replace(repeats=1), fitting, runs)
    worse = clearly_worse(once) - {own}
    again = [cell for cell in fitting if cell not in worse]
    most = int(half / sum(map(case.seconds_of, again))) + 1
    repeats = max(min(case.repeats, most), min(case.repeats, 2))
    points = measure(case.replace(repeats=repeats), again, runs)
    return points + [point for point in once if point.cell in worse]


def _answers(case: CaseTrade, chosen: Point | None) -> list[Point]:
    """Those whose times the answer tells: the chosen one, the next one, and what the scene has now."""
    known = chosen or min(case.usable, key=price)
    _, other = next_choice(case, known) or ("", known)
    now = [point for point in case.usable if point.cell == case.own]
    return list({point.cell: point for point in (*now, known, other)}.values())


def _time_alone(case: Case, points: Sequence[Point]) -> None:
    """In turns, with nothing else running: the first times were taken beside other runs."""
    passes: list[list[float]] = [[] for _ in points]
    for _ in range(TURNS):
        for point, found in zip(points, passes, strict=True):
            cost = bare_cost(Task(case, point.cell, 0))
            found += [] if cost is None else [cost]
    for point, found in zip(points, passes, strict=True):
        point.milliseconds, point.alone = Spread.of(found) if found else point.milliseconds, True


def _distance(cell: Cell, own: Cell) -> float:
    """How far a setting is from the scene's own: fields that differ, and halvings or doublings of the step; smaller
    steps are farther, because they cost more."""
    alike = grids.with_own_flight(dataclasses.replace(own, collision=cell.collision))
    differ = cell.differences(alike) + (cell.collision != own.collision)
    halvings = math.log2(own.dt / cell.dt)
    return differ + (1.5 * halvings if halvings > 0 else -halvings)


def summed_up(case: Case, reference: Reference, points: Iterable[Point]) -> CaseTrade:
    """The record of a case."""
    points = list(points)
    methods = by_method(points)
    curves = []
    for method, found in methods.items():
        curve = Curve(label_of(method, methods), found)
        for norm in case.norms:
            curve.theory[norm] = case.theory(method, norm)
            curve.orders[norm] = order_of(found, norm, reference)
        curves.append(curve)
    subject, norms = case.subject, {norm: norm_of(norm).text for norm in case.norms}
    repeats = max((point.repeats for point in points), default=case.repeats)
    return CaseTrade(
        subject.name, subject.target or subject.name, subject.description, case.kind, case.why, norms, case.seconds,
        repeats, case.repeated, reference, curves,
    )  # fmt: skip


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

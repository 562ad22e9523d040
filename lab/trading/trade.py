"""``trade()``: the trade-off between speed and accuracy, measured over a grid of settings."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..bench.results import machine
from ..cases import grid as grids
from ..cases.case import Case, case_of, check_arguments
from ..cases.subjects import subject_of
from ..commands.usage_errors import Problem, did_you_mean
from ..jobs.result_store import Store
from ..jobs.runs import Runs, point_of, refined_reference, run_tasks
from ..jobs.tasks import engine_of
from ..measure.norms import NORMS
from ..reporting.progress import NO_PROGRESS, Progress
from .clock import time_points
from .records import CAROM, PYMUNK, CaseTrade, Cell, Curve, Outcome, Point, Reference, Trade, by_method, observed_order

ROUNDING = 1e-12  # smaller errors are rounding, which has no order
SURE = 1e-10  # a reference with a better agreement needs no refinement
SMALL = 0.1  # relative errors above this are too large for asymptotic orders
CLEAR = 4.0  # a statistic's error must exceed its own noise by this factor to count for the order
ASYMPTOTIC = 4  # number of finest points used for the order


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
        world = case.subject.world(None)
        known = world.registry.integrators
        world.close()
        for name in self.integrators:
            if name not in known:
                raise Problem(f"no integrator {name!r}{did_you_mean(name, known)}")
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
        chosen = tuple(dict.fromkeys(grids.with_own_flight(cell) for cell in found))
        for cell in chosen:
            case.subject.world(cell.settings(case.survey.settings)).close()  # raises for unknown names
        return chosen


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
    quick: bool = False,
    workers: int | None = None,
    store: Store | None = None,
    progress: Progress = NO_PROGRESS,
    command: str = "",
) -> Trade:
    """Measure work and error of every setting that matters in each scene.

    targets: names of scenes, files, or functions build(settings, seed=0) -> World. norms: the first is the main one;
    seconds of each run; repeats of each setting (start phases, or seeds of chaotic scenes); steps s. Values not given
    follow from the scene. quick: every second step and at most 8 repeats, unless given, for a first look. workers:
    processes at most, None for all cores (small amounts of work use none); store: finished runs, to be continued. Of
    several scenes, one that cannot be measured is in the result with the reason. ValueError or Problem for wrong
    arguments, and for a single scene that cannot be measured.
    """
    check_arguments(norms, seconds, repeats, steps)
    for target in targets:
        subject_of(target)
    runs = Runs(workers, store, progress)
    cases = []
    for target in targets:
        name = target if isinstance(target, str) else getattr(target, "__name__", "scene")
        progress.say(f"{name}: survey")
        try:
            case = case_of(
                target, norms=norms, seconds=seconds, repeats=repeats, steps=steps, options=options, seed=seed
            )
        except Problem as problem:
            if len(targets) == 1:
                raise
            cases.append(_refused(name, problem.message))
            continue
        looked = case.quick(not steps, repeats is None) if quick else case
        measured = measure(looked, only or Only(), against_pymunk, timing, runs)
        cases.append(dataclasses.replace(measured, whole=case.repeats))
    return Trade({**machine(), "clock": "wall time"}, command, cases)


def measure(case: Case, only: Only, against_pymunk: bool, timing: bool, runs: Runs) -> CaseTrade:
    """One case: its references, its grid, then the clock, with no other work in parallel."""
    name = case.subject.name
    curves = only.of(case)
    peers = grids.peer_methods() if against_pymunk else ()
    if peers:
        engine_of(case, dataclasses.replace(peers[0], dt=case.steps[0]), 0).close()  # raises, with the reason
    case, reference, _ = refined_reference(
        case, runs, lambda _, found: max(found.agreement.values(), default=0.0) <= SURE
    )
    cells = grids.grid((*curves, *peers), case.steps)
    records = runs.all(run_tasks(case, cells), f"{name}: {len(cells)} settings, {case.repeats_text}")
    outcomes: dict[Cell, list[Outcome]] = {}
    for record in records:
        outcome = Outcome.from_dict(record)
        outcomes.setdefault(outcome.cell, []).append(outcome)
    points = [point_of(found) for found in outcomes.values()]
    if timing:
        time_points(case, points, runs.progress)
    return summed_up(case, reference, points)


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
        {norm: NORMS[norm].text for norm in case.norms},
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
    small = NORMS[norm].absolute or error.mean < SMALL
    noise = CLEAR * error.uncertainty if NORMS[norm].signed else 0.0
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
        parts.append(f"{method.substeps} substep{'s' * (method.substeps > 1)}")
    if differs(lambda cell: cell.geometry):
        parts.append(method.geometry)
    return ", ".join(parts)


def _refused(name: str, why: str) -> CaseTrade:
    return CaseTrade(name, name, "", "", "", {"": ""}, 0.0, 0, "", Reference(""), [], refused=why)

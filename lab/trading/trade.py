"""``trade()``: the errors and the cost of the settings that matter in a scene, and which of them to use.

Choices are made by counts of work, which are the same on every machine and in every call.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

from ...framework import Settings
from ..cli.usage_errors import Problem
from ..jobs import Jobs
from ..measure.observer import RunResult, work_of
from ..measure.timing import machine
from ..reporting.progress import NO_PROGRESS, Progress
from ..reporting.text import jsonable, number
from .errors import SHARE, TRUSTED, Figure, Norm, failure_of, figures_of, norms_for, reference_of
from .grid import FEWEST_STEPS, FIELDS, PHASES, SEEDS, Facts, Task, grid, milliseconds, perform, survey, tasks_of
from .subject import Subject

HARDLY = 1.25  # times the cost: within it, costs are the same
BETTER = 0.5  # of the error: what a dearer choice must have to be worth a line
ROUNDING = 1e-9  # smaller errors are none
FIRST = 0.4  # of the scene's own step: smaller ones are tried later
APEX_PHASES = 32  # the error of a highest point is as large as its distance from a step's end


@dataclass
class Point:
    """One setting. line: the code that makes it; asked: it may be recommended; repeats: its runs; failed: why it cannot
    be used, else ""; work: weighted counts per simulated second; milliseconds: of this machine for it, if timed"""

    settings: Settings
    line: str
    asked: bool
    repeats: int
    figures: dict[str, Figure]
    failed: str
    work: float
    milliseconds: float | None = None

    @property
    def noticed(self) -> list[tuple[str, Figure]]:
        """What a player would notice, the worst first."""
        found = [(name, figure) for name, figure in self.figures.items() if figure.times > 1]
        return sorted(found, key=lambda one: -one[1].times)

    @property
    def severity(self) -> float:
        """How many times what a player would notice, at the worst."""
        return max((figure.times for figure in self.figures.values()), default=0.0)


@dataclass
class SceneTrade:
    """One scene.

    chaotic, why: places cannot be compared, and how that is known
    norms: in words, the first counts; game: the names of what the game compares
    reference: in words; agreement: its own error by norm
    scale: what the first norm is relative to, in the scene's units; size: m, of the smallest body
    doubt: m, how far the reference may have a body elsewhere
    max_error, max_cost: what is asked for, relative to the scale, and ms per simulated second
    own, chosen, more: what it has now, what to use, and one step more; None: there is none
    inputs: what is noticed if inputs act in whole steps, by the length of the step, s
    refused: why nothing was measured, else ""
    """

    scene: str
    chaotic: bool = False
    why: str = ""
    norms: dict[str, str] = field(default_factory=dict)
    game: tuple[str, ...] = ()
    seconds: float = 0.0
    reference: str = ""
    agreement: Mapping[str, float] = field(default_factory=dict)
    scale: float = 1.0
    size: float = 1.0
    doubt: float = 0.0
    max_error: float = math.inf
    max_cost: float = math.inf
    points: list[Point] = field(default_factory=list)
    own: Point | None = None
    chosen: Point | None = None
    more: Point | None = None
    inputs: dict[float, list[str]] = field(default_factory=dict)
    refused: str = ""

    @property
    def norm(self) -> str:
        return next(iter(self.norms))

    @property
    def usable(self) -> list[Point]:
        """Those that may be recommended: without failures."""
        return [point for point in self.points if point.asked and not point.failed]

    @property
    def unknowable(self) -> bool:
        """True if the reference cannot tell errors of the size that is asked for."""
        return not self.chaotic and not self.trusts(self.norm, self.max_error)

    def trusts(self, norm: str, error: float) -> bool:
        """True if an error of that size can be distinguished from the reference's own."""
        return error >= TRUSTED * self.agreement.get(norm, 0.0)

    def error(self, point: Point) -> float:
        """The largest error in the first norm, with the reference's own."""
        return point.figures[self.norm].error + self.agreement.get(self.norm, 0.0)


@dataclass
class Trade:
    """All scenes of one call, on one machine; ``command`` reproduces it."""

    machine: dict[str, str]
    command: str
    scenes: list[SceneTrade]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return jsonable(self)


def trade(
    *scenes: Any, norms: Sequence[str] = (), max_error: float | None = None, max_cost: float | None = None,
    absolute: bool = False, vary: Mapping[str, Sequence[Any]] | None = None, seconds: float | None = None,
    repeats: int | None = None, options: Mapping[str, Any] | None = None, seed: int = 0, timing: bool = True,
    thorough: bool = False, workers: int | None = None, cluster: str = "", folder: Path | None = None,
    progress: Progress = NO_PROGRESS, command: str = "",
) -> Trade:  # fmt: skip
    """Measure errors and cost of the settings that matter in each scene, and choose the cheapest.

    scenes: names of the library, files, or functions build(settings, seed=0) -> World. norms: the first counts.
    max_error: the cheapest that keeps it, relative to the norm's scale or ``absolute``; max_cost: ms per frame of
    1/60 s. vary: values by field of Settings, as in {"dt": (1 / 30, 1 / 60)}, for those that matter. seconds, repeats:
    of each run. thorough: all repeats of all settings, not only of those in question. workers: processes, None for all
    cores; cluster: the address of a scheduler; folder: where finished runs are kept. Of several scenes, one that cannot
    be measured is in the result with the reason. ValueError, TypeError or Problem for wrong arguments, and for a single
    scene that cannot be measured.
    """
    vary = vary or {}
    for name, values in {"norms": norms, **vary}.items():
        if isinstance(values, str) or not isinstance(values, Sequence):
            raise TypeError(f"{name} must be a sequence, got {values!r}")
    for name, value in {"max_error": max_error, "max_cost": max_cost, "seconds": seconds, "repeats": repeats}.items():
        whole = isinstance(value, int) or (isinstance(value, float) and name != "repeats")
        if value is not None and (isinstance(value, bool) or not whole or not 0 < value < math.inf):
            raise ValueError(f"{name} must be a {'whole ' * (name == 'repeats')}number above 0, got {value!r}")
    subjects = [Subject.of(scene, options, seed) for scene in scenes]
    jobs, found = Jobs(workers, folder, progress, cluster), []
    for subject in subjects:
        try:
            found.append(_measured(
                subject, jobs, norms, vary, seconds, repeats, max_error, max_cost, absolute, timing, thorough
            ))  # fmt: skip
        except Problem as problem:
            if len(subjects) == 1:
                raise
            found.append(SceneTrade(subject.name, refused=problem.message))
    return Trade(machine(), command, found)


def _measured(
    subject: Subject, jobs: Jobs, norms: Sequence[str], vary: Mapping[str, Sequence[Any]], seconds: float | None,
    repeats: int | None, max_error: float | None, max_cost: float | None, absolute: bool, timing: bool, thorough: bool,
) -> SceneTrade:  # fmt: skip
    """One scene. Each setting runs once, with much smaller steps than its own only if no other will do; what would be
    the answer runs as often as it takes to know, until it still is the answer."""
    with closing(subject.world(None)) as world:
        for name, value in ((name, value) for name, values in vary.items() for value in values):
            subject.world(world.settings.replace(**{name: value})).close()  # raises for unknown names
    facts = survey(subject, seconds or subject.seconds, jobs)
    known, shown = norms_for(facts, norms)
    cells, own = grid(facts, vary), facts.settings
    usual = SEEDS if facts.chaotic else APEX_PHASES if "apex" in norms else 1 if facts.rests else PHASES
    repeats = repeats or usual
    # Of the reference: the two finest steps; of chaos half of the seeds each, as chance hides what is finer.
    fine, runs = (own.dt / 2, max(repeats // 2, 2)) if facts.chaotic else (min(cell.dt for cell in cells) / 2, 1)
    methods = (facts.exact,) if facts.chaotic else (facts.exact, facts.other)
    exact = [method.replace(dt=dt) for method in methods for dt in (fine, fine / 2)]
    tasks = [task for cell in exact for task in tasks_of(facts, cell, range(runs))]
    found = jobs.all(perform, tasks, f"{subject.name}: reference")
    right, agreement = reference_of(facts, known, shown, found)
    scale, method = known[next(iter(agreement))].scale(right, right), facts.exact
    case = SceneTrade(
        subject.name, facts.chaotic, facts.why, {name: known[name].text for name in agreement}, tuple(right.values),
        facts.task.seconds, f"{method.collision if facts.contacts else method.integrator}, steps of {number(fine)} and "
        f"{number(fine / 2)} s", agreement, scale, right.size, right.doubt,
        math.inf if max_error is None else max_error / (scale if absolute else 1.0),
        math.inf if max_cost is None else 60 * max_cost,
    )  # fmt: skip
    seens: dict[Settings, list[RunResult]] = {}
    times: dict[Settings, float | None] = {}

    def run(some: Sequence[Settings], count: int) -> None:
        new = [(cell, range(len(seens.setdefault(cell, [])), count)) for cell in some]
        tasks = [(cell, task) for cell, numbers in new for task in tasks_of(facts, cell, numbers)]
        what = f"{subject.name}: {len(some)} settings, {count} {'seeds' if facts.chaotic else 'start phases'}"
        for (cell, _), seen in zip(tasks, jobs.all(perform, [task for _, task in tasks], what), strict=True):
            seens[cell].append(seen)

    later = [] if thorough or "dt" in vary else sorted({cell.dt for cell in cells if cell.dt < FIRST * own.dt})
    first = [cell for cell in cells if cell.dt not in later]
    fits = own not in first and FEWEST_STEPS * own.dt <= facts.task.seconds
    run([*first, *[own] * fits], repeats if thorough else 1)
    while True:
        case.points = [
            _point(cell, cell in cells, found, right, known, facts.chaotic, times.get(cell))
            for cell, found in seens.items()
        ]
        case.own = next((point for point in case.points if point.settings == own), None)
        case.chosen = recommended(case)
        case.more = next_better(case)
        answers = [point for point in (case.own, case.chosen) if point is not None]
        if few := [point.settings for point in answers if point.repeats < repeats and not point.failed]:
            run(list(dict.fromkeys(few)), repeats)
        elif later and (case.chosen is None or (case.max_error == math.inf and case.chosen.severity > 1)):
            run([cell for cell in cells if cell.dt == later[-1]], 1)
            later.pop()
        elif timing and (untimed := {point.settings for point in (*answers, case.more) if point} - times.keys()):
            times |= {cell: milliseconds(tasks_of(facts, cell, [0])[0]) for cell in untimed}
        else:
            break
    if facts.task.inputs and not facts.chaotic:
        for cell in dict.fromkeys(point.settings for point in answers):
            case.inputs[cell.dt] = _inputs_late(facts, known, tasks_of(facts, cell, range(repeats)), jobs)
    return case


def _point(
    cell: Settings, asked: bool, seens: Sequence[RunResult], right: RunResult, norms: Mapping[str, Norm], chaotic: bool,
    milliseconds: float | None,
) -> Point:  # fmt: skip
    """What the runs of a setting have shown, against what is right."""
    failures = [failure_of(seen, right, chaotic) for seen in seens]
    good = [seen for seen, failure in zip(seens, failures, strict=True) if failure is None]
    words = [f"{failures.count(one)} of {len(seens)} {one}" for one in dict.fromkeys(filter(None, failures))]
    works = [work_of(seen.counts) / (seen.simulated or seen.seconds) for seen in seens if seen.counts]
    return Point(
        cell, settings_line(cell), asked, len(seens), figures_of(good, right, norms, chaotic), ", ".join(words),
        sum(works) / max(len(works), 1), milliseconds,
    )  # fmt: skip


def _inputs_late(facts: Facts, norms: Mapping[str, Norm], exact: list[Task], jobs: Jobs) -> list[str]:
    """What is noticed of inputs that act in whole steps, as in the game, beside the same runs in which they act in
    time."""
    late = [dataclasses.replace(task, inputs=()) for task in exact]
    seens = jobs.all(perform, [*exact, *late], f"{facts.task.subject.name}: inputs in whole steps")
    worst: dict[str, Figure] = {}
    for right, seen in zip(seens[: len(exact)], seens[len(exact) :], strict=True):
        if not (right.failure or seen.failure):
            right = dataclasses.replace(right, tolerance=SHARE * right.size)
            for name, figure in figures_of([seen], right, norms).items():
                worst[name] = max(worst.get(name, figure), figure, key=lambda figure: figure.times)
    return [figure.text for figure in sorted(worst.values(), key=lambda figure: -figure.times) if figure.times > 1]


# -- the choice -------------------------------------------------------------------------------------------------------


def recommended(case: SceneTrade) -> Point | None:
    """The settings to use; None if nothing can be used, or is what is asked for.

    The cheapest of which nothing would be noticed, or hardly more than with the best of all; with the largest error
    given, the cheapest that keeps it. The scene's own if they cost hardly more; else, of those that cost hardly more
    than the cheapest, the one with the fewest changes.
    """
    points = [
        point for point in case.usable
        if case.error(point) <= case.max_error and (point.milliseconds or 0.0) <= case.max_cost
    ]  # fmt: skip
    if not points or case.unknowable:
        return None
    if case.max_error == math.inf:
        least = min(point.severity for point in points)
        points = [point for point in points if point.severity <= (HARDLY * least if least > 1 else 1)]
    cheapest = min(point.work for point in points)

    def order(point: Point) -> tuple[Any, ...]:
        own = point if case.own is None else case.own
        changes = [name for name in FIELDS if getattr(point.settings, name) != getattr(own.settings, name)]
        return bool(changes), len({*changes} - {"dt"}), point.work, point.severity

    return min((point for point in points if point.work <= HARDLY * cheapest), key=order)


def next_better(case: SceneTrade) -> Point | None:
    """The next dearer settings that have at most half of what is noticed; where nothing is, at most half of the error,
    if the reference can tell that."""
    chosen = case.chosen
    if chosen is None:
        return None
    seen, half = chosen.severity, BETTER * case.error(chosen)
    known = half > 2 * case.agreement.get(case.norm, 0.0) + ROUNDING
    better = [
        point for point in case.usable
        if point.work > HARDLY * chosen.work and point.severity <= max(BETTER * seen, 1.0)
        and (seen > 1 or (known and case.error(point) <= half))
    ]  # fmt: skip
    return min(better, key=lambda point: point.work, default=None)


# -- settings as a line of Python -------------------------------------------------------------------------------------


def settings_line(settings: Settings) -> str:
    """The shortest ``Settings(...)`` with identical values, bit for bit: those of the default are left out."""
    values = {each.name: getattr(settings, each.name) for each in dataclasses.fields(Settings)}
    changed = {name: value for name, value in values.items() if value != getattr(Settings(), name)}
    texts = {name: json.dumps(value) if isinstance(value, str) else repr(value) for name, value in changed.items()}
    texts |= {"dt": seconds_text(settings.dt)} if "dt" in texts else {}
    return f"Settings({', '.join(f'{name}={text}' for name, text in texts.items())})"


def seconds_text(dt: float) -> str:
    """A step as Python source: 1/30 or 2/45 where that is the same number and shorter."""
    fraction = Fraction(dt).limit_denominator(1_000_000)
    text = f"{fraction.numerator}/{fraction.denominator}"
    same = fraction.numerator and fraction.numerator / fraction.denominator == dt
    return text if same and fraction.denominator > 1 and len(text) <= min(len(repr(dt)), 8) else repr(float(dt))

"""Cases: a scene with its norms, duration, repeats, steps and reference.

Scenes with a known answer have a case defined here; any other scene gets one from its survey.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..cli.usage_errors import Problem
from ..engines.adapters import work_of
from ..measure.norms import MEAN, NORMS, OF_KIND, check_norm, norm_of
from ..measure.observation import Seen
from ..measure.survey import Each, Survey, one_by_one, survey
from ..trading.records import CAROM, CHAOTIC, IMPACTS, RESTING, SMOOTH, Cell
from . import grid as grids
from .closed_forms import FORMS
from .subjects import Subject, subject_of

PHASES = {SMOOTH: 4, IMPACTS: 64, RESTING: 1, CHAOTIC: 5}  # repeats; for chaotic scenes these are seeds
BY_BODY = ("position", "impact_time", "count", "apex")  # norms that compare single runs
OF_CONTACTS = ("impact_time", "count", "overlap", "overlap_mean", "pressure", "rate")
FINER = 8  # own references use steps this many times smaller than the smallest measured step
FEWEST_STEPS = 3  # per run
MOST_REFINED = 2  # refinements of a reference at most

OBSERVED = 2e-4  # s: what a step takes with its observation, besides the work that is counted
FOR_REFERENCES = 0.4  # of the seconds of an effort
FEWEST = 3  # repeats of a game: keys that were recorded in steps fit the first start phase too well
ENSEMBLE = 40  # runs of each of the two own references of a chaotic scene
DENSE = 0.5  # changes of the inputs per step: longer steps would be split too often to be judged


@dataclass(frozen=True)
class Effort:
    """What quick mode measures of a case; it depends on the scene alone, not on the clock.

    repeats, at most; steps down to the scene's own / ``down`` and up to own * ``up``; seconds: of one processor, by
    counts of work, for references and runs together.
    """

    repeats: int
    down: int
    up: int
    seconds: float


FIRST, QUICK = Effort(1, 4, 2, 5.0), Effort(8, 16, 4, 20.0)


@dataclass(frozen=True)
class Known:
    """What the library knows about a scene; fields that are None come from the survey.

    orders: (integrator, norm, order) of methods with a higher order than theory gives in general, at the end of
    ``seconds``
    """

    seconds: float | None = None
    norms: tuple[str, ...] = ()
    repeats: int | None = None
    steps: tuple[float, ...] = ()
    options: tuple[tuple[str, Any], ...] = ()
    orders: tuple[tuple[str, str, float], ...] = ()


def _halved(largest: float, count: int) -> tuple[float, ...]:
    return tuple(largest / 2**k for k in range(count))


KNOWN: Mapping[str, Known] = {
    "jump": Known(1.0, ("apex", "position", "energy"), steps=_halved(1 / 15, 6)),
    "spring": Known(5.2, ("position", "energy"), steps=_halved(1 / 15, 8)),  # a turning point would hide phase errors
    # Semi-implicit Euler is velocity Verlet shifted by half a step (Hairer, Lubich, Wanner: Geometric Numerical
    # Integration, VI.3). At the perihelion, the start, that shift changes no energy, and after whole orbits no length.
    "orbit": Known(
        20 * math.pi,
        ("position", "energy"),
        1,
        _halved(2 * math.pi / 100, 8),
        orders=(("semi_implicit_euler", "position", 2.0),),
    ),
    # As published: 49 balls, 20 s, these steps.
    "bouncing": Known(20.0, ("energy_square", "position", "energy"), 4, (0.1, 0.04, 0.01, 0.004, 0.001), (("n", 49),)),
    "oblique": Known(3.0, ("position", "energy", "impact_time"), steps=_halved(0.8, 6)),
    "stack": Known(5.0, ("overlap", "overlap_mean", "speed", "drift"), 1, _halved(1 / 30, 6)),
    "billiards": Known(1.0, steps=_halved(1 / 30, 6)),
    "thermal_gas": Known(100.0, ("pressure", "rate"), steps=_halved(0.8, 7)),
}


@dataclass(frozen=True)
class Case:
    """One scene ready to be measured.

    reference: the result of a closed form; None: fine runs of carom are the reference
    reference_cells: of these fine runs: two methods, and unless the scene is chaotic the first one with twice its step
    orders: as in ``Known``
    refinements: of the reference at most; fineness: how many times smaller its steps are; ensemble: runs of each
    reference of a chaotic scene
    given: what the caller has chosen: "steps", "repeats"
    """

    subject: Subject
    survey: Survey
    kind: str
    why: str
    norms: tuple[str, ...]
    seconds: float
    repeats: int
    steps: tuple[float, ...]
    form: str
    reference: Seen | None
    reference_cells: tuple[Cell, ...]
    orders: tuple[tuple[str, str, float], ...] = ()
    refinements: int = MOST_REFINED
    fineness: int = FINER
    ensemble: int = ENSEMBLE
    given: tuple[str, ...] = ()

    @property
    def repeated(self) -> str:
        return "seeds" if self.kind == CHAOTIC else "start phases"

    @property
    def repeats_text(self) -> str:
        """For messages: 1 start phase, 64 start phases, 5 seeds."""
        return f"{self.repeats} {self.repeated if self.repeats > 1 else self.repeated[:-1]}"

    def theory(self, cell: Cell, norm: str) -> float | None:
        """The order of accuracy expected of the method in this norm, as ``grids.theory``."""
        for integrator, name, order in self.orders:
            if (cell.engine, cell.integrator, name) == (CAROM, integrator, norm):
                return order
        if self.subject.names:  # its systems act in each step
            return None
        return grids.theory(cell, norm, self.survey)

    def scale(self, norm: str) -> float:
        """What errors in this norm are relative to, in the scene's units, by the reference that there is."""
        assert self.reference is not None
        return norm_of(norm).scale(self.reference, self.reference)

    def phase(self, repeat: int) -> float:
        """The length of the first step of that repeat, as a fraction of a step: spread evenly however many there are
        (van der Corput's sequence, in the order of the Gray code: 1, 1/2, 1/4, 3/4, ...; so few reach far too)."""
        if self.kind == CHAOTIC:
            return 1.0
        code = repeat ^ repeat >> 1
        return 1.0 - sum((code >> k & 1) / 2 ** (k + 1) for k in range(code.bit_length()))

    def replace(self, **changes: Any) -> Case:
        return dataclasses.replace(self, **changes)

    def seconds_of(self, cell: Cell) -> float:
        """About how long a run takes, by the work of the trial run: the same on every machine."""
        counts = self.survey.trial.counts
        return self.seconds / cell.dt * (OBSERVED + 1e-9 * work_of(counts) / counts["steps"])

    def at(self, effort: Effort) -> Case:
        """The case as quick mode measures it with that effort."""
        own, allowed = self.survey.settings.dt, FOR_REFERENCES * effort.seconds
        least = FEWEST if self.subject.names else 1
        repeats = self.repeats if "repeats" in self.given else min(self.repeats, max(least, effort.repeats))
        case = self.replace(repeats=repeats, refinements=1)
        if self.reference_cells and self.kind == CHAOTIC:
            fine = max(self.reference_cells[0].dt, own / 2)
            cells = tuple(dataclasses.replace(cell, dt=fine) for cell in self.reference_cells)
            runs = int(allowed / sum(map(self.seconds_of, cells)))
            case = case.replace(reference_cells=cells, ensemble=min(self.ensemble, max(runs, 2)))
        steps, fine = self.steps, 0.0
        finest = steps[-1] if "steps" in self.given else own / effort.down
        if self.reference_cells and self.kind != CHAOTIC:
            fine = own / 2
            while fine > finest / FINER and self._cost(fine / 2) <= allowed:
                fine /= 2
        if "steps" not in self.given:
            finest = max(finest, 2 * fine)
            near = [dt for dt in steps if 0.99 * finest < dt < 1.01 * own * effort.up]
            fits = own <= steps[0]
            steps = tuple(sorted({*near, *[own] * fits}, reverse=True)) or steps[:2]
        case = case.replace(steps=steps)
        if not fine:
            return case
        fineness = max(round(steps[-1] / fine), 2)
        return case.replace(fineness=fineness)._with_reference_step(steps[-1] / fineness)

    def _cost(self, dt: float) -> float:
        return sum(map(self.seconds_of, self._with_reference_step(dt).reference_cells))

    def _with_reference_step(self, dt: float) -> Case:
        """The case with other steps in its own references; those of chaotic scenes do not change."""
        if self.kind == CHAOTIC or not self.reference_cells:
            return self
        cells = [dataclasses.replace(cell, dt=dt) for cell in self.reference_cells[:2]]
        return self.replace(reference_cells=with_twice_the_step(cells), reference=None)

    def coarse_reference(self) -> Case:
        """The case with the largest steps allowed in its own references, where smooth motion lets them converge."""
        coarse = max(self.steps[0] / self.fineness**2, self.steps[-1] / self.fineness)
        coarse = min(coarse, self.steps[-1])
        return self._with_reference_step(coarse) if self.kind == SMOOTH else self

    def finer_reference(self) -> Case | None:
        """The case with smaller steps in its own references; None after the last refinement."""
        if self.kind == CHAOTIC or not self.reference_cells:
            return None
        finer = self.reference_cells[0].dt / self.fineness
        least = self.steps[-1] / self.fineness**self.refinements
        return self._with_reference_step(finer) if finer >= least else None


def case_of(
    target: Any, *, norms: Sequence[str] = (), seconds: float | None = None, repeats: int | None = None,
    steps: Sequence[float] = (), options: Mapping[str, Any] | None = None, seed: int = 0, each: Each = one_by_one,
) -> Case:  # fmt: skip
    """A case for a scene name, a file, or a function build(settings, seed=0) -> World.

    norms: the first is the main one; seconds: of each run; repeats; steps: s, the step lengths of the grid. Values not
    given come from the library or from a survey of the scene, see ``survey`` for each. Problem for a scene that cannot
    be measured.
    """
    check_arguments(norms, seconds, repeats, steps)
    known = KNOWN.get(target, Known()) if isinstance(target, str) else Known()
    subject = subject_of(target, {**dict(known.options), **(options or {})}, seed)
    for name in norms:
        check_norm(name, subject.names)
    duration = seconds or known.seconds or subject.seconds
    facts = survey(subject, duration, each)
    kind, why = facts.kind, facts.why
    chosen = tuple(norms) or known.norms or subject.names or OF_KIND[kind]
    if kind == CHAOTIC:
        asked, chosen = chosen, _statistics(subject, chosen, facts)
        left = [name for name in asked if not {name, MEAN + name} & {*chosen}]
        why += f"; places have no mean: {', '.join(left)}" if left else ""
    own, changes = facts.settings.dt, len(facts.inputs)
    usual = [dt for dt in grids.steps_for(facts) if dt <= own * (1 + 1e-9) or changes * dt <= DENSE * duration]
    ladder = _fitting(steps or known.steps or usual, duration)
    form, reference = _closed_form(subject, duration, kind, chosen)
    if kind == RESTING and set(chosen) <= set(OF_KIND[RESTING]) and facts.trial.reach <= facts.trial.size:
        form, reference = "what rests stays where it is: all these errors should be 0", facts.trial
    times = repeats or known.repeats or PHASES[kind]
    if "apex" in chosen and not (repeats or known.repeats):  # its error depends on where in a step it lies
        times = max(times, PHASES[IMPACTS])
    found = Case(
        subject, facts, kind, why, chosen, duration, times, ladder, form, reference,
        () if reference is not None else _own_references(facts, ladder, bool(subject.names)),
        known.orders if duration == known.seconds else (), fineness=FINER, ensemble=ENSEMBLE,
        given=tuple(name for name, value in (("steps", steps), ("repeats", repeats)) if value),
    )  # fmt: skip
    if kind == CHAOTIC and not facts.contacts and not subject.names:
        raise Problem(
            f"{subject.name} is chaotic: {facts.why}. No body can be compared with itself after {duration:g} s, and "
            f"without contacts there is no pressure or rate to measure instead: take a shorter time"
        )
    idle = [name for name in chosen if name in OF_CONTACTS]
    if idle and not facts.contacts:
        raise Problem(f"{subject.name}: {facts.why} within {duration:g} s, so there is no {' and no '.join(idle)}")
    chance = [name for name in chosen if name in BY_BODY]
    if kind == CHAOTIC and chance:
        raise Problem(
            f"{subject.name} is chaotic: {facts.why}, so no body can be compared with itself after {duration:g} s, and "
            f"{', '.join(chance)} would measure chance. Measure statistics (pressure, rate, kinetic), or a shorter time"
        )
    return found


def _statistics(subject: Subject, norms: Sequence[str], facts: Survey) -> tuple[str, ...]:
    """The norms, with means over the seeds of what a game compares; Problem if it compares places only."""
    places = [name for name in subject.names if len(facts.trial.values.get(name, ())) > 1]
    found = tuple(name if name in NORMS else MEAN + name for name in norms if name not in places)
    if not found:
        raise Problem(
            f"{subject.name} is chaotic: {facts.why}, so {', '.join(places)} would measure chance: let compared give "
            "numbers too, such as counts, times or scores"
        )
    return found


def check_arguments(
    norms: Sequence[str] = (), seconds: float | None = None, repeats: int | None = None, steps: Sequence[float] = ()
) -> None:
    """Raise ValueError, TypeError or Problem for arguments that no case can have."""
    if isinstance(norms, str):
        raise TypeError(f"norms must be a sequence of names, got {norms!r}")
    for name, numbers in (("seconds", () if seconds is None else (seconds,)), ("steps", steps)):
        for number in numbers:
            good = isinstance(number, (int, float)) and not isinstance(number, bool)
            if not good or not math.isfinite(number) or number <= 0:
                raise ValueError(f"{name} must be finite and above 0, got {number!r}")
    if repeats is not None and (isinstance(repeats, bool) or not isinstance(repeats, int) or repeats < 1):
        raise ValueError(f"repeats must be a whole number from 1, got {repeats!r}")


def _fitting(steps: Sequence[float], seconds: float) -> tuple[float, ...]:
    """Steps from largest to smallest, without those too long for the run; Problem if none is left."""
    largest = seconds / FEWEST_STEPS
    fitting = tuple(sorted({dt for dt in steps if dt <= largest}, reverse=True))
    if not fitting:
        raise Problem(f"a run of {seconds:g} s has no room for steps of {min(steps):g} s: at most {largest:g} s")
    return fitting


def _closed_form(subject: Subject, seconds: float, kind: str, norms: Sequence[str]) -> tuple[str, Seen | None]:
    """Name and result of the closed form, if it defines all the norms. Scenes at rest need none: the right answer is
    0."""
    form = FORMS.get(subject.target)
    if form is None or (subject.target == "jump" and kind != SMOOTH):
        return "", None
    if {name for name, _ in subject.options} - set(form.options):
        return "", None
    world = subject.world(None)
    seen = form.function(world, seconds)
    world.close()
    return (form.text, seen) if all(norm_of(name).is_usable_with(seen) for name in norms) else ("", None)


def _own_references(facts: Survey, ladder: Sequence[float], steered: bool) -> tuple[Cell, ...]:
    """Two methods that share as little as possible, with steps far below the smallest one measured. Unless the scene is
    chaotic, also the first method with twice that step, to detect errors that both methods share. steered: the systems
    of a game act in each step."""
    own = facts.settings
    fine = ladder[-1] / FINER
    if facts.kind == CHAOTIC:  # long runs; without forces the step does not affect the paths
        free = not (facts.forces or facts.damping or steered)
        fine = ladder[0] / 2 if free else ladder[-1]
        pairs = (("velocity_verlet", "event_driven"), ("velocity_verlet", "continuous"))
    elif facts.force_systems and not facts.contacts:
        pairs = (("yoshida4", own.collision), ("rk4", own.collision))
    elif facts.force_systems:  # two kinds of sweep: both could make the same error on a curved path
        pairs = (("yoshida4", "continuous"), ("velocity_verlet", "event_driven"))
    else:
        pairs = (("velocity_verlet", "event_driven"), ("velocity_verlet", "continuous"))
    cells = tuple(Cell(fine, integrator, collision, 32, "precise") for integrator, collision in pairs)
    return cells if facts.kind == CHAOTIC else with_twice_the_step(cells)


def with_twice_the_step(cells: Sequence[Cell]) -> tuple[Cell, ...]:
    """The two cells, and the first one with twice its step."""
    return (*cells, dataclasses.replace(cells[0], dt=2 * cells[0].dt))

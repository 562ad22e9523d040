"""The grid of settings that matter in a scene, and its runs.

Two trial runs with starts that differ by an invisible amount find what matters, and whether the scene is chaotic.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...framework import Settings, World
from ...framework.settings import COLLISION_MODES
from ..cli.loading import stdout_kept_clean
from ..cli.usage_errors import Problem
from ..inputs import forget_asked, times_asked
from ..jobs import Jobs
from ..measure.bodies import QUIET, apart, size_of, sizes_of
from ..measure.observer import ESCAPED, STOPPED, Observer, RunResult, step_lengths
from ..measure.timing import faults_in_results, timed
from .subject import Subject

NUDGE = 1e-10  # of the smallest body: the difference between the two starts
SEEN = 0.01  # of the smallest body: where bodies come, what changes with so little cannot be followed
CHAOS = 1e7  # a growth beyond this makes a nudge a thousandth of a body: chaotic
STILL = 0.01  # sizes per second: slower bodies are at rest

LONGEST = 1 / 30  # s: longer steps are tried only if the scene has one, or if asked for
STEPS = (8, 4, 2, 1, 1 / 2, 1 / 4)  # of the scene's own
FEWEST_STEPS = 3  # of a run
LOOKS = 2000  # at the state of a run, at most: a look may cost more than a step
DENSE = 0.5  # changes of the inputs per step: longer steps would be split too often to be judged
METHODS = ("semi_implicit_euler", "velocity_verlet", "rk4", "yoshida4")  # explicit Euler is tried only if asked for
SUBSTEPS = (1, 4, 16)
PHASES, SEEDS = 4, 4  # runs of a setting: start phases, by where events fall within a step; of a chaotic scene

FIELDS = ("dt", "integrator", "collision", "substeps")  # that are varied
AWHILE = 0.2  # s: for the passes of a run that is timed
PASSES, BLOCK = 10, 20  # at most; steps between two looks at the clock


@dataclass(frozen=True)
class Task:
    """One run. phase: the length of its first step, in steps; nudged: how far bodies start from where they should, in
    sizes; inputs: when these change, s: there a step ends; whole: without a last partial step."""

    subject: Subject
    settings: Settings
    seconds: float
    seed: int
    phase: float = 1.0
    nudged: float = 0.0
    inputs: tuple[float, ...] = ()
    walled: bool = True
    whole: bool = False
    step: float = dataclasses.field(default=0.0, compare=False, repr=False)  # s that one step takes, about

    @functools.cached_property
    def key(self) -> str:
        """Identifies the run, in this process and later ones."""
        mark = self.subject.mark
        return mark and hashlib.sha256(repr((mark, dataclasses.replace(self, subject=None))).encode()).hexdigest()[:24]

    @property
    def cost(self) -> float:
        """About how long it takes, s."""
        return self.seconds / self.settings.dt * self.step

    def world(self) -> World:
        """The world at its start."""
        world = self.subject.world(self.settings, self.seed)
        if self.nudged:
            nudge(world, self.nudged * size_of(world, sizes_of(world)), self.seed)
        return world


@QUIET
@faults_in_results()
def perform(task: Task) -> RunResult:
    """What the run shows; of one that an error ends that it has failed, and why."""
    try:
        loaded = task.subject.loaded
        with closing(task.world()) as world, loaded.attribute_errors(), stdout_kept_clean():
            watch = Observer(world, task.seconds, task.walled)
            steps = step_lengths(task.seconds, task.settings.dt, task.phase, task.whole, task.inputs)
            every = -(-len(steps) // LOOKS)
            for done, step in enumerate(steps, 1):
                watch.step(step)
                if done % every == 0 or done == len(steps):
                    watch.look()
                if watch.seen.failure:
                    break
            seen = watch.finished()
            if not seen.failure:
                seen.values = loaded.values_of(world)
            elif world.physics is not None:
                world.physics.report_faults("")  # of what no step has looked at yet
                seen.detail = "; ".join(world.faults[:1])
            return seen
    except Problem as problem:
        return RunResult(np.zeros((0, 2)), failure=STOPPED, detail=problem.message, seconds=task.seconds)


def nudge(world: World, size: float, seed: int = 0) -> None:
    """Move every dynamic body by up to ``size`` along each axis, at random from ``seed``.

    Not along an axis on which all bodies are at one place and nothing moves or falls: bodies on a line stay on it.
    """
    dynamic = world.bodies.dynamic
    position = dynamic.position
    axes = np.ptp(position, axis=0) > 0 if len(position) > 1 else np.ones(position.shape[1], bool)
    axes |= np.any(dynamic.linear_velocity, axis=0) | (np.asarray(world.gravity) != 0)
    position += np.random.default_rng(seed).uniform(-size, size, position.shape) * axes


@faults_in_results()
def milliseconds(task: Task) -> float | None:
    """Of this machine per simulated second, without observing it: the least of some passes; None if kernels loaded in
    each of them."""
    passes, total = [], 0.0
    for _ in range(PASSES):
        spent = simulated = 0.0
        with closing(task.world()) as world, task.subject.loaded.attribute_errors(), stdout_kept_clean():
            world.step()  # the first one prepares what all others use
            for _ in range(max(int(task.seconds / task.settings.dt / BLOCK), 1)):
                seconds, valid, _ = timed(lambda world=world: [world.step() for _ in range(BLOCK)])
                spent, simulated = spent + seconds * valid, simulated + BLOCK * task.settings.dt * valid
                total += seconds
                if total > AWHILE:
                    break
        passes += [1e3 * spent / simulated] if simulated else []
        if passes and total > AWHILE:
            break
    return min(passes, default=None)


# -- what matters in a scene ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Facts:
    """What the trial runs have shown.

    settings: those that the scene recommends; task, trial: a run with about these, and what it has shown
    seeded: seeds change its start; force_systems, free: there are such; nothing but contacts acts on bodies
    contacts: solid bodies touch; rests: in the end all is at rest on something
    chaotic: two almost equal starts diverge; why: in words
    """

    settings: Settings
    task: Task
    trial: RunResult
    seeded: bool
    force_systems: bool
    free: bool
    contacts: bool
    rests: bool
    chaotic: bool
    why: str

    @property
    def exact(self) -> Settings:
        """Of the reference, whose step is smaller: a method of high order, with all impacts at their true times."""
        fine = self.settings.replace(substeps=max(self.settings.substeps, 32 if self.rests else 8), geometry="precise")
        if self.chaotic:  # its statistics need no times of impacts, but many runs
            return fine.replace(collision="continuous")
        if self.contacts:
            return fine.replace(integrator="velocity_verlet", collision="event_driven")
        return fine.replace(integrator="yoshida4" if self.force_systems else "velocity_verlet")

    @property
    def other(self) -> Settings:
        """Another method as good, which would not make the same mistake."""
        if self.contacts:
            return self.exact.replace(collision="continuous")
        return self.exact.replace(integrator="rk4" if self.force_systems else "velocity_verlet")


def survey(subject: Subject, seconds: float, jobs: Jobs) -> Facts:
    """Two trial runs; Problem for a scene that cannot be measured."""
    with closing(subject.world(None)) as recommended, subject.loaded.attribute_errors(), stdout_kept_clean():
        settings, start = recommended.settings, recommended.state_hash()
        dynamic = recommended.bodies.dynamic
        if not len(dynamic) and subject.loaded.compared is None:  # a game may begin with characters, or with a title
            raise Problem(f"{subject.name}: there is no body that moves by itself: nothing to measure")
        forces = bool(recommended.force_systems), bool(np.any(recommended.gravity) and np.any(dynamic.gravity_scale))
        free = not (any(forces) or np.any(dynamic.constant_force) or np.any(dynamic.linear_damping))
        forget_asked()
        recommended.step()
    seeded = _is_seeded(subject, settings, start)
    swept = settings.replace(collision="event_driven" if settings.collision == "event_driven" else "continuous")
    task = Task(subject, swept, seconds, subject.seed, inputs=times_asked(seconds))

    def tried(task: Task) -> RunResult:
        seen = jobs.all(perform, [task], f"{subject.name}: trial runs")[0]
        if seen.failure not in (None, ESCAPED):
            raise Problem(
                seen.detail if seen.failure == STOPPED else f"{subject.name}: the trial run with {settings.dt:.4g} s "
                f"steps failed after {seen.simulated:.4g} s: {'; '.join(filter(None, (seen.failure, seen.detail)))}"
            )
        return seen

    first = tried(task)
    if first.failure:  # for example a ball that rolls off a platform
        task = dataclasses.replace(task, walled=False)
        first = tried(task)
    if not first.reach and not first.counts["solver_loops"]:
        raise Problem(f"{subject.name}: no body moves within {seconds:g} s: nothing to measure")
    contacts = bool(first.struck)
    least = SEEN if first.created else NUDGE
    other = tried(dataclasses.replace(task, nudged=least, walled=False))
    grown = np.inf
    if other.entities == first.entities:
        ways, _ = apart((other.entities, other.position), (first.entities, first.position))
        grown = float(ways.max(initial=0.0)) / first.size
    rests = contacts and first.counts["solver_loops"] > 0 and first.speed <= STILL and not first.values
    chaotic = grown > (1.0 if first.created else CHAOS * NUDGE)
    why = f"two starts {least:g} of a body apart end {grown:.1e} of it apart"
    task = dataclasses.replace(task, step=1e-3 * (first.milliseconds or 0.0) * settings.dt)
    return Facts(settings, task, first, seeded, forces[0], free, contacts, rests, chaotic, why)


def _is_seeded(subject: Subject, settings: Settings, start: str) -> bool:
    """True if seeds change the start, whose hash is given; Problem if the same seed gives different worlds."""

    def of(seed: int) -> str:
        with closing(subject.world(settings, seed)) as world:
            return world.state_hash()

    if of(subject.seed) != start:
        raise Problem(
            f"{subject.name}: build makes another world each time, with the same settings and seed: draw what is "
            "random from numpy.random.default_rng(seed)"
        )
    return of(subject.seed + 1) != start


# -- what is varied -------------------------------------------------------------------------------------------------


def grid(facts: Facts, vary: Mapping[str, Sequence[Any]]) -> tuple[Settings, ...]:
    """Every setting that makes a difference, and the scene's own, the longest steps first. vary: other values of these
    fields. Problem for a run without room for any step."""
    own, seconds, many = facts.settings, facts.task.seconds, max(len(facts.task.inputs), 1)
    most = max(own.dt, min(LONGEST * (1 + 1e-9), DENSE * seconds / many))
    methods = METHODS if facts.force_systems else METHODS[:2]
    if facts.rests or facts.free or facts.chaotic:  # the solver, or chance, determines the result
        methods = (own.integrator,)
    collisions = COLLISION_MODES[: 2 if facts.chaotic else 3] if facts.contacts else (own.collision,)
    values: dict[str, Sequence[Any]] = {
        "dt": [dt for factor in STEPS if (dt := own.dt * factor) <= most],
        "integrator": list(dict.fromkeys((own.integrator, *methods))),
        "collision": sorted({own.collision, *collisions}, key=COLLISION_MODES.index),
        "substeps": sorted({own.substeps, *SUBSTEPS}) if facts.rests else (own.substeps,),
        **vary,
    }
    longest = seconds / FEWEST_STEPS
    fitting = sorted({dt for dt in values["dt"] if dt <= longest}, reverse=True)
    if not fitting:
        raise Problem(
            f"a run of {seconds:g} s has no room for steps of {min(values['dt']):g} s: at most {longest:g} s"
        )
    cells = [own.replace(dt=dt) for dt in fitting]
    for name in list(values)[1:]:
        cells = [cell.replace(**{name: value}) for cell in cells for value in values[name]]
    # In its own flight, a world driven by events ignores the integrator.
    one = own.integrator if own.integrator in values["integrator"] else values["integrator"][0]
    cells = [cell.replace(integrator=one) if cell.collision == "event_driven" else cell for cell in cells]
    return tuple(dict.fromkeys([*cells, own] if own.dt <= longest and "dt" not in vary else cells))


def tasks_of(facts: Facts, settings: Settings, repeats: Iterable[int]) -> list[Task]:
    """The runs of a setting: start phases, spread evenly however many there are (van der Corput's sequence, in the
    order of the Gray code: 1, 1/2, 1/4, 3/4, ...), or seeds of a chaotic scene."""
    first = dataclasses.replace(facts.task, settings=settings, whole=facts.rests)
    if facts.chaotic:
        nudged = 0.0 if facts.seeded else max(1e3 * NUDGE, SEEN * (facts.trial.created > 0))
        return [dataclasses.replace(first, seed=first.seed + repeat, nudged=nudged) for repeat in repeats]
    codes = [repeat ^ repeat >> 1 for repeat in repeats]
    phases = [1.0 - sum((code >> k & 1) / 2 ** (k + 1) for k in range(code.bit_length())) for code in codes]
    return [dataclasses.replace(first, phase=phase) for phase in phases]

"""Cost and benefit of each collision mode: the same bodies, discrete, continuous and event-driven.

All modes of a scene start from the same bodies and alternate in short blocks, with a different one first each time.
Each repeat runs every scene once, in a different order and with a different seed. After each block the same number of
steps runs inside a profile, which gives the fraction of the step spent in the impact loop.
"""

from __future__ import annotations

import contextlib
import statistics
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from .... import scenes
from ....framework import Settings, World
from ....framework.compilation import log
from ...bench.report import digits, span
from ...bench.results import machine
from ...cli.usage_errors import Problem
from ...measure.body_shapes import shapes_of
from ...measure.escape import Enclosure
from ...measure.timing import Spread, no_garbage_collection, timed
from ...plain import Plain
from ...reporting.progress import NO_PROGRESS, Progress
from ...reporting.text_tables import TextTable
from ...wording import NOTHING

STEPS = 60
REPEATS = 5
BLOCKS = 10  # of the timed steps: the modes alternate this many times
WARM_UP_STEPS = 10
IMPACT_LOOP = "resolve_impacts"  # the kernel that resolves impacts one by one

DISCRETE, CONTINUOUS, EVENT_DRIVEN = "discrete", "continuous", "event_driven"
ONE_SWEPT = "discrete, one ccd"  # one body with ccd
KINDS = (DISCRETE, CONTINUOUS, EVENT_DRIVEN)

RATIO, PER_IMPACT, ESCAPED, CAPPED = "ratio", "µs per impact", "escaped", "capped"
Limits = Mapping[str, float]


def _limits(**of: Limits) -> Mapping[str, Limits]:
    return MappingProxyType(of)


@dataclass(frozen=True)
class Course:
    """One measured scene.

    ``part``
        distinguishes two courses of one scene
    ``first``
        number of untimed steps at the start
    ``energy``
        "kept": kinetic energy must be conserved; "left": it must be dissipated
    ``share``
        fraction of the requested steps that is timed
    ``limits``
        by collision mode: upper limits of the figures
    """

    scene: str
    bodies: int
    part: str = ""
    first: int = WARM_UP_STEPS
    energy: str = "kept"
    share: float = 1.0
    kinds: tuple[str, ...] = KINDS
    limits: Mapping[str, Limits] = field(default_factory=_limits)

    @property
    def label(self) -> str:
        return " ".join(filter(None, (self.scene, f"{self.bodies:,}", self.part)))

    def build(self, kind: str, seed: int) -> World:
        """Build the world; scenes accept more keywords than their protocol declares."""
        function: Any = scenes.get(self.scene).build
        mode = DISCRETE if kind == ONE_SWEPT else kind
        world: World = function(Settings(collision=mode), seed, n=self.bodies)
        if kind == ONE_SWEPT:
            world.bodies.dynamic.ccd[0] = True
        return world

    def steps(self, asked: int) -> int:
        """The number of timed steps."""
        return max(1, round(self.share * asked))


SLOW: Limits = {RATIO: 1.5}  # no fast bodies: sweeping finds nothing to do
SAFE: Limits = {ESCAPED: 0, CAPPED: 0}

COURSES: tuple[Course, ...] = (
    Course("gas2d", 1000, limits=_limits(continuous=SLOW)),
    Course(
        "gas2d",
        10_000,
        kinds=(DISCRETE, ONE_SWEPT, CONTINUOUS, EVENT_DRIVEN),
        limits=_limits(continuous=SLOW, event_driven={RATIO: 5, PER_IMPACT: 1.5}),
    ),
    Course("fastgas", 1000, limits=_limits(continuous={ESCAPED: 0}, event_driven={ESCAPED: 0})),
    Course("bullets", 1000, share=1 / 6, limits=_limits(continuous=SAFE, event_driven=SAFE)),
    Course("pile2d", 1000, "falling", first=30, energy="left"),
    Course("pile2d", 1000, "settled", first=600, energy="left", limits=_limits(continuous=SLOW)),
)


def outer_box(world: World) -> Enclosure:
    """The box around all static shapes. Walls surround every scene here, so a body outside it has escaped."""
    shapes = shapes_of(world)
    fixed = shapes.where(shapes.static)
    return Enclosure(fixed.lower.min(axis=0), fixed.upper.max(axis=0))


class Run:
    """A world being measured: seconds, impacts and rounds of the timed steps, loop shares of the profiled steps."""

    def __init__(self, world: World, first: int) -> None:
        self.world = world
        self.bin = outer_box(world)
        self.energy_at_start = world.kinetic_energy()
        self.steps, self.seconds, self.impacts, self.rounds = 0, 0.0, 0, 0
        self.shares: list[float] = []  # by block: fraction of the time spent in the impact loop
        self.take(first)
        self.capped_before = self.counters()["capped_impacts"]

    def take(self, count: int) -> None:
        """Take ``count`` steps."""
        step = self.world.step
        for _ in range(count):
            step()

    def counters(self) -> dict[str, int]:
        """The world's counters since its creation."""
        return self.world.stats().counters

    def note(self, seconds: float, count: int, before: dict[str, int]) -> None:
        """Add a timed block of ``count`` steps; before: the counters at its start."""
        after = self.counters()
        self.steps += count
        self.seconds += seconds
        self.impacts += after["impacts"] - before["impacts"]
        self.rounds += after["rounds"] - before["rounds"]

    def profile(self, count: int) -> None:
        """Take ``count`` steps inside a profile."""
        before = self.world.stats().profiled
        with self.world.profile(), no_garbage_collection():
            started = time.perf_counter()  # the clock that profiles use: background load affects both alike
            self.take(count)
            seconds = time.perf_counter() - started
        block = self.world.stats().profiled - before
        loop = sum(spent for (_, name), spent in block.kernel_seconds.items() if name == IMPACT_LOOP)
        self.shares.append(loop / seconds)

    def found(self) -> Found:
        """The figures of this run."""
        impacts = self.impacts / self.steps
        microseconds = 1e6 * self.seconds / self.impacts if impacts >= 1 else None  # with fewer: the search's time
        energy = self.world.kinetic_energy()
        position = np.array(self.world.bodies.dynamic.position)
        finite = np.isfinite(position).all(axis=1)
        return Found(
            milliseconds=1e3 * self.seconds / self.steps,
            impacts=impacts,
            rounds=1 + self.rounds / self.steps,
            step_us=microseconds,
            loop_us=None if microseconds is None else statistics.median(self.shares) * microseconds,
            change=energy / self.energy_at_start - 1 if self.energy_at_start else 0.0,
            joules=energy,
            escaped=self.bin.outside(position[finite]) + int((~finite).sum()),
            capped=self.counters()["capped_impacts"] - self.capped_before,
        )


@dataclass(frozen=True)
class Found:
    """Figures of one run in one mode: impacts and rounds per step, energies at the end."""

    milliseconds: float
    impacts: float
    rounds: float
    step_us: float | None
    loop_us: float | None
    change: float
    joules: float
    escaped: int
    capped: int


@dataclass
class ModeCost(Plain):
    """One collision mode in one scene.

    ``milliseconds`` per step; ``ratio``: to discrete, within each repeat; ``impacts`` and ``rounds`` per step, means;
    ``step_us`` and ``loop_us``: microseconds per impact, of the whole step and of the impact loop alone, None if there
    is less than one impact per step. Worst of the repeats, at the end: ``change`` of the kinetic energy as a fraction
    of the start's, bodies ``escaped``, impacts ``capped`` since timing began; ``joules`` left, the mean.
    """

    scene: str
    kind: str
    bodies: int
    steps: int
    energy: str
    limits: dict[str, float]
    milliseconds: Spread
    ratio: Spread
    impacts: float
    rounds: float
    step_us: Spread | None
    loop_us: Spread | None
    change: float
    joules: float
    escaped: int
    capped: int


@dataclass
class Modes(Plain):
    """All scenes with all their modes. ``steps``: the number requested."""

    steps: int
    repeats: int
    machine: dict[str, str]
    compile_seconds: float
    costs: list[ModeCost]


def modes(
    steps: int = STEPS, repeats: int = REPEATS, progress: Progress = NO_PROGRESS, courses: Iterable[Course] = COURSES
) -> Modes:
    """Run every course in all its modes once per repeat, each time starting with another course."""
    courses = list(courses)
    found: dict[tuple[str, str], list[Found]] = {(c.label, kind): [] for c in courses for kind in c.kinds}
    waited = log.waited
    progress.begin(len(courses) * repeats)
    for repeat in range(repeats):
        first = repeat * len(courses) // repeats
        for course in (*courses[first:], *courses[:first]):
            progress.say(f"{course.label}, repeat {repeat + 1} of {repeats}")
            for kind, one in _repeat(course, repeat, course.steps(steps)).items():
                found[course.label, kind].append(one)
            progress.advance(1)
    costs = [_cost(course, kind, course.steps(steps), found) for course in courses for kind in course.kinds]
    return Modes(steps, repeats, machine(), log.waited - waited, costs)


def _repeat(course: Course, repeat: int, steps: int) -> dict[str, Found]:
    """All modes of one course, alternating."""
    with contextlib.ExitStack() as stack:
        runs = {}
        for kind in course.kinds:
            world = stack.enter_context(contextlib.closing(course.build(kind, repeat)))
            runs[kind] = Run(world, course.first)
        ends = np.linspace(0, steps, min(BLOCKS, steps) + 1).astype(int)
        for block, count in enumerate(np.diff(ends).tolist()):
            turn = (block + repeat) % len(runs)
            kinds = [*course.kinds[turn:], *course.kinds[:turn]]
            before = {kind: runs[kind].counters() for kind in kinds}
            seconds, counts = {}, True
            with no_garbage_collection():
                for kind in kinds:
                    seconds[kind], undisturbed, _ = timed(partial(runs[kind].take, count))
                    counts &= undisturbed
            if counts:
                for kind, run in runs.items():
                    run.note(seconds[kind], count, before[kind])
            for run in runs.values():
                run.profile(count)
        if not all(run.steps for run in runs.values()):
            raise Problem(f"{course.label}: kernels were compiled in all blocks of steps; run it once more")
        return {kind: run.found() for kind, run in runs.items()}


def _cost(course: Course, kind: str, steps: int, found: dict[tuple[str, str], list[Found]]) -> ModeCost:
    """Combine all repeats."""
    own, plain = found[course.label, kind], found[course.label, DISCRETE]
    ratios = [one.milliseconds / other.milliseconds for one, other in zip(own, plain, strict=True)]

    def mean(of: Callable[[Found], float]) -> float:
        return float(np.mean([of(one) for one in own]))

    return ModeCost(
        course.label, kind, course.bodies, steps, course.energy, dict(course.limits.get(kind, {})),
        milliseconds=Spread.of([one.milliseconds for one in own]),
        ratio=Spread.of(ratios),
        impacts=mean(lambda one: one.impacts),
        rounds=mean(lambda one: one.rounds),
        step_us=_spread([one.step_us for one in own]),
        loop_us=_spread([one.loop_us for one in own]),
        change=max((one.change for one in own), key=abs),
        joules=mean(lambda one: one.joules),
        escaped=max(one.escaped for one in own),
        capped=max(one.capped for one in own),
    )  # fmt: skip


def _spread(values: list[float | None]) -> Spread | None:
    """None if any repeat has no value."""
    known = [value for value in values if value is not None]
    return Spread.of(known) if len(known) == len(values) else None


def tables(result: Modes) -> list[TextTable]:
    """The tables of cost and benefit."""
    return [_times(result), _quality(result)]


def remarks(result: Modes) -> list[str]:
    """Notes below the tables."""
    return [f"compiling and loading kernels: {result.compile_seconds:.1f} s, not counted"]


def _times(result: Modes) -> TextTable:
    cells = []
    for cost in result.costs:
        alone = cost.kind == DISCRETE
        per_impact = [NOTHING if spread is None else digits(spread.median) for spread in (cost.step_us, cost.loop_us)]
        cells.append((
            cost.scene, cost.kind, digits(cost.milliseconds.median), NOTHING if alone else digits(cost.ratio.median),
            NOTHING if alone else span(cost.ratio), digits(cost.impacts), *per_impact, digits(cost.rounds),
            _at_most(cost, RATIO, PER_IMPACT),
        ))  # fmt: skip
    headings = (
        "scene", "collision", "ms", "ratio", "from .. to", "impacts", "µs per impact", "its loop alone", "rounds",
        "at most",
    )  # fmt: skip
    repeats = f"medians of {result.repeats} repeats" if result.repeats > 1 else "one repeat"
    title = f"ms, impacts and rounds per step: {repeats}; ratio: to discrete"
    return TextTable(title, headings, cells, words=2)


def _quality(result: Modes) -> TextTable:
    cells = [
        (
            cost.scene,
            cost.kind,
            f"{digits(cost.joules)} J" if cost.energy == "left" else f"{cost.change:+.1e}" if cost.change else "0",
            str(cost.escaped),
            str(cost.capped),
            _at_most(cost, ESCAPED, CAPPED),
        )
        for cost in result.costs
    ]
    title = (
        "at the end, the worst repeat: change of the kinetic energy or what is left of it, bodies escaped, impacts"
        " beyond the cap"
    )
    return TextTable(title, ("scene", "collision", "energy", "escaped", "capped", "at most"), cells, words=2)


def _at_most(cost: ModeCost, *names: str) -> str:
    """The limits with these names as one table cell."""
    named = [f"{name} {cost.limits[name]:g}" for name in names if name in cost.limits]
    return ", ".join(named) or NOTHING

"""Survey of a scene: trial runs find its kind and which settings matter.

Two runs with starts that differ by an invisible amount tell whether it is chaotic, by the ratio of their distance at
the end to that at the start.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...framework import Settings, World
from ..cases.subjects import Subject
from ..cli.usage_errors import Problem
from ..engines.adapters import CaromEngine
from ..inputs import forget_asked, times_asked
from ..trading.records import CHAOTIC, ESCAPED, IMPACTS, RESTING, SMOOTH
from .norms import distances
from .observation import Seen, mean_of, observe
from .timing import faults_in_results, now

NUDGE = 1e-10  # of the smallest body: the difference between the two starts
SEEN = 0.01  # of the smallest body: where bodies come, what changes with so little cannot be followed
CHAOS = 1e7  # a growth beyond this makes a nudge a thousandth of a body: chaotic
STILL = 0.01  # sizes per second: slower bodies are at rest
TRIED = 3  # steps that are timed
LONG = 3.0  # s for both runs: then each has a process of its own

Each = Callable[[Callable[[Any], Any], Iterable[Any]], list[Any]]


@dataclass(frozen=True)
class Survey:
    """Facts of a scene.

    settings: those it recommends; settings that are not varied keep these values
    growth: of the distance between two nearby starts, over the run
    speed: the largest at the end, sizes per second
    seeded: whether seeds change the start
    walled: whether walls hold all bodies: a body beyond them in another run has escaped
    trial: the observation of the run with all impacts at their true times; of a chaotic game the mean of some
    nudge: sizes of a body by which repeats of a chaotic scene without seeds differ
    inputs: times at which the recorded inputs change that the game plays back, s
    """

    settings: Settings
    force_systems: bool
    forces: bool
    damping: bool
    levels: bool
    contacts: int
    resting: int
    growth: float
    speed: float
    seeded: bool
    walled: bool
    trial: Seen
    nudge: float = 1e3 * NUDGE
    inputs: tuple[float, ...] = ()

    @property
    def kind(self) -> str:
        """SMOOTH, IMPACTS, RESTING or CHAOTIC."""
        if not self.contacts:
            return CHAOTIC if self.growth > CHAOS else SMOOTH
        if self.resting and self.speed <= STILL and not self.trial.values:  # a game tells itself what matters
            return RESTING
        return CHAOTIC if self.growth > CHAOS else IMPACTS

    @property
    def why(self) -> str:
        """How the kind was determined, in a sentence."""
        grown = f"two starts {NUDGE:g} of a body apart grew {self.growth:.1e} times farther apart"
        if self.growth == math.inf:
            grown = f"bodies come, and a start {SEEN:g} of a body apart becomes another game"
        if not self.contacts:
            return f"nothing touches anything; {grown}" if self.kind == CHAOTIC else "nothing touches anything"
        if self.kind == RESTING:
            return f"in the end all is at rest: no body faster than {self.speed:.1e} of its size per second"
        return grown if self.kind == CHAOTIC else f"bodies meet; {grown}, which is no chaos"


def one_by_one(function: Callable[[Any], Any], tasks: Iterable[Any]) -> list[Any]:
    """The function's result for each task."""
    return [function(task) for task in tasks]


@faults_in_results()
def survey(subject: Subject, seconds: float, each: Each = one_by_one) -> Survey:
    """Run the scene twice, with all impacts at their true times; Problem for one that cannot be measured.

    each: what shares out long runs.
    """
    with closing(subject.world(None)) as recommended:
        settings, start = recommended.settings, recommended.state_hash()
        facts = _facts(subject.name, recommended)
    seeded = _seeded(subject, settings, start)
    exact = settings.replace(collision="event_driven")
    known: dict[tuple[float, bool], Seen] = {}  # by how far the start is nudged, and whether walls hold all

    def seen(nudged: float, walled: bool = False) -> Seen:
        start = nudged, walled
        if start not in known:
            known[start] = run(start)
        return known[start]

    with closing(_obedient(subject, exact.replace(dt=settings.dt / 2, substeps=settings.substeps + 1))) as other:
        forget_asked()
        with subject.loaded.attribute_errors():
            each_step = _time_of_step(other)
        inputs = times_asked(seconds)
        run = functools.partial(_twin, subject, exact, seconds, inputs)
        if 2 * seconds / settings.dt * each_step > LONG:
            starts = (0.0, True), (SEEN if subject.names else NUDGE, False)
            known.update(zip(starts, each(run, starts), strict=True))
        levels = other.stats().counters.get("first_level_tests", 0) > 0
    first, walled = seen(0.0, True), True
    if first.failure == ESCAPED:  # for example a ball that rolls off a platform
        first, walled = seen(0.0, False), False
    other = seen(SEEN) if first.created else first
    moved = float(distances(other, first)[0].max(initial=0.0))
    if other.entities != first.entities or moved > first.size:  # another game, in which other bodies come
        growth = math.inf
    else:
        nudged = seen(NUDGE)
        growth = float(distances(nudged, first)[0].max(initial=0.0)) / (NUDGE * nudged.size)
    if growth > CHAOS and subject.names:
        first = mean_of([first, seen(SEEN)], ())
    if not first.reach and not first.counts["solver_loops"]:
        raise Problem(f"{subject.name}: no body moves within {seconds:g} s: nothing to measure")
    return Survey(
        settings, growth=growth, contacts=max(sum(first.struck), int(first.met)), speed=first.speed, seeded=seeded,
        resting=int(first.counts["solver_loops"] > 0), walled=walled, levels=levels, trial=first,
        nudge=SEEN if growth == math.inf else 1e3 * NUDGE, inputs=inputs, **facts,
    )  # fmt: skip


def _facts(name: str, world: World) -> dict[str, Any]:
    dynamic = world.bodies.dynamic
    if not len(dynamic):
        raise Problem(f"{name}: there is no body that moves by itself: nothing to measure")
    gravity = bool(np.any(world.gravity) and np.any(dynamic.gravity_scale))
    constant = bool(np.any(dynamic.constant_force))
    return {
        "force_systems": bool(world.force_systems),
        "forces": gravity or constant or bool(world.force_systems),
        "damping": bool(np.any(dynamic.linear_damping)),
    }


def _time_of_step(world: World) -> float:
    """The seconds that a step takes when what it needs is there."""
    began = 0.0
    for _ in range(TRIED):
        began = now()
        world.step()
    return now() - began


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
def _twin(
    subject: Subject, settings: Settings, seconds: float, inputs: tuple[float, ...], start: tuple[float, bool]
) -> Seen:
    nudged, walled = start
    engine = CaromEngine(_obedient(subject, settings))
    if nudged:
        nudge(engine.world, nudged * engine.size)
    try:
        with subject.loaded.attribute_errors():
            seen = observe(engine, seconds, settings.dt, walled=walled, inputs=inputs, values=subject.loaded.values_of)
        if seen.failure not in (None, ESCAPED):
            if engine.world.physics is not None:
                engine.world.physics.report_faults("")  # of what no step has looked at yet
            raise Problem(
                f"{subject.name}: the trial run with {settings.dt:.4g} s steps failed after {seen.simulated:.4g} s: "
                f"{'; '.join([seen.failure, *engine.world.faults[:1]])}"
            )
        return seen
    finally:
        engine.close()


def _obedient(subject: Subject, settings: Settings) -> World:
    """The world with these settings; Problem if its settings differ."""
    world = subject.world(settings)
    changed = [
        f"{field.name}={getattr(world.settings, field.name)!r} instead of {getattr(settings, field.name)!r}"
        for field in dataclasses.fields(settings)
        if getattr(world.settings, field.name) != getattr(settings, field.name)
    ]
    if changed:
        world.close()
        raise Problem(
            f"{subject.name}: build must hand its settings to the World as they are, World(..., settings=settings); "
            f"its World has {', '.join(changed)}"
        )
    return world


def _seeded(subject: Subject, settings: Settings, start: str) -> bool:
    """True if seeds change the start, whose hash is given; Problem if the same seed gives different worlds."""
    hashes = []
    for seed in (0, 1):
        with closing(subject.world(settings, subject.seed + seed)) as world:
            hashes.append(world.state_hash())
    if hashes[0] != start:
        raise Problem(
            f"{subject.name}: build makes another world each time, with the same settings and seed: draw what is "
            "random from numpy.random.default_rng(seed)"
        )
    return hashes[1] != start

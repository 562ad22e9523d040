"""One run observed from outside: the figures that norms need, for any engine.

A run of T seconds takes a first step of a fraction of dt (its start phase), then whole steps, then the remainder. So it
ends at exactly T for any dt, and the phase sets where in a step events happen. Recorded inputs change between steps, at
the same times in every run: no error is the age of a key.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...framework import World
from ..plain import JsonRecord
from .body_shapes import Floats
from .engine import CaromEngine, carried

# Failures of runs; STOPPED: ended by an error.
NOT_FINITE, ESCAPED, TUNNELLED, BLEW_UP, STOPPED = "not finite", "escaped", "tunnelled", "blew up", "stopped"
SETTLED = 0.5  # fraction of the run after which contacts at rest are measured
EARLY = 0.2  # fraction of the run after which statistics begin
MOST_TIMES = 200  # impacts whose times are kept
SAMPLES = 200  # of the overlaps
LOOKS = 2000  # at the state of a run, at most: a look may cost more than a step
NEAR = 0.05  # of a step: an end of a step that close to a change of the inputs moves there


@dataclass
class RunResult(JsonRecord):
    """What one run showed. Lengths in the scene's units, energies in J, times in s.

    position (n, d): at the end, by entity id
    reach: the largest distance of a body from its start, over the run
    apex: the greatest height that a body gains over its own start, against gravity; 0 without gravity
    energy, kinetic: at the end; energy_start at the start; energy_worst: the largest departure from the start;
    energy_square: its mean square, J^2; energy_scale: the largest kinetic energy
    impacts, times: their number, and the times of the first ones
    pressure: mean force on static bodies, N, after the first part of the run; rate: impacts per second there
    overlap, overlap_mean: after half of the run, the worst and the mean over samples of the sum per body, in sizes of
    the smaller body
    speed: the largest at the end, sizes per second; drift: the largest displacement since half of the run, sizes
    struck (n,): bodies that touched anything
    failure: None, or why the run is unusable
    seconds: planned duration; simulated: the actual one, which is less if the run failed
    size: m, the smallest extent of the bodies
    milliseconds: cost of a simulated second on this machine; None if it is not known
    entities (n,): the bodies at the end; fixed: they are those of the start; created: how many came; met: something
    touched
    touches: pairs of entities and the time of their first contact, in order of time
    values: what a game compares, see ``Loaded.values_of``; spread: standard deviations from game to game, where these
    are means over that many ``runs``
    doubt, tolerance: m, of a reference: how far it may itself have a body elsewhere in the end; and a run, unnoticed
    """

    position: Floats
    reach: float = 0.0
    apex: float = 0.0
    energy: float = 0.0
    energy_start: float = 0.0
    energy_worst: float = 0.0
    energy_square: float = 0.0
    energy_scale: float = 0.0
    kinetic: float = 0.0
    impacts: int = 0
    times: list[float] = field(default_factory=list)
    pressure: float = 0.0
    rate: float = 0.0
    overlap: float = 0.0
    overlap_mean: float = 0.0
    speed: float = 0.0
    drift: float = 0.0
    struck: list[bool] = field(default_factory=list)
    failure: str | None = None
    counts: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0
    simulated: float = 0.0
    size: float = 1.0
    milliseconds: float | None = None
    entities: list[int] = field(default_factory=list)
    detail: str = ""
    fixed: bool = True
    created: int = 0
    met: bool = False
    touches: list[tuple[int, int, float]] = field(default_factory=list)
    values: dict[str, list[float]] = field(default_factory=dict)
    spread: dict[str, float] = field(default_factory=dict)
    runs: int = 1
    doubt: float = 0.0
    tolerance: float = 0.0


def observe(
    engine: CaromEngine, seconds: float, dt: float, phase: float = 1.0, whole_steps: bool = False, walled: bool = True,
    inputs: Sequence[float] = (),
    values: Callable[[World], dict[str, list[float]]] | None = None,
) -> RunResult:  # fmt: skip
    """Run ``engine`` for ``seconds``; phase: the first step's length in steps, above 0 up to 1.

    whole_steps: leave out the last partial step, because a change of the step length disturbs contacts at rest. walled:
    a body outside the walls around all bodies has escaped. inputs: when they change, s; there a step ends. values:
    what a game compares, read at the end.
    """
    watch = Observer(engine, seconds, walled)
    steps = step_lengths(seconds, dt, phase, whole_steps, inputs)
    every = -(-len(steps) // LOOKS)
    with np.errstate(over="ignore", invalid="ignore"):
        for done, step in enumerate(steps, 1):
            engine.step(step)
            watch.count()
            if done % every == 0 or done == len(steps):
                watch.look()
            if watch.seen.failure:
                break
        seen = watch.finished()
        if values is not None and seen.failure is None:
            seen.values = values(engine.world)
        return seen


def mean_of(seens: Sequence[RunResult], names: Iterable[str]) -> RunResult:
    """The averages of several runs: of these fields, and of what a game compares; all else is that of the first."""
    means: dict[str, Any] = {name: float(np.mean([getattr(seen, name) for seen in seens])) for name in names}
    values, spread = {}, {}
    for name in seens[0].values:
        known = np.array([value for seen in seens if not np.isnan(value := seen.values.get(name, [np.nan])).any()])
        values[name] = known.mean(axis=0).tolist() if len(known) else [math.nan]
        spread[name] = float(known.std(axis=0, ddof=1).max()) if len(known) > 1 else 0.0
    return dataclasses.replace(seens[0], **means, values=values, spread=spread, runs=len(seens))


def step_lengths(
    seconds: float, dt: float, phase: float, whole_steps: bool = False, inputs: Sequence[float] = ()
) -> list[float]:
    """The step lengths. A remainder below a millionth of a step is rounding, and omitted."""
    first = min(phase * dt, seconds)
    rest = seconds - first
    whole = int(rest / dt * (1 + 1e-12) + 1e-9)
    last = rest - whole * dt
    lengths = [first, *[dt] * whole, *([last] if last > 1e-6 * dt and not whole_steps else [])]
    if not inputs:
        return lengths
    ends = list(itertools.accumulate(lengths))
    changes = set(inputs)
    for change in inputs:
        k = bisect_left(ends, change)
        if k == len(ends):
            break
        near = [j for j in (k - 1, k) if 0 <= j < len(ends) - 1 and abs(ends[j] - change) < NEAR * dt]
        if near and ends[near[0]] not in changes:
            ends[near[0]] = change
        elif ends[k] != change:
            ends.insert(k, change)
    found = [end - before for before, end in itertools.pairwise([0.0, *ends])]
    return [dt if math.isclose(length, dt, rel_tol=1e-9) else length for length in found]


class Observer:
    """Observes the engine after its steps; ``seen`` is what it has shown so far.

    ``energies``: kinetic and whole energy, J, at the start and at each look.
    """

    def __init__(self, engine: CaromEngine, seconds: float, walled: bool = True) -> None:
        self.engine, self.walled = engine, walled
        self.start = self.settled = engine.position
        self.ids = engine.ids
        self.energies = [engine.energies]
        self.seen = RunResult(self.start, seconds=seconds)
        self.impulse, self.late_impacts = 0.0, 0
        self.mean_overlaps = [0.0]
        self.next_sample = SETTLED * seconds
        gravity = np.asarray(engine.world.gravity, float)
        size = float(np.linalg.norm(gravity))
        self.up = -gravity / size if size else None

    def count(self) -> None:
        """After each step: its impacts."""
        engine, seen = self.engine, self.seen
        seen.impacts += len(engine.times)
        if len(seen.times) < MOST_TIMES:
            seen.times += engine.times
        if engine.time > EARLY * seen.seconds:
            self.impulse += engine.impulse
            self.late_impacts += len(engine.times)

    def look(self) -> None:
        """Now and then: places and energy."""
        engine, seen = self.engine, self.seen
        position = self._followed()
        self.energies.append(engine.energies)
        if not (np.isfinite(position).all() and math.isfinite(self.energies[-1][0])):
            seen.failure = NOT_FINITE
            return
        way = position - self.start
        seen.reach = max(seen.reach, float(np.sqrt((way * way).sum(axis=1).max(initial=0.0))))
        if self.up is not None and len(way):
            seen.apex = max(seen.apex, float((way @ self.up).max()))
        if engine.time <= SETTLED * seen.seconds:
            self.settled = position
        if engine.time >= self.next_sample and engine.fixed:  # sizes are known of those of the start
            self.next_sample += seen.seconds * (1 - SETTLED) / SAMPLES
            depths = engine.overlaps()
            seen.overlap = max(seen.overlap, float(depths.max(initial=0.0)))
            self.mean_overlaps.append(float(depths.sum()) / max(len(position), 1))
        if self.walled and engine.enclosure.outside(position):
            seen.failure = ESCAPED

    def _followed(self) -> Floats:
        """The positions; what has come starts where it is seen first."""
        engine = self.engine
        position = engine.position
        if engine.ids is not self.ids:
            self.start = carried(self.start, self.ids, engine.ids, position.copy())
            self.settled = carried(self.settled, self.ids, engine.ids, position.copy())
            self.ids = engine.ids
        return position

    def finished(self) -> RunResult:
        """At the end: what is known only then."""
        engine, seen = self.engine, self.seen
        position, velocity = self._followed(), engine.velocity
        seen.position, seen.entities = position, engine.ids.tolist()
        seen.kinetic, seen.energy = engine.energies
        known = np.array([both for both in self.energies if math.isfinite(both[0])] or [(0.0, 0.0)])
        departures = np.abs(known[1:, 1] - known[0, 1])
        seen.energy_start, seen.energy_scale = float(known[0, 1]), float(known[:, 0].max())
        seen.energy_worst = float(departures.max(initial=0.0))
        seen.energy_square = float((departures**2).sum() / max(len(self.energies) - 1, 1))
        seen.times = sorted(seen.times)[:MOST_TIMES]
        late = (1 - EARLY) * seen.seconds
        seen.pressure, seen.rate = self.impulse / late, self.late_impacts / late
        seen.overlap_mean = float(np.mean(self.mean_overlaps))
        seen.size = engine.size
        seen.speed = _longest(velocity) / seen.size
        seen.drift = _longest(position - self.settled) / seen.size
        seen.struck, seen.met = engine.struck.tolist(), engine.met
        seen.touches = sorted(((a, b, at) for (a, b), at in engine.touches.items()), key=lambda touch: touch[2])
        seen.fixed, seen.created = engine.fixed, engine.created
        seen.counts, seen.simulated = engine.counts(), engine.time
        if engine.timed_seconds:
            seen.milliseconds = 1e3 * engine.spent / engine.timed_seconds
        return seen


def _longest(vectors: Floats) -> float:
    return float(np.sqrt((vectors * vectors).sum(axis=1)).max(initial=0.0))

"""A run observed from outside: the figures that norms and reports need.

A run of T seconds takes a first step of a fraction of dt (its start phase), then whole steps, then the remainder. So it
ends at exactly T for any dt, and the phase sets where in a step events happen. Recorded inputs change between steps, at
the same times in every run: no error is the age of a key.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from bisect import bisect_left
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ...framework import World
from .bodies import Floats, overlaps_of, sensor_entities, size_of, sizes_of, state_by_id, walls_around
from .timing import now, timed

# Failures of runs; STOPPED: ended by an error.
NOT_FINITE, ESCAPED, MISSED, BLEW_UP, STOPPED = "not finite", "escaped", "missed a contact", "blew up", "stopped"
SETTLED = 0.5  # fraction of the run after which contacts at rest are measured
EARLY = 0.2  # fraction of the run after which statistics begin
MOST_TIMES = 200  # impacts whose times are kept
MOST_TOUCHES = 400  # pairs whose first contact is kept
SAMPLES = 200  # of the overlaps
NEAR = 0.05  # of a step: an end of a step that close to a change of the inputs moves there


@dataclass
class RunResult:
    """What one run showed. Lengths in the scene's units, energies in J, times in s.

    position (n, d): at the end, by entity id; entities (n,): these; fixed: they are those of the start; created: how
    many came
    reach: the largest distance of a body from its start, over the run
    apex: the greatest height that a body gains over its own start, against gravity; 0 without gravity
    energy, kinetic: at the end; energy_start at the start; energy_worst: the largest departure from the start;
    energy_square: its mean square, J^2; energy_scale: the largest kinetic energy
    impacts, times: their number, and the times of the first ones
    pressure: mean force on static bodies, N, after the first part of the run; rate: impacts per second there
    overlap: after half of the run, the worst, in sizes of the smaller body
    speed: the largest at the end, sizes per second; drift: the largest displacement since half of the run, sizes
    struck: the entities that touched anything solid; touches: pairs of entities and the time of their first contact
    failure: None, or why the run is unusable; detail: more about it
    counts: see ``counts_of``
    seconds: planned duration; simulated: the actual one, which is less if the run failed
    size: m, the smallest extent of the bodies
    milliseconds: cost of a simulated second on this machine; None if it is not known
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
    speed: float = 0.0
    drift: float = 0.0
    struck: list[int] = field(default_factory=list)
    touches: list[tuple[int, int, float]] = field(default_factory=list)
    failure: str | None = None
    detail: str = ""
    counts: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0
    simulated: float = 0.0
    size: float = 1.0
    milliseconds: float | None = None
    entities: list[int] = field(default_factory=list)
    fixed: bool = True
    created: int = 0
    values: dict[str, list[float]] = field(default_factory=dict)
    spread: dict[str, float] = field(default_factory=dict)
    runs: int = 1
    doubt: float = 0.0
    tolerance: float = 0.0


class Observer:
    """Takes the steps of a world and looks at it between them; ``seen`` is what it has shown so far.

    walled: a body outside the walls around all bodies has escaped. clock: of the steps' times.
    energies: kinetic and whole energy, J, at the start and at each look
    step_seconds: of the steps that neither compiled nor loaded kernels; compile_seconds: of the others, in all
    """

    def __init__(
        self, world: World, seconds: float = math.inf, walled: bool = True, clock: Callable[[], float] = now
    ) -> None:
        self.world, self.walled, self.clock = world, walled, clock
        self.ids, self.start, _, _ = state_by_id(world)
        self.settled = self.start
        self.seen = RunResult(self.start, seconds=seconds)
        self.walls = walls_around(world)
        self.energies: list[tuple[float, float]] = []
        self._note_energies()
        self.step_seconds: list[float] = []
        self.compile_seconds = self._timed_seconds = 0.0
        self._bodies = np.array(world.bodies.entity), len(world.bodies.dynamic)
        self._sensors = [sensor_entities(world)]  # and those before the last change: what is touched may be deleted
        self._struck: set[int] = set()
        self._touches: dict[tuple[int, int], float] = {}
        self._impulse, self._late_impacts = 0.0, 0
        self._next_sample = SETTLED * seconds
        gravity = np.asarray(world.gravity, float)
        size = float(np.linalg.norm(gravity))
        self._up = -gravity / size if size else None

    def step(self, dt: float) -> bool:
        """One step of ``dt`` seconds; False if it compiled or loaded kernels, so that its time does not count."""
        world = self.world
        if world.settings.dt != dt:
            world.settings = world.settings.replace(dt=dt)
        before = world.time
        seconds, valid, _ = timed(world.step, self.clock)
        if valid:
            self.step_seconds.append(seconds)
            self._timed_seconds += dt
        else:
            self.compile_seconds += seconds
        self._follow()
        self._note_contacts(before)
        return valid

    def _follow(self) -> None:
        """Take up which bodies there are now; what has come starts where it is seen first."""
        bodies = self.world.bodies
        if len(bodies.dynamic) == self._bodies[1] and np.array_equal(bodies.entity, self._bodies[0]):
            return
        self._bodies = np.array(bodies.entity), len(bodies.dynamic)
        self._sensors = [sensor_entities(self.world), self._sensors[0]]
        ids, position, _, _ = state_by_id(self.world)
        if np.array_equal(ids, self.ids):
            return
        _, mine, theirs = np.intersect1d(ids, self.ids, assume_unique=True, return_indices=True)
        starts = position.copy(), position.copy()
        for new, old in zip(starts, (self.start, self.settled), strict=True):
            new[mine] = old[theirs]
        self.seen.fixed = False
        self.seen.created += len(ids) - len(mine)
        self.ids, (self.start, self.settled) = ids, starts

    def _note_contacts(self, before: float) -> None:
        """What touched in the world's last step, which began at that time."""
        seen, contacts = self.seen, self.world.contacts
        impacts, begin, a, b = contacts.impacts, contacts.begin, contacts.entity_a, contacts.entity_b
        late = self.world.time > EARLY * seen.seconds
        seen.impacts += len(impacts)
        self._late_impacts += late * len(impacts)
        if late and len(contacts):
            fixed = ~(np.isin(a, self.ids) & np.isin(b, self.ids))
            self._impulse += float(contacts.normal_impulse[fixed].sum())
        if not len(impacts) and not len(begin):
            return
        times = (before + np.asarray(impacts.time_of_impact)).tolist()
        if len(seen.times) < MOST_TIMES:
            seen.times += sorted(times)
        sensors = np.concatenate(self._sensors)
        solid = ~(np.isin(a, sensors) | np.isin(b, sensors))
        self._struck.update(a[solid].tolist(), b[solid].tolist())
        if len(self._touches) < MOST_TOUCHES:
            found = list(zip(times, impacts.entity_a.tolist(), impacts.entity_b.tolist(), strict=True))
            began = zip(begin.entity_a.tolist(), begin.entity_b.tolist(), strict=True)
            for time, one, other in sorted(found + [(self.world.time, *pair) for pair in began]):
                self._touches.setdefault((min(one, other), max(one, other)), time)

    def _note_energies(self) -> None:
        """Without the potential of force systems that do not report theirs."""
        kinetic = self.world.kinetic_energy()
        self.energies.append((kinetic, kinetic + self.world.potential_energy()))

    def look(self) -> None:
        """Now and then: places and energy."""
        world, seen = self.world, self.seen
        _, position, _, _ = state_by_id(world)
        self._note_energies()
        if not (np.isfinite(position).all() and math.isfinite(self.energies[-1][0])):
            seen.failure = NOT_FINITE
            return
        way = position - self.start
        seen.reach = max(seen.reach, _longest(way))
        if self._up is not None and len(way):
            seen.apex = max(seen.apex, float((way @ self._up).max()))
        if world.time <= SETTLED * seen.seconds:
            self.settled = position
        if world.time >= self._next_sample and seen.fixed:  # sizes are known of those of the start
            self._next_sample += seen.seconds * (1 - SETTLED) / SAMPLES
            _, _, depth, size = self.overlaps()
            seen.overlap = max(seen.overlap, float((depth / size).max(initial=0.0)))
        if self.walled and self.walls.outside(position):
            seen.failure = ESCAPED

    @cached_property
    def _sizes(self) -> dict[int, float]:
        return sizes_of(self.world)

    def overlaps(self) -> tuple[Any, Any, Floats, Floats]:
        """See ``overlaps_of``; a sensor that the last step has deleted is no body, either."""
        return overlaps_of(self.world, self._sizes, np.concatenate(self._sensors))

    def finished(self) -> RunResult:
        """At the end: what is known only then."""
        world, seen = self.world, self.seen
        _, seen.position, velocity, _ = state_by_id(world)
        seen.entities, seen.struck = self.ids.tolist(), sorted(self._struck)
        seen.kinetic, seen.energy = self.energies[-1]
        known = np.array([both for both in self.energies if math.isfinite(both[0])] or [(0.0, 0.0)])
        departures = np.abs(known[1:, 1] - known[0, 1])
        seen.energy_start, seen.energy_scale = float(known[0, 1]), float(known[:, 0].max())
        seen.energy_worst = float(departures.max(initial=0.0))
        seen.energy_square = float((departures**2).sum() / max(len(self.energies) - 1, 1))
        seen.times = sorted(seen.times)[:MOST_TIMES]
        late = (1 - EARLY) * seen.seconds
        seen.pressure, seen.rate = self._impulse / late, self._late_impacts / late
        seen.size = size_of(world, self._sizes)
        seen.speed, seen.drift = _longest(velocity) / seen.size, _longest(seen.position - self.settled) / seen.size
        seen.touches = sorted(((*pair, at) for pair, at in self._touches.items()), key=lambda touch: touch[2])
        seen.counts, seen.simulated = counts_of(world), world.time
        if self._timed_seconds:
            seen.milliseconds = 1e3 * sum(self.step_seconds) / self._timed_seconds
        return seen


def _longest(vectors: Floats) -> float:
    return float(np.sqrt((vectors * vectors).sum(axis=1)).max(initial=0.0))


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


# -- cost ------------------------------------------------------------------------------------------------


# ns each. A step runs Python code between kernels; an evaluation of forces calls each force system once.
WEIGHTS: Mapping[str, float] = {
    "steps": 50_000.0,
    "force_evaluations": 10_000.0,
    "bodies": 10.0,
    "candidates": 5.0,
    "pairs": 10.0,
    "impacts": 1_000.0,
    "rounds": 50_000.0,
    "solver_loops": 4.0,
}


def counts_of(world: World) -> dict[str, float]:
    """The world's counters since its creation, the same on every machine, with the same substeps throughout; bodies:
    summed over the steps; rounds: how often candidates were searched again within a step."""
    counters = dict(world.stats().counters)
    loops = counters.get("resting_contacts", 0) * world.settings.substeps
    counters |= {"steps": world.step_count, "solver_loops": loops}
    return {name: float(counters.get(name, 0)) for name in WEIGHTS}


def work_of(counts: Mapping[str, float]) -> float:
    """The weighted sum of the counts."""
    return sum(WEIGHTS[name] * count for name, count in counts.items())

"""Runs a world for a number of steps and measures it: what reports and pictures show."""

from __future__ import annotations

import dataclasses
import itertools
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..framework import World
from ..framework.compilation import log
from .escape import Enclosure
from .shapes import dimensions_of

TRACED_BODIES = 200  # in a picture
CANDIDATES = 12_000  # bodies that are followed, to choose from
QUIET = np.errstate(over="ignore", invalid="ignore")  # bodies out of range are reported, not warned about
SAMPLES = 600  # of a path and of the energy, at most


@dataclass(frozen=True)
class Drift:
    """A conserved quantity at the start and at the end, and the largest departure seen (sampled, in units of
    ``scale``).

    ``relative`` is the change over the run, ``worst`` the largest departure from the start on the way.
    """

    start: float | list[float]
    end: float | list[float]
    relative: float
    worst: float
    scale: float


@dataclass
class RunReport:
    """What a run was and what it showed; times as named, everything else in the scene's units."""

    scene: str
    seed: int
    dimensions: int
    settings: dict[str, Any]
    steps: int = 0
    simulated_seconds: float = 0.0
    wall_seconds: float = 0.0
    compile_seconds: float = 0.0  # what the steps took that compiled kernels, or loaded compiled ones
    kernels_compiled: int = 0
    kernels_loaded: int = 0
    bodies: dict[str, int] = field(default_factory=dict)
    contacts: dict[str, float] = field(
        default_factory=dict
    )  # at the end, mean and most per step, impacts in total
    step_milliseconds: float = 0.0  # median
    system_milliseconds: dict[str, float] = field(default_factory=dict)  # mean per step, compiling left out
    energy: Drift | None = None
    momentum: Drift | None = None
    momentum_conserved: bool = True  # whether the scene lets it be: nothing fixed, no force from outside
    deepest_overlap: float = 0.0
    deepest_overlap_step: int | None = None
    escaped: dict[str, int] = field(default_factory=dict)  # outside, non_finite
    counters: dict[str, int] = field(default_factory=dict)  # the world's own, totals
    faults: list[str] = field(default_factory=list)  # what went wrong without stopping the world
    state_hash: str = ""
    pictures: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """Plain dicts, lists and numbers, ready for json.dumps; what is not finite becomes None."""
        return _jsonable(dataclasses.asdict(self))


@dataclass
class Traces:
    """Paths: ``positions`` (samples, bodies, d), NaN where no body was; ``entities`` (bodies,), ascending."""

    entities: NDArray[np.int64]
    samples: list[NDArray[np.float32]] = field(default_factory=list)

    @property
    def places(self) -> NDArray[np.float64]:
        """All finite points of all paths, (n, d)."""
        points = self.positions.reshape(-1, self.samples[0].shape[1])
        return points[np.isfinite(points).all(axis=1)]

    @property
    def positions(self) -> NDArray[np.float64]:
        return np.array(self.samples, np.float64)

    @classmethod
    def of(cls, world: World) -> Traces:
        """Follows the dynamic bodies, or CANDIDATES of them."""
        ids = np.sort(np.asarray(world.bodies.dynamic.entity))
        if len(ids) > CANDIDATES:
            ids = np.sort(np.random.default_rng(0).choice(ids, CANDIDATES, replace=False))
        return cls(ids)

    def record(self, world: World) -> None:
        """Add a sample."""
        ids = np.asarray(world.bodies.entity)
        order = np.argsort(ids, kind="stable")
        place = np.searchsorted(ids, self.entities, sorter=order)
        sample = np.full((len(self.entities), dimensions_of(world)), np.nan, np.float32)
        if len(ids):
            row = order[np.minimum(place, len(ids) - 1)]
            there = ids[row] == self.entities
            sample[there] = world.bodies.position[row[there]]
        self.samples.append(sample)

    @QUIET
    def farthest(self, count: int) -> Traces:
        """The ``count`` bodies that travelled farthest."""
        if len(self.entities) <= count:
            return self
        travelled = np.zeros(len(self.entities))
        for before, after in itertools.pairwise(self.samples):
            travelled += np.nan_to_num(np.linalg.norm(after - before, axis=1))
        chosen = np.sort(np.argsort(-travelled, kind="stable")[:count])
        return Traces(self.entities[chosen], [sample[chosen] for sample in self.samples])


@dataclass
class Run:
    """A finished run: the report, the paths, and the world as it stands at the end."""

    report: RunReport
    traces: Traces
    world: World


class Meter:
    """Looks at a world between its steps; nothing here is inside the measured time of a step."""

    def __init__(self, world: World, every: int) -> None:
        self.world, self.every = world, every
        self.traces = Traces.of(world)
        self.enclosure = Enclosure.around(world)
        self.step_seconds: list[float] = []
        self.contact_counts: list[int] = []
        self.impacts = 0
        self.deepest, self.deepest_step = 0.0, None
        self.energies: list[float] = []
        self.kinetic_most = 0.0
        self.momenta: list[NDArray[np.float64]] = []
        self.momentum_scale = 0.0
        self._stats_base: tuple[int, dict[str, float]] = (0, {})
        self._kernels_seen = _kernels()
        started = time.perf_counter()
        self.sample()
        self.compile_seconds = time.perf_counter() - started if _kernels() != self._kernels_seen else 0.0
        self._kernels_seen = _kernels()

    @QUIET
    def sample(self) -> None:
        """Paths, energy and momentum: every few steps."""
        world = self.world
        self.traces.record(world)
        kinetic = float(world.kinetic_energy())
        self.kinetic_most = max(self.kinetic_most, kinetic)
        self.energies.append(kinetic + float(world.potential_energy()))
        self.momenta.append(np.array(world.momentum(), float))
        dynamic = world.bodies.dynamic
        speed = np.linalg.norm(dynamic.linear_velocity, axis=1)
        self.momentum_scale = max(self.momentum_scale, float(np.dot(np.asarray(dynamic.mass), speed)))

    def step(self) -> None:
        """One step, timed; then what must be seen after every step."""
        world = self.world
        started = time.perf_counter()
        world.step()
        seconds = time.perf_counter() - started
        if _kernels() != self._kernels_seen:  # this step compiled or loaded kernels: its time says nothing
            self._kernels_seen = _kernels()
            self.compile_seconds += seconds
            stats = world.stats()
            self._stats_base = (stats.steps, dict(stats.milliseconds))
        else:
            self.step_seconds.append(seconds)
        depth = np.asarray(world.contacts.depth)
        self.contact_counts.append(len(depth))
        self.impacts += len(world.contacts.impacts)
        if len(depth) and float(depth.max()) > self.deepest:
            self.deepest, self.deepest_step = float(depth.max()), world.step_count
        if world.step_count % self.every == 0:
            self.sample()

    @QUIET
    def fill(self, report: RunReport) -> None:
        """Write what was seen into ``report``."""
        world = self.world
        report.compile_seconds = self.compile_seconds
        report.steps, report.simulated_seconds = world.step_count, world.time
        bodies = world.bodies
        report.bodies = {
            "total": len(bodies),
            "dynamic": len(bodies.dynamic),
            "kinematic": len(bodies.kinematic),
            "static": len(bodies.static),
        }
        counts = self.contact_counts or [0]
        report.contacts = {
            "end": counts[-1],
            "mean": round(float(np.mean(counts)), 3),
            "most": max(counts),
            "impacts": self.impacts,
        }
        report.step_milliseconds = 1e3 * float(np.median(self.step_seconds)) if self.step_seconds else 0.0
        report.system_milliseconds = self._milliseconds_by_system()
        report.energy = self._energy_drift()
        report.momentum = self._momentum_drift()
        report.momentum_conserved = not (len(bodies.static) or len(bodies.kinematic) or np.any(world.gravity))
        report.deepest_overlap, report.deepest_overlap_step = self.deepest, self.deepest_step
        positions = np.asarray(bodies.dynamic.position)
        finite = np.isfinite(positions).all(axis=1) & np.isfinite(bodies.dynamic.linear_velocity).all(axis=1)
        report.escaped = {
            "outside": self.enclosure.outside(positions[finite]),
            "non_finite": int((~finite).sum()),
        }
        report.counters = dict(world.stats().counters)
        report.faults = list(world.faults)
        report.state_hash = world.state_hash()

    def _milliseconds_by_system(self) -> dict[str, float]:
        """Means over the steps since the last one that compiled; over all, if that was the very last."""
        stats = self.world.stats()
        base_steps, base = self._stats_base
        steps = stats.steps - base_steps
        if steps <= 0:
            return dict(stats.milliseconds)
        return {
            name: (mean * stats.steps - base.get(name, 0.0) * base_steps) / steps
            for name, mean in stats.milliseconds.items()
        }

    def _energy_drift(self) -> Drift:
        """In units of the largest kinetic energy seen: a potential has no natural zero to compare with."""
        energies = np.array(self.energies)
        scale = self.kinetic_most or 1.0
        departure = (energies - energies[0]) / scale
        return Drift(
            float(energies[0]),
            float(energies[-1]),
            float(departure[-1]),
            float(np.abs(departure).max()),
            scale,
        )

    def _momentum_drift(self) -> Drift:
        """The length of the change, in units of the largest sum of mass times speed seen."""
        momenta = np.array(self.momenta)
        scale = self.momentum_scale or 1.0
        departure = np.linalg.norm(momenta - momenta[0], axis=1) / scale
        return Drift(
            momenta[0].tolist(), momenta[-1].tolist(), float(departure[-1]), float(departure.max()), scale
        )


def run(
    world: World,
    steps: int,
    *,
    scene: str = "",
    seed: int = 0,
    after_step: Callable[[int], None] | None = None,
) -> Run:
    """Take ``steps`` steps of ``world`` and measure them; ``after_step`` is told how many are done."""
    report = RunReport(scene, seed, dimensions_of(world), plain_settings(world))
    compiled, loaded = _kernels()
    started = time.perf_counter()
    meter = Meter(world, max(1, math.ceil(steps / SAMPLES)))
    for done in range(1, steps + 1):
        meter.step()
        if after_step is not None:
            after_step(done)
    if steps % meter.every:
        meter.sample()
    report.wall_seconds = time.perf_counter() - started
    report.kernels_compiled, report.kernels_loaded = _kernels()[0] - compiled, _kernels()[1] - loaded
    meter.fill(report)
    return Run(report, meter.traces.farthest(TRACED_BODIES), world)


def plain_settings(world: World) -> dict[str, Any]:
    """The settings' fields with values that JSON knows; anything else by its name."""
    plain = (bool, int, float, str, type(None))
    values = {f.name: getattr(world.settings, f.name) for f in dataclasses.fields(world.settings)}
    return {k: v if isinstance(v, plain) else getattr(v, "name", None) or str(v) for k, v in values.items()}


def _kernels() -> tuple[int, int]:
    return len(log.compiled), log.loaded


def _jsonable(value: Any) -> Any:
    """JSON has no word for infinity and for what is not a number."""
    if isinstance(value, dict):
        return {key: _jsonable(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_jsonable(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value

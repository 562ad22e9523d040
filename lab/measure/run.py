"""Runs a world for a number of steps and measures it, for reports and pictures."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...components import AABBCollider, SphereCollider
from ...framework import World
from ...framework.compilation import log
from ...framework.schedule.profile_report import Stats, Totals
from ..plain import jsonable
from .body_shapes import dimensions_of, sensor_entities
from .escape import Enclosure
from .impacts import PathImpact, path_impacts, with_corners

TRACED_BODIES = 200  # in a picture
CANDIDATES = 12_000  # bodies that are recorded, to choose from
KEPT = 1e-3  # of the energy: one that has never changed by more is kept
QUIET = np.errstate(over="ignore", invalid="ignore")  # bodies out of range are reported without warnings
SAMPLES = 600  # of the energy, at most; of paths too if there are many
FEW_STEPS, FEW_BODIES = 12, 60  # up to this size a run is shown step by step, with all its impacts
PATH_POINTS = 80_000  # of all paths together: up to this number every step is sampled, so that corners are visible


@dataclass(frozen=True)
class Drift:
    """A conserved quantity at the start and at the end, and the largest departure (sampled, in units of ``scale``).

    ``relative`` is the change over the run, ``worst`` the largest departure from the start during it.
    """

    start: float | list[float]
    end: float | list[float]
    relative: float
    worst: float
    scale: float


@dataclass
class RunReport:
    """Settings and results of a run; times as named, everything else in the scene's units."""

    scene: str
    seed: int
    dimensions: int
    settings: dict[str, Any]
    steps: int = 0
    simulated_seconds: float = 0.0
    wall_seconds: float = 0.0
    compile_seconds: float = 0.0  # of steps that compiled kernels, or loaded compiled ones
    kernels_compiled: int = 0
    kernels_loaded: int = 0
    bodies: dict[str, int] = field(default_factory=dict)
    contacts: dict[str, float] = field(default_factory=dict)  # at the end, mean and most per step, impacts in total
    step_milliseconds: float = math.nan  # median of the steps that compiled nothing; NaN if there were none
    step_milliseconds_mean: float = math.nan
    system_milliseconds: dict[str, float] = field(default_factory=dict)  # mean per step, without compilation
    profile: dict[str, Any] | None = None  # by system and kernel; None unless requested
    energy: Drift | None = None
    energy_changes: list[str] = field(default_factory=list)  # what has changed it, besides the integrator
    momentum: Drift | None = None
    momentum_conserved: bool = True  # False with fixed bodies, gravity or force systems
    deepest_overlap: float = 0.0
    deepest_overlap_step: int | None = None
    escaped: dict[str, int] = field(default_factory=dict)  # outside, non_finite
    counters: dict[str, int] = field(default_factory=dict)  # the world's counters, totals
    faults: list[str] = field(default_factory=list)  # faults that did not stop the world
    compared: dict[str, list[float]] = field(default_factory=dict)  # what a game counts, see Loaded.values_of
    state_hash: str = ""
    pictures: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """Plain dicts, lists and numbers for json.dumps; non-finite numbers become None."""
        return jsonable(self)


@dataclass
class Traces:
    """Paths: ``positions`` (samples, bodies, d), NaN where no body was; ``entities`` (bodies,), ascending.

    ``impacts``: the impacts of the run, if all steps are shown, else None.
    """

    entities: NDArray[np.int64]
    samples: list[NDArray[np.float32]] = field(default_factory=list)
    moved: int = 0  # number of all bodies that moved, including these
    impacts: list[PathImpact] | None = None

    @property
    def places(self) -> NDArray[np.float64]:
        """All finite points of all paths, (n, d)."""
        points = self.positions.reshape(-1, self.samples[0].shape[1])
        return points[np.isfinite(points).all(axis=1)]

    @property
    def positions(self) -> NDArray[np.float64]:
        return np.array(self.samples, np.float64)

    @property
    def corners(self) -> NDArray[np.float64]:
        """The positions, with additional samples at the impacts."""
        return with_corners(self.entities, self.positions, self.impacts or [])

    @QUIET
    def farthest(self, count: int) -> Traces:
        """The ``count`` bodies that travelled farthest; ``moved`` does not change."""
        travelled = np.zeros(len(self.entities))
        for before, after in itertools.pairwise(self.corners if self.impacts else self.samples):
            travelled += np.nan_to_num(np.linalg.norm(after - before, axis=1))
        moved = int((travelled > 0).sum())
        chosen = np.sort(np.argsort(-travelled, kind="stable")[: min(count, moved)])
        samples = [sample[chosen] for sample in self.samples]
        return Traces(self.entities[chosen], samples, moved, self.impacts)


class Recorder:
    """Records moving bodies, including those created during the run, up to CANDIDATES bodies."""

    def __init__(self, world: World, step_by_step: bool = False) -> None:
        self.world = world
        self.impacts: list[PathImpact] | None = [] if step_by_step else None
        self.entities: NDArray[np.int64] = np.empty(0, np.int64)  # in the order they appeared
        self.samples: list[NDArray[np.float32]] = []  # positions of the entities known at that time

    @QUIET
    def record(self) -> None:
        """Add a sample."""
        if self.impacts is not None and self.samples:
            self.impacts += path_impacts(self.world, len(self.samples))
        bodies = self.world.bodies
        ids = np.asarray(bodies.entity)
        moving = np.concatenate([bodies.dynamic.entity, bodies.kinematic.entity])
        new = np.setdiff1d(moving, self.entities)
        room = CANDIDATES - len(self.entities)
        if len(new) > room:
            new = np.sort(np.random.default_rng(0).choice(new, room, replace=False))
        self.entities = np.concatenate([self.entities, new])
        sample = np.full((len(self.entities), dimensions_of(self.world)), np.nan, np.float32)
        if len(ids):
            order = np.argsort(ids, kind="stable")
            row = order[np.minimum(np.searchsorted(ids, self.entities, sorter=order), len(ids) - 1)]
            there = ids[row] == self.entities
            sample[there] = bodies.position[row[there]]
        self.samples.append(sample)

    def traces(self) -> Traces:
        """The recorded paths, NaN where a body did not exist."""
        order = np.argsort(self.entities, kind="stable")
        filled = []
        for sample in self.samples:
            whole = np.full((len(self.entities), sample.shape[1]), np.nan, np.float32)
            whole[: len(sample)] = sample
            filled.append(whole[order])
        return Traces(self.entities[order], filled, impacts=self.impacts)


@dataclass
class Run:
    """A finished run: the report, the paths, the world in its final state, and the profile if one was requested."""

    report: RunReport
    traces: Traces
    world: World
    profile: Stats | None = None


class Meter:
    """Observes a world between its steps, outside the measured time."""

    def __init__(self, world: World, every: int, path_every: int, step_by_step: bool) -> None:
        self.world, self.every, self.path_every = world, every, path_every
        self.recorder = Recorder(world, step_by_step)
        self.came_or_went = False
        self._entities = np.sort(np.asarray(world.bodies.entity))
        self.enclosure = Enclosure.around(world)
        self.step_seconds: list[float] = []
        self.contact_counts: list[int] = []
        self.impacts = 0
        self.deepest, self.deepest_step = 0.0, None
        self._sensors = set(sensor_entities(world).tolist())  # all that there were: what is touched may be deleted
        self.energies: list[float] = []
        self.kinetic_most = 0.0
        self.momenta: list[NDArray[np.float64]] = []
        self.momentum_scale = 0.0
        self.measured = Totals()  # of the steps in step_seconds
        self._kernels_seen = _kernels()
        started = time.perf_counter()
        self.recorder.record()
        self.sample()
        self.compile_seconds = time.perf_counter() - started if _kernels() != self._kernels_seen else 0.0
        self._kernels_seen = _kernels()

    @QUIET
    def sample(self) -> None:
        """Sample energy and momentum, every few steps."""
        world = self.world
        self.came_or_went |= not np.array_equal(np.sort(np.asarray(world.bodies.entity)), self._entities)
        kinetic = float(world.kinetic_energy())
        self.kinetic_most = max(self.kinetic_most, kinetic)
        self.energies.append(kinetic + float(world.potential_energy()))
        self.momenta.append(np.array(world.momentum(), float))
        dynamic = world.bodies.dynamic
        speed = np.linalg.norm(dynamic.linear_velocity, axis=1)
        self.momentum_scale = max(self.momentum_scale, float(np.dot(np.asarray(dynamic.mass), speed)))

    def step(self) -> None:
        """Take one step, timed; then record what is needed after every step."""
        world = self.world
        before = world.stats().totals
        started = time.perf_counter()
        world.step()
        seconds = time.perf_counter() - started
        if _kernels() != self._kernels_seen:  # this step compiled or loaded kernels: its time does not count
            self._kernels_seen = _kernels()
            self.compile_seconds += seconds
        else:
            self.step_seconds.append(seconds)
            self.measured += world.stats().totals - before
        self._sensors.update(sensor_entities(world).tolist())
        depth = np.asarray(world.contacts.depth)
        self.contact_counts.append(len(depth))
        self.impacts += len(world.contacts.impacts)
        if len(depth) and float(depth.max()) > self.deepest:
            deepest = self._deepest_of_solids(depth)
            if deepest > self.deepest:
                self.deepest, self.deepest_step = deepest, world.step_count
        if world.step_count % self.path_every == 0:
            self.recorder.record()
        if world.step_count % self.every == 0:
            self.sample()

    @QUIET
    def fill(self, report: RunReport) -> None:
        """Write the observations into ``report``."""
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
        if self.step_seconds:
            report.step_milliseconds = 1e3 * float(np.median(self.step_seconds))
            report.step_milliseconds_mean = 1e3 * float(np.mean(self.step_seconds))
        stats = self.stats()
        report.system_milliseconds = {
            name: mean if self.step_seconds else math.nan for name, mean in stats.milliseconds.items()
        }
        energies = np.array(self.energies)
        report.energy = _drift(energies, self.kinetic_most)  # the zero of a potential is arbitrary
        report.energy_changes = self._energy_changes(energies)
        report.momentum = _drift(np.array(self.momenta), self.momentum_scale)
        report.momentum_conserved = not (
            len(bodies.static) or len(bodies.kinematic) or np.any(world.gravity) or world.force_systems
        )
        report.deepest_overlap, report.deepest_overlap_step = self.deepest, self.deepest_step
        positions = np.asarray(bodies.dynamic.position)
        finite = np.isfinite(positions).all(axis=1) & np.isfinite(bodies.dynamic.linear_velocity).all(axis=1)
        if world.physics is not None:
            finite &= ~world.physics.taken_out()[bodies.dynamic.rows]
        report.escaped = {
            "outside": self.enclosure.outside(positions[finite]),
            "non_finite": int((~finite).sum()),
        }
        report.counters = dict(world.stats().counters)
        report.faults = list(world.faults)
        report.state_hash = world.state_hash()

    def stats(self) -> Stats:
        """Statistics of the steps that neither compiled nor loaded kernels."""
        return Stats(self.measured, self.measured, self.world.stats().units)

    def _deepest_of_solids(self, depth: NDArray[np.float64]) -> float:
        """The deepest overlap of a dynamic body, without sensors."""
        contacts, sensors, dynamic = self.world.contacts, list(self._sensors), self.world.bodies.dynamic.entity
        a, b = contacts.entity_a, contacts.entity_b
        counts = (np.isin(a, dynamic) | np.isin(b, dynamic)) & ~(np.isin(a, sensors) | np.isin(b, sensors))
        return float(depth[counts].max(initial=0.0))

    def _energy_changes(self, energies: NDArray[np.float64]) -> list[str]:
        """What in the present world may have added or removed energy; nothing if it was kept."""
        noise = KEPT * max(self.kinetic_most, float(np.abs(energies).max()))
        if np.ptp(energies) <= noise:
            return []
        bodies = self.world.bodies
        dynamic, reasons = bodies.dynamic, []
        any_pair = self.world.settings.restitution_mixing != "max"  # "max": a pair has at least a body's own value
        touched = bodies if any_pair else dynamic
        met = self.impacts > 0 or max(self.contact_counts, default=0) > 0
        fell = (np.maximum.accumulate(energies) - energies).max() > noise  # an impact never adds any
        if met and fell and (_restitutions(touched) < 1).any():
            reasons.append("restitution below 1")
        if np.any(dynamic.linear_damping):
            reasons.append("damping")
        own_forces = [force for force in self.world.force_systems if not hasattr(force, "potential_energy")]
        if np.any(dynamic.constant_force) or np.any(dynamic.applied_force) or own_forces:
            reasons.append("forces")
        if any(not type(system).__module__.startswith("carom.systems.") for system in self.world.systems):
            reasons.append("systems of the game")
        if np.any(bodies.kinematic.linear_velocity):
            reasons.append("kinematic bodies that move")
        if self.came_or_went:
            reasons.append("bodies that came or went")
        return reasons


def _drift(values: NDArray[np.float64], scale: float) -> Drift:
    """Of samples of a number, or of a vector (n, d), of which the length of the change counts."""
    scale = scale or 1.0
    departure = values - values[0]
    apart = np.abs(departure) if departure.ndim == 1 else np.linalg.norm(departure, axis=1)
    change = departure[-1] if departure.ndim == 1 else apart[-1]
    return Drift(values[0].tolist(), values[-1].tolist(), float(change / scale), float(apart.max() / scale), scale)


def run(
    world: World,
    steps: int,
    *,
    scene: str = "",
    seed: int = 0,
    after_step: Callable[[int], None] | None = None,
    profile: bool = False,
) -> Run:
    """Take ``steps`` steps of ``world`` and measure them; ``after_step`` is called with the number of steps done.

    ``profile``: time each kernel too, which makes each call slightly slower.
    """
    report = RunReport(scene, seed, dimensions_of(world), plain_settings(world))
    compiled, loaded = _kernels()
    started = time.perf_counter()
    every = max(1, math.ceil(steps / SAMPLES))
    moving = len(world.bodies.dynamic) + len(world.bodies.kinematic)
    path_every = max(1, min(every, math.ceil(steps * max(moving, 1) / PATH_POINTS)))
    meter = Meter(world, every, path_every, steps <= FEW_STEPS and moving <= FEW_BODIES)
    with world.profile() if profile else contextlib.nullcontext():
        for done in range(1, steps + 1):
            meter.step()
            if after_step is not None:
                after_step(done)
    if world.step_count % meter.every:
        meter.sample()
    if world.step_count % meter.path_every:
        meter.recorder.record()
    report.wall_seconds = time.perf_counter() - started
    report.kernels_compiled, report.kernels_loaded = _kernels()[0] - compiled, _kernels()[1] - loaded
    meter.fill(report)
    stats = meter.stats() if profile else None
    report.profile = None if stats is None else _plain_profile(stats)
    return Run(report, meter.recorder.traces().farthest(TRACED_BODIES), world, stats)


def _plain_profile(stats: Stats) -> dict[str, Any]:
    """What ``stats`` knows of systems and kernels, as values of JSON."""
    kernels = [dataclasses.asdict(row) for row in stats.kernels]
    return {"steps": stats.steps, "nanoseconds": stats.nanoseconds, "kernels": kernels}


def plain_settings(world: World) -> dict[str, Any]:
    """The settings' fields as values of JSON; others by their name."""
    plain = (bool, int, float, str, type(None))
    values = {f.name: getattr(world.settings, f.name) for f in dataclasses.fields(world.settings)}
    return {k: v if isinstance(v, plain) else getattr(v, "name", None) or str(v) for k, v in values.items()}


def _restitutions(bodies: Any) -> NDArray[np.float64]:
    """Of all spheres and boxes of ``bodies``."""
    found = []
    for name, collider in (("sphere_collider", SphereCollider), ("aabb_collider", AABBCollider)):
        has = np.asarray(bodies.has(collider), bool)
        if has.any():  # else there may be no such columns
            found.append(getattr(bodies, name).restitution[has])
    return np.concatenate([np.zeros(0), *found])


def _kernels() -> tuple[int, int]:
    return len(log.compiled), log.loaded

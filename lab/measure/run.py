"""Runs a world for a number of steps and measures it, for reports and pictures."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...framework import World
from ...framework.compilation import log
from ...framework.schedule.profile_report import Stats, Totals
from ...plugins.joints import Joints
from .bodies import QUIET, dimensions_of
from .observer import Observer
from .paths import Recorder, Traces
from .timing import timed

TRACED_BODIES = 200  # in a picture
KEPT = 1e-3  # of the energy: one that has never changed by more is kept
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


@dataclass
class Run:
    """A finished run: the report, the paths, the world in its final state, and the profile if one was requested."""

    report: RunReport
    traces: Traces
    world: World
    profile: Stats | None = None


@QUIET
def run(
    world: World, steps: int, *, scene: str = "", seed: int = 0, after_step: Callable[[int], None] | None = None,
    profile: bool = False,
) -> Run:  # fmt: skip
    """Take ``steps`` steps of ``world`` and measure them; ``after_step`` is called with the number of steps done.

    ``profile``: time each kernel too, which makes each call slightly slower.
    """
    report = RunReport(scene, seed, dimensions_of(world), plain_settings(world))
    compiled, loaded, started = len(log.compiled), log.loaded, time.perf_counter()
    every = max(1, math.ceil(steps / SAMPLES))
    moving = len(world.bodies.dynamic) + len(world.bodies.kinematic)
    path_every = max(1, min(every, math.ceil(steps * max(moving, 1) / PATH_POINTS)))
    recorder = Recorder(world, steps <= FEW_STEPS and moving <= FEW_BODIES)
    recorder.record()
    seconds, valid, watch = timed(lambda: Observer(world, clock=time.perf_counter), time.perf_counter)
    momenta, contacts, measured = [_momentum(world)], [0] * (not steps), Totals()
    with world.profile() if profile else contextlib.nullcontext():
        for done in range(1, steps + 1):
            totals = world.stats().totals
            if watch.step(world.settings.dt):
                measured += world.stats().totals - totals
            depth = np.asarray(world.contacts.depth)
            contacts.append(len(depth))
            if depth.max(initial=0.0) > report.deepest_overlap:
                deepest = float(watch.overlaps()[2].max(initial=0.0))
                if deepest > report.deepest_overlap:
                    report.deepest_overlap, report.deepest_overlap_step = deepest, world.step_count
            if done % path_every == 0 or done == steps:
                recorder.record()
            if done % every == 0 or done == steps:
                watch.look()
                momenta.append(_momentum(world))
            if after_step is not None:
                after_step(done)
    report.wall_seconds = time.perf_counter() - started
    report.compile_seconds = watch.compile_seconds + (0.0 if valid else seconds)
    report.kernels_compiled, report.kernels_loaded = len(log.compiled) - compiled, log.loaded - loaded
    impacts, mean = watch.seen.impacts, round(float(np.mean(contacts)), 3)
    report.contacts = {"end": contacts[-1], "mean": mean, "most": max(contacts), "impacts": impacts}
    stats = Stats(measured, measured, world.stats().units)
    report.system_milliseconds = stats.milliseconds
    if watch.step_seconds:
        report.step_milliseconds = 1e3 * float(np.median(watch.step_seconds))
        report.step_milliseconds_mean = 1e3 * float(np.mean(watch.step_seconds))
    else:
        report.system_milliseconds = dict.fromkeys(stats.milliseconds, math.nan)
    kinetic, energies = np.array(watch.energies).T
    report.energy = _drift(energies, float(kinetic.max()))  # the zero of a potential is arbitrary
    met = impacts > 0 or max(contacts) > 0
    report.energy_changes = _energy_changes(world, energies, float(kinetic.max()), met, watch.seen.fixed)
    vectors, scales = zip(*momenta, strict=True)
    report.momentum = _drift(np.array(vectors), max(scales))
    _note_end(report, world, watch)
    if profile:
        kernels = [dataclasses.asdict(row) for row in stats.kernels]
        report.profile = {"steps": stats.steps, "nanoseconds": stats.nanoseconds, "kernels": kernels}
    return Run(report, recorder.traces().farthest(TRACED_BODIES), world, stats if profile else None)


def _note_end(report: RunReport, world: World, watch: Observer) -> None:
    """What is known from the world's final state."""
    report.steps, report.simulated_seconds = world.step_count, world.time
    bodies = world.bodies
    kinds = {kind: len(getattr(bodies, kind)) for kind in ("dynamic", "kinematic", "static")}
    report.bodies = {"total": len(bodies), **kinds}
    outer = kinds["static"] or kinds["kinematic"] or np.any(world.gravity) or world.force_systems
    report.momentum_conserved = not outer
    positions = np.asarray(bodies.dynamic.position)
    finite = np.isfinite(positions).all(axis=1) & np.isfinite(bodies.dynamic.linear_velocity).all(axis=1)
    if world.physics is not None:
        finite &= ~world.physics.excluded()[bodies.dynamic.rows]
    report.escaped = {"outside": watch.walls.outside(positions[finite]), "non_finite": int((~finite).sum())}
    report.counters = dict(world.stats().counters)
    report.faults = list(world.faults)
    report.state_hash = world.state_hash()


def _momentum(world: World) -> tuple[NDArray[np.float64], float]:
    """The momentum (d,), and the sum of mass times speed."""
    dynamic = world.bodies.dynamic
    speed = np.linalg.norm(dynamic.linear_velocity, axis=1)
    return np.array(world.momentum(), float), float(np.dot(np.asarray(dynamic.mass), speed))


def _energy_changes(
    world: World, energies: NDArray[np.float64], kinetic: float, met: bool, fixed: bool
) -> list[str]:
    """What in the present world may have added or removed energy; nothing if it was kept."""
    noise = KEPT * max(kinetic, float(np.abs(energies).max()))
    if np.ptp(energies) <= noise:
        return []
    bodies, dynamic = world.bodies, world.bodies.dynamic
    # Of "max" a pair has at least a body's own restitution; an impact never adds any energy.
    touched = dynamic if world.settings.restitution_mixing == "max" else bodies
    fell = (np.maximum.accumulate(energies) - energies).max() > noise
    own_forces = [force for force in world.force_systems if not hasattr(force, "potential_energy")]
    reasons = {
        "restitution below 1": met and fell and (_restitutions(world, touched) < 1).any(),
        "damping": np.any(dynamic.linear_damping),
        "forces": np.any(dynamic.constant_force) or np.any(dynamic.applied_force) or own_forces,
        "systems of the game": any(not type(one).__module__.startswith("carom.systems.") for one in world.systems),
        "kinematic bodies that move": np.any(bodies.kinematic.linear_velocity),
        "joints that drive, spring or stop": any(
            isinstance(plugin, Joints) and plugin.changes_energy for plugin in world.plugins
        ),
        "bodies that came or went": not fixed,
    }
    return [reason for reason, holds in reasons.items() if holds]


def _drift(values: NDArray[np.float64], scale: float) -> Drift:
    """Of samples of a number, or of a vector (n, d), of which the length of the change counts."""
    scale = scale or 1.0
    departure = values - values[0]
    apart = np.abs(departure) if departure.ndim == 1 else np.linalg.norm(departure, axis=1)
    change = departure[-1] if departure.ndim == 1 else apart[-1]
    return Drift(values[0].tolist(), values[-1].tolist(), float(change / scale), float(apart.max() / scale), scale)


def plain_settings(world: World) -> dict[str, Any]:
    """The settings' fields as values of JSON; others by their name."""
    plain = (bool, int, float, str, type(None))
    values = {f.name: getattr(world.settings, f.name) for f in dataclasses.fields(world.settings)}
    return {k: v if isinstance(v, plain) else getattr(v, "name", None) or str(v) for k, v in values.items()}


def _restitutions(world: World, bodies: Any) -> NDArray[np.float64]:
    """Of all colliders of these bodies."""
    found = []
    for collider in world.registry.shapes:
        has = np.asarray(bodies.has(collider), bool)
        if has.any():  # else there may be no such columns
            found.append(getattr(bodies, collider.prefix[:-1]).restitution[has])
    return np.concatenate([np.zeros(0), *found])

"""Survey of a scene: trial runs find its kind and which settings matter.

Two runs with starts that differ by an invisible amount tell whether it is chaotic, by the ratio of their distance at
the end to that at the start.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...framework import Settings, World
from ..cases.subjects import Subject
from ..commands.usage_errors import Problem
from ..engines.adapters import CaromEngine
from ..trading.records import CHAOTIC, ESCAPED, IMPACTS, RESTING, SMOOTH
from .norms import distances
from .observation import Seen, mean_of, observe
from .told_in_results import faults_in_results

NUDGE = 1e-10  # of the smallest body: the difference between the two starts
SEEN = 0.01  # of the smallest body: where bodies come, what changes with so little cannot be followed
CHAOS = 1e7  # a growth beyond this makes a nudge a thousandth of a body: chaotic
STILL = 0.01  # sizes per second: slower bodies are at rest


@dataclass(frozen=True)
class Survey:
    """Facts of a scene.

    settings
        those it recommends; settings that are not varied keep these values
    growth
        of the distance between two nearby starts, over the run
    speed
        the largest at the end, sizes per second
    seeded
        whether seeds change the start
    walled
        whether walls hold all bodies: a body beyond them in another run has escaped
    trial
        the observation of the run with all impacts at their true times; of a chaotic game the mean of some
    nudge
        sizes of a body by which repeats of a chaotic scene without seeds differ
    """

    settings: Settings
    bodies: int
    force_systems: bool
    forces: bool
    damping: bool
    levels: bool
    impacts: int
    contacts: int
    resting: int
    growth: float
    speed: float
    seeded: bool
    walled: bool
    trial: Seen
    nudge: float = 1e3 * NUDGE

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


@faults_in_results()
def survey(subject: Subject, seconds: float) -> Survey:
    """Run the scene twice, with all impacts at their true times; Problem for one that cannot be measured."""
    with_recommended = subject.world(None)
    settings = with_recommended.settings
    facts = _facts(subject.name, with_recommended)
    with_recommended.close()
    seeded = _seeded(subject, settings)
    _obedient(subject, settings.replace(dt=settings.dt / 2, substeps=settings.substeps + 1)).close()
    exact = settings.replace(collision="event_driven")
    first, walled = _twin(subject, exact, seconds, 0.0, True), True
    if first.failure == ESCAPED:  # for example a ball that rolls off a platform
        first, walled = _twin(subject, exact, seconds, 0.0, False), False
    second = _twin(subject, exact, seconds, SEEN if first.created else NUDGE, False)
    if first.created and _is_another(second, first):
        growth = math.inf
    else:
        second = _twin(subject, exact, seconds, NUDGE, False) if first.created else second
        growth = float(distances(second, first)[0].max(initial=0.0)) / _nudge_of(subject, settings)
    if growth > CHAOS and subject.names:
        other = second if growth == math.inf else _twin(subject, exact, seconds, SEEN, False)
        first = mean_of([first, other], ())
    if not first.reach and not first.counts["solver_loops"]:
        raise Problem(f"{subject.name}: no body moves within {seconds:g} s: nothing to measure")
    return Survey(
        settings,
        growth=growth,
        impacts=first.impacts,
        contacts=max(sum(first.struck), int(first.met)),
        resting=int(first.counts["solver_loops"] > 0),
        speed=first.speed,
        seeded=seeded,
        walled=walled,
        trial=first,
        nudge=SEEN if growth == math.inf else 1e3 * NUDGE,
        **facts,
    )


def _is_another(seen: Seen, first: Seen) -> bool:
    """True if another start has led to other bodies, or has taken one where it is nowhere near."""
    apart, _ = distances(seen, first)
    return seen.entities != first.entities or float(apart.max(initial=0.0)) > first.size


def _facts(name: str, world: World) -> dict[str, Any]:
    dynamic = world.bodies.dynamic
    if not len(dynamic):
        raise Problem(f"{name}: there is no body that moves by itself: nothing to measure")
    gravity = bool(np.any(world.gravity) and np.any(dynamic.gravity_scale))
    constant = bool(np.any(dynamic.constant_force))
    several = [len(world.components_for_entity(int(entity))) for entity in world.bodies.entity]
    return {
        "bodies": len(dynamic),
        "force_systems": bool(world.force_systems),
        "forces": gravity or constant or bool(world.force_systems),
        "damping": bool(np.any(dynamic.linear_damping)),
        "levels": max(several) > 2 and _has_levels(world),
    }


def _has_levels(world: World) -> bool:
    """True if a step tests first levels."""
    world.step()
    return world.stats().counters.get("first_level_tests", 0) > 0


def nudge(world: World, size: float, seed: int = 0) -> None:
    """Move every dynamic body by up to ``size`` along each axis, at random from ``seed``.

    Not along an axis on which all bodies are at one place and nothing moves or falls: bodies on a line stay on it.
    """
    dynamic = world.bodies.dynamic
    position = dynamic.position
    axes = np.ptp(position, axis=0) > 0 if len(position) > 1 else np.ones(position.shape[1], bool)
    axes |= np.any(dynamic.linear_velocity, axis=0) | (np.asarray(world.gravity) != 0)
    position += np.random.default_rng(seed).uniform(-size, size, position.shape) * axes


def _nudge_of(subject: Subject, settings: Settings) -> float:
    world = subject.world(settings)
    size = NUDGE * CaromEngine(world).size
    world.close()
    return size


def _twin(subject: Subject, settings: Settings, seconds: float, nudged: float, walled: bool) -> Seen:
    engine = CaromEngine(_obedient(subject, settings))
    if nudged:
        nudge(engine.world, nudged * engine.size)
    try:
        with subject.attribute_errors():
            seen = observe(engine, seconds, settings.dt, walled=walled, values=subject.values_of)
        if seen.failure not in (None, ESCAPED):
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


def _seeded(subject: Subject, settings: Settings) -> bool:
    """True if seeds change the start; Problem if the same seed gives different worlds."""
    hashes = []
    for seed in (0, 0, 1):
        world = subject.world(settings, seed)
        hashes.append(world.state_hash())
        world.close()
    if hashes[0] != hashes[1]:
        raise Problem(
            f"{subject.name}: build makes another world each time, with the same settings and seed: draw what is "
            "random from numpy.random.default_rng(seed)"
        )
    return hashes[0] != hashes[2]

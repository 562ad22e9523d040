"""Small worlds in which a field of Settings matters, and measures of their errors.

A measure takes a function that builds the world and returns its errors by name; their meaning is described in
:mod:`studies.settings.fields`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from carom import scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Phase, Plugin, Settings, System, World
from carom.lab import testing as kit
from carom.lab.cases.closed_forms import FORMS
from carom.lab.engines.adapters import CaromEngine
from carom.lab.measure.body_shapes import Enclosure, Floats
from carom.lab.measure.norms import NORMS
from carom.lab.measure.observation import Seen, observe
from carom.plugins import Physics
from carom.scenes import drops, galperin, random_numbers
from carom.scenes import orbit as orbit_scene

Build = Callable[[Settings], World]
Make = Callable[[], World]
Errors = dict[str, float]

PHASES = 4  # start phases, if the time of an event within a step matters
GRAVITY = 10.0  # m/s2, of sliding bodies


def scene_of(name: str, **options: Any) -> Build:
    """A scene of the library."""
    function: Any = scenes.get(name).build
    return lambda settings: function(settings, **options)


def seen(make: Make, seconds: float, phase: float = 1.0) -> Seen:
    """The observation of a run."""
    with make() as world:
        return observe(CaromEngine(world), seconds, world.settings.dt, phase)


def _run(world: World, seconds: float) -> None:
    kit.run(world, round(seconds / world.settings.dt))


# -- motion and rest --------------------------------------------------------------------------------------------


def apex(make: Make, seconds: float) -> Errors:
    """Apex of the jump, in pixels: the worst of PHASES."""
    true = _closed_form("jump", make, seconds)
    runs = [seen(make, seconds, 1 - k / PHASES) for k in range(PHASES)]
    return {"apex": max(NORMS["apex"].measure(run, true) * true.apex for run in runs)}


TEN_TURNS = 10 * orbit_scene.PERIOD


def orbit(make: Make, seconds: float) -> Errors:
    """Energy in % of that at the start: the largest departure, and the departure at the end."""
    true, run = _closed_form("orbit", make, seconds), seen(make, seconds)
    grown = run.energy - run.energy_start
    return {
        "energy": 100 * NORMS["energy"].measure(run, true),
        "growth": 100 * grown / abs(run.energy_start),
    }


def _closed_form(name: str, make: Make, seconds: float) -> Seen:
    with make() as world:
        return FORMS[name].function(world, seconds)


def rest(make: Make, seconds: float) -> Errors:
    """Deepest overlap in % of a body, and the residual speed, in thousandths of a body per second."""
    run = seen(make, seconds)
    return {"overlap": 100 * run.overlap, "speed": 1000 * run.speed}


def last_bounce(make: Make, seconds: float) -> Errors:
    """mm, height of the first bounce that is suppressed: after n impacts the ball would rise to h e^(2n)."""
    impacts = seen(make, seconds).impacts
    return {"lost": 1000 * drops.HEIGHT * drops.RESTITUTION ** (2 * (impacts + 1))}


STEPS_UP = (0.001, 0.003, 0.01, 0.03, 0.06, 0.12)  # m
LENGTH, GOES, TILES = 2.0, 6.0, 20  # tile length, m; speed of the box, m/s; number of tiles


def tiles(settings: Settings, *, step: float = 0.0) -> World:
    """A box of 1 m slides over a floor of tiles without friction; every second one is ``step`` m higher."""
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), settings=settings)
    for k in range(TILES):
        world.create_entity(Transform((k * LENGTH, -0.5 + step * (k % 2))), AABBCollider((LENGTH / 2, 0.5)))
    kit.box(world, (0.0, 0.5), GOES)
    return world


def seams(make: Make, seconds: float) -> Errors:
    """% of its speed that the box loses on an even floor, and the highest step, in mm, that does not slow it down."""
    with make() as world:
        settings = world.settings
        _run(world, seconds)
        left = float(world.bodies.dynamic.linear_velocity[0, 0])
    passed = 0.0
    for step in STEPS_UP:
        with tiles(settings, step=step) as world:
            _run(world, seconds)
            if world.bodies.dynamic.linear_velocity[0, 0] < GOES / 2:
                break
            passed = step
    return {"stuck": 100 * (1 - left / GOES), "passed": 1000 * passed}


# -- impacts ----------------------------------------------------------------------------------------------------


def lost(make: Make, seconds: float) -> Errors:
    """% of the bodies that end outside the walls, and % of the impacts that are missing.

    The reference is a run with all impacts at their true times.
    """
    counts = []
    outside = bodies = 0
    for exact in (False, True):
        with make() as world:
            if exact:
                world.settings = world.settings.replace(dt=1 / 60, collision="event_driven", max_impacts_per_step=None)
            enclosure, counter = Enclosure.around(world), galperin.ImpactCounter()
            world.add_system(counter)
            _run(world, seconds)
            counts.append(counter.count)
            if not exact:
                positions = np.array(world.bodies.dynamic.position)
                outside, bodies = enclosure.outside(positions), len(positions)
    return {"outside": 100 * outside / bodies, "missing": 100 * (1 - counts[0] / counts[1])}


def wrong_balls(make: Make, seconds: float) -> Errors:
    """Bodies more than 1 % of their size from the right position."""
    places, sizes = [], []
    for exact in (False, True):
        with make() as world:
            if exact:
                world.settings = world.settings.replace(dt=1 / 60, collision="event_driven")
            engine = CaromEngine(world)
            sizes = [engine.sizes[int(entity)] for entity in np.sort(world.bodies.dynamic.entity)]
            _run(world, seconds)
            places.append(engine.position)
    apart = np.sqrt(((places[0] - places[1]) ** 2).sum(axis=1))
    return {"wrong": float((apart / sizes > 0.01).sum())}


def counted_pi(make: Make, seconds: float) -> Errors:
    """Galperin's blocks: % of the 314 impacts that are missing, and % of the energy that is lost."""
    with make() as world:
        before = world.kinetic_energy()
        _run(world, seconds)
        count = next(system.count for system in world.systems if isinstance(system, galperin.ImpactCounter))
        after = world.kinetic_energy()
    return {"missing": 100 * (1 - count / galperin.impacts(2)), "energy": 100 * abs(1 - after / before)}


# -- geometry ---------------------------------------------------------------------------------------------------


def boxes_in_spheres(settings: Settings, *, dimensions: int, n: int = 2000) -> World:
    """Sensors at random places: boxes of side 1, each in its smallest enclosing sphere."""
    world = World(Physics(dimensions=dimensions), settings=settings)
    side = (4 * n) ** (1 / dimensions)
    places = side * random_numbers.uniform(n * dimensions, 0).reshape(n, dimensions)
    world.create_entities(
        n, Transform.many(places), RigidBody.many(),
        SphereCollider.many(radius=0.5 * math.sqrt(dimensions), sensor=True),
        AABBCollider.many(half_extents=0.5, sensor=True),
    )  # fmt: skip
    return world


def false_contacts(make: Make, seconds: float) -> Errors:
    """% of the contacts that are false positives."""
    del seconds
    counts = []
    for geometry in (None, "precise"):
        with make() as world:
            world.settings = world.settings.replace(geometry=geometry or world.settings.geometry)
            world.step()
            counts.append(len(world.contacts))
    return {"false": 100 * (1 - counts[1] / counts[0])}


# -- mixing -----------------------------------------------------------------------------------------------------

FIRST, SECOND = 0.9, 0.4  # the two bodies' values
RULES = ("max", "min", "average", "multiply", "geometric_mean")


def head_on(settings: Settings) -> World:
    """Two balls of equal mass that meet at 1 m/s, one of restitution FIRST, the other of SECOND."""
    world = World(Physics(dimensions=2, gravity=(0.0, 0.0)), settings=settings)
    for x, speed, restitution in ((0.0, 1.0, FIRST), (1.01, 0.0, SECOND)):
        kit.ball(world, x, speed, restitution=restitution)
    return world


def bounced(make: Make, seconds: float) -> Errors:
    """The observed restitution: they part at so many m/s, having approached at 1 m/s."""
    with make() as world:
        _run(world, seconds)
        return {"shown": float(np.diff(CaromEngine(world).velocity[:, 0])[0])}


def sliding(settings: Settings) -> World:
    """A box with friction FIRST that slides at 5 m/s on a floor with friction SECOND."""
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), settings=settings)
    kit.floor(world, friction=SECOND)
    kit.box(world, (0.0, 0.5), 5.0, friction=FIRST)
    return world


def slowed(make: Make, seconds: float) -> Errors:
    """The observed coefficient of friction: (v0 - v) / g t."""
    with make() as world:
        before = world.bodies.dynamic.linear_velocity[0, 0]
        _run(world, seconds)
        return {"shown": float(before - world.bodies.dynamic.linear_velocity[0, 0]) / (GRAVITY * world.time)}


# -- settings that must change nothing --------------------------------------------------------------------------

EVERY_PAIR = "every pair"
every_pair = Plugin("every pair of boxes")


@every_pair.broad_phase(EVERY_PAIR)
class EveryPair:
    """Compares all boxes with all others, without a spatial index."""

    def pairs(self, lower: Floats, upper: Floats, moving: int) -> tuple[Any, Any]:
        """Rows of overlapping boxes."""
        overlap = np.ones((moving, len(lower)), bool)
        for axis in range(lower.shape[1]):
            overlap &= lower[:moving, axis, None] <= upper[:, axis]
            overlap &= lower[:, axis] <= upper[:moving, axis, None]
        first, second = np.nonzero(np.triu(overlap, 1))
        return first, second


def with_every_pair(settings: Settings, *, n: int) -> World:
    """The gas, with this additional broad phase available."""
    world = scene_of("gas2d", n=n)(settings.replace(broad_phase="automatic"))
    world.add_plugin(every_pair)
    world.settings = settings
    return world


def same_as(**default: Any) -> Callable[[Make, float], Errors]:
    """The number of bodies whose final position differs in any bit from that with ``default``."""
    return partial(_elsewhere, default)


def _elsewhere(default: dict[str, Any], make: Make, seconds: float) -> Errors:
    places = []
    for changes in ({}, default):
        with make() as world:
            world.settings = world.settings.replace(**changes)
            engine = CaromEngine(world)
            _run(world, seconds)
            places.append(engine.position)
    return {"elsewhere": float((places[0] != places[1]).any(axis=1).sum())}


class Spoiler(System):
    """A user error: in the third step a body's velocity becomes NaN."""

    phase = Phase.FORCES

    def process(self, dt: float) -> None:
        del dt
        if self.world.step_count == 2:
            self.world.bodies.dynamic.linear_velocity[0] = math.nan


def culprit(make: Make, seconds: float) -> Errors:
    """Bodies that differ from a run without debug, and whether the first fault fails to name the culprit system."""
    errors = _elsewhere({"debug": False}, make, seconds)
    with make() as world:
        world.add_system(Spoiler())
        _run(world, 4 * world.settings.dt)
        named = "Spoiler" in next(iter(world.faults), "")
    return {**errors, "unnamed": 0.0 if named else 1.0}


# -- frames -----------------------------------------------------------------------------------------------------

FRAME, SLOW_FRAME, EVERY = 1 / 60, 1 / 4, 30  # s, s, frames: one slow frame about every half second
CYCLE = (EVERY - 1) * FRAME + SLOW_FRAME  # s


def frames(world: World, seconds: float) -> float:
    """Play whole cycles of frames in which every EVERY-th frame is slow; returns the seconds played."""
    cycles = round(seconds / CYCLE)
    for _ in range(cycles):
        _cycle(world)
    return cycles * CYCLE


def _cycle(world: World) -> list[int]:
    """The steps taken in each frame."""
    return [world.advance(SLOW_FRAME if k == EVERY - 1 else FRAME) for k in range(EVERY)]


def dropped(make: Make, seconds: float) -> Errors:
    """% of the time played that was not simulated, and the number of steps in the longest frame."""
    with make() as world:
        taken = [count for _ in range(round(seconds / CYCLE)) for count in _cycle(world)]
        gone = world.stats().counters.get("dropped_steps", 0)
    return {"dropped": 100 * gone / (gone + sum(taken)), "longest": float(max(taken))}

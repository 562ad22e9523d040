"""Small worlds in which a field of Settings matters, and measures of their errors.

A measure takes a function that builds the world and returns its errors by name; their meaning is described in
:mod:`studies.settings.fields`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from carom import scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.lab import testing as kit
from carom.lab.measure.body_shapes import Enclosure
from carom.lab.measure.engine import CaromEngine
from carom.lab.measure.observation import RunResult, observe
from carom.lab.trading.errors import NORMS
from carom.plugins import Physics
from carom.scenes import drops, galperin, random_numbers
from carom.scenes import orbit as orbit_scene

from ..closed_forms import FORMS

Build = Callable[[Settings], World]
Make = Callable[[], World]
Errors = dict[str, float]

PHASES = 4  # start phases, if the time of an event within a step matters
GRAVITY = 10.0  # m/s2, of sliding bodies


def scene_of(name: str, **options: Any) -> Build:
    """A scene of the library."""
    function: Any = scenes.get(name).build
    return lambda settings: function(settings, **options)


def seen(make: Make, seconds: float, phase: float = 1.0) -> RunResult:
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
    return {"apex": max(abs(NORMS["apex"].measure(run, true)) for run in runs)}


TEN_TURNS = 10 * orbit_scene.PERIOD


def orbit(make: Make, seconds: float) -> Errors:
    """Energy in % of that at the start: the largest departure, and the departure at the end."""
    run = seen(make, seconds)
    grown = run.energy - run.energy_start
    return {
        "energy": 100 * run.energy_worst / abs(run.energy_start),
        "growth": 100 * grown / abs(run.energy_start),
    }


def _closed_form(name: str, make: Make, seconds: float) -> RunResult:
    with make() as world:
        return FORMS[name](world, seconds)


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
                world.settings = world.settings.replace(dt=1 / 60, collision="event_driven", max_impacts_per_step=64)
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

"""Each field of Settings, varied alone in a scene where it matters: what its values cost, and what goes wrong."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from dataclasses import field as value_of
from functools import partial
from typing import Any

import numpy as np

from carom import scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.framework.settings import COLLISION_MODES
from carom.lab import testing as kit
from carom.lab.reporting.text import TextTable, compact
from carom.plugins import Physics
from carom.scenes import drops, galperin, jump, orbit, random_numbers

from .runner import Axis, Line, Result, nanoseconds_per_step, ratios

METHODS = ("explicit_euler", "semi_implicit_euler", "velocity_verlet", "rk4", "yoshida4")
ENOUGH = 0.03  # s of processor time per repeat: shorter runs are repeated until then
ROUNDING = 1e-6  # smaller errors are shown as this limit
PHASES = 4  # start phases, where the time of an event within a step matters
EXACT = {"dt": 1 / 60, "collision": "event_driven", "max_impacts_per_step": 64}
GRAVITY, LENGTH, GOES, TILES = 10.0, 2.0, 6.0, 20  # m/s2; length of a tile, m; speed of the box, m/s; tiles
STEPS_UP = (0.001, 0.003, 0.01, 0.03, 0.06, 0.12)  # m

Make = Callable[[], World]
Errors = dict[str, float]


@dataclass(frozen=True)
class Varied:
    """One field and one scene.

    build: makes the scene; values: of the field, that of ``others`` or of Settings is the default
    measure: (make, seconds) -> errors by name, whose units are in ``errors``
    seconds: of the runs whose errors are measured; timed: of those that are timed; others: fields set otherwise there
    """

    field: str
    scene: str
    build: Callable[..., World]
    values: tuple[Any, ...]
    measure: Callable[[Make, float], Errors]
    errors: Mapping[str, str]
    seconds: float
    timed: float
    others: Mapping[str, Any] = value_of(default_factory=dict)

    @property
    def base(self) -> Settings:
        """The settings with the default value."""
        return Settings(**self.others)

    @property
    def default(self) -> Any:
        """The value that the others are compared with."""
        return getattr(self.base, self.field)

    def world(self, value: Any) -> World:
        """The scene with that value, at its start."""
        return self.build(self.base.replace(**{self.field: value}))

    def facts(self, value: Any) -> dict[Any, Any]:
        """Its errors, by name."""
        return self.measure(partial(self.world, value), self.seconds)

    def time(self, value: Any, repeat: int) -> dict[str, float]:
        """Seconds per simulated second, from the start of the scene."""
        dt, what = self.base.replace(**{self.field: value}).dt, f"{self.field} {value}, {self.scene}"
        taken = nanoseconds_per_step(partial(self.world, value), what, round(self.timed / dt), ENOUGH)
        return {"seconds": 1e-9 * taken / dt}


def _scene(name: str, **options: Any) -> Callable[..., World]:
    return partial(scenes.get(name).build, **options)


def _steps(world: World, seconds: float) -> Iterator[int]:
    """Takes the steps, and tells after each how many are left."""
    for left in reversed(range(round(seconds / world.settings.dt))):
        world.step()
        yield left


# -- motion and rest --------------------------------------------------------------------------------------------------


def apex(make: Make, seconds: float) -> Errors:
    """Of the jump, in pixels, beside v^2 / 2g: the worst of PHASES, by the length of the first step."""
    worst = 0.0
    for phase in range(PHASES):
        with make() as world:
            settings, start, highest = world.settings, float(world.bodies.dynamic.position[0, 1]), 0.0
            world.settings = settings.replace(dt=settings.dt * (1 - phase / PHASES))
            world.step()
            world.settings = settings
            for _ in _steps(world, seconds):
                highest = max(highest, float(world.bodies.dynamic.position[0, 1]) - start)
        worst = max(worst, abs(highest - jump.JUMP_SPEED**2 / (2 * jump.GRAVITY)))
    return {"apex": worst}


def kepler(make: Make, seconds: float) -> Errors:
    """Energy in % of that at the start: the largest departure, and what of it is left in the end."""
    with make() as world:
        start = world.kinetic_energy() + world.potential_energy()
        grown = [world.kinetic_energy() + world.potential_energy() - start for _ in _steps(world, seconds)]
    return {"energy": 100 * max(map(abs, grown)) / abs(start), "growth": 100 * grown[-1] / abs(start)}


def rest(make: Make, seconds: float) -> Errors:
    """Deepest overlap in the second half, % of the smallest body; speed in the end, thousandths of it a second."""
    deepest = 0.0
    with make() as world:
        dynamic = world.bodies.dynamic
        size = 2 * float(dynamic.aabb_collider.half_extents.min())
        for left in _steps(world, seconds):
            if 2 * left * world.settings.dt < seconds:
                deepest = max(deepest, float(world.contacts.depth.max(initial=0.0)))
        speed = float(np.linalg.norm(dynamic.linear_velocity, axis=1).max())
    return {"overlap": 100 * deepest / size, "speed": 1000 * speed / size}


def last_bounce(make: Make, seconds: float) -> Errors:
    """mm, height of the first bounce that is suppressed: after n impacts the ball would rise to h e^(2n)."""
    with make() as world:
        world.add_system(counter := galperin.ImpactCounter())
        kit.run(world, round(seconds / world.settings.dt))
        return {"lost": 1000 * drops.HEIGHT * drops.RESTITUTION ** (2 * (counter.count + 1))}


def tiles(settings: Settings, *, step: float = 0.0) -> World:
    """A box of 1 m slides over a floor of tiles without friction; every second one is ``step`` m higher."""
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), settings=settings)
    for k in range(TILES):
        world.create_entity(Transform((k * LENGTH, -0.5 + step * (k % 2))), AABBCollider((LENGTH / 2, 0.5)))
    kit.box(world, (0.0, 0.5), GOES)
    return world


def seams(make: Make, seconds: float) -> Errors:
    """% of its speed that the box loses on an even floor, and the highest step, in mm, that does not slow it down."""

    def left(world: World) -> float:
        with world:
            kit.run(world, round(seconds / world.settings.dt))
            return float(world.bodies.dynamic.linear_velocity[0, 0]) / GOES

    with make() as world:
        settings = world.settings
    passed = 0.0
    for step in STEPS_UP:
        if left(tiles(settings, step=step)) < 0.5:
            break
        passed = step
    return {"stuck": 100 * (1 - left(make())), "passed": 1000 * passed}


# -- impacts and contacts ---------------------------------------------------------------------------------------------


def _exact(make: Make, **changes: Any) -> World:
    world = make()
    world.settings = world.settings.replace(**changes)
    return world


def lost(make: Make, seconds: float) -> Errors:
    """% of the bodies that end outside the walls, and % of the impacts that are missing beside a run in which all have
    their true times."""
    counts, outside = [], 0.0
    for world in (_exact(make, **EXACT), make()):
        with world:
            world.add_system(counter := galperin.ImpactCounter())
            kit.run(world, round(seconds / world.settings.dt))
            counts.append(counter.count)
            walls, place = world.bodies.static, world.bodies.dynamic.position
            half = walls.aabb_collider.half_extents
            lower, upper = (walls.position - half).min(axis=0), (walls.position + half).max(axis=0)
            outside = float(((place < lower) | (place > upper)).any(axis=1).mean())
    return {"outside": 100 * outside, "missing": 100 * (1 - counts[1] / counts[0])}


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
    counts = []
    for world in (make(), _exact(make, geometry="precise")):
        with world:
            world.step()
            counts.append(len(world.contacts))
    return {"false": 100 * (1 - counts[1] / counts[0])}


STEPS = (1 / 30, 1 / 60, 1 / 120, 1 / 240)
SUBSTEPS = (1, 2, 4, 8, 16, 32)
THRESHOLDS = (None, 0.0, 0.1, 0.5, 1.0, 2.0)
APEX, RESTS, LOST = {"apex": "px"}, {"overlap": "%", "speed": "mm/s"}, {"outside": "% out", "missing": "% missed"}
STACK, PYRAMID, FAST = _scene("stack"), _scene("pyramid", rows=20), _scene("fastgas")

VARIED = (
    Varied("dt", "jump", _scene("jump"), STEPS, apex, APEX, 1.0, 0.8),
    Varied("dt", "stack of 10", STACK, STEPS, rest, RESTS, 5.0, 1.0),
    Varied("dt", "fast gas", FAST, (1 / 60, 1 / 120, 1 / 240, 1 / 960), lost, LOST, 0.5, 0.5),
    Varied("substeps", "stack of 10", STACK, SUBSTEPS, rest, RESTS, 5.0, 1.0),
    Varied("substeps", "pyramid of 210", PYRAMID, SUBSTEPS, rest, RESTS, 3.0, 0.5),
    Varied("integrator", "jump", _scene("jump"), METHODS, apex, APEX, 1.0, 0.8),
    Varied(
        "integrator", "orbit", _scene("orbit"), METHODS, kepler, {"energy": "%", "growth": "% in the end"},
        10 * orbit.PERIOD, 2.0,
    ),
    Varied("collision", "fast gas", FAST, COLLISION_MODES, lost, LOST, 0.5, 0.5),
    Varied("collision", "slow gas", _scene("gas2d"), COLLISION_MODES, lost, LOST, 2.0, 0.5),
    *(
        Varied(
            "geometry", f"2,000 boxes in {things}", partial(boxes_in_spheres, dimensions=dimensions),
            ("precise", "bounds"), false_contacts, {"false": "% false"}, 0.1, 1 / 12,
        )
        for dimensions, things in ((2, "circles"), (3, "spheres"))
    ),
    Varied(
        "restitution_threshold", "drops", _scene("drops"), THRESHOLDS, last_bounce, {"lost": "mm"}, 12.0, 2.0,
        {"integrator": "velocity_verlet", "collision": "continuous"},
    ),
    Varied(
        "restitution_threshold", "platforms", _scene("platforms"), THRESHOLDS, rest, RESTS, 6.0, 3.0,
        {"max_impacts_per_step": 32},
    ),
    Varied(
        "slop", "tiles", tiles, (None, 0.0, 0.001, 0.02, 0.1), seams, {"stuck": "% lost", "passed": "mm passed"},
        3.0, 3.0,
    ),
    Varied(
        "max_impacts_per_step", "fast gas", FAST, (64, 1, 4, 8, 16), lost, LOST, 0.5, 0.5,
        {"collision": "continuous"},
    ),
    Varied("sleeping", "pyramid of 210", PYRAMID, (False, True), rest, RESTS, 5.0, 5.0),
)  # fmt: skip


def axes(quick: bool = False) -> list[Axis]:
    """All of them."""
    del quick
    return [Axis(each.field, each.scene, each.values, each.time, each.facts) for each in VARIED]


def report(result: Result) -> tuple[list[TextTable], list[str]]:
    """The cost and the errors of each value of each field; how and where it was timed."""
    by_name = {(varied.field, varied.scene): varied for varied in VARIED}
    rows = [row for line in result.lines for row in _rows(by_name[line.axis, line.of], line)]
    title = "each field alone: time per simulated second, the default value's being 1; what goes wrong"
    return [TextTable(title, ("field", "scene", "value", "time", "error"), rows, words=3)], [
        f"time: {result.machine['clock']}, medians of {result.repeats}, in which the values take turns; no compiling "
        f"is in it; {result.machine['processor']}"
    ]


def _rows(varied: Varied, line: Line) -> Iterator[tuple[str, ...]]:
    own = line.sample(varied.default).figures["seconds"]
    for place, sample in enumerate(line.samples):
        names = (varied.field, varied.scene) if place == 0 else ("", "")
        default = "" if sample.value != varied.default else f" (default, {compact(1e3 * own.median)} ms)"
        errors = ", ".join(_amount(sample.facts[name], unit) for name, unit in varied.errors.items())
        time = ratios(sample.figures["seconds"], own).median
        yield *names, source(varied.field, sample.value) + default, f"{time:.2f}", errors


def source(name: str, value: Any) -> str:
    """The value as Python source; a step as a fraction."""
    if name == "dt":
        return f"1/{round(1 / value)}"
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _amount(amount: float, unit: str) -> str:
    text = f"{amount:.0f}" if amount == round(amount) and abs(amount) < 1e6 else compact(amount)
    if 0 < abs(amount) < ROUNDING:
        text = f"< {ROUNDING:g}"
    return f"{text} {unit}".strip()

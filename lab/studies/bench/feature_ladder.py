"""The cost of each feature: nanoseconds per body per step of a scene with the feature and of the same scene without it.

A scene pays only for the features it uses. ``world.plan()`` lists them; this benchmark measures their cost.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....components import AABBCollider, RigidBody, SphereCollider, Transform
from ....framework import ForceSystem, Settings, World
from ....framework.schedule.phases import System
from ....plugins import Physics
from ....scenes import gas
from ...bench.report import digits, span
from ...bench.results import machine
from ...measure.timing import Spread
from ...plain import Plain
from ...reporting.progress import NO_PROGRESS, Progress
from ...reporting.text_tables import TextTable
from .step_time import nanoseconds_per_step

BODIES = 10_000
STEPS = 60  # per repeat
SPACING = 3.0  # m between bodies that never meet: they are 1 m wide and all have the same velocity


class Drag(ForceSystem):
    """A force that depends on the state, in numpy."""

    def add_forces(self, bodies: Any, time: float) -> None:
        bodies.force[:] -= 0.1 * bodies.linear_velocity


class Idle(System):
    """A user system that does nothing. carom cannot know that, and keeps copies to roll the step back."""

    def process(self, dt: float) -> None:
        pass


def _drifting(n: int, *components: Any, dimensions: int = 2, gravity: float = 0.0, **how: Any) -> World:
    """Bodies that never meet. how: integrator, rotation and fields of RigidBody."""
    settings = Settings(integrator=how.pop("integrator", "semi_implicit_euler"))
    down = (0.0, -gravity, 0.0)[:dimensions]
    world = World(Physics(dimensions=dimensions, gravity=down), settings=settings)
    side = math.ceil(n ** (1 / dimensions))
    places = np.stack(np.unravel_index(np.arange(n), (side,) * dimensions), axis=1) * SPACING
    transform = Transform.many(places, rotation=how.pop("rotation", 0.0))
    velocity = (1.0, 0.5, 0.25)[:dimensions]
    world.create_entities(n, transform, RigidBody.many(linear_velocity=velocity, **how), *components)
    return world


def _spheres(**collider: Any) -> Any:
    return SphereCollider.many(radius=0.5, **collider)


def _boxes() -> Any:
    return AABBCollider.many(half_extents=(0.5, 0.5))


def _with(world: World, system: Any) -> World:
    world.add_system(system)
    return world


def _walled(n: int) -> World:
    world = _drifting(n, _spheres())
    far = 2.0 * SPACING * math.sqrt(n)
    for centre, half in (((far, 0), (1, far)), ((-far, 0), (1, far)), ((0, far), (far, 1)), ((0, -far), (far, 1))):
        world.create_entity(Transform(centre), AABBCollider(half))
    return world


def _resting(n: int, handler: bool = False, **collider: Any) -> World:
    """Spheres at rest on a floor, side by side without contact to each other."""
    world = World(Physics(gravity=(0.0, -9.81)))
    places = np.stack((1.5 * np.arange(n), np.full(n, 0.5)), axis=1)
    world.create_entities(n, Transform.many(places), RigidBody.many(mass=1.0), _spheres(**collider))
    world.create_entity(Transform((0.75 * n, -0.5)), AABBCollider((0.75 * n + 2.0, 0.5)))
    if handler:
        world.on("contact_stay", _ignore)
    return world


def _ignore(contact: Any) -> None:
    pass


@dataclass(frozen=True)
class Rung:
    """A scene with one feature more than the scene named ``beside``; build(bodies, seed) creates it."""

    feature: str
    beside: str
    build: Callable[[int, int], World]


BARE = "drifting"
RUNGS: tuple[Rung, ...] = (
    Rung(BARE, "", lambda n, seed: _drifting(n)),
    Rung("gravity", BARE, lambda n, seed: _drifting(n, gravity=9.81)),
    Rung("constant_force", BARE, lambda n, seed: _drifting(n, constant_force=(0.0, -9.81))),
    Rung("linear_damping", BARE, lambda n, seed: _drifting(n, linear_damping=0.1)),
    Rung("max_linear_speed", BARE, lambda n, seed: _drifting(n, max_linear_speed=10.0)),
    Rung("rotation", BARE, lambda n, seed: _drifting(n, rotation=0.3)),
    Rung("3D", BARE, lambda n, seed: _drifting(n, dimensions=3)),
    Rung("a system of the game", BARE, lambda n, seed: _with(_drifting(n), Idle())),
    Rung("a force system", "gravity", lambda n, seed: _with(_drifting(n, gravity=9.81), Drag())),
    Rung("velocity_verlet", "gravity", lambda n, seed: _drifting(n, gravity=9.81, integrator="velocity_verlet")),
    Rung("spheres, apart", BARE, lambda n, seed: _drifting(n, _spheres())),
    Rung("boxes, apart", BARE, lambda n, seed: _drifting(n, _boxes())),
    Rung("boxes, turned", "boxes, apart", lambda n, seed: _drifting(n, _boxes(), rotation=0.3)),
    Rung("two levels", "boxes, apart", lambda n, seed: _drifting(n, SphereCollider.many(radius=0.8), _boxes())),
    Rung("walls", "spheres, apart", lambda n, seed: _walled(n)),
    Rung("elastic impacts", "walls", lambda n, seed: gas.gas2d(seed=seed, n=n)),
    Rung("contacts at rest", "walls", lambda n, seed: _resting(n)),
    Rung("friction", "contacts at rest", lambda n, seed: _resting(n, friction=0.5)),
    Rung("restitution, at rest", "contacts at rest", lambda n, seed: _resting(n, restitution=0.5)),
    Rung("a handler", "contacts at rest", lambda n, seed: _resting(n, handler=True)),
)


@dataclass
class Cost(Plain):
    """One rung. nanoseconds: per body and step; extra: difference to the scene beside it, within each repeat.

    ``bytes``: of the columns, per body; ``kernels``: those called here but not by the scene beside it.
    """

    feature: str
    beside: str
    nanoseconds: Spread
    extra: Spread | None
    bytes: int
    kernels: list[str]


@dataclass
class Ladder(Plain):
    """All rungs."""

    bodies: int
    steps: int
    repeats: int
    machine: dict[str, str]
    costs: list[Cost]


def ladder(bodies: int = BODIES, repeats: int = 5, progress: Progress = NO_PROGRESS, steps: int = STEPS) -> Ladder:
    """Time every rung once per repeat, each time starting with another rung."""
    found: dict[str, list[float]] = {rung.feature: [] for rung in RUNGS}
    calls: dict[str, list[str]] = {"": []}
    sizes: dict[str, int] = {}
    progress.begin(len(RUNGS) * repeats)
    for repeat in range(repeats):
        first = repeat * len(RUNGS) // repeats
        for rung in (*RUNGS[first:], *RUNGS[:first]):
            progress.say(f"{rung.feature}, repeat {repeat + 1} of {repeats}")
            with contextlib.closing(rung.build(bodies, repeat)) as world:
                found[rung.feature].append(nanoseconds_per_step(world, rung.feature, steps) / bodies)
                calls[rung.feature] = _called(world)
                sizes[rung.feature] = sum(column.bytes for column in world.plan().columns if column.of == "body")
            progress.advance(1)
    costs = []
    for rung in RUNGS:
        values, beside = found[rung.feature], found.get(rung.beside)
        extra = None if beside is None else Spread.of([a - b for a, b in zip(values, beside, strict=True)])
        kernels = [name for name in calls[rung.feature] if name not in calls[rung.beside]]
        costs.append(Cost(rung.feature, rung.beside, Spread.of(values), extra, sizes[rung.feature], kernels))
    return Ladder(bodies, steps, repeats, machine(), costs)


def _called(world: World) -> list[str]:
    """The kernels that a step calls, in system order."""
    with world.profile():
        world.step()
    return list(dict.fromkeys(row.kernel for row in world.stats().kernels))


def table(result: Ladder) -> TextTable:
    """The rungs as a table."""
    cells = []
    for cost in result.costs:
        extra, more = ("", "") if cost.extra is None else (f"{cost.extra.median:+.1f}", span(cost.extra))
        ns = digits(cost.nanoseconds.median)
        cells.append((cost.feature, cost.beside, ", ".join(cost.kernels), ns, extra, more, str(cost.bytes)))
    title = (
        f"ns per body per step of {result.bodies:,} bodies, and how much that is above the scene beside it; "
        f"medians of {result.repeats}"
    )
    headings = ("scene with", "beside", "kernels that the other has not", "ns", "more", "from .. to", "bytes per body")
    return TextTable(title, headings, cells, words=3)

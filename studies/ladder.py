"""The cost of each feature: nanoseconds per body per step of a scene with the feature and of the same scene without it.

A scene pays only for the features it uses. ``world.plan()`` lists them; this benchmark measures their cost.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Settings, System, World
from carom.lab import testing as kit
from carom.lab.measure.timing import Spread
from carom.lab.reporting.text import TextTable, compact, span
from carom.plugins import Physics
from carom.scenes import gas

from .runner import WARM_UP_STEPS, Axis, Result, Sample, nanoseconds_per_step

BODIES, FEW = 10_000, 1000
STEPS = 60  # per repeat
FEATURE = "feature"
SPACING = 3.0  # m between bodies that never meet: they are 1 m wide and all have the same velocity


class Drag(ForceSystem):
    """A force that depends on the state, in numpy."""

    def add_forces(self, bodies: Any, time: float) -> None:
        bodies.force[:] -= 0.1 * bodies.linear_velocity


class Idle(System):
    """A user system that does nothing. carom cannot know that, and keeps copies to roll the step back."""

    def process(self, dt: float) -> None:
        pass


def drifting(n: int, *components: Any, dimensions: int = 2, gravity: float = 0.0, **how: Any) -> World:
    """Bodies that never meet. how: plugins, integrator, rotation and fields of RigidBody."""
    settings = Settings(integrator=how.pop("integrator", "semi_implicit_euler"))
    down = (0.0, -gravity, 0.0)[:dimensions]
    world = World(Physics(dimensions=dimensions, gravity=down), *how.pop("plugins", ()), settings=settings)
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
    world = drifting(n, _spheres())
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
    Rung(BARE, "", lambda n, seed: drifting(n)),
    Rung("gravity", BARE, lambda n, seed: drifting(n, gravity=9.81)),
    Rung("constant_force", BARE, lambda n, seed: drifting(n, constant_force=(0.0, -9.81))),
    Rung("linear_damping", BARE, lambda n, seed: drifting(n, linear_damping=0.1)),
    Rung("max_linear_speed", BARE, lambda n, seed: drifting(n, max_linear_speed=10.0)),
    Rung("rotation", BARE, lambda n, seed: drifting(n, rotation=0.3)),
    Rung("3D", BARE, lambda n, seed: drifting(n, dimensions=3)),
    Rung("a system of the game", BARE, lambda n, seed: _with(drifting(n), Idle())),
    Rung("a force system", "gravity", lambda n, seed: _with(drifting(n, gravity=9.81), Drag())),
    Rung("velocity_verlet", "gravity", lambda n, seed: drifting(n, gravity=9.81, integrator="velocity_verlet")),
    Rung("spheres, apart", BARE, lambda n, seed: drifting(n, _spheres())),
    Rung("boxes, apart", BARE, lambda n, seed: drifting(n, _boxes())),
    Rung("boxes, turned", "boxes, apart", lambda n, seed: drifting(n, _boxes(), rotation=0.3)),
    Rung("two levels", "boxes, apart", lambda n, seed: drifting(n, SphereCollider.many(radius=0.8), _boxes())),
    Rung("walls", "spheres, apart", lambda n, seed: _walled(n)),
    Rung("elastic impacts", "walls", lambda n, seed: gas.gas2d(seed=seed, n=n)),
    Rung("contacts at rest", "walls", lambda n, seed: _resting(n)),
    Rung("friction", "contacts at rest", lambda n, seed: _resting(n, friction=0.5)),
    Rung("restitution, at rest", "contacts at rest", lambda n, seed: _resting(n, restitution=0.5)),
    Rung("a handler", "contacts at rest", lambda n, seed: _resting(n, handler=True)),
)


BY_FEATURE = {rung.feature: rung for rung in RUNGS}


def axes(quick: bool = False, long: bool = False) -> list[Axis]:
    """The features."""
    del long
    return [axis(FEW if quick else BODIES)]


def axis(bodies: int, steps: int = STEPS, by_feature: Mapping[str, Rung] = BY_FEATURE) -> Axis:
    """Nanoseconds per body and step of each rung; bytes of the columns per body, and the kernels that a step calls."""

    def measure(feature: str, repeat: int) -> dict[str, float]:
        make = partial(by_feature[feature].build, bodies, repeat)
        return {"ns": nanoseconds_per_step(make, feature, steps) / bodies}

    def facts(feature: str) -> dict[str, Any]:
        with contextlib.closing(by_feature[feature].build(bodies, 0)) as world:
            kit.run(world, WARM_UP_STEPS)
            with world.profile():
                world.step()
            kernels = list(dict.fromkeys(row.kernel for row in world.stats().kernels))
            held = sum(column.bytes for column in world.plan().columns if column.of == "body")
        return {"kernels": kernels, "bytes": held}

    return Axis(FEATURE, f"{bodies:,} bodies", tuple(by_feature), measure, facts)


def extra(sample: Sample, beside: Sample) -> Spread:
    """The difference to the scene beside it, within each repeat."""
    pairs = zip(sample.figures["ns"].values, beside.figures["ns"].values, strict=True)
    return Spread.of([one - other for one, other in pairs])


def report(result: Result) -> tuple[list[TextTable], list[str]]:
    """The rungs as a table."""
    (line,) = result.lines
    cells = []
    for sample in line.samples:
        beside, kernels, more = BY_FEATURE[sample.value].beside, sample.facts["kernels"], ("", "")
        if beside:
            other = line.sample(beside)
            kernels = [name for name in kernels if name not in other.facts["kernels"]]
            spread = extra(sample, other)
            more = f"{spread.median:+.1f}", span(spread)
        ns = compact(sample.figures["ns"].median)
        cells.append((sample.value, beside, ", ".join(kernels), ns, *more, str(sample.facts["bytes"])))
    title = (
        f"ns per body per step of {line.of}, and how much that is above the scene beside it; "
        f"medians of {result.repeats}"
    )
    headings = ("scene with", "beside", "kernels that the other has not", "ns", "more", "from .. to", "bytes per body")
    return [TextTable(title, headings, cells, words=3)], []

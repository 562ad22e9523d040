"""The cost of each feature: nanoseconds per body and step of a scene with it, and of the same scene without it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Settings, System, World
from carom.lab.reporting.text import TextTable, compact, span
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.scenes import gas

from .runner import Axis, Result, nanoseconds_per_step, ratios

BODIES, TURNING, FEW = 10_000, 3000, 300
STEPS = 60  # per repeat
SPACING = 3.0  # m between bodies that never meet: they are 1 m wide and all have the same velocity
HEIGHT = 10  # of a stack


class Drag(ForceSystem):
    """A force that depends on the state, in numpy."""

    def add_forces(self, bodies: Any, time: float) -> None:
        bodies.force[:] -= 0.1 * bodies.linear_velocity


class Idle(System):
    """A user system that does nothing. carom cannot know that, and keeps copies to roll the step back."""

    def process(self, dt: float) -> None:
        pass


def drifting(
    n: int, *components: Any, dimensions: int = 2, gravity: float = 0.0, integrator: str = "semi_implicit_euler",
    rotation: float = 0.0, plugins: tuple[Any, ...] = (), system: Any = None, **fields: Any,
) -> World:  # fmt: skip
    """Bodies that never meet; fields: of RigidBody."""
    physics = Physics(dimensions=dimensions, gravity=(0.0, -gravity, 0.0)[:dimensions])
    world = World(physics, *plugins, settings=Settings(integrator=integrator))
    side = math.ceil(n ** (1 / dimensions))
    places = np.stack(np.unravel_index(np.arange(n), (side,) * dimensions), axis=1) * SPACING
    body = RigidBody.many(linear_velocity=(1.0, 0.5, 0.25)[:dimensions], **fields)
    world.create_entities(n, Transform.many(places, rotation=rotation), body, *components)
    if system is not None:
        world.add_system(system)
    return world


def _balls(n: int, *components: Any, **how: Any) -> World:
    return drifting(n, SphereCollider.many(radius=0.5), *components, **how)


def _walled(n: int) -> World:
    world, far = _balls(n), 2.0 * SPACING * math.sqrt(n)
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        world.create_entity(Transform((x * far, y * far)), AABBCollider((1, far) if x else (far, 1)))
    return world


def _resting(n: int, handler: Callable[[Any], None] | None = None, **material: Any) -> World:
    """Spheres at rest on a floor, side by side without contact to each other."""
    world = World(Physics(gravity=(0.0, -9.81)))
    places = Transform.many(np.stack((1.5 * np.arange(n), np.full(n, 0.5)), axis=1))
    world.create_entities(n, places, RigidBody.many(), SphereCollider.many(radius=0.5, **material))
    world.create_entity(Transform((0.75 * n, -0.5)), AABBCollider((0.75 * n + 2.0, 0.5)))
    if handler is not None:
        world.on("contact_stay", handler)
    return world


def _boxes(n: int, kind: Any = BoxCollider, *components: Any, dimensions: int = 2, **how: Any) -> World:
    return drifting(n, kind.many(half_extents=(0.4, 0.3, 0.2)[:dimensions]), *components, dimensions=dimensions, **how)


def _stacks(n: int, kind: Any, *components: Any, dimensions: int = 2, one_more: bool = False) -> World:
    """Boxes that stand on each other, ten high. one_more: and a ball that turns, far away."""
    world = World(Physics(dimensions, gravity=(0.0, -9.81, 0.0)[:dimensions]), Rotation())
    column, height = np.divmod(np.arange(n), HEIGHT)
    side = math.ceil(math.sqrt(n / HEIGHT)) if dimensions == 3 else n
    places = np.stack((1.5 * (column % side), height + 0.5, 1.5 * (column // side)), axis=1)[:, :dimensions]
    box = kind.many(half_extents=(0.5,) * dimensions, friction=0.5)
    world.create_entities(n, Transform.many(places), RigidBody.many(), box, *components)
    floor = AABBCollider((2.0 * n, 0.5, 2.0 * n)[:dimensions], friction=0.5)
    world.create_entity(Transform((0.0, -0.5, 0.0)[:dimensions]), floor)
    if one_more:
        world.create_entity(Transform((-9.0, 99.0)), RigidBody(gravity_scale=0.0), Spin(1.0), SphereCollider(0.5))
    return world


TURNS: dict[str, Any] = {"plugins": (Rotation(),)}
IN_3D: dict[str, Any] = {"dimensions": 3, **TURNS}
Rungs = Mapping[str, tuple[str, Callable[..., World]]]

# By feature: the scene without it, and how to build the one with it, of so many bodies; "": there is none.
LADDER: Rungs = {
    "drifting": ("", drifting),
    "gravity": ("drifting", partial(drifting, gravity=9.81)),
    "constant_force": ("drifting", partial(drifting, constant_force=(0.0, -9.81))),
    "linear_damping": ("drifting", partial(drifting, linear_damping=0.1)),
    "max_linear_speed": ("drifting", partial(drifting, max_linear_speed=10.0)),
    "rotation": ("drifting", partial(drifting, rotation=0.3)),
    "3D": ("drifting", partial(drifting, dimensions=3)),
    "a system of the game": ("drifting", lambda n: drifting(n, system=Idle())),
    "a force system": ("gravity", lambda n: drifting(n, gravity=9.81, system=Drag())),
    "velocity_verlet": ("gravity", partial(drifting, gravity=9.81, integrator="velocity_verlet")),
    "spheres, apart": ("drifting", _balls),
    "boxes, apart": ("drifting", partial(_boxes, kind=AABBCollider)),
    "boxes, turned": ("boxes, apart", partial(_boxes, kind=AABBCollider, rotation=0.3)),
    "two levels": ("boxes, apart", lambda n: _boxes(n, AABBCollider, SphereCollider.many(radius=0.8))),
    "walls": ("spheres, apart", _walled),
    "elastic impacts": ("walls", lambda n: gas.gas2d(n=n)),
    "contacts at rest": ("walls", _resting),
    "friction": ("contacts at rest", partial(_resting, friction=0.5)),
    "restitution, at rest": ("contacts at rest", partial(_resting, restitution=0.5)),
    "a handler": ("contacts at rest", partial(_resting, handler=lambda contact: None)),
}
SPINS: Rungs = {
    "balls in flight": ("", _balls),
    "Rotation, nothing spins": ("balls in flight", partial(_balls, **TURNS)),
    "balls with a Spin": ("balls in flight", lambda n: _balls(n, Spin.many(1.0), **TURNS)),
    "boxes in flight": ("", partial(_boxes, rotation=0.3, **TURNS)),
    "boxes with a Spin": ("boxes in flight", lambda n: _boxes(n, BoxCollider, Spin.many(1.0), rotation=0.3, **TURNS)),
    "boxes in flight, 3D": ("", partial(_boxes, **IN_3D)),
    "boxes with a Spin, 3D": (
        "boxes in flight, 3D", lambda n: _boxes(n, BoxCollider, Spin.many((1.0, 0.5, 0.2)), **IN_3D),
    ),
    "stacks of AABBs": ("", partial(_stacks, kind=AABBCollider)),
    "and one ball that spins": ("stacks of AABBs", partial(_stacks, kind=AABBCollider, one_more=True)),
    "stacks of boxes without a Spin": ("stacks of AABBs", partial(_stacks, kind=BoxCollider)),
    "stacks of boxes with a Spin": ("stacks of AABBs", lambda n: _stacks(n, BoxCollider, Spin.many())),
    "stacks of AABBs, 3D": ("", partial(_stacks, kind=AABBCollider, dimensions=3)),
    "stacks of boxes with a Spin, 3D": (
        "stacks of AABBs, 3D", lambda n: _stacks(n, BoxCollider, Spin.many(), dimensions=3),
    ),
}  # fmt: skip


def axes(rungs: Rungs, bodies: int, quick: bool = False) -> list[Axis]:
    """Nanoseconds per body and step of each rung."""
    n = FEW if quick else bodies

    def measure(feature: str, repeat: int) -> dict[str, float]:
        return {"ns": nanoseconds_per_step(partial(rungs[feature][1], n), feature, STEPS) / n}

    return [Axis("feature", f"{n:,} bodies", tuple(rungs), measure)]


def report(rungs: Rungs, result: Result) -> tuple[list[TextTable], list[str]]:
    """The rungs as a table."""
    (line,) = result.lines
    cells = []
    for sample in line.samples:
        ns, beside = sample.figures["ns"], rungs[sample.value][0]
        more = ("", "", "")
        if beside:
            other = line.sample(beside).figures["ns"]
            times = ratios(ns, other)
            more = f"{ns.median - other.median:+.1f}", compact(times.median), span(times)
        cells.append((sample.value, beside, compact(ns.median), *more))
    title = f"ns per body and step, {line.of}, and beside the same scene without it; medians of {result.repeats}"
    return [TextTable(title, ("scene with", "beside", "ns", "more", "times", "from .. to"), cells, words=2)], []

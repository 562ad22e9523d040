"""The quantities: each value is measured in a world of its own, whose motion is known in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Settings, World
from carom.framework.settings import COLLISION_MODES
from carom.lab import testing as kit
from carom.plugins import Physics
from carom.systems.integration.integrators import STANDARD_INTEGRATORS

GRAVITY = 10.0  # m/s^2
SPEED = 1.0  # m/s, of bodies that meet head on
FREQUENCY = 2 * math.pi  # rad/s: one oscillation per second
SWINGS, FEWEST_STEPS, MOST_STEPS = 10, 100, 1000
BLOWN_UP = 1e6  # times the energy at the start
SHORT_SWING, TEN_SWINGS = 0.1, 628  # z of the spring in the long run; steps of ten oscillations, for the mean energy
SHOTS, RADIUS, WALL = 200, 0.25, 0.1  # start phases of a step; m
REST_STEPS, LAST_STEPS = 600, 60  # ten seconds, of which the last one is measured

Method = Mapping[str, Any]  # settings that differ from the default; "ccd": of the bodies


class BrokenError(Exception):
    """Raised by a measurement whose result is unusable, with the reason. error: its size all the same, else None."""

    def __init__(self, why: str, error: float | None = None) -> None:
        super().__init__(why)
        self.error = error


@dataclass(frozen=True)
class Quantity:
    """What is varied, and the error that follows.

    unit: of the values, in words; norm: the error, and what it is relative to
    values: ascending, from where all works; ``quick``: fewer of them
    measure: (method, value) -> error; raises BrokenError. Errors raised by carom count as broken too
    fine: levels are found to this factor; None: the values are not refined
    whole: values are whole numbers
    """

    name: str
    title: str
    unit: str
    norm: str
    values: tuple[float, ...]
    methods: Mapping[str, Method]
    measure: Callable[[Method, float], float]
    fine: float | None = 1.1
    whole: bool = False
    quick: tuple[float, ...] = ()


def new_world(method: Method, gravity: float = 0.0, **settings: Any) -> World:
    """An empty 2D world."""
    changes = {name: value for name, value in method.items() if name != "ccd"}
    return World(Physics(dimensions=2, gravity=(0.0, -gravity)), settings=Settings(**changes, **settings))


# -- free flight ------------------------------------------------------------------------------------------------------


class Pull(ForceSystem):
    """A spring to the origin, in N/m."""

    def __init__(self, stiffness: float) -> None:
        self.stiffness = stiffness

    def add_forces(self, bodies: Any, time: float) -> None:
        bodies.force[:] -= self.stiffness * bodies.position


def swing(method: Method, dt: float) -> float:
    """A body pushed off on a spring, against sin(w t), for ten periods, at least 100 and at most 1,000 steps."""
    steps = min(max(round(SWINGS * 2 * math.pi / FREQUENCY / dt), FEWEST_STEPS), MOST_STEPS)
    true = np.sin(FREQUENCY * dt * np.arange(1, steps + 1))
    found = _swung(method, dt, FREQUENCY, 0.0, FREQUENCY, steps)[:, 0]
    return float(np.abs(found - true).max() / np.abs(true).max())


def stiffness(method: Method, z: float) -> float:
    """A body released on a spring of z = w dt, a thousand steps: the largest change of the energy."""
    states = _swung(method, 1.0, z, 1.0, 0.0, MOST_STEPS)
    return float(np.abs(states**2 @ (z * z, 1.0) / (z * z) - 1).max())


def _swung(method: Method, dt: float, frequency: float, x: float, v: float, steps: int) -> np.ndarray:
    """(steps, 2): position and velocity on a spring; BrokenError once the energy has grown a millionfold."""
    states, highest = np.empty((steps, 2)), BLOWN_UP * ((frequency * x) ** 2 + v * v)
    with closing(new_world(method, dt=dt)) as world:
        world.create_entity(Transform((x, 0)), RigidBody(linear_velocity=(v, 0)))
        world.add_system(Pull(frequency**2))
        for n in range(steps):
            world.step()
            states[n] = world.bodies.position[0, 0], world.bodies.linear_velocity[0, 0]
            if not (frequency * states[n, 0]) ** 2 + states[n, 1] ** 2 < highest:
                raise BrokenError("energy grows")
    return states


def duration(method: Method, steps: float) -> float:
    """Drift of the mean energy of a spring of z = 0.1, from the first ten oscillations to the last."""
    window = min(TEN_SWINGS, round(steps) // 2)
    means = []
    with closing(new_world(method, dt=1.0)) as world:
        world.create_entity(Transform((1, 0)), RigidBody())
        world.add_system(Pull(SHORT_SWING**2))
        x, v = world.bodies.position, world.bodies.linear_velocity
        for skipped in (0, round(steps) - 2 * window):
            kit.run(world, skipped)
            total = 0.0
            for _ in range(window):
                world.step()
                total += SHORT_SWING**2 * x[0, 0] ** 2 + v[0, 0] ** 2
            means.append(total / window)
    return abs(means[1] / means[0] - 1)


# -- impacts ----------------------------------------------------------------------------------------------------------


def distance(method: Method, offset: float) -> float:
    """Two balls of 1 m meet head on at this distance from the origin: the error of their positions after 0.5 s."""
    with closing(new_world(method)) as world:
        for side in (-1, 1):
            kit.ball(world, offset + 0.6 * side, -SPEED * side, restitution=1.0)
        start = world.bodies.position.copy()
        kit.run(world, 30)
        position, velocity = world.bodies.position.copy(), world.bodies.linear_velocity.copy()
    if (position == start).all():
        raise BrokenError("nothing moves: a step is less than the spacing of the numbers")
    if not velocity[0, 0] < 0 < velocity[1, 0]:
        raise BrokenError("they pass through each other")
    travel = 30 / 60 * SPEED
    true = offset + np.array([-1, 1]) * (0.5 + (travel - 0.1))
    return float(np.abs(position[:, 0] - true).max() / travel)


def speed(method: Method, ratio: float) -> float:
    """Balls shot at a wall from all phases of a step: the share behind the wall, or the error of their positions."""
    way, touch = ratio * (WALL + 2 * RADIUS), -(WALL / 2 + RADIUS)  # in a step; where they meet it
    start = touch - way * (np.arange(SHOTS) + 0.5) / SHOTS - 1e-3 * way
    with closing(new_world(method)) as world:
        world.create_entity(Transform((0, 0)), AABBCollider((WALL / 2, 2.0 * SHOTS)))
        world.create_entities(
            SHOTS,
            Transform.many(np.column_stack((start, 2.0 * np.arange(SHOTS) - SHOTS))),
            RigidBody.many(linear_velocity=(60 * way, 0.0), ccd=method.get("ccd", False)),
            SphereCollider.many(radius=RADIUS, restitution=1.0, layer=2, mask=1),
        )
        kit.run(world, 3)
        x = world.bodies.dynamic.position[:, 0].copy()
        back = world.bodies.dynamic.linear_velocity[:, 0] < 0
    error = np.abs(x - (2 * touch - start - 3 * way))[back].max(initial=0.0) / (3 * way)
    if not back.all():
        raise BrokenError("tunnels", max(float(np.mean(~back)), error))
    return float(error)


# -- contacts at rest -------------------------------------------------------------------------------------------------


def load(method: Method, ratio: float) -> float:
    """The largest overlap of a box at rest on another that is ``ratio`` times lighter."""
    return _tower(method, [1.0, ratio])[0]


def tower(method: Method, height: float) -> float:
    """The distance that the top of a tower of ``height`` boxes has sunk."""
    return _tower(method, [1.0] * round(height))[1]


def _tower(method: Method, mass: list[float]) -> tuple[float, float]:
    """(largest overlap in ten seconds, sinking of the top in the last second), in box sizes."""
    n, deepest, lowest = len(mass), 0.0, 0.0
    with closing(new_world(method, GRAVITY)) as world:
        kit.floor(world)
        places = Transform.many(np.column_stack((np.zeros(n), 0.5 + np.arange(n))))
        world.create_entities(n, places, RigidBody.many(mass=mass), AABBCollider.many(half_extents=(0.5, 0.5)))
        for step in range(REST_STEPS):
            world.step()
            place = world.bodies.dynamic.position
            deepest = max(deepest, float((1 - np.diff(place[:, 1], prepend=-0.5)).max()))
            if np.abs(place[:, 0]).max() > 0.5:
                raise BrokenError("it falls over", min(deepest, 1.0))
            if step >= REST_STEPS - LAST_STEPS:
                lowest = max(lowest, float(n - 0.5 - place[-1, 1]))
    if deepest > 0.5:
        raise BrokenError("boxes are pressed past each other's middle", min(deepest, 1.0))
    return deepest, lowest


def decades(first: int, last: int, per_decade: int = 1) -> tuple[float, ...]:
    """10^first ... 10^last, with ``per_decade`` values per decade."""
    return tuple(float(10.0 ** (first + k / per_decade)) for k in range((last - first) * per_decade + 1))


BY_MODE: dict[str, Method] = {mode: {"collision": mode} for mode in COLLISION_MODES}
FLIGHTS = {**{name: {"integrator": name} for name in STANDARD_INTEGRATORS}, "event_driven": BY_MODE["event_driven"]}
STABLE = {name: method for name, method in FLIGHTS.items() if name != "explicit_euler"}  # its long runs diverge
FINE_SOLVER = {"discrete with 32 substeps": {"substeps": 32}}
STEPS = decades(-9, -4) + decades(-3, 1, 2)

QUANTITIES = (
    Quantity(
        "dt", "step, of a spring", "s", "place on a spring that swings once a second, of the amplitude", STEPS,
        FLIGHTS, swing, quick=(1e-9, 1e-4, 1e-2, 0.1, 1),
    ),
    Quantity(
        "stiffness", "stiffness x dt", "z = w dt", "energy of a spring over 1,000 steps, of that at the start",
        (*decades(-2, 0, 4), 1.25, 1.5, 1.75, 1.99, 2.5, 3.0), FLIGHTS, stiffness, fine=1.01,
        quick=(0.01, 0.1, 1.0, 1.99, 3.0),
    ),
    Quantity(
        "duration", "duration, of a spring", "steps", "drift of the mean energy of a spring of z = 0.1", decades(3, 5),
        STABLE, duration, fine=None, whole=True, quick=(1e3,),
    ),
    Quantity(
        "distance", "distance from the origin", "m", "place of balls that meet head on, of the way they go",
        decades(0, 16), BY_MODE, distance, quick=(1.0, 1e9, 1e12, 1e15, 1e16),
    ),
    Quantity(
        "speed", "speed x dt / size", "v dt / (w + 2 r)",
        "share of 200 start phases in which a ball passes a wall, or the error of its place, of its way",
        (*decades(-2, 0, 2), 2.0, *decades(1, 6)), {**BY_MODE, "discrete with ccd": {"ccd": True}}, speed, fine=1.01,
        quick=(0.01, 0.9, 2.0, 100.0, 1e6),
    ),
    Quantity(
        "load", "ratio of masses", "", "overlap of a box that rests on a lighter one, of its size",
        decades(0, 12)[::2], BY_MODE, load, quick=(1.0, 1e4, 1e12),
    ),
    Quantity(
        "stack", "height of a tower", "boxes", "sinking of the top after 10 s, of a box",
        (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0), {**BY_MODE, **FINE_SOLVER}, tower, whole=True,
        quick=(1.0, 10.0, 40.0),
    ),
)  # fmt: skip

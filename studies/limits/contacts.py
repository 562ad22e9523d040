"""The quantities of contacts: speed against a thin wall, mass ratios, towers, many bodies at one point."""

from __future__ import annotations

from contextlib import closing
from types import MappingProxyType

import numpy as np

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.lab import testing as kit

from .edges import BY_MODE, BrokenError, Method, Quantity, decades
from .motion import GRAVITY, SPEED, new_world

SHOTS = 200  # start phases of a step
RADIUS, WALL = 0.25, 0.1  # m
SIZE = WALL + 2 * RADIUS
REST_STEPS, LAST_STEPS = 600, 60  # ten seconds, of which the last second is measured
CROWD_STEPS = 60
ONE_SWEPT = Method("discrete with ccd")
FINE_SOLVER = Method("discrete with 32 substeps", MappingProxyType({"substeps": 32}))


def speed(method: Method, ratio: float) -> float:
    """Balls shot at a wall from all phases of a step: the share behind the wall, or the error of their positions."""
    way = ratio * SIZE  # in a step
    velocity = 60 * way
    touch = -(WALL / 2 + RADIUS)
    start = touch - way * (np.arange(SHOTS) + 0.5) / SHOTS - 1e-3 * way
    with closing(new_world(method)) as world:
        world.create_entity(Transform((0, 0)), AABBCollider((WALL / 2, 2.0 * SHOTS)))
        world.create_entities(
            SHOTS,
            Transform.many(np.column_stack((start, 2.0 * np.arange(SHOTS) - SHOTS))),
            RigidBody.many(linear_velocity=(velocity, 0.0), ccd=method is ONE_SWEPT),
            SphereCollider.many(radius=RADIUS, restitution=1.0, layer=2, mask=1),
        )
        kit.run(world, 3)
        x = world.bodies.dynamic.position[:, 0].copy()
        back = world.bodies.dynamic.linear_velocity[:, 0] < 0
    through = float(np.mean(~back))
    error = np.abs(x - (2 * touch - start - 3 * way))[back]
    worst = max(through, float(error.max(initial=0.0)) / (3 * way))
    if through:
        raise BrokenError("tunnels", worst)
    return worst


def exchange(method: Method, ratio: float) -> float:
    """Elastic impact of a light ball and one ``ratio`` times heavier, against the closed form: velocities, momentum."""
    with closing(new_world(method)) as world:
        for side, mass in ((-1, 1.0), (1, ratio)):
            kit.ball(world, 0.6 * side, -SPEED * side, mass=mass, restitution=1.0)
        kit.run(world, 12)
        light, heavy = world.bodies.linear_velocity[:, 0].tolist()
        momentum = float(world.momentum()[0])
    true = SPEED * np.array([(1 - 3 * ratio) / (1 + ratio), (3 - ratio) / (1 + ratio)])
    if not light < heavy:
        raise BrokenError("they pass through each other")
    return max(
        float(np.abs(np.array([light, heavy]) - true).max() / SPEED), abs(momentum / SPEED - (1 - ratio)) / (1 + ratio)
    )


def load(method: Method, ratio: float) -> float:
    """The largest overlap of a box at rest on another that is ``ratio`` times lighter."""
    return _tower(method, [1.0, ratio])[0]


def load_on_three(method: Method, ratio: float) -> float:
    """The largest overlap of a box at rest on a tower of three boxes that are ``ratio`` times lighter."""
    return _tower(method, [1.0, 1.0, 1.0, ratio])[0]


def tower(method: Method, height: float) -> float:
    """The distance that the top of a tower of ``height`` boxes has sunk."""
    return _tower(method, [1.0] * round(height))[1]


def _tower(method: Method, masses: list[float]) -> tuple[float, float]:
    """(largest overlap in ten seconds, sinking of the top in the last second), in box sizes."""
    with closing(new_world(method, GRAVITY)) as world:
        kit.floor(world)
        n = len(masses)
        world.create_entities(
            n,
            Transform.many(np.column_stack((np.zeros(n), 0.5 + np.arange(n)))),
            RigidBody.many(mass=masses),
            AABBCollider.many(half_extents=(0.5, 0.5)),
        )
        deepest = lowest = 0.0
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


def crowd(method: Method, count: float) -> float:
    """Balls at one point: the deepest overlap left after a second, in diameters."""
    with closing(new_world(method)) as world:
        n = round(count)
        world.create_entities(n, Transform.many(np.zeros((n, 2))), RigidBody.many(), SphereCollider.many(radius=0.5))
        kit.run(world, CROWD_STEPS)
        depth = np.asarray(world.contacts.depth)
        finite = np.isfinite(world.bodies.position).all()
    if not finite:
        raise BrokenError("not finite")
    return float(depth.max(initial=0.0))


QUANTITIES = (
    Quantity(
        "speed", "speed x dt / size", "v dt / (w + 2 r)",
        "share of 200 start phases in which a ball passes a wall, or the error of its place, of its way",
        (*decades(-2, 0, 2), 2.0, *decades(1, 6)), 0.01, (*BY_MODE, ONE_SWEPT), speed, fine=1.01,
        quick=(0.01, 0.9, 2.0, 100.0, 1e6),
    ),
    Quantity(
        "mass", "ratio of masses, in an impact", "", "velocities and momentum after an elastic impact",
        decades(0, 18), 1.0, BY_MODE, exchange, quick=(1.0, 1e6, 1e12, 1e18),
    ),
    Quantity(
        "load", "ratio of masses, one on the other", "", "overlap of a box that rests on a lighter one, of its size",
        decades(0, 12)[::2], 1.0, (*BY_MODE, FINE_SOLVER), load, quick=(1.0, 1e4, 1e12),
    ),
    Quantity(
        "load-on-three", "ratio of masses, one on three", "",
        "overlap under a box that rests on a tower of three lighter ones, of its size",
        decades(0, 6), 1.0, (*BY_MODE, FINE_SOLVER), load_on_three, quick=(1.0, 1e2, 1e6),
    ),
    Quantity(
        "stack", "height of a tower", "boxes", "sinking of the top after 10 s, of a box",
        (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0), 1.0, (*BY_MODE, FINE_SOLVER), tower, whole=True,
        quick=(1.0, 10.0, 40.0),
    ),
    Quantity(
        "crowd", "bodies at one point", "bodies", "deepest overlap left after a second, of a diameter",
        (2.0, 5.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 5000.0), 2.0, BY_MODE, crowd, whole=True, fine=None,
        quick=(2.0, 10.0, 5000.0), long=(2000.0,),
    ),
)  # fmt: skip

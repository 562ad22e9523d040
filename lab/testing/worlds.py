"""Small worlds for tests: bodies placed by one call each, and steps until a condition holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...components import AABBCollider, RigidBody, SphereCollider, Transform
from ...framework import Settings, World
from ...plugins import Physics
from ..measure.bodies import Floats

FLOOR_HALF = (1e3, 0.5, 1e3)

Check = Callable[[], object]


def make_world(dimensions: int = 2, gravity: Any = 0.0, **settings: Any) -> World:
    """An empty world with physics. gravity: a number acts downwards along the second axis; (d,) m/s^2 otherwise.

    settings: fields of :class:`~carom.framework.Settings`.
    """
    vector = gravity if np.ndim(gravity) else [0.0, -gravity, 0.0][:dimensions]
    return World(Physics(dimensions=dimensions, gravity=vector), settings=Settings(**settings))


def _place(world: World, value: Any) -> tuple[float, ...]:
    """Expand a number to a position on the first axis."""
    return tuple(value) if np.ndim(value) else (float(value), *(0.0,) * ((world.dimensions or 2) - 1))


def ball(
    world: World, position: Any, velocity: Any = 0.0, *, radius: float = 0.5, mass: float = 1.0, kind: Any = "dynamic",
    **collider: Any,
) -> int:  # fmt: skip
    """Create a ball; returns its entity. position, velocity: (d,) m and m/s, or a number on the first axis; radius: m;
    mass: kg; kind: as of a RigidBody; collider: more fields of the collider."""
    body = RigidBody(mass, _place(world, velocity), kind=kind)
    return world.create_entity(Transform(_place(world, position)), body, SphereCollider(radius, **collider))


def box(
    world: World, position: Any, velocity: Any = 0.0, *, half: Any = 0.5, mass: float = 1.0, kind: Any = "dynamic",
    rotation: Any = 0.0, **collider: Any,
) -> int:  # fmt: skip
    """Create a box; returns its entity. half: half extents, (d,) m or one number for all axes; rotation: as of a
    Transform; position, velocity, mass, kind and collider as of :func:`ball`."""
    half = tuple(half) if np.ndim(half) else (half,) * (world.dimensions or 2)
    body = RigidBody(mass, _place(world, velocity), kind=kind)
    return world.create_entity(Transform(_place(world, position), rotation), body, AABBCollider(half, **collider))


def floor(world: World, restitution: float = 0.0, **collider: Any) -> int:
    """Create a static box, 2 km wide, with its top at y = 0; returns its entity. restitution, collider: its fields."""
    half, centre = FLOOR_HALF[: world.dimensions], (0.0, -0.5, 0.0)[: world.dimensions]
    return world.create_entity(Transform(centre), AABBCollider(half, restitution=restitution, **collider))


def position(world: World, entity: int) -> Floats:
    """A copy, (d,) m; KeyError if the entity is not a body."""
    return np.array(world.bodies.position[world.bodies.row_of(entity)])


def velocity(world: World, entity: int) -> Floats:
    """A copy, (d,) m/s; KeyError if the entity is not a body."""
    return np.array(world.bodies.linear_velocity[world.bodies.row_of(entity)])


def run(world: World, steps: int, *checks: Check) -> None:
    """Take that many steps; after each all ``checks``, as ``Conserved(world).assert_energy``, are called."""
    for _ in range(steps):
        world.step()
        for check in checks:
            check()


def run_until(world: World, condition: Callable[[], bool], seconds: float = 10.0) -> float:
    """Step until the condition holds; returns ``world.time`` then. AssertionError if it does not within ``seconds``."""
    steps = round(seconds / world.settings.dt)
    for _ in range(steps):
        if condition():
            return world.time
        world.step()
    assert condition(), f"step {world.step_count}: the condition has not come true within {seconds:g} s ({steps} steps)"
    return world.time


def create_in_order(world: World, bodies: Sequence[Sequence[Any]], order: Sequence[int]) -> list[int]:
    """Create one entity per list of components, with ids in sequence, but add the components in another order.

    order: a permutation of range(len(bodies)). Equal ids mean equal bits, whatever the order.
    """
    entities = [world.create_entity() for _ in bodies]
    for index in order:
        for component in bodies[index]:
            world.add_component(entities[index], component)
    return entities

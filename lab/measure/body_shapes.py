"""The collision geometry of a world as plain arrays, for pictures and measurements.

Read entity by entity through the public components, which costs microseconds per body: use it once per run, not once
per step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...components import AABBCollider, RigidBody, SphereCollider, Transform
from ...framework import World
from ...systems.shapes.rotation import axes_of

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Shapes:
    """One row per collider. A box has half extents (d); a sphere has its radius in each of them.

    ``entity (n,)``, ``centre (n, d)``, ``half (n, d)``, ``speed (n,)``, ``round (n,)`` true for spheres,
    ``static (n,)`` true for static bodies, ``sensor (n,)`` true for sensors.
    """

    entity: NDArray[np.int64]
    centre: Floats
    half: Floats
    speed: Floats
    round: NDArray[np.bool_]
    static: NDArray[np.bool_]
    sensor: NDArray[np.bool_]

    @property
    def lower(self) -> Floats:
        return self.centre - self.half

    @property
    def upper(self) -> Floats:
        return self.centre + self.half

    @property
    def typical_diameter(self) -> float:
        """The median diameter; 0 without shapes."""
        return float(2 * np.median(self.half.max(axis=1))) if len(self.entity) else 0.0

    def row(self, index: int) -> Shapes:
        """One row as Shapes."""
        return self.where(np.arange(len(self.entity)) == index)

    def at(self, places: Floats) -> Shapes:
        """A single shape, repeated at each of the places (m, d)."""
        repeated = {name: np.repeat(getattr(self, name), len(places), axis=0) for name in self.__dataclass_fields__}
        return Shapes(**{**repeated, "centre": places})

    def where(self, chosen: NDArray[np.bool_]) -> Shapes:
        """The rows where ``chosen`` is true."""
        return Shapes(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))


def dimensions_of(world: World) -> int:
    """2 or 3; NoPhysicsError for a world without physics."""
    return world.bodies.position.shape[1]


def shapes_of(world: World) -> Shapes:
    """All built-in colliders of ``world`` in its present state."""
    dimensions = dimensions_of(world)
    entities, centres, halves, rounds, sensors = [], [], [], [], []
    for entity, (transform, sphere) in world.get_components(Transform, SphereCollider):
        entities.append(entity)
        centres.append(np.asarray(transform.position) + _turned(transform.rotation, sphere.offset, dimensions))
        halves.append(np.full(dimensions, float(sphere.radius)))
        rounds.append(True)
        sensors.append(bool(sphere.sensor))
    for entity, (transform, box) in world.get_components(Transform, AABBCollider):
        entities.append(entity)
        centres.append(np.asarray(transform.position) + _turned(transform.rotation, box.offset, dimensions))
        halves.append(_stretched(transform.rotation, box.half_extents, dimensions))
        rounds.append(False)
        sensors.append(bool(box.sensor))

    entity = np.array(entities, np.int64)
    speed, static = np.zeros(len(entity)), np.ones(len(entity), bool)
    moving = {e: body for e, body in world.get_component(RigidBody) if body.kind != "static"}
    for row, e in enumerate(entities):
        if e in moving:
            static[row] = False
            speed[row] = float(np.linalg.norm(moving[e].linear_velocity))
    return Shapes(
        entity,
        np.array(centres, float).reshape(-1, dimensions),
        np.array(halves, float).reshape(-1, dimensions),
        speed,
        np.array(rounds, bool),
        static,
        np.array(sensors, bool),
    )


def sensor_entities(world: World) -> NDArray[np.int64]:
    """The ids of entities with a sensor collider."""
    bodies = world.bodies
    found = np.zeros(len(bodies), bool)
    for name in bodies.column_names():
        collider, dot, column = name.partition(".")
        if dot and column == "sensor":
            found |= np.asarray(getattr(getattr(bodies, collider), column), bool)
    return np.asarray(bodies.entity)[found]


def _turned(rotation: object, offset: object, dimensions: int) -> Floats:
    vector = np.broadcast_to(np.asarray(offset, float), (dimensions,))
    return _axes(rotation, dimensions) @ vector if vector.any() else vector


def _stretched(rotation: object, half_extents: object, dimensions: int) -> Floats:
    """The half extents of the axis-aligned box that encloses the turned box."""
    return np.abs(_axes(rotation, dimensions)) @ np.broadcast_to(np.asarray(half_extents, float), (dimensions,))


def _axes(rotation: object, dimensions: int) -> Floats:
    return axes_of(np.asarray(rotation, float).reshape((1,) if dimensions == 2 else (1, 4)), dimensions)[0]

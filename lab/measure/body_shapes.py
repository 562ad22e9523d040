"""The spheres and boxes of a world as plain arrays, for pictures and measurements, and how deep they overlap."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...components import AABBCollider, SphereCollider
from ...framework import World
from ...systems.shapes.rotation import axes_of

Floats = NDArray[np.float64]
QUIET = np.errstate(over="ignore", invalid="ignore")  # bodies out of range are reported without warnings


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

    def at(self, places: Floats) -> Shapes:
        """A single shape, repeated at each of the places (m, d)."""
        repeated = {name: np.repeat(getattr(self, name), len(places), axis=0) for name in self.__dataclass_fields__}
        return Shapes(**{**repeated, "centre": places})

    def where(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> Shapes:
        """The rows where ``chosen`` is true, or those of these numbers."""
        return Shapes(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))


def dimensions_of(world: World) -> int:
    """2 or 3; NoPhysicsError for a world without physics."""
    return world.bodies.position.shape[1]


@QUIET
def shapes_of(world: World) -> Shapes:
    """All built-in colliders of ``world`` in its present state; a turned box has the half extents of what encloses
    it."""
    bodies, d = world.bodies, dimensions_of(world)
    fixed = np.arange(len(bodies)) >= bodies.kinematic.rows.stop
    axes = axes_of(np.asarray(bodies.rotation), d)
    speeds = np.where(fixed, 0.0, np.linalg.norm(bodies.linear_velocity, axis=1))
    parts: list[tuple[Any, ...]] = []
    for collider, name in ((SphereCollider, "sphere_collider"), (AABBCollider, "aabb_collider")):
        has = np.asarray(bodies.has(collider), bool)
        if not has.any():  # there may be no such columns
            continue
        columns, turned = getattr(bodies, name), axes[has]
        if collider is SphereCollider:
            half = np.repeat(columns.radius[has, None], d, axis=1)
        else:
            half = np.einsum("nij,nj->ni", np.abs(turned), columns.half_extents[has])
        centre = bodies.position[has] + np.einsum("nij,nj->ni", turned, columns.offset[has])
        rounds = np.full(len(half), collider is SphereCollider)
        parts.append((bodies.entity[has], centre, half, speeds[has], rounds, fixed[has], columns.sensor[has]))
    if not parts:
        empty, none = np.zeros((0, d)), np.zeros(0, bool)
        return Shapes(np.zeros(0, np.int64), empty, empty, np.zeros(0), none, none, none)
    return Shapes(*(np.concatenate([np.asarray(column) for column in columns]) for columns in zip(*parts, strict=True)))


def sizes_of(world: World) -> dict[int, float]:
    """The smallest extent of each entity that has a built-in shape, m."""
    shapes = shapes_of(world)
    return dict(zip(shapes.entity.tolist(), (2 * shapes.half.min(axis=1)).tolist(), strict=True))


def dynamic_by_id(world: World) -> tuple[Floats, Floats, Floats]:
    """Positions, velocities (n, d) and masses (n,) of the dynamic bodies, ascending by entity id; copies."""
    dynamic = world.bodies.dynamic
    order = np.argsort(dynamic.entity, kind="stable")
    return dynamic.position[order], dynamic.linear_velocity[order], dynamic.mass[order]


def sensor_entities(world: World) -> NDArray[np.int64]:
    """The ids of entities with a sensor collider."""
    bodies = world.bodies
    found = np.zeros(len(bodies), bool)
    for name in bodies.column_names():
        collider, dot, column = name.partition(".")
        if dot and column == "sensor":
            found |= np.asarray(getattr(getattr(bodies, collider), column), bool)
    return np.asarray(bodies.entity)[found]


def overlaps_of(world: World) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """The pairs of solid spheres and boxes that overlap where they are now: the entities of both, (k,) each, and how
    deep, in sizes of the smaller one.

    Pairs that layers keep apart are included; pairs of two static bodies are not.
    """
    shapes = shapes_of(world)
    solid = shapes.where(~shapes.sensor & np.isfinite(shapes.centre).all(axis=1))
    moving = np.flatnonzero(~solid.static)
    hits = world.query_aabbs(solid.lower[moving], solid.upper[moving])
    asked, order = np.repeat(moving, np.diff(hits.offsets)), np.argsort(solid.entity, kind="stable")
    ids, places = solid.entity[order], np.searchsorted(solid.entity[order], hits.entities)
    rows = []
    for place in (places, places + 1):  # an entity may have a sphere and a box
        there = ids.take(place, mode="clip") == hits.entities
        there &= place < len(ids)
        rows.append((asked[there], order[place[there]]))
    a, b = (np.concatenate(some) for some in zip(*rows, strict=True))
    once = (solid.entity[a] != solid.entity[b]) & (solid.static[b] | (a < b))
    a, b = a[once], b[once]
    depth = _depths(solid.where(a), solid.where(b))
    return solid.entity[a][depth > 0], solid.entity[b][depth > 0], depth[depth > 0]


def _depths(a: Shapes, b: Shapes) -> Floats:
    """How deep each row of ``a`` is in the same row of ``b``, in sizes of the smaller one; negative where apart."""
    apart = np.abs(b.centre - a.centre)
    radius = np.where(a.round, a.half[:, 0], b.half[:, 0])
    box = np.where(a.round[:, None], b.half, a.half)
    outside = np.linalg.norm(np.maximum(apart - box, 0.0), axis=1)
    ball_and_box = radius + np.where(outside > 0, -outside, (box - apart).min(axis=1))
    balls = a.half[:, 0] + b.half[:, 0] - np.linalg.norm(apart, axis=1)
    boxes = (a.half + b.half - apart).min(axis=1)
    depth = np.where(a.round & b.round, balls, np.where(a.round | b.round, ball_and_box, boxes))
    return depth / (2 * np.minimum(a.half, b.half).min(axis=1))


# -- bodies that escaped ---------------------------------------------------------------------------------


COVERED = 0.5
ROUNDING = 1e-9  # relative to the coordinates: tolerance for the faces of adjacent walls of different sizes


@dataclass(frozen=True)
class Enclosure:
    """The space inside the walls, up to their outer faces; infinite on a side without a wall."""

    lower: Floats
    upper: Floats

    @classmethod
    def around(cls, world: World) -> Enclosure:
        """The enclosure of the dynamic bodies by the static boxes of ``world`` in its present state."""
        dimensions = dimensions_of(world)
        lower, upper = np.full(dimensions, -np.inf), np.full(dimensions, np.inf)
        shapes = shapes_of(world)
        bodies, walls = shapes.where(~shapes.static), shapes.where(shapes.static & ~shapes.round & ~shapes.sensor)
        if len(bodies.entity) and len(walls.entity):
            for axis in range(dimensions):
                for sign, bounds in ((-1.0, lower), (1.0, upper)):
                    inner = sign * walls.centre[:, axis] - walls.half[:, axis]
                    outer = sign * walls.centre[:, axis] + walls.half[:, axis]
                    beyond = inner >= (sign * bodies.centre[:, axis]).max()
                    outermost = outer >= outer.max() - ROUNDING * np.abs(outer).max()
                    if _covered(bodies, walls.where(beyond & outermost), axis) >= COVERED:
                        bounds[axis] = sign * outer.max()
        return cls(lower, upper)

    def outside(self, positions: Floats) -> int:
        """The number of finite ``positions`` (n, d) outside."""
        return int(np.any((positions < self.lower) | (positions > self.upper), axis=1).sum())


def _covered(bodies: Shapes, walls: Shapes, axis: int) -> float:
    """The share of the bodies' extent across ``axis`` covered by walls; overlapping walls count twice."""
    lower, upper = bodies.lower.min(axis=0), bodies.upper.max(axis=0)
    span = np.minimum(walls.upper, upper) - np.maximum(walls.lower, lower)
    share = np.clip(span, 0, None) / np.maximum(upper - lower, np.finfo(float).tiny)
    return float(np.delete(share, axis, axis=1).prod(axis=1).sum())

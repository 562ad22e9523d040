"""The shapes of a world as plain arrays, for pictures and measurements, and how deep they overlap."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...components import AABBCollider, SphereCollider
from ...components.spin import Spin
from ...framework import World
from ...systems.shapes.rotation import axes_of
from .outlines import FACES, NO_FACES, OUTLINES, SIGNS, depths, outlines_of

Floats = NDArray[np.float64]
NONE: Mapping[int, Collection[Any]] = {}
QUIET = np.errstate(over="ignore", invalid="ignore")  # bodies out of range are reported without warnings


@dataclass(frozen=True)
class Shapes:
    """One row per collider. ``half``: half extents of the box around it; a sphere has its radius in each of them.

    ``entity (n,)``, ``centre (n, d)``, ``half (n, d)``, ``speed (n,)``, ``round (n,)`` true for spheres,
    ``static (n,)`` true for static bodies, ``sensor (n,)`` true for sensors.
    ``outline (n,)``: of what turns its corners as they are turned, (m, d) about the centre, of others None;
    ``rounding (n,)``: how far it goes beyond these, of spheres the radius; ``size (n,)``: the smallest extent;
    ``faces (n,)``: the rows of the corners of each face, see :class:`~.outlines.Outline`.
    ``axes (n, d, d)``: of a sphere that spins the axes of its body in its columns, of others NaN.
    """

    entity: NDArray[np.int64]
    centre: Floats
    half: Floats
    speed: Floats
    round: NDArray[np.bool_]
    static: NDArray[np.bool_]
    sensor: NDArray[np.bool_]
    outline: NDArray[np.object_]
    rounding: Floats
    size: Floats
    faces: NDArray[np.object_]
    axes: Floats

    @property
    def lower(self) -> Floats:
        return self.centre - self.half

    @property
    def upper(self) -> Floats:
        return self.centre + self.half

    @property
    def turns(self) -> NDArray[np.bool_]:
        """Which rows have an outline."""
        return np.array([outline is not None for outline in self.outline], bool)

    @property
    def faceless(self) -> NDArray[np.bool_]:
        """Which rows have no faces: in space balls and capsules."""
        return np.array([len(faces) == 0 for faces in self.faces], bool)

    @property
    def corners(self) -> list[Floats]:
        """Of each row (m, d) about its centre, without the rounding."""
        d = self.half.shape[1]
        rows = zip(self.outline, self.round, SIGNS[d] * self.half[:, None], strict=True)
        return [(np.zeros((1, d)) if ball else box) if turning is None else turning for turning, ball, box in rows]

    @property
    def typical_diameter(self) -> float:
        """The median diameter; 0 without shapes."""
        return float(2 * np.median(self.half.max(axis=1))) if len(self.entity) else 0.0

    def at(self, places: Floats, turns: Floats) -> Shapes:
        """A single shape, repeated at each of the places (m, d), turned on by matrices (m, d, d)."""
        repeated = {name: np.repeat(getattr(self, name), len(places), axis=0) for name in self.__dataclass_fields__}
        for k, turn in enumerate(turns):
            repeated["axes"][k] = turn @ self.axes[0]
            repeated["outline"][k] = None if self.outline[0] is None else self.outline[0] @ turn.T
        return Shapes(**{**repeated, "centre": places})

    def where(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> Shapes:
        """The rows where ``chosen`` is true, or those of these numbers."""
        return Shapes(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))


def dimensions_of(world: World) -> int:
    """2 or 3; NoPhysicsError for a world without physics."""
    return world.bodies.position.shape[1]


@QUIET
def shapes_of(world: World, further: Mapping[int, Collection[Any]] = NONE) -> Shapes:
    """All built-in colliders of ``world`` in its present state, in a plane capsules and polygons too, and ``further``
    ones by the dimensions; a turned AABBCollider has the half extents of what encloses it."""
    bodies, d = world.bodies, dimensions_of(world)
    fixed = np.arange(len(bodies)) >= bodies.kinematic.rows.stop
    axes = axes_of(np.asarray(bodies.rotation), d)
    speeds = np.where(fixed, 0.0, np.linalg.norm(bodies.linear_velocity, axis=1))
    spins = bodies.has(Spin)
    parts: list[tuple[Any, ...]] = []
    for collider in (SphereCollider, AABBCollider, *(OUTLINES if d == 2 else ()), *further.get(d, ())):
        has = np.asarray(bodies.has(collider), bool)
        if not has.any():  # there may be no such columns
            continue
        columns, turned, count = getattr(bodies, collider.prefix[:-1]), axes[has], int(has.sum())
        outline, faces, rounding = np.full(count, None), np.full(count, None), np.zeros(count)
        marked = np.full((count, d, d), np.nan)
        if collider is SphereCollider:
            rounding = np.array(columns.radius[has])
            half, size, known = np.repeat(rounding[:, None], d, axis=1), 2 * rounding, [NO_FACES] * count
            marked[spins[has]] = turned[spins[has]]
        elif collider is AABBCollider:
            half = np.einsum("nij,nj->ni", np.abs(turned), columns.half_extents[has])
            size, known = 2 * half.min(axis=1), [FACES[d]] * count
        else:
            corners, rounding, size, known = outlines_of(world, collider, bodies.entity[has])
            for k in range(count):
                outline[k] = corners[k] @ turned[k].T if collider.rotates else corners[k]
            half = np.array([np.abs(one).max(axis=0) for one in outline]) + rounding[:, None]
        for k in range(count):
            faces[k] = known[k]
        centre = bodies.position[has] + np.einsum("nij,nj->ni", turned, columns.offset[has])
        rounds = np.full(count, collider is SphereCollider)
        first = bodies.entity[has], centre, half, speeds[has], rounds, fixed[has], columns.sensor[has]
        parts.append((*first, outline, rounding, size, faces, marked))
    if not parts:
        empty, none, nothing, objects = np.zeros((0, d)), np.zeros(0, bool), np.zeros(0), np.zeros(0, object)
        first = np.zeros(0, np.int64), empty, empty, nothing, none, none, none
        return Shapes(*first, objects, nothing, nothing, objects, np.zeros((0, d, d)))
    return Shapes(*(np.concatenate([np.asarray(column) for column in columns]) for columns in zip(*parts, strict=True)))


def sizes_of(world: World) -> dict[int, float]:
    """The smallest extent of each entity that has such a shape, m."""
    shapes = shapes_of(world)
    return dict(zip(shapes.entity.tolist(), shapes.size.tolist(), strict=True))


def dynamic_by_id(world: World) -> tuple[Floats, Floats, Floats]:
    """Positions, velocities (n, d) and masses (n,) of the dynamic bodies, ascending by entity id; copies."""
    dynamic = world.bodies.dynamic
    order = np.argsort(dynamic.entity, kind="stable")
    return dynamic.position[order], dynamic.linear_velocity[order], dynamic.mass[order]


def inertia_by_id(world: World) -> Floats:
    """Moments of inertia (n,) of the dynamic bodies of a plane, likewise; infinite for what does not spin."""
    dynamic = world.bodies.dynamic
    inertia = np.full(len(dynamic), np.inf)
    for k in np.flatnonzero(dynamic.has(Spin)).tolist():
        inertia[k] = world.component_for_entity(int(dynamic.entity[k]), Spin).moments
    return inertia[np.argsort(dynamic.entity, kind="stable")]


def turns_by_id(world: World) -> tuple[Floats, Floats]:
    """In a plane, the angles and angular velocities (m,) of the dynamic bodies by id, then of the kinematic ones."""
    bodies, order = world.bodies, moving_rows(world)
    spins = bodies.spin.angular_velocity if bodies.has(Spin).any() else np.zeros(len(bodies))
    return np.array(bodies.rotation)[order], np.array(spins)[order]


def moving_rows(world: World) -> NDArray[np.int64]:
    """Of the dynamic bodies, ascending by entity id, then of the kinematic ones, likewise."""
    dynamic, kinematic = world.bodies.dynamic, world.bodies.kinematic
    some = [bodies.rows.start + np.argsort(bodies.entity, kind="stable") for bodies in (dynamic, kinematic)]
    return np.concatenate(some)


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
    """The pairs of solid shapes that overlap where they are now: the entities of both, (k,) each, and how deep, in
    sizes of the smaller one.

    Pairs that layers keep apart are included; pairs of two immovable bodies are not.
    """
    shapes = shapes_of(world)
    solid = shapes.where(~shapes.sensor & np.isfinite(shapes.centre).all(axis=1))
    movable = np.isin(solid.entity, world.bodies.dynamic.entity)
    moving = np.flatnonzero(movable)
    hits = world.query_aabbs(solid.lower[moving], solid.upper[moving])
    asked, order = np.repeat(moving, np.diff(hits.offsets)), np.argsort(solid.entity, kind="stable")
    ids, places = solid.entity[order], np.searchsorted(solid.entity[order], hits.entities)
    rows = [(asked[:0], order[:0])]
    for further in range(np.bincount(np.unique(ids, return_inverse=True)[1]).max(initial=0)):  # each has several
        place = places + further
        there = ids.take(place, mode="clip") == hits.entities
        there &= place < len(ids)
        rows.append((asked[there], order[place[there]]))
    a, b = (np.concatenate(some) for some in zip(*rows, strict=True))
    once = (solid.entity[a] != solid.entity[b]) & (~movable[b] | (a < b))
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
    turning = np.flatnonzero(a.turns | b.turns)
    if len(turning):
        depth[turning] = boxes[turning]
        near = turning[boxes[turning] >= 0]
        one, other = a.where(near), b.where(near)
        depth[near] = depths(one.corners, other.corners, other.centre - one.centre, one.rounding + other.rounding)
    return depth / np.minimum(a.size, b.size)


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

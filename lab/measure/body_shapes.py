"""The shapes of a world as plain arrays, for pictures and measurements, and how deep they overlap."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...components import AABBCollider, SphereCollider
from ...components.spin import Spin
from ...framework import World
from ...systems.shapes.rotation import axes_of
from .outlines import FACES, NO_FACES, ONLY_DRAWN, OUTLINES, SIGNS, outlines_of

Floats = NDArray[np.float64]
SOLID = SphereCollider, AABBCollider, *OUTLINES
QUIET = np.errstate(over="ignore", invalid="ignore")  # bodies out of range are reported without warnings


@dataclass(frozen=True)
class Shapes:
    """One row per collider: ``entity (n,)``, ``centre (n, d)``, ``speed (n,)``, ``static (n,)``, ``sensor (n,)``.

    ``corners (n,)``: each (m, d) about its centre, as it is turned, of a sphere one; ``rounding (n,)``: how far it goes
    beyond these; ``faces (n,)``: the rows of the corners of each face, see :class:`~.outlines.Outline`.
    ``half (n, d)``: half extents of the box around it; ``size (n,)``: the smallest extent.
    ``axes (n, d, d)``: of what turns those of its body in its columns, of others NaN.
    """

    entity: NDArray[np.int64]
    centre: Floats
    speed: Floats
    static: NDArray[np.bool_]
    sensor: NDArray[np.bool_]
    corners: NDArray[np.object_]
    rounding: Floats
    faces: NDArray[np.object_]
    half: Floats
    size: Floats
    axes: Floats

    @property
    def lower(self) -> Floats:
        return self.centre - self.half

    @property
    def upper(self) -> Floats:
        return self.centre + self.half

    @property
    def round(self) -> NDArray[np.bool_]:
        """Which rows are spheres."""
        return np.array([len(corners) == 1 for corners in self.corners], bool)

    @property
    def faceless(self) -> NDArray[np.bool_]:
        """Which rows have no faces: in space balls and capsules."""
        return np.array([len(faces) == 0 for faces in self.faces], bool)

    @property
    def typical_diameter(self) -> float:
        """The median diameter; 0 without shapes."""
        return float(2 * np.median(self.half.max(axis=1))) if len(self.entity) else 0.0

    def at(self, places: Floats, turns: Floats) -> Shapes:
        """A single shape, repeated at each of the places (m, d), turned on by matrices (m, d, d)."""
        repeated = {name: np.repeat(getattr(self, name), len(places), axis=0) for name in self.__dataclass_fields__}
        for k, turn in enumerate(turns if np.isfinite(self.axes).all() else ()):
            repeated["axes"][k], repeated["corners"][k] = turn @ self.axes[0], self.corners[0] @ turn.T
        return Shapes(**{**repeated, "centre": places})

    def where(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> Shapes:
        """The rows where ``chosen`` is true, or those of these numbers."""
        return Shapes(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))


def dimensions_of(world: World) -> int:
    """2 or 3; NoPhysicsError for a world without physics."""
    return world.bodies.position.shape[1]


@QUIET
def shapes_of(world: World, colliders: Iterable[Any] = (*SOLID, *ONLY_DRAWN)) -> Shapes:
    """All such colliders of ``world`` in its present state, in the order of their kinds."""
    bodies, d = world.bodies, dimensions_of(world)
    fixed = np.arange(len(bodies)) >= bodies.kinematic.rows.stop
    speeds = np.where(fixed, 0.0, np.linalg.norm(bodies.linear_velocity, axis=1))
    axes, spins = axes_of(np.asarray(bodies.rotation), d), bodies.has(Spin)
    none, flags, objects, wide = np.zeros(0), np.zeros(0, bool), np.zeros(0, object), np.zeros((0, d))
    found: list[tuple[Any, ...]] = [
        (np.zeros(0, np.int64), wide, none, flags, flags, objects, none, objects, wide, none, np.zeros((0, d, d)))
    ]
    for collider in colliders:
        rows = np.flatnonzero(bodies.has(collider))
        if not len(rows):  # there may be no such columns
            continue
        columns, turned = getattr(bodies, collider.prefix[:-1]), axes[rows].copy()
        centre = bodies.position[rows] + np.einsum("nij,nj->ni", turned, columns.offset[rows])
        if collider is SphereCollider:
            rounding = np.array(columns.radius[rows])
            corners, size, faces = [np.zeros((1, d))] * len(rows), 2 * rounding, [NO_FACES] * len(rows)
            turned[~spins[rows]] = np.nan
        elif collider is AABBCollider:  # a turned one is what encloses it
            half = np.einsum("nij,nj->ni", np.abs(turned), columns.half_extents[rows])
            corners, rounding, size = [*(SIGNS[d] * half[:, None])], np.zeros(len(rows)), 2 * half.min(axis=1)
            faces, turned = [FACES[d]] * len(rows), np.full_like(turned, np.nan)
        else:
            corners, rounding, size, faces = outlines_of(world, collider, bodies.entity[rows])
            if collider.rotates:
                corners = [own @ matrix.T for own, matrix in zip(corners, turned, strict=True)]
        half = np.array([np.abs(own).max(axis=0) for own in corners]) + rounding[:, None]
        lists = (np.fromiter(some, object, len(rows)) for some in (corners, faces))
        both = bodies.entity[rows], centre, speeds[rows], fixed[rows], columns.sensor[rows]
        found.append((*both, next(lists), rounding, next(lists), half, size, turned))
    return Shapes(*(np.concatenate(columns) for columns in zip(*found, strict=True)))


def sizes_of(world: World) -> dict[int, float]:
    """The smallest extent of each entity that has such a shape, m."""
    shapes = shapes_of(world)
    return dict(zip(shapes.entity.tolist(), shapes.size.tolist(), strict=True))


def size_of(world: World, sizes: Mapping[int, float]) -> float:
    """The smallest extent of the dynamic bodies, m, of these sizes; without shapes the largest coordinate, else 1."""
    ids, position, _, _ = state_by_id(world)
    known = [sizes[entity] for entity in ids.tolist() if entity in sizes]
    return min(known, default=0.0) or float(np.abs(position).max(initial=0.0)) or 1.0


def state_by_id(world: World) -> tuple[NDArray[np.int64], Floats, Floats, Floats]:
    """The dynamic bodies, ascending by entity id, which is the order of creation: ids (n,), positions and velocities
    (n, d), masses (n,); copies."""
    dynamic = world.bodies.dynamic
    order = np.argsort(dynamic.entity, kind="stable")
    return dynamic.entity[order], dynamic.position[order], dynamic.linear_velocity[order], dynamic.mass[order]


def apart(one: tuple[Any, Floats], other: tuple[Any, Floats]) -> tuple[Floats, NDArray[np.int64]]:
    """Of two states, each ids and positions: how far the bodies are apart that both have, (n,), and their ids."""
    ids, a, b = np.intersect1d(one[0], other[0], return_indices=True)
    ways = one[1][a] - other[1][b]
    return np.sqrt((ways * ways).reshape(len(ids), -1).sum(axis=1)), ids


def sensor_entities(world: World) -> NDArray[np.int64]:
    """The ids of entities with a sensor collider."""
    bodies = world.bodies
    found = np.zeros(len(bodies), bool)
    for name in bodies.column_names():
        collider, _, column = name.partition(".")
        if column == "sensor":
            found |= np.asarray(getattr(getattr(bodies, collider), column), bool)
    return np.asarray(bodies.entity)[found]


def overlaps_of(
    world: World, sizes: Mapping[int, float] | None = None, sensors: NDArray[np.int64] | None = None
) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats, Floats]:
    """The pairs of solid shapes that overlap in the contacts of the last step, of which one is of a dynamic body: the
    entities of both, (k,) each, how deep, m, and the size of the smaller one, m. sizes, sensors: those of the world,
    where they are known."""
    contacts, dynamic = world.contacts, world.bodies.dynamic.entity
    sensors = sensor_entities(world) if sensors is None else sensors
    a, b = contacts.entity_a, contacts.entity_b
    deep = (contacts.depth > 0.0) & (np.isin(a, dynamic) | np.isin(b, dynamic))  # platforms pass walls
    deep &= ~(np.isin(a, sensors) | np.isin(b, sensors))
    sizes = sizes_of(world) if sizes is None else sizes
    pairs = zip(a[deep].tolist(), b[deep].tolist(), strict=True)
    smaller = [min(sizes.get(one, np.inf), sizes.get(other, np.inf)) for one, other in pairs]
    return a[deep], b[deep], contacts.depth[deep], np.array(smaller, float)


# -- bodies that escaped ---------------------------------------------------------------------------------


COVERED = 0.5
ROUNDING = 1e-9  # relative to the coordinates: tolerance for the faces of adjacent walls of different sizes


class Enclosure(NamedTuple):
    """The space inside the walls, up to their outer faces; infinite on a side without a wall."""

    lower: Floats
    upper: Floats

    def outside(self, positions: Floats) -> int:
        """The number of finite ``positions`` (n, d) outside."""
        return int(np.any((positions < self.lower) | (positions > self.upper), axis=1).sum())


def walls_around(world: World) -> Enclosure:
    """The enclosure of the dynamic bodies by the static boxes of ``world`` in its present state."""
    dimensions = dimensions_of(world)
    found = Enclosure(np.full(dimensions, -np.inf), np.full(dimensions, np.inf))
    shapes = shapes_of(world, SOLID)
    bodies, walls = shapes.where(~shapes.static), shapes.where(shapes.static & ~shapes.round & ~shapes.sensor)
    for axis in range(dimensions if len(bodies.entity) and len(walls.entity) else 0):
        for sign, bounds in zip((-1.0, 1.0), found, strict=True):
            inner = sign * walls.centre[:, axis] - walls.half[:, axis]
            outer = sign * walls.centre[:, axis] + walls.half[:, axis]
            beyond = inner >= (sign * bodies.centre[:, axis]).max()
            outermost = outer >= outer.max() - ROUNDING * np.abs(outer).max()
            if _covered(bodies, walls.where(beyond & outermost), axis) >= COVERED:
                bounds[axis] = sign * outer.max()
    return found


def _covered(bodies: Shapes, walls: Shapes, axis: int) -> float:
    """The share of the bodies' extent across ``axis`` covered by walls; overlapping walls count twice."""
    lower, upper = bodies.lower.min(axis=0), bodies.upper.max(axis=0)
    span = np.minimum(walls.upper, upper) - np.maximum(walls.lower, lower)
    share = np.clip(span, 0, None) / np.maximum(upper - lower, np.finfo(float).tiny)
    return float(np.delete(share, axis, axis=1).prod(axis=1).sum())

"""The bodies of a world as plain arrays, for measurements: states, sizes, how deep they overlap, the walls around."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...drawing import Drawing
from ...drawing.outline_cache import OutlineCache
from ...drawing.shapes import colliders_of
from ...framework import World
from ...framework.outlines import Outline

Floats = NDArray[np.float64]
QUIET = np.errstate(over="ignore", invalid="ignore")  # bodies out of range are reported without warnings


def dimensions_of(world: World) -> int:
    """2 or 3; NoPhysicsError for a world without physics."""
    return world.bodies.position.shape[1]


def sizes_of(world: World) -> dict[int, float]:
    """The smallest extent of each entity that has a shape, m."""
    cache = OutlineCache(dimensions_of(world))
    found = colliders_of(world, cache, world.bodies.rows)
    sizes = smallest_extents(cache.outlines)[found.outline]
    sizes = np.where(np.isnan(found.radius), sizes, 2 * found.radius)
    order = np.argsort(-sizes, kind="stable")  # of several shapes of an entity the smallest
    return dict(zip(world.bodies.entity[found.row[order]].tolist(), sizes[order].tolist(), strict=True))


def smallest_extents(outlines: list[tuple[Outline, float]]) -> Floats:
    """(n,) m, of shapes with these outlines and roundings: in a plane between the edges of the narrowest piece, else
    along an axis; of a line, or a triangle in space, the length."""
    sizes = np.full(len(outlines), np.inf)
    rings: dict[int, list[tuple[int, Floats]]] = {}
    for number, ((corners, faces), rounding) in enumerate(outlines):
        extents = np.ptp(corners, axis=0)
        if len(corners) < 3:
            sizes[number] = 2 * rounding or np.linalg.norm(extents)
        elif corners.shape[1] == 3:
            sizes[number] = (extents.min() if len(faces) > 1 else extents.max()) + 2 * rounding
        else:
            for ring in [corners[face] for face in faces] or [corners]:
                rings.setdefault(len(ring), []).append((number, ring))
    for some in rings.values():
        numbers, corners = (np.array(column) for column in zip(*some, strict=True))
        edges = np.roll(corners, -1, axis=1) - corners
        lengths = np.maximum(np.linalg.norm(edges, axis=2, keepdims=True), np.finfo(float).tiny)
        normals = np.stack((edges[..., 1], -edges[..., 0]), axis=2) / lengths
        widths = np.ptp(np.einsum("nki,nji->nkj", corners, normals), axis=1).min(axis=1)
        np.minimum.at(sizes, numbers, widths + 2 * np.array([outlines[number][1] for number in numbers]))
    return sizes


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
    return np.sqrt((ways * ways).sum(axis=1)), ids


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
    """The enclosure of the dynamic bodies by the static convex shapes of ``world`` in its present state."""
    dimensions = dimensions_of(world)
    found = Enclosure(np.full(dimensions, -np.inf), np.full(dimensions, np.inf))
    bodies, walls = _boxes(world)
    centres = (bodies.lower + bodies.upper) / 2
    for axis in range(dimensions if len(centres) and len(walls.lower) else 0):
        for sign, bounds in zip((-1.0, 1.0), found, strict=True):
            inner, outer = (sign * ends[:, axis] for ends in walls[:: int(sign)])
            beyond = inner >= (sign * centres[:, axis]).max()
            outermost = outer >= outer.max() - ROUNDING * np.abs(outer).max()
            if _covered(bodies, walls.where(beyond & outermost), axis) >= COVERED:
                bounds[axis] = sign * outer.max()
    return found


class Boxes(NamedTuple):
    """Boxes around shapes, (n, d) each."""

    lower: Floats
    upper: Floats

    @classmethod
    def of(cls, groups: list[Any], but: NDArray[np.int64]) -> Boxes:
        """Around the shapes in groups of a drawing list, but for those of these entities."""
        some = [group.where(~np.isin(group.entity, but)) for group in groups]
        return cls(*np.concatenate([np.array(group.boxes()) for group in some], axis=1))

    def where(self, chosen: NDArray[np.bool_]) -> Boxes:
        return Boxes(self.lower[chosen], self.upper[chosen])


@QUIET
def _boxes(world: World) -> tuple[Boxes, Boxes]:
    """Around the convex shapes of the bodies that may move, and of those that may be walls."""
    shown, bodies = Drawing(world).update(interpolated=False, joints=False), world.bodies
    concave = [bodies.has(component) for component, shape in world.registry.shapes.items() if shape.support is None]
    others = bodies.entity[np.any([np.zeros(len(bodies), bool), *concave], axis=0)]
    moving = [shown.circles, shown.capsules, *shown.polygons, *shown.lines]
    still = [shown.fixed_capsules, *shown.fixed, *shown.fixed_lines]
    return Boxes.of(moving, others), Boxes.of(still, np.concatenate((others, sensor_entities(world))))


def _covered(bodies: Boxes, walls: Boxes, axis: int) -> float:
    """The share of the bodies' extent across ``axis`` covered by walls; overlapping walls count twice."""
    lower, upper = bodies.lower.min(axis=0), bodies.upper.max(axis=0)
    span = np.minimum(walls.upper, upper) - np.maximum(walls.lower, lower)
    share = np.clip(span, 0, None) / np.maximum(upper - lower, np.finfo(float).tiny)
    return float(np.delete(share, axis, axis=1).prod(axis=1).sum())

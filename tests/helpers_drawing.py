"""Crowds of all shapes, those of a user among them, and what their drawing lists hold of one body."""

from __future__ import annotations

import math

import numpy as np

from carom import AABBCollider, Collider, Physics, Plugin, RigidBody, SphereCollider, Transform, World, column
from carom.framework.vectors import item, replace, scale
from carom.plugins import capsule, convex_hull, convex_polygon, half_space, terrain, tile_grid
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_hull import ConvexHullCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.joints import Joints
from carom.plugins.parts import Parts
from carom.plugins.rotation import BoxCollider, Rotation, Spin

users = Plugin("shapes of a user")


@users.shape(cost=2)
class Gem(Collider):
    """|x| + |y| + |z| <= radius; it says nothing of what it looks like."""

    radius = column(positive=True)

    def bounds(shape, dimensions):
        return (shape.radius,) * dimensions

    def support(shape, direction):
        best = max(range(len(direction)), key=lambda k: abs(item(direction, k)))
        return replace(scale(direction, 0.0), best, math.copysign(shape.radius, item(direction, best)))


@users.shape(cost=2)
class Pad(Collider):
    """A square of the xz plane, in a plane a line, and all that is near it; it turns with its body."""

    rotates = True
    half = column(positive=True)
    thickness = column(positive=True)

    def bounds(shape, dimensions):
        reach = shape.half * math.sqrt(dimensions - 1.0) + shape.thickness
        return (reach,) * dimensions

    def support(shape, direction):
        flat = [axis for k, axis in enumerate(shape.axes) if k != 1]
        ends = [math.copysign(shape.half, float(np.dot(axis, direction))) * np.array(axis) for axis in flat]
        return tuple(np.sum(ends, axis=0).tolist())

    def rounding(shape):
        return shape.thickness


def crowd(d: int, seed: int, count: int = 24) -> World:
    """Bodies of all convex shapes of random sizes and places, on some of their offsets, some turned."""
    random = np.random.default_rng((d, seed))
    plugins = capsule.plugin, half_space.plugin, terrain.plugin, users, Joints(), Parts()
    other = (convex_polygon.plugin, tile_grid.plugin) if d == 2 else (convex_hull.plugin,)
    world = World(Physics(dimensions=d, gravity=(0.0, -10.0, 0.0)[:d]), Rotation(), *plugins, *other)
    for k in range(count):
        create(world, random, "static" if k % 4 == 3 else "kinematic" if k % 7 == 6 else "dynamic")
    return world


def create(world: World, random: np.random.Generator, kind: str) -> int:
    d = world.dimensions
    sizes = random.uniform(0.2, 1.0, 3)
    kinds = [
        lambda **common: SphereCollider(sizes[0], **common),
        lambda **common: AABBCollider(sizes[:d], **common),
        lambda **common: BoxCollider(sizes[:d], **common),
        lambda **common: CapsuleCollider(sizes[0], sizes[1], **common),
        lambda **common: Gem(sizes[0], **common),
        lambda **common: Pad(sizes[0], 0.2 * sizes[1], **common),
        lambda **common: polygon(random, **common) if d == 2 else hull(random, **common),
    ]
    make = kinds[random.integers(len(kinds))]
    offset = random.uniform(-1.0, 1.0, d) * (random.random() < 0.3)
    collider = make(offset=offset, sensor=random.random() < 0.2)
    turn = random.uniform(-3.0, 3.0) if d == 2 else random.normal(size=4)
    place = Transform(random.uniform(-9.0, 9.0, d), turn)
    body = () if kind == "static" else (RigidBody(kind=kind, linear_velocity=random.normal(size=d)),)
    spins = body and not isinstance(collider, (AABBCollider, Gem)) and random.random() < 0.5
    if spins:
        spin = (random.normal(), 1.0) if d == 2 else (random.normal(size=3), (1.0, 1.0, 1.0))
        body = *body, Spin(angular_velocity=spin[0], inertia=spin[1])
    return world.create_entity(place, *body, collider)


def polygon(random, **common):
    angles = np.sort(random.uniform(0.0, 2.0 * np.pi, 9))
    points = 0.8 * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    return ConvexPolygonCollider(points, corner_radius=0.1 * (random.random() < 0.5), **common)


def hull(random, **common):
    return ConvexHullCollider(0.5 * random.normal(size=(12, 3)), **common)


def groups_of(shown):
    """All groups of shapes of a list."""
    still = *shown.fixed, shown.fixed_circles, shown.fixed_capsules, *shown.fixed_lines
    moving = [group for group in shown.lines if len(group) and group.style[0] < 6]
    return [*shown.polygons, shown.circles, shown.capsules, *moving, *still]


def reach_of(shown, entity, way):
    """How far what is drawn of an entity reaches in a direction."""
    found = []
    for group in groups_of(shown):
        own = group.where(group.entity == entity)
        if len(own):
            points = next(getattr(own, name) for name in ("points", "ends", "centre") if hasattr(own, name))
            along = (points.reshape(len(own), -1, len(way)) @ way).max(axis=1)
            found.append((along + getattr(own, "radius", 0.0) * np.linalg.norm(way)).max())
    return max(found)


def collider_of(world, entity):
    return next(one for one in world.components_for_entity(entity) if isinstance(one, Collider))

"""Random floors of boxes, polygons, capsules and tiles that lie flush, and one body that walks over them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from worlds import MODES

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, capsule, convex_polygon, tile_grid
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.tile_grid import TileGridCollider

FLOORS = ("box", "polygon", "wedge", "capsule", "tiles")
WALKERS = ("box", "polygon", "capsule", "ball")
G = 30.0
PIECES, MOST_STEPS = 8, 300
STANDS = 60  # steps before it walks: it has landed, and contacts push out what it has sunk


@dataclass(frozen=True)
class Walk:
    """The farthest from the height it stood at, in units, and the share of speed lost in a step beyond friction."""

    jitter: float
    lost: float


def polygon(world, corners, **common):
    """A static polygon with its corners at these places."""
    corners = np.array(corners, float)
    first, second = corners, np.roll(corners, -1, axis=0)
    cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    centre = ((first + second) * cross[:, None]).sum(axis=0) / (3.0 * cross.sum())
    return world.create_entity(Transform(tuple(centre)), ConvexPolygonCollider(corners - centre, **common))


def lay(world, random, kind, x, y, width, unit, **common):
    """A static body with an even top at height y, from x to x + width."""
    high = random.uniform(0.2, 1.0) * unit
    if kind == "box":
        world.create_entity(Transform((x + width / 2, y - high)), AABBCollider((width / 2, high), **common))
    elif kind == "polygon":
        polygon(world, ((x, y - high), (x + width, y - high), (x + width, y), (x, y)), **common)
    elif kind == "wedge":
        tip = x + width * random.uniform(0.1, 0.9)
        polygon(world, ((tip, y - high), (x + width, y), (x, y)), **common)
    elif kind == "capsule":  # its round ends lie inside its neighbours
        place = Transform((x + width / 2, y - high / 2), rotation=math.pi / 2)
        world.create_entity(place, CapsuleCollider(high / 2, width / 2, **common))
    else:
        columns = int(random.integers(1, 4))
        tile = width / columns
        world.create_entity(Transform((x + width / 2, y - tile)), TileGridCollider(["#" * columns] * 2, tile, **common))


def walker_of(random, kind, unit, **common):
    """(collider, half its height)."""
    wide = random.choice((0.4, random.uniform(0.2, 0.6))) * unit
    high = random.choice((0.7, random.uniform(0.2, 0.9))) * unit
    if kind == "box":
        return AABBCollider((wide, high), **common), high
    if kind == "polygon":
        return ConvexPolygonCollider(((-wide, -high), (wide, -high), (wide, high), (-wide, high)), **common), high
    if kind == "capsule":
        return CapsuleCollider(wide, high, **common), wide + high
    return SphereCollider(high, **common), high


def random_walk(seed, floors=FLOORS, walkers=WALKERS):
    """A :class:`Walk` at constant speed over a random floor, in one of the three kinds of collision."""
    random = np.random.default_rng(seed)
    unit, friction = random.choice((1.0, 1.0, 0.1, 32.0)), random.choice((0.0, 0.0, 0.5))
    x, y = random.choice((0.0, 36.0, random.uniform(-50, 50))), random.choice((0.0, 2.0, random.uniform(-50, 50)))
    settings = Settings(collision=MODES[seed % 3], substeps=int(random.choice((4, 4, 1, 8))))
    plugins = (convex_polygon.plugin, capsule.plugin, tile_grid.plugin)
    with World(Physics(2, gravity=(0, -G * unit)), *plugins, settings=settings) as world:
        start = x
        for _ in range(PIECES):
            width = random.choice((1.0, 2.0, random.uniform(0.5, 3.0))) * unit
            lay(world, random, random.choice(floors), x, y, width, unit, friction=friction)
            x += width
        collider, half = walker_of(random, random.choice(walkers), unit, friction=friction)
        speed = random.choice((3.0, 6.0, 8.0, random.uniform(0.2, 20.0))) * unit
        way = x - start - 1.2 * unit
        begin, velocity = (start + 0.6 * unit, speed) if random.random() < 0.5 else (x - 0.6 * unit, -speed)
        walker = world.create_entity(Transform((begin, y + half)), RigidBody(), collider)
        return follow(world, walker, velocity, int(min(way / (speed * settings.dt), MOST_STEPS)), unit, friction)


def follow(world, walker, velocity, steps, unit, friction):
    body, place = (world.component_for_entity(walker, kind) for kind in (RigidBody, Transform))
    for _ in range(STANDS):
        world.step()
    height, dt = place.y, world.settings.dt
    jitter = lost = 0.0
    for _ in range(steps):
        before = place.x
        body.linear_velocity = (velocity, body.linear_velocity[1])
        world.step()
        jitter = max(jitter, abs(place.y - height) / unit)
        lost = max(lost, 1.0 - (place.x - before) / (velocity * dt) - friction * G * unit * dt / abs(velocity))
    return Walk(jitter, lost)

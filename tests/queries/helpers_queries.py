"""Brute force for queries, and for casts by bisection of the gap, which is convex; below GRAZE any answer is right."""

from __future__ import annotations

import math

import numpy as np

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics

GRAZE = 1e-7  # relative to the sizes here, all about 1


class Bodies:
    """The oracle's data: spheres (radius) and boxes (half extents) at places, by entity."""

    def __init__(self, entity, centre, half, sphere):
        self.entity = np.asarray(entity)
        self.centre = np.asarray(centre, float)
        self.half = np.asarray(half, float)  # (n, d); the radius for a sphere
        self.sphere = np.asarray(sphere, bool)

    def gap(self, centres, half, sphere):
        """Distances (n,) between a sphere or a box at (d,) or (n, d) and every body; a box against a box: per axis."""
        d = np.abs(self.centre - centres)
        between = np.where(self.sphere[:, None], d, np.maximum(d - self.half, 0.0))
        if sphere:
            reach = half[0] + np.where(self.sphere, self.half[:, 0], 0.0)
            return np.linalg.norm(between, axis=1) - reach
        around = np.linalg.norm(np.maximum(d - half, 0.0), axis=1) - self.half[:, 0]
        return np.where(self.sphere, around, (d - half - self.half).max(axis=1))

    def depth_of_point(self, point):
        """Depth of the point inside each body; negative outside."""
        d = np.abs(self.centre - point)
        outside = -np.linalg.norm(np.maximum(d - self.half, 0.0), axis=1)
        inside = (self.half - d).min(axis=1)
        return np.where(
            self.sphere, self.half[:, 0] - np.linalg.norm(d, axis=1), np.where(inside > 0, inside, outside)
        )

    def cast(self, start, direction, length, half, sphere):
        """(distances to the first touch, inf for none; smallest gaps), each (n,)."""

        def gap(t):
            return self.gap(start + t[:, None] * direction, half, sphere)

        n = len(self.entity)
        low, high = np.zeros(n), np.full(n, float(length))
        for _ in range(60):  # to 1e-10 of the length: the gap is flat there, or far from 0
            one, two = low + (high - low) / 3, high - (high - low) / 3
            left = gap(one) <= gap(two)
            low, high = np.where(left, low, one), np.where(left, two, high)
        closest = (low + high) / 2
        ends = np.stack((np.zeros(n), closest, np.full(n, float(length))))
        gaps = np.stack([gap(t) for t in ends])
        least = gaps.min(axis=0)
        closest = ends[gaps.argmin(axis=0), np.arange(n)]
        low, high = np.zeros(n), closest.copy()
        for _ in range(54):
            middle = (low + high) / 2
            touches = gap(middle) <= 0
            low, high = np.where(touches, low, middle), np.where(touches, middle, high)
        high = np.where(gaps[0] <= 0, 0.0, high)
        return np.where(least <= 0, high, np.inf), least


def scene(d, n, seed, sizes="even", kinds=("dynamic", "static", "kinematic"), **settings):
    """A world of n spheres and boxes with the oracle's data; every third is turned, a fifth is a sensor."""
    rng = np.random.default_rng(seed)
    side = 2.5 * n ** (1 / d)
    places = rng.random((n, d)) * side
    scale = np.ones(n)
    if sizes == "spread":
        places = side * rng.standard_normal((n, d)) * 10.0 ** rng.uniform(-3, 3, (n, 1))
    if sizes in ("power", "spread"):
        scale = 0.02 * rng.random(n) ** -0.7
    if sizes == "clusters":
        places = side * (rng.integers(0, 3, (n, d)) + 0.1 * rng.standard_normal((n, d)))
        places[: n // 50] += 1e6 * rng.standard_normal((n // 50, d))
    half = rng.random((n, d)) * scale[:, None] * 0.8
    sphere = rng.random(n) < 0.5
    half[sphere] = half[sphere, :1]
    world = World(Physics(dimensions=d), settings=Settings(**settings))
    entities = []
    for k in range(n):
        shape = SphereCollider(half[k, 0]) if sphere[k] else AABBCollider(half[k])
        shape.sensor, shape.layer = k % 5 == 0, 1 << (k % 4)
        angle = 0.3 * k if k % 3 == 0 else 0.0
        turn = angle if d == 2 else (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))
        entities.append(world.create_entity(Transform(places[k], turn), RigidBody(kind=kinds[k % len(kinds)]), shape))
        if not sphere[k]:
            c, s = abs(math.cos(angle)), abs(math.sin(angle))
            half[k, :2] = c * half[k, 0] + s * half[k, 1], s * half[k, 0] + c * half[k, 1]
    return world, Bodies(entities, places, half, sphere), side


def directions(rng, m, d):
    """Unit vectors, one in four along an axis."""
    made = rng.standard_normal((m, d))
    made[::4] = np.eye(d)[rng.integers(0, d, len(made[::4]))] * rng.choice([-1.0, 1.0], (len(made[::4]), 1))
    return made / np.linalg.norm(made, axis=1, keepdims=True)

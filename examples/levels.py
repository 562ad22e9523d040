"""Cost and savings of geometry levels, measured: python examples/levels.py [bodies]

Boxes of several proportions in spheres, and rocks of twelve circles, whose precise test is expensive. All are sensors
that drift through each other, so that only finding contacts takes time.
"""

from __future__ import annotations

import math
import sys

import numpy as np

from carom import AABBCollider, Collider, Physics, Plugin, RigidBody, Settings, SphereCollider, Transform, World, column

STEPS = 20
rocks = Plugin("rocks")


@rocks.shape(cost=20)
class RockCollider(Collider):
    """Twelve circles on a ring, within a circle of that radius."""

    dimensions = (2,)
    radius: float = column(positive=True)

    @staticmethod
    def bounds(shape, dimensions):
        return shape.radius, shape.radius


@rocks.pair(RockCollider, RockCollider)
def rock_rock(a, b, d):
    deepest, x, y = -math.inf, 1.0, 0.0
    for i in range(12):
        for j in range(12):
            to_x = d[0] + 0.7 * (b.radius * math.cos(j * math.pi / 6) - a.radius * math.cos(i * math.pi / 6))
            to_y = d[1] + 0.7 * (b.radius * math.sin(j * math.pi / 6) - a.radius * math.sin(i * math.pi / 6))
            depth = 0.3 * (a.radius + b.radius) - math.sqrt(to_x * to_x + to_y * to_y)
            if depth > deepest:
                deepest, x, y = depth, to_x, to_y
    gap = math.sqrt(x * x + y * y)
    normal = (x / gap, y / gap) if gap > 0.0 else (1.0, 0.0)
    return deepest >= 0.0, deepest, normal, (0.5 * d[0], 0.5 * d[1])


def crowd(d, seed, n, room):
    """n positions with that much area or volume each, and velocities of 1 m/s on each axis."""
    rng = np.random.default_rng(seed)
    side = (n * room) ** (1 / d)
    return rng, Transform.many(rng.uniform(0, side, (n, d))), RigidBody.many(linear_velocity=rng.normal(0, 1, (n, d)))


def boxes(d, proportion, geometry, with_spheres, n):
    """Boxes of 1 m^d of that proportion, their long sides along random axes."""
    world = World(Physics(dimensions=d), settings=Settings(geometry=geometry))
    rng, places, bodies = crowd(d, 1, n, 4.0 * proportion)
    half = np.full((n, d), 0.5 * proportion ** (-1 / d))
    half[np.arange(n), rng.integers(0, d, n)] *= proportion
    spheres = [SphereCollider.many(radius=np.linalg.norm(half, axis=1), sensor=True)] if with_spheres else []
    world.create_entities(n, places, bodies, *spheres, AABBCollider.many(half_extents=half, sensor=True))
    return world


def rock_field(with_spheres, n):
    world = World(Physics(dimensions=2), rocks)
    rng, places, bodies = crowd(2, 1, n, 2.0)
    radius = rng.uniform(0.3, 0.7, n)
    spheres = [SphereCollider.many(radius=radius, sensor=True)] if with_spheres else []
    world.create_entities(n, places, bodies, *spheres, RockCollider.many(radius=radius, sensor=True))
    return world


def measure(name, world):
    """Print one row: candidates, first levels' tests and hits, false positives, contacts per step; time per step."""
    for _ in range(3):
        world.step()
    world.reset_stats()
    for _ in range(STEPS):
        world.step()
    stats = world.stats()
    names = ("candidates", "first_level_tests", "first_level_hits", "false_positives", "contacts")
    counts = [stats.counters[key] // STEPS for key in names]
    wrong = f"{100 * counts[3] / counts[2]:3.0f} %" if counts[2] else "     "
    milliseconds = sum(stats.milliseconds[system] for system in ("BroadPhase", "NarrowPhase"))
    print(f"{name:32}" + "".join(f"{count:9}" for count in counts) + f"   {wrong}   {milliseconds:6.2f} ms")
    world.close()


def main(n=4000):
    print(f"{n} bodies, per step:{'':12} candidates    tests     hits    false contacts")
    for d in (2, 3):
        for proportion in (1, 2, 4):
            name = f"{d}D, boxes 1:{proportion}"
            measure(name, boxes(d, proportion, "precise", False, n))
            measure(f"{name} in spheres", boxes(d, proportion, "precise", True, n))
            measure(f"{name} in spheres, bounds", boxes(d, proportion, "bounds", True, n))
    measure("2D, rocks", rock_field(False, n))
    measure("2D, rocks in spheres", rock_field(True, n))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))

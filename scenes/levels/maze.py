"""1,000 discs and boxes wander in a maze, and bounce off its walls and each other.

The maze has exactly one path between any two of its cells (made by a random walk to unvisited cells, with
backtracking). Straight runs of wall are one long static box, so the level is a few hundred boxes
of very unequal length. Restitution 1, no gravity: kinetic energy is conserved.
"""

import numpy as np
from numpy.typing import NDArray

from carom import AABBCollider, Physics, Settings, Transform, World
from carom.scenes.bodies import add_discs_and_boxes, random_velocities
from carom.scenes.sizes import ceil_root, whole

MOVERS = 1000
CELL = 5.0  # metres, from wall to wall
WALL = 0.5  # thickness
SPEEDS = (2.0, 8.0)  # metres/s
EXTENTS = (0.3, 0.7)  # radius or half extent
SIDE = ceil_root(MOVERS, 2) * CELL
SECONDS = 10.0
VIEW = ((-WALL, -WALL), (SIDE + WALL, SIDE + WALL))


def cut(side: int, random: np.random.Generator) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Walls of a maze of ``side`` by ``side`` cells: ``right[x, y]`` of and ``above[x, y]`` cell (x, y)."""
    right, above = np.ones((side, side), bool), np.ones((side, side), bool)
    seen = np.zeros((side, side), bool)
    seen[0, 0] = True
    way = [(0, 0)]
    while way:
        x, y = way[-1]
        ahead = [
            (x + dx, y + dy)
            for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))
            if 0 <= x + dx < side and 0 <= y + dy < side and not seen[x + dx, y + dy]
        ]
        if not ahead:
            way.pop()
            continue
        to = ahead[random.integers(len(ahead))]
        (right if to[1] == y else above)[min(x, to[0]), min(y, to[1])] = False
        seen[to] = True
        way.append(to)
    return right, above


def runs(walls: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
    """(row, start, end) of each run of True along the second axis."""
    found = []
    for row, line in enumerate(walls):
        edges = np.flatnonzero(np.diff(np.concatenate([[False], line, [False]])))
        found += [(row, int(start), int(end)) for start, end in edges.reshape(-1, 2)]
    return found


def wall_boxes(side: int, random: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres and half extents, (m, 2) each, of all walls, the outer ones included."""
    right, above = cut(side, random)
    boxes = []
    for axis, walls in enumerate((right, above.T)):  # lines of wall perpendicular to that axis
        lines = np.concatenate([np.ones((1, side), bool), walls])  # with the outer wall before the first cell
        for line, start, end in runs(lines):
            centre, half = np.empty(2), np.empty(2)
            centre[axis], half[axis] = line * CELL, WALL / 2
            centre[1 - axis], half[1 - axis] = (start + end) / 2 * CELL, ((end - start) * CELL + WALL) / 2
            boxes.append((centre, half))
    return np.array([centre for centre, _ in boxes]), np.array([half for _, half in boxes])


def build(settings: Settings | None = None, seed: int = 0, *, n: int = MOVERS) -> World:
    """``n`` movers, each in a separate cell of the smallest square maze that holds them, discs first."""
    side = ceil_root(whole(n, "n"), 2)
    random = np.random.default_rng(seed)
    world = World(Physics(dimensions=2), settings=settings)
    centres, halves = wall_boxes(side, random)
    world.create_entities(
        len(centres), Transform.many(centres), AABBCollider.many(half_extents=halves, restitution=1.0)
    )
    cells = np.sort(random.choice(side**2, n, replace=False))
    extent = random.uniform(*EXTENTS, n)
    room = (CELL - WALL) / 2 - extent
    places = (np.stack([cells % side, cells // side], axis=1) + 0.5) * CELL
    places += random.uniform(-1, 1, (n, 2)) * room[:, None]
    add_discs_and_boxes(world, places, random_velocities(random, n, SPEEDS), extent)
    return world

"""Drifting asteroids in three sizes, bouncing elastically.

They bounce off each other and off the edge of space. No gravity and restitution 1: kinetic energy is conserved. A large
rock is about 25 times as heavy as a small one, so this also tests unequal masses: a small one that is hit from behind
must fly forwards.
"""

import math

import numpy as np

from carom import Physics, Settings, World
from carom.scenes.bodies import add_spheres, random_velocities
from carom.scenes.walls import enclose

COLUMNS, ROWS = 12, 7
CELL = 15.0  # metres; one large rock, one medium one or four small ones start in each
SIZES = {"large": (5.0, 6.5), "medium": (2.6, 3.6), "small": (1.0, 1.5)}  # radius from .. to, metres
SHARES = (0.25, 0.4, 0.35)  # of the cells, in the order of SIZES
SPEEDS = (2.0, 14.0)  # metres/s
DENSITY = 1.0
SECONDS = 10.0
VIEW = ((-2.0, -2.0), (COLUMNS * CELL + 2.0, ROWS * CELL + 2.0))


def build(settings: Settings | None = None, seed: int = 0) -> World:
    """Some 180 asteroids in a field of 180 by 105 metres; ``seed`` chooses sizes, places and velocities."""
    world = World(Physics(dimensions=2), settings=settings)
    enclose(world, (0.0, 0.0), (COLUMNS * CELL, ROWS * CELL), thickness=2.0, restitution=1.0)
    random = np.random.default_rng(seed)
    size_of_cell = random.choice(len(SIZES), size=COLUMNS * ROWS, p=SHARES)
    positions, radii = [], []
    for cell, size in enumerate(size_of_cell):
        corner = np.array([cell % COLUMNS, cell // COLUMNS]) * CELL
        smallest, largest = list(SIZES.values())[size]
        quarters = 2 if size == 2 else 1
        room = CELL / quarters
        for part in range(quarters**2):
            radius = random.uniform(smallest, largest)
            centre = corner + (np.array([part % quarters, part // quarters]) + 0.5) * room
            positions.append(centre + random.uniform(-1, 1, 2) * (room / 2 - radius))
            radii.append(radius)
    radius = np.array(radii)
    velocities = random_velocities(random, len(radii), SPEEDS)
    add_spheres(world, positions, velocities, radius=radius, mass=DENSITY * math.pi * radius**2)
    return world

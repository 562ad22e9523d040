"""60 crates rain on platforms and come to rest.

Typical for game levels: boxes of several sizes and masses on static ledges, with friction and a little bounce. They
slide to a stop or slip over the edge; those that miss every platform end on the ground between the walls.
"""

import math

import numpy as np

from carom import AABBCollider, Physics, RigidBody, Settings, Transform, World
from carom.scenes.sizes import whole
from carom.scenes.walls import block, enclose

CRATES = 60
WIDTH, HEIGHT = 40.0, 26.0
PLATFORMS = (  # from x, to x, height of the top
    (1.5, 8.5, 4.0),
    (31.5, 38.5, 4.0),
    (8.5, 15.0, 10.0),
    (25.0, 31.5, 10.0),
    (16.5, 23.5, 16.0),
)
THICKNESS = 0.6
PER_ROW = 10
LOWEST = HEIGHT - 6.0  # height of the lowest row of crates at the start
PITCH = (3.8, 2.2)  # distance within a row, distance of the rows
EXTENTS = (0.35, 0.75)  # half the width, half the height
DRIFT = 6.0  # metres/s, at most, to either side
FRICTION, RESTITUTION, GRAVITY = 0.15, 0.3, 9.81
IMPACTS = 32  # per crate and step, at most: a crate between two others may bounce to and fro many times
SETTINGS = Settings(max_impacts_per_step=IMPACTS)


def _top(n: int) -> float:
    """Height of the walls: above the highest crate."""
    return max(HEIGHT, LOWEST + PITCH[1] * math.ceil(n / PER_ROW))


def build(settings: Settings | None = None, seed: int = 0, *, n: int = CRATES) -> World:
    """``n`` crates in rows above the platforms; ``seed`` chooses their sizes, places and velocities."""
    n = whole(n, "n")
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), settings=settings or SETTINGS)
    top = _top(n)
    enclose(world, (0.0, 0.0), (WIDTH, top), friction=FRICTION, open_top=True)
    for start, end, height in PLATFORMS:
        block(world, (start, height - THICKNESS), (end, height), friction=FRICTION)
    random = np.random.default_rng(seed)
    index = np.arange(n)
    half = random.uniform(*EXTENTS, (n, 2))
    places = np.stack(
        [WIDTH / 2 + (index % PER_ROW - (PER_ROW - 1) / 2) * PITCH[0], LOWEST + index // PER_ROW * PITCH[1]], axis=1
    )
    places += random.uniform(-1, 1, (n, 2)) * (np.array(PITCH) / 2 - half)
    velocities = np.stack([random.uniform(-DRIFT, DRIFT, n), np.zeros(n)], axis=1)
    world.create_entities(
        n,
        Transform.many(places),
        RigidBody.many(mass=4 * half.prod(axis=1), linear_velocity=velocities),
        AABBCollider.many(half_extents=half, restitution=RESTITUTION, friction=FRICTION),
    )
    return world


SECONDS = 6.0
VIEW = ((-1.0, -1.0), (WIDTH + 1.0, _top(CRATES)))

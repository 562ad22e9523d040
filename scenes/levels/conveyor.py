"""A belt of moving slats carries crates into a bin.

The belt is a row of kinematic boxes with a velocity, and friction makes the crates follow. A slat that has passed the
end is put back at the start. The bin's floor has little friction, so that a crate makes room for the next one.
"""

import math

import numpy as np
from numpy.typing import NDArray

from carom import AABBCollider, Phase, Physics, RigidBody, Settings, System, Transform, World
from carom.scenes.sizes import whole
from carom.scenes.walls import block

CRATES = 10
LENGTH, SLAT, THICKNESS = 16.0, 1.0, 0.5  # metres; the belt's upper face is at height 0
SPEED = 2.0
FRICTION, GRAVITY = 0.6, 9.81
EVERY = 0.75  # seconds between crates
DROP = ((1.5, 2.0), (2.5, 2.5))  # where they are created
EXTENTS = (0.3, 0.6)
BIN = (LENGTH, LENGTH + 12.0)
DEPTH = 5.0
SECONDS = 20.0
VIEW = ((-2.0, -DEPTH - 1.0), (BIN[1] + 1.0, 4.0))


class Belt(System):
    """Moves slats that have passed the end back to the start, without changing their spacing."""

    phase = Phase.START

    def __init__(self, slats: list[int]) -> None:
        super().__init__()
        self.slats = slats

    def process(self, dt: float) -> None:
        for slat in self.slats:
            transform = self.world.component_for_entity(slat, Transform)
            if transform.x > LENGTH - SLAT / 2:
                transform.position = transform.position - (SLAT * len(self.slats), 0.0)


class Chute(System):
    """Drops a crate every EVERY seconds, at ``places`` (n, 2) with ``half_extents`` (n, 2)."""

    phase = Phase.START

    def __init__(self, places: NDArray[np.float64], half_extents: NDArray[np.float64]) -> None:
        super().__init__()
        self.places, self.half_extents = places, half_extents

    def process(self, dt: float) -> None:
        time = self.world.time
        k = math.ceil(time / EVERY - 1e-9)  # the next crate: in this step, or in a later one
        if k < len(self.places) and EVERY * k < time + dt * (1 - 1e-6):
            half = self.half_extents[k]
            self.world.create_entity(
                Transform(self.places[k]),
                RigidBody(mass=float(4 * half.prod())),
                AABBCollider(half, friction=FRICTION),
            )


def build(settings: Settings | None = None, seed: int = 0, *, n: int = CRATES) -> World:
    """An empty belt and ``n`` crates to come; ``seed`` chooses their sizes and places."""
    n = whole(n, "n")
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), settings=settings)
    slats = world.create_entities(
        round(LENGTH / SLAT),
        Transform.many([((k + 0.5) * SLAT - SLAT, -THICKNESS / 2) for k in range(round(LENGTH / SLAT))]),
        RigidBody.many(kind="kinematic", linear_velocity=(SPEED, 0.0)),
        AABBCollider.many(half_extents=(SLAT / 2, THICKNESS / 2), friction=FRICTION),
    )
    block(world, (BIN[0], -DEPTH - 1.0), (BIN[1], -DEPTH), friction=0.0)
    block(world, (BIN[0] - 1.0, -DEPTH - 1.0), (BIN[0], -2 * THICKNESS), friction=FRICTION)
    block(world, (BIN[1], -DEPTH - 1.0), (BIN[1] + 1.0, 2.0), friction=FRICTION)
    world.add_system(Belt([int(slat) for slat in slats]))
    random = np.random.default_rng(seed)
    world.add_system(Chute(random.uniform(*DROP, (n, 2)), random.uniform(*EXTENTS, (n, 2))))
    return world

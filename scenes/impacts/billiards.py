"""The break: a cue ball into a rack of fifteen.

Sizes and masses of the real game, in metres and kilograms, seen from above, on a table without pockets. Each impact
loses 5 % of the approach speed, and the balls slow down on the cloth (by damping, the simplest approximation of rolling
friction). The cue ball crosses its own radius in 1/280 s, hence the small time step.
"""

import math

import numpy as np

from carom import Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.scenes.walls import enclose

LENGTH, WIDTH = 2.54, 1.27
RADIUS = 0.028575
MASS = 0.17
RESTITUTION = 0.95
CUSHION = 0.06  # thickness
CLOTH = 0.35  # 1/s
BREAK_SPEED = 8.0
GAP = 2e-4  # a real rack is never perfectly tight
SETTINGS = Settings(dt=1 / 960)
SECONDS = 2.0
VIEW = ((-CUSHION, -CUSHION), (LENGTH + CUSHION, WIDTH + CUSHION))


def rack(seed: int = 0) -> np.ndarray:
    """The fifteen centres, (15, 2), from the foot spot on; ``seed`` shifts each by up to GAP / 2."""
    pitch = 2 * RADIUS + 2 * GAP
    centres = [
        (0.75 * LENGTH + row * pitch * math.sqrt(3) / 2, WIDTH / 2 + (place - row / 2) * pitch)
        for row in range(5)
        for place in range(row + 1)
    ]
    return np.array(centres) + np.random.default_rng(seed).uniform(-GAP / 2, GAP / 2, (15, 2))


def build(settings: Settings | None = None, seed: int = 0) -> World:
    """Sixteen balls at the moment of the break; ``seed`` varies the rack by a tenth of a millimetre."""
    world = World(Physics(dimensions=2), settings=settings or SETTINGS)
    enclose(world, (0.0, 0.0), (LENGTH, WIDTH), thickness=CUSHION, restitution=RESTITUTION)
    cue = np.array([[0.25 * LENGTH, WIDTH / 2 + 0.004]])  # a little off centre, as in a real break
    velocities = np.zeros((16, 2))
    velocities[0, 0] = BREAK_SPEED
    world.create_entities(
        16,
        Transform.many(np.concatenate([cue, rack(seed)])),
        RigidBody.many(mass=MASS, linear_velocity=velocities, linear_damping=CLOTH),
        SphereCollider.many(radius=RADIUS, restitution=RESTITUTION),
    )
    return world

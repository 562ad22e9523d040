"""Newton's cradle: as many balls fly off as arrive.

Without the strings. Each line of equal elastic balls is a separate experiment: of its five balls the first k arrive
together at 1 m/s, the others are at rest. The impacts pass the velocity on from ball to ball, one at a time. In the end
the last k fly off at 1 m/s and the others are at rest, for any gap between the balls, including none.
"""

from collections.abc import Sequence

import numpy as np

from carom import Physics, Settings, World
from carom.scenes.bodies import add_spheres
from carom.scenes.sizes import real, whole

BALLS = 5
APPROACH = 3.0  # metres, gap between the balls that arrive and those at rest
BETWEEN_LINES = 2.0
SPEED = 1.0
SECONDS = 6.0
VIEW = ((-8.0, -1.0), (7.0, 7.0))


def build(
    settings: Settings | None = None, seed: int = 0, *, arriving: Sequence[int] = (1, 2, 3, 4), gap: float = 0.0
) -> World:
    """One line for each k in ``arriving``, the first one lowest, created ball by ball from left to right.

    ``gap``: metres between neighbours, both at rest and arriving; ``seed`` changes nothing.
    """
    gap = real(gap, "gap")
    world = World(Physics(dimensions=2), settings=settings)
    index = np.arange(BALLS)
    for line, value in enumerate(arriving):
        k = whole(value, "arriving")
        if k >= BALLS:
            raise ValueError(f"arriving must leave one of the {BALLS} balls at rest, got {value!r}")
        comes = index < k
        x = (index - k) * (1.0 + gap) - np.where(comes, APPROACH - gap, 0.0)
        velocities = np.zeros((BALLS, 2))
        velocities[comes, 0] = SPEED
        centres = np.stack([x, np.full(BALLS, BETWEEN_LINES * line)], axis=1)
        add_spheres(world, centres, velocities, radius=0.5, mass=1.0)
    return world

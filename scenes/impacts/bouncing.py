"""Seven elastic balls bounce for 20 seconds and must keep their energy.

The "bouncing" test of SimBenchmark (RSL, ETH Zurich) with one row of its balls: 10 kg, radius 0.1 m, 2 m apart so
that they never meet, centres 5 m above the ground. The energy of each is m g h = 490.5 J at all times. SimBenchmark's
error is the mean over all steps of (E - E0)^2, for its 49 balls together, which is 49^2 times that of one ball.
"""

import numpy as np

from carom import Physics, Settings, World
from carom.scenes.bodies import add_spheres
from carom.scenes.sizes import real, whole
from carom.scenes.walls import block

BALLS = 7
SPACING = 2.0
MASS = 10.0
RADIUS = 0.1
HEIGHT = 5.0
MARGIN = 10.0  # of the ground beyond the row, and its depth
SETTINGS = Settings(integrator="velocity_verlet", collision="continuous")
SECONDS = 20.0
VIEW = ((-8.0, -1.0), (8.0, 6.0))


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BALLS, height: float = HEIGHT) -> World:
    """``n`` balls in a row, centres ``height`` metres above the ground, whose top is at 0. ``seed`` changes nothing."""
    n, height = whole(n, "n"), real(height, "height", RADIUS)
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), settings=settings or SETTINGS)
    reach = SPACING * (n - 1) / 2
    block(world, (-reach - MARGIN, -MARGIN), (reach + MARGIN, 0.0), restitution=1.0)
    centres = np.stack([SPACING * np.arange(n) - reach, np.full(n, height)], axis=1)
    add_spheres(world, centres, np.zeros((n, 2)), radius=RADIUS, mass=MASS)
    return world

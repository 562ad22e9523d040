"""1,000 discs fast enough to jump through thin walls.

The elastic gas of :mod:`carom.scenes.gases.gas2d` thirty times as fast, between walls only 0.2 thick. A disc crosses up
to three and a half of its diameters in a step of 1/60 s, and the wall several times over. With discrete collisions
bodies pass through each other and out of the box. The scene shows the cost and benefit of the collision mode and the
step; try ``--set dt=1/960``.
"""

from carom import Settings, World
from carom.scenes import gas
from carom.scenes.bodies import add_spheres

BODIES = 1000
SPEED_UP = 30.0  # velocity components between -150 and 150 metres/s
WALL = 0.2  # thickness
MARGIN = 25.0  # shown around the box, for bodies that have tunnelled through the wall
SECONDS = 0.5
VIEW = ((-MARGIN, -MARGIN), (gas.side(BODIES, 2) + MARGIN, gas.side(BODIES, 2) + MARGIN))


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES) -> World:
    """``n`` discs in a square of side sqrt(n pi)."""
    world = gas.empty_box(settings, n, 2, WALL)
    positions, velocities = gas.initial_state(n, 2, seed)
    add_spheres(world, positions, SPEED_UP * velocities, radius=gas.RADIUS, mass=gas.BODY_VOLUME[2])
    return world

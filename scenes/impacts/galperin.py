"""Two blocks and a wall count to 314, the first digits of pi.

Galperin's light block, mass 1, is at rest 1 metre from the wall; the heavy one, mass 100^digits, comes from 1 metre
further on at 1 m/s. All impacts are elastic and without friction. There are 3, 31, 314, ... of them: pi to as many
digits (G. Galperin, Playing pool with pi, 2003). More than a hundred fall into the same hundredth of a second, so
this scene tests many impacts in one step, and its own settings allow 1,000 of them.
"""

import math

from carom import AABBCollider, Phase, Physics, RigidBody, Settings, System, Transform, World
from carom.scenes.sizes import whole
from carom.scenes.walls import block

DIGITS = 2  # after the first
GAP = 1.0
SPEED = 1.0
SMALL, LARGE = 0.5, 1.0  # half the blocks' widths
SETTINGS = Settings(dt=1 / 240, max_impacts_per_step=1000)
SECONDS = 9.0
VIEW = ((-1.0, -2.0), (11.5, 2.0))


class ImpactCounter(System):
    """Counts impacts in ``count``."""

    phase = Phase.END

    def __init__(self) -> None:
        super().__init__()
        self.count = 0

    def process(self, dt: float) -> None:
        self.count += len(self.world.contacts.impacts)


def impacts(digits: int) -> int:
    """The number of impacts: ceil(pi / atan(sqrt(m / M))) - 1."""
    return math.ceil(math.pi / math.atan(10.0**-digits)) - 1


def build(settings: Settings | None = None, seed: int = 0, *, digits: int = DIGITS) -> World:
    """The wall ends at x = 0; small block first, then the large one; ``seed`` changes nothing."""
    digits = whole(digits, "digits", 0)
    world = World(Physics(dimensions=2), settings=settings or SETTINGS)
    block(world, (-1.0, -2.0), (0.0, 2.0), restitution=1.0)
    world.create_entity(
        Transform((GAP + SMALL, 0.0)), RigidBody(mass=1.0), AABBCollider((SMALL, SMALL), restitution=1.0)
    )
    world.create_entity(
        Transform((2 * GAP + 2 * SMALL + LARGE, 0.0)),
        RigidBody(mass=100.0**digits, linear_velocity=(-SPEED, 0.0)),
        AABBCollider((LARGE, LARGE), restitution=1.0),
    )
    world.add_system(ImpactCounter())
    return world

"""Galperin's blocks: a heavy block drives a light one against a wall, and the number of impacts gives the digits of pi.

The light block, mass 1, is at rest 1 metre from the wall; the heavy one, mass 100^digits, comes from 1 metre
further on at 1 m/s. All impacts are elastic and without friction. There are 3, 31, 314, ... of them: pi to as many
digits (G. Galperin, Playing pool with pi, 2003). More than a hundred fall into the same hundredth of a second, so
this scene tests many impacts in one step, and its own settings allow 1,000 of them.
"""

from __future__ import annotations

import math

from ...components import AABBCollider, RigidBody, Transform
from ...framework import Phase, Settings, System, World
from ...plugins import Physics
from ..protocol import Scene
from ..sizes import whole
from ..walls import block

DIGITS = 2  # after the first
GAP = 1.0
SPEED = 1.0
SMALL, LARGE = 0.5, 1.0  # half the blocks' widths

SETTINGS = Settings.balanced().replace(dt=1 / 240, max_impacts_per_step=1000)


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
    settings = settings or SETTINGS
    world = World(Physics(dimensions=2, gravity=(0.0, 0.0)), settings=settings)
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


SCENE = Scene(
    name="galperin",
    description="two blocks and a wall count to 314, the first digits of pi",
    build=build,
    seconds=9.0,
    view=((-1.0, -2.0), (11.5, 2.0)),
    settings=SETTINGS,
)

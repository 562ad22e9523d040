"""An elastic gas of 500 discs and 500 boxes: three kinds of pairs.

The gas of :mod:`carom.scenes.gases.gas2d` with every other disc replaced by a box. Body k is a disc of mass pi/4 if k
is even and a box of side 1 and mass 1 if it is odd.
"""

import numpy as np

from carom import Settings, World
from carom.scenes import gas
from carom.scenes.bodies import add_discs_and_boxes

BODIES = 1000
SECONDS = 10.0
VIEW = gas.view(BODIES, 2)


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES) -> World:
    """``n`` bodies, the discs created first, then the boxes, each in the gas' order."""
    world = gas.empty_box(settings, n, 2)
    add_discs_and_boxes(world, *gas.initial_state(n, 2, seed), np.full(n, gas.RADIUS))
    return world

"""1,275 boxes in 50 rows stand by friction.

Each row of unit boxes has one less than the row below and is offset by half a box. Restitution 0, mass 1, gravity 9.81.
It must stand, with friction 0.6 and without. A spacing of 1.1 leaves gaps between the boxes of a row. With ``spins``
the boxes can turn.
"""

import numpy as np
from numpy.typing import NDArray

from carom import AABBCollider, BoxCollider, Physics, RigidBody, Rotation, Settings, Spin, Transform, World
from carom.scenes.sizes import real, whole
from carom.scenes.walls import block

ROWS = 50
FRICTION = 0.6
GROUND = 200.0  # metres wide, or twice the pyramid's width if that is more
SECONDS = 8.0
VIEW = ((-30.0, -1.0), (30.0, 52.0))


def initial_positions(rows: int, spacing: float = 1.0) -> NDArray[np.float64]:
    """(rows (rows + 1) / 2, 2), row by row from the ground: row j has rows - j boxes, centres at height 0.5 + j."""
    return np.array(
        [((i - (boxes - 1) / 2) * spacing, 0.5 + rows - boxes) for boxes in range(rows, 0, -1) for i in range(boxes)]
    )


def build(
    settings: Settings | None = None,
    seed: int = 0,
    *,
    rows: int = ROWS,
    friction: float = FRICTION,
    spacing: float = 1.0,
    spins: bool = False,
) -> World:
    """``rows`` rows, ``spacing`` >= 1 metre from centre to centre in a row; ``seed`` changes nothing."""
    rows, friction, spacing = whole(rows, "rows"), real(friction, "friction"), real(spacing, "spacing", 1.0)
    plugins = [Physics(dimensions=2, gravity=(0.0, -9.81)), *[Rotation()] * spins]
    world = World(*plugins, settings=settings)
    reach = max(GROUND / 2, rows * spacing)
    block(world, (-reach, -1.0), (reach, 0.0), friction=friction)
    positions = initial_positions(rows, spacing)
    world.create_entities(
        len(positions),
        Transform.many(positions),
        RigidBody.many(mass=1.0),
        (BoxCollider if spins else AABBCollider).many(half_extents=(0.5, 0.5), friction=friction),
        *[Spin.many(0.0)] * spins,
    )
    return world

"""Newton's cradle without the strings: equal elastic balls in a line; as many fly off as arrive.

Each line is a separate experiment: of its five balls the first k arrive together at 1 m/s, the others are at rest.
The impacts pass the velocity on from ball to ball, one at a time. In the end the last k fly off at 1 m/s and the
others are at rest, for any gap between the balls, including none.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...components import RigidBody, SphereCollider, Transform
from ...framework import Settings, World
from ...plugins import Physics
from ..protocol import Scene
from ..sizes import real, whole

BALLS = 5
APPROACH = 3.0  # metres, gap between the balls that arrive and those at rest
BETWEEN_LINES = 2.0
SPEED = 1.0


def build(
    settings: Settings | None = None, seed: int = 0, *, arriving: Sequence[int] = (1, 2, 3, 4), gap: float = 0.0
) -> World:
    """One line for each k in ``arriving``, the first one lowest, created ball by ball from left to right.

    ``gap``: metres between neighbours, both at rest and arriving; ``seed`` changes nothing.
    """
    gap = real(gap, "gap")
    world = World(Physics(dimensions=2, gravity=(0.0, 0.0)), settings=settings or Settings.balanced())
    index = np.arange(BALLS)
    for line, value in enumerate(arriving):
        k = whole(value, "arriving")
        if k >= BALLS:
            raise ValueError(f"arriving must leave one of the {BALLS} balls at rest, got {value!r}")
        comes = index < k
        x = (index - k) * (1.0 + gap) - np.where(comes, APPROACH - gap, 0.0)
        velocities = np.zeros((BALLS, 2))
        velocities[comes, 0] = SPEED
        world.create_entities(
            BALLS,
            Transform.many(np.stack([x, np.full(BALLS, BETWEEN_LINES * line)], axis=1)),
            RigidBody.many(mass=1.0, linear_velocity=velocities),
            SphereCollider.many(radius=0.5, restitution=1.0),
        )
    return world


SCENE = Scene(
    name="cradle",
    description="Newton's cradle: as many balls fly off as arrive",
    build=build,
    seconds=6.0,
    view=((-8.0, -1.0), (7.0, 7.0)),
)

"""The elastic gas of :mod:`carom.scenes.gases.gas2d` with every other disc replaced by a box: three kinds of pairs.

Body k of the gas is a disc of mass pi/4 if k is even and a box of side 1 and mass 1 if it is odd.
"""

from __future__ import annotations

from ...components import AABBCollider, RigidBody, Transform
from ...framework import Settings, World
from .. import gas
from ..protocol import Scene

BODIES = 1000


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES) -> World:
    """``n`` bodies, the discs created first, then the boxes, each in the gas' order."""
    world = gas.empty_box(settings, n, 2)
    positions, velocities = gas.initial_state(n, 2, seed)
    gas.add_spheres(world, positions[::2], velocities[::2])
    world.create_entities(
        n // 2,
        Transform.many(positions[1::2]),
        RigidBody.many(mass=1.0, linear_velocity=velocities[1::2]),
        AABBCollider.many(half_extents=(gas.RADIUS, gas.RADIUS), restitution=1.0),
    )
    return world


SCENE = Scene("mixed2d", "an elastic gas of 500 discs and 500 boxes", build, 10.0, gas.view(BODIES, 2))

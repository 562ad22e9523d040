"""Bodies for tests of forces."""

from __future__ import annotations

from carom.components import RigidBody, Transform

DT = 0.125  # a power of two: sums of steps are exact


def body(world, mass=1.0, velocity=(0.0, 0.0), *, at=(0.0, 0.0), **kwargs):
    """The RigidBody of a new body."""
    rigid = RigidBody(mass, velocity, **kwargs)
    world.create_entity(Transform(at), rigid)
    return rigid

"""Worlds with bodies of several parts."""

from __future__ import annotations

from typing import Any

import numpy as np

from carom import Physics, RigidBody, Settings, Transform, World
from carom.plugins.parts import PartOf, Parts
from carom.plugins.rotation import BoxCollider, Rotation, Spin

G = 9.81
# The boxes of a piece, (centre, half extents, mass): the first one is the body's own.
L = (((0.0, 0.0), (0.15, 0.5), 2.0), ((0.4, -0.35), (0.25, 0.15), 1.0))
U = (
    ((0.0, 0.0), (0.5, 0.15), 1.5), ((-0.35, 0.35), (0.15, 0.2), 1.0), ((0.35, 0.35), (0.15, 0.2), 0.5),
)  # fmt: skip
CORNER = (  # in space, with products of inertia
    ((0.0, 0.0, 0.0), (0.5, 0.15, 0.15), 2.0), ((0.35, 0.4, 0.0), (0.15, 0.25, 0.15), 1.0),
    ((-0.35, 0.0, 0.4), (0.15, 0.15, 0.25), 1.0),
)  # fmt: skip


def parts_world(gravity: Any = 0.0, dimensions: int = 2, **settings: Any) -> tuple[World, Parts]:
    parts = Parts()
    physics = Physics(dimensions=dimensions, gravity=gravity)
    return World(physics, Rotation(), parts, settings=Settings(**settings)), parts


def piece(
    world: World, parts: Parts, place: Any, boxes: Any = L, *, angle: Any = 0.0, velocity: Any = 0.0, spin: Any = 0.0,
    **collider: Any,
) -> list[int]:  # fmt: skip
    """A balanced body and its parts, whose first box is at that place before."""
    own, *others = boxes
    body = world.create_entity(
        Transform(place, angle), RigidBody(own[2], velocity), Spin(spin), BoxCollider(own[1], **collider)
    )
    ids = [body]
    for centre, half, mass in others:
        ids.append(world.create_entity(PartOf(body, centre, mass=mass), BoxCollider(half, **collider)))
    parts.balance(body)
    return ids


def floor(world: World, **collider: Any) -> int:
    return world.create_entity(Transform((0, -1)), BoxCollider((50.0, 1.0), **collider))


def at(world: World, body: int) -> Transform:
    return world.component_for_entity(body, Transform)


def body_of(world: World, body: int) -> RigidBody:
    return world.component_for_entity(body, RigidBody)


def angular_momentum(world: World, bodies: list[int]) -> Any:
    """kg m^2/s about the origin."""
    total: Any = 0.0
    for body in bodies:
        place, motion, spin = at(world, body), body_of(world, body), world.component_for_entity(body, Spin)
        if len(place.position) == 2:
            (x, y), (u, v) = place.position, motion.linear_velocity
            total += motion.mass * (x * v - y * u) + spin.moments * spin.angular_velocity
        else:
            axes = spin._axes()
            orbital = motion.mass * np.cross(place.position, motion.linear_velocity)
            total = total + orbital + axes @ spin.moments @ axes.T @ spin.angular_velocity
    return total

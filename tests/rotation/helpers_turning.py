"""Worlds in which bodies turn: what the tests of this folder put into them, and what they read."""

from __future__ import annotations

from typing import Any

import numpy as np

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation, Spin

G = 9.81


def turning_world(d: int = 2, gravity: Any = 0.0, *plugins: Any, **settings: Any) -> World:
    """gravity: a number acts downwards along the second axis; (d,) m/s^2 otherwise."""
    down = gravity if np.ndim(gravity) else (0.0, -gravity, 0.0)[:d]
    return World(Physics(d, gravity=down), Rotation(), *plugins, settings=Settings(**settings))


def wall(world: World, place: Any, half: Any, **collider: Any) -> int:
    """A static box."""
    return world.create_entity(Transform(place), RigidBody(kind="static"), BoxCollider(half, **collider))


def box(
    world: World, place: Any, half: Any, velocity: Any = 0.0, spin: Any = 0.0, rotation: Any = 0.0, mass: float = 1.0,
    **collider: Any,
) -> int:  # fmt: skip
    body = RigidBody(mass, velocity)
    return world.create_entity(Transform(place, rotation), body, Spin(spin), BoxCollider(half, **collider))


def ball(
    world: World, place: Any, velocity: Any = 0.0, spin: Any = 0.0, radius: float = 0.5, mass: float = 1.0,
    **collider: Any,
) -> int:  # fmt: skip
    """Its spin may be a number in space too: about the third axis."""
    about = spin if len(place) == 2 or np.ndim(spin) else (0.0, 0.0, spin)
    return world.create_entity(
        Transform(place), RigidBody(mass, velocity), Spin(about), SphereCollider(radius, **collider)
    )


def part(world: World, entity: int, component: Any) -> Any:
    return world.component_for_entity(entity, component)


def motion(world: World, entity: int) -> Any:
    """(velocity, angular velocity: a number in a plane)."""
    spin = part(world, entity, Spin).angular_velocity
    return np.array(part(world, entity, RigidBody).linear_velocity), spin if np.ndim(spin) == 0 else np.array(spin)


def pose(world: World, entity: int) -> np.ndarray:
    """The place, then the rotation."""
    transform = part(world, entity, Transform)
    return np.concatenate((transform.position, np.atleast_1d(transform.rotation)))


def turned(q: Any, v: Any) -> np.ndarray:
    """Vectors v, turned by quaternions q."""
    q = np.asarray(q)
    w, u = q[..., :1], q[..., 1:]
    return v + 2 * w * np.cross(u, v) + 2 * np.cross(u, np.cross(u, v))


def own_spin(world: World, entity: int) -> np.ndarray:
    """The angular velocity in space, along the body's own axes."""
    back = np.multiply(part(world, entity, Transform).rotation, (1, -1, -1, -1))
    return turned(back, np.array(part(world, entity, Spin).angular_velocity))

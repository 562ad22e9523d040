"""Small worlds for tests: bodies in a line, and what must hold after any impact."""

from __future__ import annotations

import numpy as np

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics

EPS = np.finfo(float).eps


def make_world(d=2, gravity=0.0, **settings):
    """Gravity: a number acts downwards along the second axis."""
    vector = gravity if np.ndim(gravity) else [0.0, -gravity, 0.0][:d]
    return World(Physics(dimensions=d, gravity=vector), settings=Settings(**settings))


def place(world, value):
    """A number stands for a place on the first axis."""
    return tuple(value) if np.ndim(value) else (float(value), *(0.0,) * (world.dimensions - 1))


def ball(world, position, velocity=0.0, *, radius=0.5, mass=1.0, kind="dynamic", **collider):
    body = RigidBody(mass, place(world, velocity), kind=kind)
    return world.create_entity(Transform(place(world, position)), body, SphereCollider(radius, **collider))


def box(world, position, velocity=0.0, *, half=0.5, mass=1.0, kind="dynamic", rotation=0.0, **collider):
    half = tuple(half) if np.ndim(half) else (half,) * world.dimensions
    body = RigidBody(mass, place(world, velocity), kind=kind)
    return world.create_entity(Transform(place(world, position), rotation), body, AABBCollider(half, **collider))


def floor(world, restitution=0.0, **collider):
    """A wide static box whose upper side is y = 0."""
    half = (1e3, 0.5, 1e3)[: world.dimensions]
    centre = (0.0, -0.5, 0.0)[: world.dimensions]
    return world.create_entity(Transform(centre), AABBCollider(half, restitution=restitution, **collider))


def run(world, steps):
    for _ in range(steps):
        world.step()


def position(world, entity):
    return world.bodies.position[world.bodies.row_of(entity)].copy()


def velocity(world, entity):
    return world.bodies.linear_velocity[world.bodies.row_of(entity)].copy()


class Conserved:
    """What no impact may change: bodies, momentum; and energy, which none with e <= 1 may raise.

    Forces and partners that are not dynamic change momentum: ``momentum=False``. Tolerances: rounding of the sums,
    1e-12 of what is summed.
    """

    def __init__(self, world):
        self.world = world
        self.bodies = len(world.bodies)
        self.momentum = world.momentum()
        self.scale = self._scale()
        self.energy = world.kinetic_energy()

    def _scale(self):
        moving = self.world.bodies.dynamic
        return float(np.abs(moving.mass[:, None] * moving.linear_velocity).sum())

    def check(self, momentum=True, energy=True):
        bodies = self.world.bodies
        assert len(bodies) == self.bodies
        assert np.isfinite(bodies.position).all()
        assert np.isfinite(bodies.linear_velocity).all()
        if momentum:
            np.testing.assert_allclose(self.world.momentum(), self.momentum, rtol=0, atol=1e-12 * self.scale)
        if energy:
            assert self.world.kinetic_energy() <= self.energy * (1 + 1e-12)

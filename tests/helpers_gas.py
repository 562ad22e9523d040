"""Elastic discs in a square box, and what statistical mechanics says of them: B20 of the accuracy list."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from worlds import make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import World

N, ETA, RADIUS = 400, 0.3, 0.5
BULK = 2.0632  # Z of hard discs at eta = 0.3, virial series of Clisby and McCoy
REFERENCE = 2.088  # the same of N = 400 in this box, in measures that the centres can reach: exact event dynamics
RATE = 2.399  # collisions of each disc per unit time at kT = m = sigma = 1: 2 sqrt(pi) rho sigma g
FINITE_RATE = 1.031  # walls keep centres out of a layer of R, so the gas is denser by up to sigma / L


def gas(dt: float, seed: int, n: int = N, **settings: Any) -> tuple[World, float]:
    """Discs on a lattice, Gaussian velocities of mean zero scaled to kT = 1; the side of the box. n: a square."""
    world = make_world(dt=dt, **settings)
    side = math.sqrt(n * math.pi / (4 * ETA))
    for axis in range(2):
        for edge, outwards in ((0.0, -1), (side, 1)):
            centre, half = np.full(2, side / 2), np.full(2, side)
            centre[axis], half[axis] = edge + outwards * 5.0, 5.0
            world.create_entity(Transform(centre), AABBCollider(half, restitution=1.0))
    row = math.isqrt(n)
    cells = np.stack(np.meshgrid(*[(np.arange(row) + 0.5) * side / row] * 2), axis=-1).reshape(-1, 2)
    velocity = np.random.default_rng(seed).normal(size=(n, 2))
    velocity -= velocity.mean(axis=0)
    velocity *= math.sqrt(2 * n / (velocity**2).sum())
    world.create_entities(
        n,
        Transform.many(cells),
        RigidBody.many(mass=1.0, linear_velocity=velocity),
        SphereCollider.many(radius=RADIUS, restitution=1.0),
    )
    return world, side


@dataclass
class Measured:
    z: float  # from the impulses on the walls
    rate: float  # collisions per disc and unit time
    drift: float  # of the energy, relative, at worst
    deepest: float  # overlap, sigma
    collisions: int


def measure(world: World, side: float, seconds: float, discard: float = 20.0) -> Measured:
    """Run until each disc has collided ``discard`` times, then measure; nobody may escape."""
    dt = world.settings.dt
    n, energy, deepest, drift, wall, hits = len(world.bodies.dynamic), world.kinetic_energy(), 0.0, 0.0, 0.0, 0
    warm_up, steps = int(discard / RATE / dt), int(seconds / dt)
    for step in range(warm_up + steps):
        world.step()
        drift = max(drift, abs(world.kinetic_energy() / energy - 1))
        if step < warm_up:
            continue
        impacts, position = world.contacts.impacts, world.bodies.dynamic.position
        on_wall = impacts.entity_a <= 4
        wall += impacts.normal_impulse[on_wall].sum()
        hits += int(np.count_nonzero(~on_wall))
        if len(world.contacts):
            deepest = max(deepest, float(world.contacts.depth.max()))
        inside = ((position > 0) & (position < side)).all()
        assert inside, "a body has escaped"
    assert len(world.bodies.dynamic) == n
    assert world.stats().counters["capped_impacts"] == 0
    z = wall * (side - 2 * RADIUS) / (4 * steps * dt * n)
    return Measured(z, 2 * hits / n / (steps * dt), drift, deepest, hits)

"""Elastic discs in a square box, and their averages by statistical mechanics: B20 of the accuracy list."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from carom.framework import Settings, World
from carom.scenes import thermal_gas

N, ETA, RADIUS = thermal_gas.BODIES, thermal_gas.ETA, thermal_gas.RADIUS
BULK = 2.0632  # Z of hard discs at eta = 0.3, virial series of Clisby and McCoy
REFERENCE = 2.088  # Z of N = 400 in this box, with the area that the centres can reach: exact event dynamics
RATE = 2.399  # collisions of each disc per unit time at kT = m = sigma = 1: 2 sqrt(pi) rho sigma g
FINITE_RATE = 1.031  # walls exclude centres from a layer of R, so the gas is denser by up to sigma / L


def gas(dt: float, seed: int, n: int = N, **settings: Any) -> tuple[World, float]:
    """The scene thermal_gas at ETA, and the side of its box. n: a square; settings: besides ``dt``."""
    return thermal_gas.build(Settings(dt=dt, **settings), seed, n=n, eta=ETA), thermal_gas.side(n, ETA)


@dataclass
class Measured:
    z: float  # from the impulses on the walls
    rate: float  # collisions per disc and unit time
    drift: float  # of the energy, relative, at worst
    deepest: float  # overlap, sigma
    collisions: int


def measure(world: World, side: float, seconds: float, discard: float = 20.0) -> Measured:
    """Run until each disc has collided ``discard`` times, then measure; no disc may escape."""
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

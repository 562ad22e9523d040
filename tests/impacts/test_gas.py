"""B20: an elastic gas against statistical mechanics: pressure on the walls, collision rate, velocities."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from helpers_modes import MODES

from carom.framework import Settings, World
from carom.scenes import thermal_gas

pytestmark = pytest.mark.early

N, ETA, RADIUS = thermal_gas.BODIES, thermal_gas.ETA, thermal_gas.RADIUS
BULK = 2.0632  # Z of hard discs at eta = 0.3, virial series of Clisby and McCoy
REFERENCE = 2.088  # Z of N = 400 in this box, with the area that the centres can reach: exact event dynamics
RATE = 2.399  # collisions of each disc per unit time at kT = m = sigma = 1: 2 sqrt(pi) rho sigma g
FINITE_RATE = 1.031  # walls exclude centres from a layer of R, so the gas is denser by up to sigma / L


def gas(dt: float, seed: int, n: int = N, **settings: Any) -> tuple[World, float]:
    """The scene thermal_gas at ETA, and the side of its box. n: a square; settings: besides ``dt``."""
    return thermal_gas.build(Settings(dt=dt, **settings), seed, n=n, eta=ETA), thermal_gas.side(n, ETA)


class Measured(NamedTuple):
    z: float  # from the impulses on the walls
    rate: float  # collisions per disc and unit time
    drift: float  # of the energy, relative, at worst
    deepest: float  # overlap, sigma
    collisions: int
    square: float  # of the speed along the normal where two discs meet
    kurtosis: float  # of a component of the velocities


def measure(world: World, side: float, seconds: float, discard: float = 20.0) -> Measured:
    """Run until each disc has collided ``discard`` times, then measure; no disc may escape."""
    dt = world.settings.dt
    n, energy, deepest, drift, wall, hits = len(world.bodies.dynamic), world.kinetic_energy(), 0.0, 0.0, 0.0, 0
    squares, fourth, second = 0.0, 0.0, 0.0
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
        squares += (impacts.normal_impulse[~on_wall] ** 2).sum()  # J = m v_n at e = 1 and equal masses
        v = world.bodies.dynamic.linear_velocity
        fourth, second = fourth + (v**4).mean(), second + (v**2).mean()
        if len(world.contacts):
            deepest = max(deepest, float(world.contacts.depth.max()))
        inside = ((position > 0) & (position < side)).all()
        assert inside, "a body has escaped"
    assert len(world.bodies.dynamic) == n
    assert world.stats().counters["capped_impacts"] == 0
    z = wall * (side - 2 * RADIUS) / (4 * steps * dt * n)
    kurtosis = steps * fourth / second**2
    return Measured(z, 2 * hits / n / (steps * dt), drift, deepest, hits, squares / hits, kurtosis)


FINITE = 1.013  # in centre-accessible measures N = 400 stays within 1.3 % of the bulk

# v dt / sigma, seeds, seconds, and 3 sigma of the noise of Z and of the rate
DISCRETE = [(dt, 1, 24.0, 0.056, 0.056) for dt in (0.3, 0.1, 0.03)]
DISCRETE += [pytest.param(dt, 5, 41.7, 0.019, 0.01, marks=pytest.mark.long) for dt in (0.3, 0.1, 0.03, 0.01)]


def mean_of(runs):
    """Means of Z and the rate, the worst drift and overlap, the sum of the collisions."""
    z, rate, drift, deepest, collisions, square, kurtosis = zip(*runs, strict=True)
    return Measured(
        np.mean(z), np.mean(rate), max(drift), max(deepest), sum(collisions), np.mean(square), np.mean(kurtosis)
    )


@pytest.mark.slow
@pytest.mark.parametrize(("dt", "seeds", "seconds", "noise", "of_rate"), DISCRETE)
def test_pressure_and_rate_in_discrete_worlds(dt, seeds, seconds, noise, of_rate):
    """Z and the rate fall short by 2 v dt / sigma at most (B20), and never exceed."""
    found = mean_of(measure(*gas(dt, seed, max_impacts_per_step=100), seconds) for seed in range(1, 1 + seeds))
    assert found.drift < 1e-12
    assert BULK * (1 - 2 * dt - noise) < found.z < BULK * (FINITE + noise)
    assert RATE * (1 - 2 * dt - of_rate) < found.rate < RATE * (FINITE_RATE + of_rate)


SWEPT = [(mode, dt, 1, 62.0, 0.035, 0.02) for mode in MODES for dt in (0.3, 0.1)]
SWEPT += [
    pytest.param(mode, dt, 3, 83.0, 0.02, 0.01, marks=pytest.mark.long)
    for mode, dt in zip(MODES + MODES, (0.03, 0.01, 0.3, 0.1), strict=True)
]


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "dt", "seeds", "seconds", "noise", "of_rate"), SWEPT)
def test_pressure_and_rate_at_true_times(mode, dt, seeds, seconds, noise, of_rate):
    """They do not depend on the step; nothing rests, so no overlap but rounding; energy to 1e-11; and velocities at
    impact and in the end are those of Maxwell."""
    worlds = (gas(dt, seed, collision=mode, max_impacts_per_step=1000) for seed in range(1, 1 + seeds))
    found = mean_of(measure(world, side, seconds) for world, side in worlds)
    assert found.collisions > 458 * seconds * seeds
    assert found.drift < 1e-11
    assert abs(found.z / REFERENCE - 1) < noise
    assert RATE * (1 - of_rate) < found.rate < RATE * (FINITE_RATE + of_rate)
    assert found.deepest < 1e-12
    assert found.square == pytest.approx(4.0, abs=12 / math.sqrt(12000))  # 4 kT / m, within 3 sigma
    assert found.kurtosis == pytest.approx(3.0, abs=0.19)

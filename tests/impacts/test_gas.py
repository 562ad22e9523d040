"""B20: an elastic gas against statistical mechanics: pressure on the walls and collision rate."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_gas import BULK, FINITE_RATE, RADIUS, RATE, N, gas, measure
from worlds import make_world

from carom.components import RigidBody, SphereCollider, Transform

FINITE = 1.013  # in centre-accessible measures N = 400 stays within 1.3 % of the bulk
CAP = 100  # impacts per body and step: not tested here


@pytest.mark.parametrize("dt", [0.3, 0.1, 0.03])
def test_pressure_and_rate_of_an_elastic_gas(dt):
    """Z and the rate fall short by 2 v dt / sigma at most (B20), and never exceed; 3 sigma of the noise are 5.6 %."""
    found = measure(*gas(dt, 1, max_impacts_per_step=CAP), 24.0)
    noise = 0.056
    assert found.drift < 1e-12
    assert BULK * (1 - 2 * dt - noise) < found.z < BULK * (FINITE + noise)
    assert RATE * (1 - 2 * dt - noise) < found.rate < RATE * (FINITE_RATE + noise)


@pytest.mark.long
@pytest.mark.parametrize("dt", [0.3, 0.1, 0.03, 0.01])
def test_pressure_and_rate_with_many_collisions(dt):
    """The same over 5 seeds and 100,000 collisions: noise of Z 3 * 2 / sqrt(1e5) = 1.9 %, of the rate less."""
    seconds = 1e5 / 5 / (N * RATE / 2)
    runs = [measure(*gas(dt, seed, max_impacts_per_step=CAP), seconds) for seed in range(5)]
    z, rate = np.mean([run.z for run in runs]), np.mean([run.rate for run in runs])
    drift, deepest = max(run.drift for run in runs), max(run.deepest for run in runs)
    print(f"v dt/sigma {dt}: Z {z:.4f}, rate {rate:.4f}, energy drift {drift:.1e}, deepest overlap {deepest:.3f}")
    assert drift < 1e-12
    assert BULK * (1 - 2 * dt - 0.019) < z < BULK * (FINITE + 0.019)
    assert RATE * (1 - 2 * dt - 0.01) < rate < RATE * (FINITE_RATE + 0.01)


def test_momentum_without_walls():
    """In free space momentum is conserved to rounding and energy to 1e-12, while the cloud still collides a lot."""
    world = make_world(dt=0.05, max_impacts_per_step=CAP)
    rng = np.random.default_rng(5)
    cells = np.stack(np.meshgrid(*[np.arange(15) * 1.05] * 2), axis=-1).reshape(-1, 2)
    mass = 10.0 ** rng.uniform(-1, 1, len(cells))
    velocity = rng.normal(size=cells.shape) - (cells - cells.mean(axis=0)) * 0.5
    world.create_entities(
        len(cells),
        Transform.many(cells),
        RigidBody.many(mass=mass, linear_velocity=velocity),
        SphereCollider.many(radius=RADIUS, restitution=1.0),
    )
    momentum, energy = world.momentum(), world.kinetic_energy()
    hits = 0
    for _ in range(200):
        world.step()
        hits += len(world.contacts.impacts)
    scale = np.abs(mass[:, None] * velocity).sum()
    np.testing.assert_allclose(world.momentum(), momentum, rtol=0, atol=1e-13 * scale)
    assert world.kinetic_energy() == pytest.approx(energy, rel=1e-12)
    assert hits > 500
    assert world.stats().counters["capped_impacts"] == 0

"""B20: an elastic gas. Energy alone proves nothing (a gas that misses collisions keeps it too), so the pressure on the
walls and the collision rate are compared with statistical mechanics."""

from __future__ import annotations

import math

import numpy as np
import pytest
from worlds import make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform

N, ETA, RADIUS = 400, 0.3, 0.5
BULK = 2.0632  # Z of hard discs at eta = 0.3, virial series of Clisby and McCoy
FINITE = 1.013  # in centre-accessible measures N = 400 stays within 1.3 % of the bulk
FINITE_RATE = 1.031  # the walls keep centres out of a layer of R, so the gas is denser by up to sigma / L
CAP = 100  # impacts of a body in a step: not what is judged here
RATE = 2.399  # collisions of each disc per unit time at kT = m = sigma = 1: 2 sqrt(pi) rho sigma g


def gas(dt, seed):
    """400 discs on a lattice in a square box, Gaussian velocities of mean zero scaled to kT = 1; thermal speed 1."""
    world = make_world(dt=dt, max_impacts_per_step=CAP)
    side = math.sqrt(N * math.pi / (4 * ETA))
    for axis in range(2):
        for edge, outwards in ((0.0, -1), (side, 1)):
            centre, half = np.full(2, side / 2), np.full(2, side)
            centre[axis], half[axis] = edge + outwards * 5.0, 5.0
            world.create_entity(Transform(centre), AABBCollider(half, restitution=1.0))
    cells = np.stack(np.meshgrid(*[(np.arange(20) + 0.5) * side / 20] * 2), axis=-1).reshape(-1, 2)
    velocity = np.random.default_rng(seed).normal(size=(N, 2))
    velocity -= velocity.mean(axis=0)
    velocity *= math.sqrt(2 * N / (velocity**2).sum())
    world.create_entities(
        N,
        Transform.many(cells),
        RigidBody.many(mass=1.0, linear_velocity=velocity),
        SphereCollider.many(radius=RADIUS, restitution=1.0),
    )
    return world, side


def measure(dt, seconds, seed=1, discard=20):
    """Z from the impulses on the walls, collisions per disc and second, drift of the energy, deepest overlap."""
    world, side = gas(dt, seed)
    energy = world.kinetic_energy()
    warm_up = int(discard / RATE / dt)
    wall, hits, deepest, drift = 0.0, 0, 0.0, 0.0
    steps = int(seconds / dt)
    for step in range(warm_up + steps):
        world.step()
        drift = max(drift, abs(world.kinetic_energy() / energy - 1))
        if step < warm_up:
            continue
        impacts, contacts = world.contacts.impacts, world.contacts
        on_wall = impacts.entity_a <= 4
        wall += impacts.normal_impulse[on_wall].sum()
        hits += np.count_nonzero(~on_wall)
        if len(contacts):
            deepest = max(deepest, contacts.depth.max())
    seconds = steps * dt
    z = wall * (side - 2 * RADIUS) / (4 * seconds * N)
    position = world.bodies.dynamic.position
    inside = ((position > 0) & (position < side)).all()
    assert inside, "a body has escaped"
    assert len(position) == N
    assert world.stats().counters["capped_impacts"] == 0
    return z, 2 * hits / N / seconds, drift, deepest


@pytest.mark.parametrize("dt", [0.3, 0.1, 0.03])
def test_pressure_and_rate_of_an_elastic_gas(dt):
    """v dt / sigma = dt. Energy to 1e-12. Z and the rate may fall short by 2 v dt / sigma (B20), never exceed.

    Noise: 24 s are 11,500 collisions and 2,200 hits on walls; relative error of Z 2 / sqrt(11500), 3 sigma: 5.6 %.
    """
    z, rate, drift, _ = measure(dt, 24.0)
    noise = 0.056
    assert drift < 1e-12
    assert BULK * (1 - 2 * dt - noise) < z < BULK * (FINITE + noise)
    assert RATE * (1 - 2 * dt - noise) < rate < RATE * (FINITE_RATE + noise)


@pytest.mark.slow
@pytest.mark.parametrize("dt", [0.3, 0.1, 0.03, 0.01])
def test_pressure_and_rate_with_many_collisions(dt):
    """The same over 5 seeds and 100,000 collisions: noise of Z 3 * 2 / sqrt(1e5) = 1.9 %, of the rate less."""
    seconds = 1e5 / 5 / (N * RATE / 2)
    runs = np.array([measure(dt, seconds, seed) for seed in range(5)])
    z, rate, drift, deepest = runs[:, 0].mean(), runs[:, 1].mean(), runs[:, 2].max(), runs[:, 3].max()
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

"""B20 with impacts at their true time: pressure and collision rate of an elastic gas do not depend on the step."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_gas import FINITE_RATE, RADIUS, RATE, REFERENCE, gas, measure
from helpers_modes import MODES, each_mode

pytestmark = pytest.mark.early

# v dt / sigma = dt: up to a third of a disc in a step.


@each_mode
@pytest.mark.parametrize("dt", [0.3, 0.1])
def test_pressure_and_rate(mode, dt):
    """30,000 collisions: 3 sigma of Z are 3.5 %; energy to 1e-11; nothing rests, so no overlap but rounding."""
    world, side = gas(dt, seed=1, collision=mode, max_impacts_per_step=1000)
    found = measure(world, side, 62.0)
    assert found.collisions > 28_000
    assert found.drift < 1e-11
    assert abs(found.z / REFERENCE - 1) < 0.035
    assert RATE * (1 - 0.02) < found.rate < RATE * (FINITE_RATE + 0.02)
    assert found.deepest < 1e-12


@pytest.mark.long
@pytest.mark.parametrize(("mode", "dt"), [
    ("continuous", 0.3), ("event_driven", 0.3), ("event_driven", 0.1), ("continuous", 0.03), ("event_driven", 0.01),
])  # fmt: skip
def test_pressure_and_rate_with_many_collisions(mode, dt):
    """Three seeds, 120,000 collisions: 3 sigma are 1.7 %, and 0.3 % are left for the method: 2 % together."""
    runs = []
    for seed in range(3):
        world, side = gas(dt, seed, collision=mode, max_impacts_per_step=1000)
        runs.append(measure(world, side, 83.0))
    z, rate = np.mean([run.z for run in runs]), np.mean([run.rate for run in runs])
    drift, deepest = max(run.drift for run in runs), max(run.deepest for run in runs)
    print(f"{mode}, v dt/sigma {dt}: Z {z:.4f}, rate {rate:.4f}, drift {drift:.1e}, deepest overlap {deepest:.1e}")
    assert sum(run.collisions for run in runs) > 114_000
    assert drift < 1e-11
    assert abs(z / REFERENCE - 1) < 0.02
    assert RATE * (1 - 0.01) < rate < RATE * (FINITE_RATE + 0.01)


@pytest.mark.parametrize("mode", MODES)
def test_velocities_at_impact_and_in_the_end(mode):
    """<v_n^2> = 4 kT / m where two discs meet, kurtosis of a component 3, each within 3 sigma."""
    world, _ = gas(0.1, seed=3, collision=mode)
    squares, fourth, second = [], [], []
    for step in range(340):
        world.step()
        if step < 80:
            continue
        impacts = world.contacts.impacts
        between = impacts.entity_a > 4
        squares.append(impacts.normal_impulse[between] ** 2)  # J = m v_n at e = 1 and equal masses
        if step % 9 == 0:
            v = world.bodies.dynamic.linear_velocity
            fourth.append((v**4).mean())
            second.append((v**2).mean())
    assert np.concatenate(squares).mean() == pytest.approx(4.0, abs=12 / math.sqrt(12000))
    assert np.mean(fourth) / np.mean(second) ** 2 == pytest.approx(3.0, abs=0.19)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_energy_over_a_million_impacts(mode):
    """10,000 discs: constant to 1e-12; each disc has 200 impacts of a few eps, at random."""
    world, _ = gas(0.1, seed=7, n=10_000, collision=mode, max_impacts_per_step=1000)
    energy, impacts, steps = world.kinetic_energy(), 0, 0
    while impacts < 1_000_000:
        world.step()
        impacts += len(world.contacts.impacts)
        steps += 1
        assert steps < 2000
    assert abs(world.kinetic_energy() / energy - 1) < 1e-12
    position = world.bodies.dynamic.position
    assert (position > RADIUS - 1e-9).all()

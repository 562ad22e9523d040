"""Law of sleep: it takes no momentum away."""

from __future__ import annotations

import numpy as np
import pytest
from laws.helpers_laws import MODES, seeds
from worlds import ball, box, make_world


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("seed", seeds(3, 40))
def test_what_slides_on_ice_goes_on(seed, mode):
    """Boxes with one or two on top, each stack at a speed of its own, 1e-4 to 1 m/s: after ten seconds all have it."""
    random = np.random.default_rng([seed, 17])
    d = int(random.integers(2, 4))
    with make_world(d, 9.81, collision=mode, sleeping=True) as world:
        box(world, np.zeros(d), half=(500.0, 0.5, 5.0)[:d], kind="static")
        speeds, stacks = 10 ** random.uniform(-4, 0, 8) * random.choice([-1, 1], 8), random.integers(1, 4, 8)
        for k, (speed, stack) in enumerate(zip(speeds, stacks, strict=True)):
            for level in range(stack):
                place, velocity = np.zeros(d), np.zeros(d)
                place[:2], velocity[0] = (50.0 * k - 200.0, 1.0 + level), speed
                maker = box if random.random() < 0.8 or level + 1 < stack else ball
                maker(world, place, velocity, mass=10 ** random.uniform(-1, 1))
        before = world.momentum()[0]
        for _ in range(600):
            world.step()
        moving = world.bodies.dynamic
        assert not moving.asleep.any()
        assert moving.linear_velocity[:, 0] == pytest.approx(np.repeat(speeds, stacks), rel=1e-9)
        assert world.momentum()[0] == pytest.approx(before, rel=1e-9)

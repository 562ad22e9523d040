"""Laws of what is struck by things that cannot be moved at the same time: its state stays finite."""

from __future__ import annotations

import numpy as np
import pytest
from worlds import ball, box, make_world

MODES = ("discrete", "continuous", "event_driven")


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("maker", [ball, box])
def test_two_plates_meet_a_body_at_the_same_time(mode, e, maker):
    """Impulses of the two plates cancel each other, however high they are: there is no solution, and no nan."""
    world = make_world(2, 0.0, collision=mode, dt=1 / 64, on_fault="ignore")
    for side in (-1.0, 1.0):
        box(world, (side * 1.75, 0.0), (-side * 32.0, 0.0), half=(1.0, 2.0), kind="kinematic", restitution=e)
    maker(world, (0.0, 0.0), restitution=e)
    for _ in range(3):
        world.step()
        assert np.isfinite(world.bodies.position).all()
        assert np.isfinite(world.bodies.linear_velocity).all()

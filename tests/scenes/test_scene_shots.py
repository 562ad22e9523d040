"""The scene ``shots``: fast balls in each collision mode, against their exact positions."""

from __future__ import annotations

import numpy as np
import pytest

from carom.framework import Settings
from carom.scenes import shots

STEPS = 6
STEP = shots.SPEED / 60  # metres
FLOWN = shots.START + STEP * STEPS  # free flight
FREE = shots.APART - 2 * shots.RADIUS  # between the plates
ROUNDING = 1e-12 * shots.END


def after_six_steps(**settings):
    """{lane: positions (balls, 2) from the left to the right at the start}, and the world."""
    world = shots.build(Settings(**settings))
    heights = world.bodies.dynamic.position[:, 1].copy()
    for _ in range(STEPS):
        world.step()
    positions = world.bodies.dynamic.position.copy()
    world.close()
    return {height: positions[heights == height] for height in np.unique(heights)}, world


def to_and_fro(way):
    """The height of the ball between the plates after a path of ``way`` metres down and up."""
    phase = (way + FREE / 2) % (2 * FREE)
    return shots.PLATES + FREE / 2 - min(phase, 2 * FREE - phase)


@pytest.mark.parametrize("mode", ["continuous", "event_driven"])
@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "velocity_verlet", "rk4"])
def test_what_sweeps_finds_every_ball_where_it_must_be(mode, integrator):
    """Reflections at planes, balls as points that pass through each other, one normal of (7, 24) / 25."""
    lanes, world = after_six_steps(collision=mode, integrator=integrator)
    post = np.array((shots.POST, shots.GRAZE - shots.OFF_CENTRE))
    touch = post + (shots.POST_RADIUS + shots.RADIUS) * np.array((-7, 24)) / 25
    gone = STEP * STEPS - (touch[0] - shots.START)
    expected = {
        shots.GRAZE: [touch + gone * np.array((527, 336)) / 625],
        shots.WALL: [(2 * (shots.WALL_FACE - shots.RADIUS) - FLOWN, shots.WALL)],
        shots.HEAD_ON: [
            (shots.OPPOSITE - STEP * STEPS - 2 * shots.RADIUS, shots.HEAD_ON),
            (FLOWN + 2 * shots.RADIUS, shots.HEAD_ON),
        ],
        shots.GHOST: [(2 * (shots.SHIELD_FACE - shots.RADIUS) - FLOWN, shots.GHOST), (shots.TARGET, shots.GHOST)],
        shots.FREE: [(FLOWN, shots.FREE)],
        shots.PLATES: [(FLOWN, to_and_fro(STEP * STEPS))],
    }
    for height, places in expected.items():
        np.testing.assert_allclose(lanes[height], places, rtol=0, atol=ROUNDING)
    assert not world.faults


def test_discrete_passes_through_thin_things_and_meets_a_ghost():
    """All fly on but the ball found inside the target, which takes its velocity, past the shield."""
    lanes, world = after_six_steps(collision="discrete")
    met = shots.TARGET - shots.TARGET_RADIUS - shots.RADIUS
    expected = {
        shots.GRAZE: [(FLOWN, shots.GRAZE)],
        shots.WALL: [(FLOWN, shots.WALL)],
        shots.HEAD_ON: [(FLOWN, shots.HEAD_ON), (shots.OPPOSITE - STEP * STEPS, shots.HEAD_ON)],
        shots.GHOST: [(met, shots.GHOST), (shots.TARGET + FLOWN - met, shots.GHOST)],
        shots.FREE: [(FLOWN, shots.FREE)],
        shots.PLATES: [(FLOWN, shots.PLATES - STEP * STEPS)],
    }
    for height, places in expected.items():
        np.testing.assert_allclose(lanes[height], places, rtol=0, atol=ROUNDING)
    (fault,) = world.faults
    assert "so fast that discrete collisions may miss what it passes" in fault

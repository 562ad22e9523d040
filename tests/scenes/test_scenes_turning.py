"""Scenes whose bodies turn: spin in billiards, flippers, dominoes, a tumbler, rubble."""

from __future__ import annotations

import numpy as np
import pytest

from carom.scenes import billiards_spin, dominoes, flipper, rubble, tumbler


def steps(world, seconds):
    for _ in range(round(seconds / world.settings.dt)):
        world.step()


def test_cue_balls_follow_stop_and_come_back_with_two_sevenths_of_their_speed():
    """Of a ball that slides without a velocity and with spin w the cloth makes one that rolls with 2/7 w r."""
    with billiards_spin.build() as world:
        steps(world, 1.0)
        balls = world.bodies.dynamic
        order = np.argsort(balls.entity)
        speeds, spins = balls.linear_velocity[order, 0], balls.spin.angular_velocity[order]
    sevenths = np.array([2, 5, 0, 5, -2, 5]) / 7 * billiards_spin.SPEED
    np.testing.assert_allclose(speeds, sevenths, rtol=0, atol=1e-3 * billiards_spin.SPEED)
    np.testing.assert_allclose(-spins * billiards_spin.RADIUS, sevenths, rtol=0, atol=1e-3 * billiards_spin.SPEED)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_the_flippers_throw_and_no_ball_is_lost(seed):
    """All balls stay above the flippers' tips, and are thrown to the upper half again and again."""
    with flipper.build(seed=seed) as world:
        lowest, thrown, up, high = np.inf, 0, 0.0, np.zeros(flipper.BALLS, bool)
        for _ in range(round(10 / world.settings.dt)):
            world.step()
            heights = world.bodies.dynamic.position[:, 1]
            lowest = min(lowest, heights.min())
            low = heights < 3.0
            thrown += int((high & low).sum())
            high = (high | (heights > flipper.HEIGHT / 2)) & ~low
            angles = np.abs(world.bodies.kinematic.rotation)
            up = max(up, angles.max())
            assert (angles <= flipper.UP + 1e-9).all()
        inside = world.bodies.dynamic.position
    assert lowest > 0.8
    assert thrown >= 4
    assert up == pytest.approx(flipper.UP, abs=1e-9)
    assert ((inside > 0) & (inside < (flipper.WIDTH, flipper.HEIGHT))).all()


def test_all_dominoes_fall_one_after_the_other():
    with dominoes.build(n=20) as world:
        fallen = np.full(20, np.inf)
        for _ in range(480):
            world.step()
            order = np.argsort(world.bodies.dynamic.entity)
            angles = world.bodies.dynamic.rotation[order]
            fallen = np.where((angles < -0.3) & np.isinf(fallen), world.time, fallen)
    assert (np.diff(fallen) > 0).all()
    assert angles[:-1] == pytest.approx(angles[8], abs=0.1)  # each leans on the next one
    assert angles[-1] == pytest.approx(-np.pi / 2, abs=0.01)


def test_the_tumbler_carries_its_boxes_up_and_loses_none():
    with tumbler.build(n=40) as world:
        highest = -np.inf
        steps(world, 3.0)  # they have fallen
        for _ in range(540):
            world.step()
            boxes = world.bodies.dynamic.position
            highest = max(highest, boxes[:, 1].max())
            assert np.hypot(*boxes.T).max() < np.sqrt(2) * tumbler.HALF
        turn = world.bodies.kinematic.rotation
    np.testing.assert_allclose(turn, 12.0 * tumbler.TURN, rtol=1e-9)
    assert highest > -3.0  # the bottom is at -12, or the corner at -17


@pytest.mark.slow
def test_what_bears_the_others_in_a_tumbler_keeps_its_shape():
    """The deepest overlap of boxes of 0.5 m, in half of the steps: below 0.07 m as a mean of three sizes, each of which
    is off by a fifth by chance."""
    medians = []
    for n in (600, 800, 1000):
        with tumbler.build(n=n) as world:
            deepest, walls = [], world.bodies.kinematic.entity
            for step in range(360):
                world.step()
                if step >= 120 and step % 5 == 0:
                    contacts = world.contacts
                    boxes = ~(np.isin(contacts.entity_a, walls) & np.isin(contacts.entity_b, walls))
                    deepest.append(contacts.depth[boxes].max())
            medians.append(np.median(deepest))
    assert np.mean(medians) < 0.07


@pytest.mark.slow
def test_rubble_comes_to_rest():
    with rubble.build(n=60) as world:
        steps(world, 20.0)
        bodies = world.bodies.dynamic
        assert world.kinetic_energy() < 1e-4  # some box may rock on a ball, which nothing damps
        assert (bodies.position > 0).all()
        assert world.contacts.depth.max() < 0.05

"""Swarm, played to both of its ends, and with any keys."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from helpers_games import fuzz, load, recorded

swarm = load("swarm")


@pytest.mark.slow
def test_recorded_keys_kill_the_queen():
    world = swarm.play(islice(recorded("swarm.keys"), 30), waves=3)
    game, most = swarm.game_of(world), 0
    for held in islice(recorded("swarm.keys"), 30, 60 * 60):
        swarm.play([held], world)
        most = max(most, len(world.bodies.dynamic))
        if game.state != "play":
            break
    assert (game.state, game.wave) == ("won", 7)
    assert min(most / 150, game.kills / 300, game.level / 6) > 1
    assert 50 < game.health <= 100
    assert not world.faults
    gems = game.gems
    swarm.play([{"right"}] * 30, world)  # nothing goes on
    assert (game.gems, game.state) == (gems, "won")


@pytest.mark.slow
def test_who_stands_still_is_overrun():
    world = swarm.play([{"space"}])
    game = swarm.game_of(world)
    while game.state == "play" and world.time < 90:
        swarm.play([set()], world)
    assert (game.state, game.wave) == ("over", 3)


@pytest.mark.slow
def test_the_horde_has_a_most_and_the_guns_a_rate():
    world = swarm.play([{"space"}])
    game = swarm.game_of(world)
    game.health, game.rate = 1e9, swarm.FASTEST
    swarm.come(world, game, np.zeros(5000, int))
    assert len(world.bodies.dynamic) == swarm.MOST
    shots = game.shots
    swarm.play([set()] * 60, world)
    assert game.shots - shots == pytest.approx(600)
    assert world.bodies.has(swarm.Bullet).sum() > 300  # of 480 that live, less those that hit


def check(world):
    game, bodies = swarm.game_of(world), world.bodies
    assert np.isfinite(np.hstack([bodies.position, bodies.linear_velocity])).all()
    assert len(bodies.dynamic) <= swarm.MOST
    assert game.health <= 100.0
    assert (game.state == "over") == (game.health <= 0.0)
    fading = bodies.has(swarm.Fades)
    late = bodies.fades.until[fading] <= world.time - 0.1
    assert game.state != "play" or not late.any()  # what is over is gone in the step that follows


@pytest.mark.slow
def test_any_keys_for_4_seconds():
    fuzz(swarm, 4, check)


@pytest.mark.long
def test_any_keys_for_10_minutes():
    assert fuzz(swarm, 600, check, seed=1) > 3

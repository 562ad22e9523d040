"""Siege, played to its end, by two over a network, and with any keys."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from helpers_games import fuzz, load, recorded

siege = load("siege")


def test_recorded_keys_bring_down_a_king():
    world = siege.play(islice(recorded("siege.keys"), 630))
    game = siege.game_of(world)
    assert (game.state, game.winner) == ("over", 0)
    kings = [solid.king for _, solid in world.get_component(siege.Solid) if solid.king >= 0]
    assert kings == [0]
    assert 60 < siege.compared(world)["stones"] < 130  # of 152
    assert not world.faults


@pytest.mark.slow
def test_castles_stand_until_something_hits_them():
    world = siege.play([set()] * 600)
    assert siege.compared(world) == {"winner": -1, "stones": 152}
    assert world.bodies.dynamic.asleep.sum() > 150
    assert siege.game_of(world).state == "title"


@pytest.mark.slow
def test_two_peers_over_the_network_have_the_same_world():
    random, frames, peers = np.random.default_rng(3), 180, [siege.Peer(0, port=0, rows=3)]
    peers.append(siege.Peer(1, "localhost", peers[0].link.getsockname()[1], rows=3))
    held = [0, 0]
    for tick in range(10 * frames):
        for peer in peers:
            for bit in range(4):
                held[peer.number] ^= (random.random() < 0.04) << bit
            if peer.rollback.frame < frames:
                peer.play(held[peer.number])
            if tick % (5, 3)[peer.number] == 0:  # they look into the post now and then
                peer.hear()
            if random.random() < 0.6:  # the other packets are lost
                peer.tell()
        if all(peer.rollback.confirmed == frames for peer in peers):
            break
    for peer in peers:
        peer.rollback.settle()
        peer.link.close()
        assert peer.rollback.frame == peer.rollback.confirmed == frames
        assert (peer.compared > 20, peer.differs) == (True, False)
        assert peer.rollback.replayed > 50
    assert peers[0].world.state_hash() == peers[1].world.state_hash()


def check(world):
    bodies, game = world.bodies, siege.game_of(world)
    assert np.isfinite(np.hstack([bodies.position, bodies.linear_velocity])).all()
    kings = {solid.king for _, solid in world.get_component(siege.Solid)} - {-1}
    assert (game.state == "over") == (len(kings) < 2) == (game.winner >= 0)
    assert len(bodies) < 700
    for _, catapult in world.get_component(siege.Catapult):
        assert (catapult.state != "empty") == world.entity_exists(catapult.sling)


@pytest.mark.slow
def test_any_keys_for_4_seconds():
    fuzz(siege, 4, check)


@pytest.mark.long
def test_any_keys_for_10_minutes():
    assert fuzz(siege, 600, check, seed=1) > 3

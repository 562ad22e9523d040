"""Cave run, played to the end of the cave, from a file, and with any keys."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from helpers_games import fuzz, load, recorded

from carom import maps

cave = load("cave_run")


def hero_of(world):
    ((entity, (me, transform, _)),) = world.get_components(cave.Character, cave.Transform, cave.Hero)
    return entity, me, transform


def put(world, x, y):
    """The hero there, once nothing of the place before is left in what it knows."""
    _, me, transform = hero_of(world)
    transform.position, me.velocity = (x, y), (0.0, 0.0)
    cave.play([set()] * 2, world)


def test_recorded_keys_lead_out_of_the_cave():
    world, saved = cave.build(keys=None), []
    world.on("saved", lambda: saved.append(world.time))
    game = cave.game_of(world)
    for held in islice(recorded("cave_run.keys"), 60 * 90):
        cave.play([held], world)
        if game.state != "play":
            break
    assert (game.state, game.lives) == ("won", 5)
    assert game.coins >= 10
    assert len(saved) == 5
    assert not world.faults


@pytest.mark.slow
def test_a_saved_game_goes_on_with_the_same_bits(tmp_path):
    world = cave.build(keys=None)
    cave.play([{"right"}] * 10, world)
    put(world, 39.5, 10.7)
    cave.play([{"right"}] * 20, world)
    assert cave.game_of(world).x > 40  # at the first flag
    world.save(tmp_path / "cave.carom")
    again = cave.loaded(tmp_path / "cave.carom", world.get_processor(cave.Act).level)
    keys = [{"right"}] * 30 + [{"right", "space"}] * 30 + [{"left"}] * 60
    hashes = {cave.play(keys, each).state_hash() for each in (world, again)}
    assert len(hashes) == 1
    assert cave.compared(again)["coins"] == cave.compared(world)["coins"]
    assert np.array_equal(cave.compared(again)["hero"], cave.compared(world)["hero"])


@pytest.mark.slow
def test_boots_spikes_walkers_and_the_switch():
    world = cave.play([{"right"}])
    game, (_, me, transform) = cave.game_of(world), hero_of(world)
    walker, others = (each for each in (world.get_component(cave.Walker)[0][0], world.get_component(cave.Walker)))
    place = world.component_for_entity(walker, cave.Transform)
    put(world, place.x, place.y + 1.8)
    cave.play([set()] * 15, world)
    assert not world.entity_exists(walker)
    assert (game.lives, len(world.get_component(cave.Walker))) == (5, len(others) - 1)
    assert me.velocity[1] > 3.0  # it bounces
    second = world.get_component(cave.Walker)[0][0]
    place = world.component_for_entity(second, cave.Transform)
    put(world, place.x + 1.5, place.y + 0.26)
    cave.play([{"left"}] * 30, world)
    assert game.lives == 4  # from the side
    assert np.allclose(transform.position, (game.x, 10.61), atol=2.5)  # near where it began
    put(world, 29.0, 7.0)
    cave.play([set()] * 60, world)
    assert game.lives == 3  # spikes
    ((_, (_, door)),) = world.get_components(cave.Door, cave.AABBCollider)
    assert door.enabled
    put(world, 116.8, 11.8)
    cave.play([set()] * 20, world)
    assert not door.enabled
    put(world, 119.0, 11.8)
    cave.play([set()] * 5, world)
    assert door.enabled


@pytest.mark.slow
def test_walkers_turn_and_the_map_has_no_mistake():
    assert maps.check(cave.MAP, cave.COMPONENTS) == []
    world = cave.build(keys=None)
    places = []
    for _ in range(20):
        cave.play([set()] * 30, world)
        places.append([place.position.copy() for _, (_, place) in world.get_components(cave.Walker, cave.Transform)])
    places = np.array(places)
    assert (places[:, :, 1] > (24.3, 24.3, 11.3, 11.3, 11.3)).all()  # none has fallen from its floor
    ways = np.sign(np.diff(places[:, :, 0], axis=0))
    assert (ways.min(axis=0) < ways.max(axis=0)).sum() >= 2  # some have turned


def check(world):
    game, (_, me, transform) = cave.game_of(world), hero_of(world)
    assert np.isfinite(world.bodies.position).all()
    assert (game.state == "over") == (game.lives == 0)
    assert game.coins + len(world.get_component(cave.Coin)) == 54
    size, place = world.get_processor(cave.Act).level.size, transform.position
    assert (place > -5).all() and (place < np.array(size) + 5).all()  # noqa: PT018
    inside = world.overlaps(cave.AABBCollider((0.35, 0.55)), place, exclude=hero_of(world)[0])
    static = [hit for hit in inside if world.has_component(hit.entity, cave.tile_grid.TileGridCollider)]
    assert not static or static[0].depth < 0.02  # never in the rock
    assert me.state in ("air", "floor", "steep", "climb")


@pytest.mark.slow
def test_any_keys_for_4_seconds():
    fuzz(cave, 4, check)


@pytest.mark.long
def test_any_keys_for_10_minutes():
    fuzz(cave, 600, check, seed=1)

"""The scene library: the protocol, the published generator, and the behaviour of each scene."""

from __future__ import annotations

import itertools
import math
import re
import runpy
import shutil
from pathlib import Path

import numpy as np
import pytest
from helpers_scenes import published_numbers

from carom import scenes
from carom.components import Transform
from carom.framework import Settings, World
from carom.scenes import conveyor, jump, player
from carom.scenes.random_numbers import uniform

WITHOUT_CHANCE = {  # any seed gives the same world
    "few", "jump", "pyramid", "stack", "lift", "cradle", "galperin", "shots",
    "spring", "orbit", "bouncing", "oblique", "drops", "billiards_spin", "dominoes", "tumbler", "car", "crane",
}  # fmt: skip


@pytest.mark.parametrize("count", [0, 1, 2, 3, 1000, 4097])
def test_random_numbers_are_the_published_sequence(count):
    for seed in (0, 7):
        assert uniform(count, seed).tolist() == list(itertools.islice(published_numbers(seed), count))


def test_names_and_get():
    assert {"jump", "asteroids", "billiards", "gas2d", "gas3d", "player"} | WITHOUT_CHANCE < set(scenes.names())
    with pytest.raises(KeyError, match=r"no scene named 'moon'.*gas2d"):
        scenes.get("moon")


@pytest.mark.slow
def test_every_scene_has_a_row_in_the_manual_with_its_bodies():
    page = (Path(__file__).resolve().parents[2] / "docs" / "scenes.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| [^|]+ \| ([\d,]+) \|", page, re.MULTILINE)
    assert [name for name, _ in rows] == list(scenes.names())
    for name, count in rows:
        with scenes.get(name).build() as world:
            bodies = conveyor.CRATES if name == "conveyor" else len(world.bodies.dynamic)
            assert int(count.replace(",", "")) == bodies


@pytest.mark.parametrize("name", scenes.names())
class TestEveryScene:
    def test_keeps_the_protocol_and_a_copy_of_its_file_is_the_same_scene(self, name, tmp_path):
        scene = scenes.get(name)
        settings = Settings.balanced().replace(substeps=3)
        copy = runpy.run_path(shutil.copy(getattr(scenes, name).__file__, tmp_path))
        assert (copy["SECONDS"], copy["VIEW"]) == (scene.seconds, scene.view)
        first, other = (scene.build(settings, seed=seed) for seed in (5, 6))
        again = copy["build"](settings, seed=5)
        assert scene.name == name
        assert 0 < len(scene.description) < 90
        assert "\n" not in scene.description
        assert scene.seconds > 0
        assert isinstance(first, World)
        assert first.settings == settings
        assert first.dimensions == scene.dimensions
        if name == "conveyor":  # empty at the start: the first crate is a body from the second step on
            for world in (first, again, other):
                world.step()
                world.step()
        views = [world.bodies for world in (first, again, other)]
        state, same, others = ([bodies.position.tolist(), bodies.linear_velocity.tolist()] for bodies in views)
        assert state == same
        assert (state == others) == (name in WITHOUT_CHANCE)

    def test_has_its_settings_and_bodies_that_start_and_stay_in_view(self, name):
        scene = scenes.get(name)
        world = scene.build()
        assert world.settings == scene.settings
        lower, upper = np.array(scene.view)
        for _ in range({"fastgas": 1, "shots": 6}.get(name, 20)):  # bodies leave the box in fastgas
            positions = world.bodies.dynamic.position
            assert np.all((positions > lower) & (positions < upper))
            world.step()


def test_the_hero_lands_six_tiles_further_on_the_ground():
    world = scenes.get("jump").build()
    while world.time < 1.2:
        world.step()
    x, y = world.bodies.dynamic.position[0]
    assert y == pytest.approx(jump.HALF_HEIGHT, abs=0.05 * jump.TILE)
    assert x == pytest.approx(jump.RUN_SPEED * world.time, rel=1e-9)  # nothing on the way, no friction


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "steps"),
    [("asteroids", 300), ("gas2d", 120), ("gas3d", 30), ("mixed2d", 120), ("maze", 120), ("static_world", 120)],
)
def test_elastic_scenes_keep_their_energy(name, steps):
    """In gas3d a wall has more impacts in a step than the cap of a body: walls have no cap."""
    world = scenes.get(name).build()
    before, impacts = world.kinetic_energy(), 0
    for _ in range(steps):
        world.step()
        impacts += len(world.contacts.impacts)
    assert impacts > 50
    assert world.kinetic_energy() == pytest.approx(before, rel=1e-11)


def test_the_break_hands_the_cue_balls_motion_on():
    world = scenes.get("billiards").build()
    before = world.kinetic_energy()
    while world.time < 0.5:
        world.step()
    speeds = np.linalg.norm(world.bodies.dynamic.linear_velocity, axis=1)
    assert (speeds > 0.05).sum() >= 12
    assert 0.2 * before < world.kinetic_energy() < before


def test_the_player_sees_what_brute_force_sees_and_pushes_what_it_meets():
    world = scenes.get("player").build()
    radar = next(system for system in world.systems if isinstance(system, player.Radar))
    assert len(world.bodies.dynamic) == player.OBJECTS + 1
    while world.time < 1.5:
        world.step()
    ids = np.asarray(world.bodies.entity)
    centre = world.component_for_entity(radar.player, Transform).position
    half_or_radius = 0.6  # the largest object's
    distance = np.linalg.norm(world.bodies.position - centre, axis=1)
    surely_near = set(ids[distance < player.RADAR_RADIUS].tolist())
    perhaps_near = set(ids[distance < player.RADAR_RADIUS + math.sqrt(2) * half_or_radius].tolist())
    walls = set(world.bodies.static.entity.tolist())
    assert surely_near <= set(radar.near) <= perhaps_near | walls
    pushed = np.linalg.norm(world.bodies.dynamic.linear_velocity, axis=1) > 0.1
    assert 1 < pushed.sum() < 2000

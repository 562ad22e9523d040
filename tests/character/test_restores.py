"""Characters go on to the bit: after a restore, from a file, after a failed step; without any nothing runs."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_character import FIGURES, G, Stage, each_dimension, plugins_of, vector, world_of

from carom import AABBCollider, RigidBody, SphereCollider, TileGridCollider, Transform, World
from carom.framework import StepError
from carom.plugins.character import Character

pytestmark = pytest.mark.slow  # its kernels take long to compile


def crowd(d, count=100):
    """Characters of random wishes on a floor with steps, lifts and crates."""
    figure = FIGURES["capsule 2D" if d == 2 else "capsule 3D"]
    stage, rng = Stage(figure, x=-45.0), np.random.default_rng(d)
    for k in range(6):
        stage.box((5 * k, 0), (5 * k + 1, 0.2))
        stage.mover(5 * k - 20.0, 0.5, (1.0, 0.2), linear_velocity=vector(d, 0.0, 0.5))
        stage.crate(5 * k - 22.5, 0.5)
    heroes = [stage.character(*rng.uniform((-20, 1, -20), (40, 3, 20))) for _ in range(count)]
    return stage, heroes


@pytest.mark.parametrize("d", [2, 3])
def test_going_back_repeats_a_hundred_characters_to_the_bit(d):
    stage, heroes = crowd(d)
    world, rng = stage.world, np.random.default_rng(9)
    for _ in range(20):
        world.step()
    wishes = rng.uniform(-4, 4, (8, 100, 3))

    def play():
        hashes = []
        for step in range(8):
            for k, entity in enumerate(heroes):
                me = world.component_for_entity(entity, Character)
                me.move, me.jump = (wishes[step, k, 0] if d == 2 else wishes[step, k]), wishes[step, k, 1] > 2.0
            world.step()
            hashes.append(world.state_hash())
        return hashes

    kept = world.snapshot()
    first = play()
    world.restore(kept)
    assert play() == first


@pytest.mark.parametrize("seed", range(3))
def test_on_tiles_they_go_on_to_the_bit_after_one_of_them_has_gone_far(seed, tmp_path):
    """From a snapshot, in another world and from a file: a step does not know what was cast before it."""
    rng = np.random.default_rng(seed)
    heights = 8 + np.cumsum(rng.integers(-1, 2, 60)).clip(-6, 6)
    world, figure = world_of(2), FIGURES["capsule 2D"]
    world.create_entity(Transform((0, 0)), TileGridCollider(np.arange(30)[::-1, None] < heights, 1.0, lower=(0, 0)))

    def create(x, y, **character):
        body = RigidBody(kind="kinematic"), figure.collider(layer=2, mask=1), Character(**character)
        return world.create_entity(Transform((x, y)), *body)

    for x in rng.uniform(3, 57, 10):
        create(x, heights[int(x)] + 0.9, move=rng.choice((-2.0, 2.0)))
    bird = create(-500.0, 25.0, gravity=0.0, acceleration=1e6, air_acceleration=1e6, max_fall=1000.0)
    for step in range(60):
        world.component_for_entity(bird, Character).move = 600.0 if step < 50 else 0.0
        world.step()
    world.save(tmp_path / "tiles")
    other = world_of(2)
    other.restore(world.snapshot())
    worlds, hashes = (world, other, World.load(tmp_path / "tiles", *plugins_of(2, G))), []
    for each in worlds:
        for _ in range(100):
            each.step()
        hashes.append(each.state_hash())
        each.close()
    assert len(set(hashes)) == 1


@each_dimension
def test_a_jump_goes_on_from_a_file_to_the_bit(figure, tmp_path):
    stage = Stage(figure, jump_cut=0.5, air_jumps=1)
    stage.box((-1, 4), (1, 5))
    stage.run(2)
    stage.run(12, lambda step: (stage.move(1.0), setattr(stage.me, "jump", True)))
    assert stage.me.state == "air"
    stage.world.save(tmp_path / "jump")
    hashes = []
    for world in (stage.world, World.load(tmp_path / "jump", *plugins_of(figure.d, G))):
        me = world.component_for_entity(stage.hero, Character)
        for step in range(60):
            me.jump, me.move = step % 20 < 5, 2.0 if figure.d == 2 else (2.0, 0.0, 0.0)
            world.step()
        hashes.append(world.state_hash())
    assert hashes[0] == hashes[1]


def test_in_a_wall_it_is_crushed_in_every_step_as_after_a_restore():
    """What it does follows from where it is: not from whether anything has changed since the last step."""
    world = world_of(2)
    wall = world.create_entity(Transform((0, -1)), AABBCollider(1.0))
    entity = world.create_entity(Transform((0.95, -1)), RigidBody(kind="kinematic"), FIGURES["capsule 2D"].collider(),
                                 Character())  # fmt: skip
    for _ in range(3):
        snapshot = world.snapshot()
        world.step()
        after = world.state_hash()
        assert world.component_for_entity(entity, Character).crushed == wall
        world.restore(snapshot)
        world.step()
        assert world.state_hash() == after
    world.close()


@each_dimension
def test_a_world_that_fails_in_a_step_goes_on_to_the_bit(figure):
    """A handler that raises rolls the step back, what the characters know as well."""
    hashes = []
    for fails in (True, False):
        stage = Stage(figure, y=0.1)
        stage.box((-5, -1), (5, 0))
        failures = []

        def fail(*what, fails=fails, failures=failures):
            if fails and not failures:
                failures.append(what)
                raise RuntimeError("once")

        stage.world.on("landed", fail)
        for _ in range(40):
            stage.move(1.0)
            try:
                stage.world.step()
            except StepError:
                stage.world.step()
        assert bool(failures) is fails
        hashes.append(stage.world.state_hash())
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize("d", [2, 3])
def test_without_a_character_nothing_of_it_runs(d):
    def runs(world):
        world.step()
        return "move_characters" in {each.kernel for each in world.plan().kernels}

    world = world_of(d)
    assert not runs(world)
    hero = world.create_entity(Transform((0.0,) * d), RigidBody(kind="kinematic"), SphereCollider(0.4), Character())
    assert runs(world)
    world.delete_entity(hero)
    assert not runs(world)

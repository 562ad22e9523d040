"""Filters of contacts: a one-way platform, made with ``contacts.enabled``."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
from helpers_filters import DT, listen
from worlds import floor, make_world, position, run, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform

ROOT = Path(__file__).resolve().parents[2]


def one_way_world(**settings):
    """The example's system, a platform whose upper side is at y = 2, and a floor."""
    example = runpy.run_path(str(ROOT / "examples" / "one_way_platform.py"), run_name="example")
    world = make_world(gravity=20.0, **settings)
    ground = floor(world)
    platform = world.create_entity(Transform((0, 1.75)), AABBCollider((2, 0.25)), example["Platform"]())
    world.add_system(example["OneWay"]())
    return world, ground, platform, example


@pytest.mark.parametrize("collider", [AABBCollider((0.4, 0.5)), SphereCollider(0.5)], ids=["box", "sphere"])
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_jump_through_a_platform_from_below_ends_on_it(collider, restitution):
    """Free flight up through it, for any gap at the end of a step; then at rest on it, with one begin."""
    world, _, platform, _ = one_way_world()
    world.component_for_entity(platform, AABBCollider).half_extents = (30, 0.25)
    players, speeds = [], 11 + 0.1 * np.arange(20)
    for k, speed in enumerate(speeds):
        shape = collider.copy()
        shape.restitution = restitution
        players.append(
            world.create_entity(Transform((2.5 * k - 25, 0.5)), RigidBody(linear_velocity=(0, speed)), shape)
        )
    told = listen(world)
    world.step()
    told.clear()
    for step in range(2, 33):  # nearly to their apexes, 3.5 to 4.8 m up
        world.step()
        for player, speed in zip(players, speeds, strict=True):
            assert velocity(world, player)[1] == pytest.approx(speed - 20 * DT * step, abs=1e-9)
    assert not [event for event in told if platform in event]
    run(world, 200)
    for player in players:
        assert position(world, player)[1] == pytest.approx(2.5, abs=0.01)
        assert abs(velocity(world, player)[1]) < 0.01
        assert [contact.entity_b for contact in world.contacts.of(player)] == [platform]
    if restitution == 0:
        begun = [event for event in told if event[0] != "stay" and platform in event]
        assert sorted(begun) == [("begin", platform, player) for player in players]


@pytest.mark.parametrize("speed", [9.5, 8.0, 7.0, 6.0])
def test_a_jump_that_does_not_reach_falls_back(speed):
    """If the feet are below its top at the apex, the body is not lifted: it falls back through it."""
    world, ground, platform, _ = one_way_world()
    player = world.create_entity(Transform((0, 0.5)), RigidBody(linear_velocity=(0, speed)), AABBCollider((0.4, 0.5)))
    top = 0.0
    for _ in range(200):
        world.step()
        top = max(top, position(world, player)[1])
    feet = top - 0.5
    expected = 2.5 if feet > 2.0 else 0.5
    assert position(world, player)[1] == pytest.approx(expected, abs=0.01)
    held_by = [contact.entity_b for contact in world.contacts.of(player)]
    assert held_by == [platform if feet > 2.0 else ground]


def test_a_body_on_it_may_drop():
    """For a fifth of a second platforms do not support the player: free fall at once, and down to the floor."""
    world, ground, platform, example = one_way_world()
    player = world.create_entity(Transform((1, 2.5)), RigidBody(), AABBCollider((0.4, 0.5)), example["Drops"]())
    run(world, 60)
    assert position(world, player)[1] == pytest.approx(2.5, abs=0.01)
    world.component_for_entity(player, example["Drops"]).until = world.time + 0.2
    start = velocity(world, player)[1]
    run(world, 6)
    assert velocity(world, player)[1] == pytest.approx(start - 20 * 6 * DT, rel=1e-12)
    run(world, 100)
    assert position(world, player)[1] == pytest.approx(0.5, abs=0.01)
    assert [contact.entity_b for contact in world.contacts.of(player)] == [ground]
    assert not world.contacts.of(platform)


def test_a_moving_platform_carries_and_lets_through():
    """A lift that is one-way: a player jumps up through it while it rises, lands, and rides at its speed."""
    world, _, still, example = one_way_world()
    world.delete_entity(still)
    lift = world.create_entity(
        Transform((0, 1.75)), RigidBody(kind="kinematic", linear_velocity=(0, 1)), AABBCollider((2, 0.25)),
        example["Platform"](),
    )  # fmt: skip
    player = world.create_entity(Transform((0, 0.5)), RigidBody(linear_velocity=(0, 14)), AABBCollider((0.4, 0.5)))
    run(world, 240)
    assert position(world, lift)[1] == pytest.approx(1.75 + 4, abs=1e-9)
    assert position(world, player)[1] - position(world, lift)[1] == pytest.approx(0.75, abs=0.01)
    assert velocity(world, player)[1] == pytest.approx(1.0, abs=0.01)


def test_the_example_runs(capsys):
    runpy.run_path(str(ROOT / "examples" / "one_way_platform.py"), run_name="__main__")
    assert "stands on the platform" in capsys.readouterr().out

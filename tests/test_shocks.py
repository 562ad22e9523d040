"""Shocks stay where they are: contacts are solved again only where one passes, and never for one somewhere else."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.whole_step import Oracle, assert_agrees
from worlds import make_world

from carom import scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.systems.contacts.colours import COLOURS

PASSES = 4 + 3 * 2 + 4  # over all contacts of a calm world: one that pushes in each substep, and those that relax


def floor(world):
    world.create_entity(Transform((0, -1)), AABBCollider((1000, 1)))


def drop(world, x, count):
    """``count`` boxes on each other fall on the floor within the next step."""
    for k in range(count):
        world.create_entity(Transform((x, 0.51 + k)), RigidBody(linear_velocity=(0.0, -3.0)), AABBCollider((0.5, 0.5)))


def visits_in_the_step(world):
    world.step()
    return world.physics.state.solver.shock_visits


def test_what_rests_elsewhere_is_not_visited():
    """A tower of three that lands beside 400 stacks of two at rest: as many visits as alone."""
    alone, beside = (make_world(gravity=(0.0, -9.81)) for _ in range(2))
    for world in (alone, beside):
        floor(world)
    places = [(5.0 + 1.5 * k, 0.5 + row) for k in range(400) for row in range(2)]
    beside.create_entities(
        len(places), Transform.many(places), RigidBody.many(), AABBCollider.many(half_extents=(0.5, 0.5))
    )
    for _ in range(60):
        assert visits_in_the_step(beside) == 0
    for world in (alone, beside):
        drop(world, 0.0, 3)
    lone, near = visits_in_the_step(alone), visits_in_the_step(beside)
    assert lone == near > 3
    assert beside.physics.state.solver.contacts == 800 + 3
    assert beside.physics.state.solver.visits >= PASSES * 803


def test_a_shock_ends_when_what_fell_lies():
    world = make_world(gravity=(0.0, -9.81))
    floor(world)
    drop(world, 0.0, 3)
    counts = [visits_in_the_step(world) for _ in range(30)]
    assert counts[0] > 0
    assert not any(counts[5:])


def test_a_pile_at_rest_has_no_shocks():
    with scenes.pile2d.build(n=100) as world:
        for _ in range(500):
            world.step()
        assert [visits_in_the_step(world) for _ in range(20)] == [0] * 20
        assert world.physics.state.solver.visits <= (PASSES + 4) * world.physics.state.solver.contacts


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_blow_through_a_heap_agrees_with_the_oracle(friction):
    """A fast disc falls on ten that touch each other."""
    world = make_world(gravity=(0.0, -9.81))
    world.create_entity(Transform((0, -1)), AABBCollider((20, 1), friction=friction))
    rng = np.random.default_rng(3)
    for row in range(4):
        for k in range(4 - row):
            place = (k + 0.5 * row + 0.01 * rng.uniform(), 0.5 + 0.86 * row)
            world.create_entity(Transform(place), RigidBody(mass=1.0 + row), SphereCollider(0.5, friction=friction))
    world.create_entity(
        Transform((1.4, 4.2)), RigidBody(linear_velocity=(1.0, -8.0)), SphereCollider(0.5, friction=friction)
    )
    for _ in range(12):
        oracle = Oracle(world)
        world.step()
        oracle.step()
        assert_agrees(world, oracle)


def test_blows_to_a_body_with_more_contacts_than_colours_agree_with_the_oracle():
    """Seventy balls above a board, of which the last eight fall on it: their contacts share a colour, and the board."""
    world = make_world()
    world.create_entity(Transform((0.0, 0.25)), RigidBody(), AABBCollider((40, 0.25)))
    for k in range(70):
        falls = k >= COLOURS
        ball = RigidBody(mass=1.0 + 0.1 * k, linear_velocity=(0.0, -3.0 if falls else 0.0))
        world.create_entity(Transform((1.1 * k - 38.0, 1.0 if falls else 1.002)), ball, SphereCollider(0.5))
    oracle = Oracle(world)
    world.step()
    oracle.step()
    assert_agrees(world, oracle)
    assert world.physics.state.solver.contacts == 70
    assert world.physics.state.solver.shock_visits > 2 * 8

"""Rows that share no body are solved many at once: a pile moves to the bit as where its few rows are solved one by one.
"""

from __future__ import annotations

import numpy as np
import pytest
from worlds import run

from carom.components import RigidBody, Transform
from carom.components.spin import Spin
from carom.framework import World
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation


def pile(world, d, random, x, count):
    """Boxes on a floor of their own, askew, with and without friction."""
    world.create_entity(Transform((x, -1.0, 0.0)[:d]), BoxCollider((50.0, 1.0, 50.0)[:d], friction=0.4))
    for k in range(count):
        place = np.array((x + 0.97 * (k % 12), 0.5 + 0.99 * (k // 24), k // 12 % 2)[:d])
        box = BoxCollider(random.uniform(0.4, 0.55, d), friction=float(random.choice([0.0, 0.5])))
        world.create_entity(Transform(place), RigidBody(mass=random.uniform(0.5, 2.0)), Spin(), box)


def laden_plank(world, d, x):
    """With more boxes on it than there are colours of rows."""
    plank = BoxCollider((45.0, 0.5, 1.0)[:d], friction=0.5)
    world.create_entity(Transform((x, 20.0, 0.0)[:d]), RigidBody(mass=9.0), Spin(), plank)
    for k in range(-40, 40):
        box = BoxCollider((0.25,) * d, friction=0.5)
        world.create_entity(Transform((x + k, 20.75, 0.0)[:d]), RigidBody(), Spin(), box)


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_a_pile_has_the_same_bits_alone_and_beside_a_heap(seed, d):
    ends = []
    for others in (False, True):
        with World(Physics(d, gravity=(0.0, -9.81, 0.0)[:d]), Rotation()) as world:
            pile(world, d, np.random.default_rng((seed, d)), 0.0, 6)
            own = sorted(world.bodies.entity)
            if others:
                pile(world, d, np.random.default_rng((seed, 7)), 500.0, 120)
                laden_plank(world, d, 500.0)
            run(world, 20)
            bodies, rows = world.bodies, world.bodies.rows_of(own)
            ends.append((bodies.position[rows].tolist(), bodies.rotation[rows].tolist()))
            assert len(world.contacts) > (100 if others else 5)
    assert ends[0] == ends[1]


def test_a_turntable_drives_more_points_than_there_are_bodies():
    """In space each box on it has four; all go round with it."""
    with World(Physics(3, gravity=(0.0, -9.81, 0.0)), Rotation()) as world:
        table = BoxCollider((20.0, 1.0, 20.0), friction=0.5)
        world.create_entity(Transform((0.0, -1.0, 0.0)), RigidBody(kind="kinematic"), Spin((0.0, 0.1, 0.0)), table)
        for k in range(40):
            box = BoxCollider((0.5, 0.5, 0.5), friction=0.5)
            world.create_entity(Transform((2.0 * (k % 8) - 7.0, 0.5, 2.0 * (k // 8) - 4.0)), RigidBody(), Spin(), box)
        run(world, 60)
        moving = world.bodies.dynamic
        assert len(world.contacts.manifold) == 160 > len(world.physics.state.solver.body_row)
        np.testing.assert_allclose(moving.linear_velocity, np.cross((0.0, 0.1, 0.0), moving.position), atol=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
def test_an_order_is_kept_while_pairs_are_and_is_that_of_a_new_one(d):
    ends = []
    for anew in (False, True):
        with World(Physics(d, gravity=(0.0, -9.81, 0.0)[:d]), Rotation()) as world:
            pile(world, d, np.random.default_rng((5, d)), 0.0, 30)
            solver, boxes = world.physics.state.solver, sorted(world.bodies.dynamic.entity)
            for step in range(300):
                if step == 40:
                    world.component_for_entity(boxes[0], RigidBody).mass = 3.0
                if step in (60, 80):
                    world.delete_entity(boxes[step // 10])
                if anew:
                    solver.ranges = 0
                world.step()
            ends.append(world.state_hash())
            kept = []
            for _ in range(10):
                solver.colour[0] = 99
                world.step()
                kept.append(solver.colour[0] == 99)
            assert any(kept)  # where nothing has come or gone
            world.delete_entity(boxes[1])
            world.step()
            assert solver.colour[0] != 99
    assert ends[0] == ends[1]

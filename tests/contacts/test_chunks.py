"""Rows that share no body may be solved in any order: many at once give the bits of one after the other."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from carom.components import RigidBody, Transform
from carom.components.spin import Spin
from carom.framework import World
from carom.framework.compilation import kernel
from carom.framework.jit.records.record_type import record_at
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation
from carom.systems.contacts.solving.chunks import find_chunks, solve_chunks
from carom.systems.contacts.solving.rows import ARMS, solve_normals
from carom.systems.records import STATE

MOTIONS, IMPULSES = ("velocity", "spin"), ("impulse", "tangent")


@lru_cache
def passes(d):
    state_at = record_at(STATE, d)

    @kernel
    def pass_over(address, rows, together, pushes):
        solver = state_at(address).solver
        span = 0, rows, 0, solver.bodies, ARMS
        if together:
            find_chunks(solver, span)
            solve_chunks(solver, solver.pushing, pushes, span)
            return solver.chunks
        solve_normals(solver, solver.pushing, pushes, span)
        return rows

    return pass_over


def heap(d, random):
    """Boxes on a floor, some in no contact with others, with and without friction; and more on a plank than there are
    colours."""
    world = World(Physics(d), Rotation())
    world.create_entity(Transform((0.0, -1.0, 0.0)[:d]), BoxCollider((50.0, 1.0, 50.0)[:d], friction=0.4))
    for k in range(120):
        place = np.array((k % 12 - 6.0, 0.5 + 0.99 * (k // 24), k // 12 % 2)[:d])
        box = BoxCollider(random.uniform(0.4, 0.55, d), friction=float(random.choice([0.0, 0.5])))
        world.create_entity(Transform(place), RigidBody(mass=random.uniform(0.5, 2.0)), Spin(), box)
    plank = BoxCollider((45.0, 0.5, 1.0)[:d], friction=0.5)
    world.create_entity(Transform((0.0, 20.0, 0.0)[:d]), RigidBody(mass=9.0), Spin(), plank)
    for x in range(-40, 40):
        world.create_entity(Transform((x, 20.75, 0.0)[:d]), RigidBody(), Spin(), BoxCollider((0.25,) * d, friction=0.5))
    return world


@pytest.mark.parametrize("d", [2, 3])
def test_chunks_give_the_bits_of_row_by_row(d):
    for seed in range(3):
        random = np.random.default_rng((seed, d))
        with heap(d, random) as world:
            for _ in range(5):
                world.step()
            solver, address = world.physics.state.solver, world.physics.state.address
            rows, bodies = solver.contacts, solver.bodies
            assert rows > 150
            for name in MOTIONS:
                moved = getattr(solver, name)[:bodies]
                moved += random.normal(size=moved.shape)
            for pushes in (True, False):
                ends = dict.fromkeys(MOTIONS, bodies) | dict.fromkeys(IMPULSES, rows)
                before = {name: getattr(solver, name)[:end].copy() for name, end in ends.items()}
                found = {}
                for together in (True, False):
                    for name, end in ends.items():
                        getattr(solver, name)[:end] = before[name]
                    solved = passes(d)(address, rows, together, pushes)
                    assert not together or 4 * solved < rows  # several in each
                    found[together] = {name: getattr(solver, name)[:end].copy() for name, end in ends.items()}
                for name in ends:
                    np.testing.assert_array_equal(found[True][name], found[False][name], name)
                    assert not np.array_equal(found[True][name], before[name])


def test_a_turntable_may_drive_more_rows_than_there_are_bodies():
    """In space each box on it has four."""
    with World(Physics(3, gravity=(0.0, -9.81, 0.0)), Rotation()) as world:
        table = BoxCollider((20.0, 1.0, 20.0), friction=0.5)
        world.create_entity(Transform((0.0, -1.0, 0.0)), RigidBody(kind="kinematic"), Spin((0.0, 0.1, 0.0)), table)
        for k in range(40):
            box = BoxCollider((0.5, 0.5, 0.5), friction=0.5)
            world.create_entity(Transform((2.0 * (k % 8) - 7.0, 0.5, 2.0 * (k // 8) - 4.0)), RigidBody(), Spin(), box)
        world.step()
        solver = world.physics.state.solver
        assert solver.driven_rows == solver.contacts == 160
        assert len(solver.driven_row) >= 160 > len(solver.body_row)

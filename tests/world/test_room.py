"""Room in the columns of the records: whatever comes, goes and comes back, no stage writes beyond it."""

from __future__ import annotations

import numpy as np
import pytest
from worlds import ball, make_world

from carom import AABBCollider, Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.plugins.joints import Distance, Joints
from carom.plugins.parts import PartOf, Parts
from carom.plugins.rotation import Rotation, Spin


def steps(world, count):
    for _ in range(count):
        world.step()


def test_what_spins_again_has_room_for_all_contacts_that_have_come_meanwhile():
    apart, heap = (np.stack(np.meshgrid(size * np.arange(4), 0.5 + size * np.arange(4)), -1) for size in (5.0, 0.95))
    with World(Physics(dimensions=2), Rotation()) as world:
        world.create_entity(Transform((0, -1)), AABBCollider((100, 1)))
        balls = world.create_entities(
            16, Transform.many(apart.reshape(16, 2)), RigidBody.many(), SphereCollider.many(radius=0.5)
        )
        solver, spins = world.physics.state.solver, int(balls[0])
        world.add_component(spins, Spin())
        steps(world, 2)
        assert 0 < solver.contacts < 16
        world.remove_component(spins, Spin)
        world.bodies.position[:16] = heap.reshape(16, 2)
        steps(world, 2)
        assert solver.contacts >= 24
        world.add_component(spins, Spin())
        steps(world, 2)
        assert solver.rows_of("arm_a") >= solver.contacts
        assert solver.rows_of("spin") >= solver.bodies


@pytest.mark.parametrize("integrator", ["velocity_verlet", "rk4"])
def test_joints_and_parts_without_colliders_have_room_for_curved_paths(integrator):
    with World(
        Physics(dimensions=2, gravity=(0.0, -9.81)), Rotation(), Joints(), Parts(),
        settings=Settings(integrator=integrator),
    ) as world:  # fmt: skip
        body = world.create_entity(Transform((1, 0)), RigidBody(), Spin(inertia=1.0))
        world.create_entity(PartOf(body, (0.5, 0.0)))
        world.create_entity(Distance(None, body))
        steps(world, 30)
        bodies = world.physics.state.bodies
        for name in ("path_velocity", "path_second", "path_third"):
            assert bodies.rows_of(name) == world.physics.table.capacity
        assert np.isclose(np.hypot(*world.bodies.position[0]), 1.0, atol=1e-3)


def test_impacts_at_once_have_room_in_all_their_lists():
    """Two pairs strike at once, then sixteen: the lists of two entries for each of these grow, too."""
    with make_world(2, collision="event_driven") as world:
        for k in range(18):
            gap = 0.5 if k < 2 else 1.0
            ball(world, (3.0 * k, 0.0), (1.0, 0.0), radius=0.25, restitution=1.0)
            ball(world, (3.0 * k + 0.5 + gap, 0.0), (-1.0, 0.0), radius=0.25, restitution=1.0)
        for _ in range(60):
            world.step()
        impacts = world.physics.state.impacts
        assert len(impacts.next_member) >= 2 * 16
        assert sorted(world.bodies.linear_velocity[:, 0].tolist()) == [-1.0] * 18 + [1.0] * 18

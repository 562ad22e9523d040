"""Scenes that a random sweep found to go wrong, before their cause was found: a stack and two rooms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from laws.helpers_laws import walls

from carom.components import AABBCollider, RigidBody, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, capsule, half_space

DT = 1 / 60


def room(number, gravity, speed, collider, restitution, **settings):
    """(world, distance at which a body is out, gravity) of a lattice of bodies in a room with thin walls."""
    random = np.random.default_rng([0, number, 1])
    world = World(Physics(dimensions=2, gravity=(0.0, -gravity / DT**2)), capsule.plugin, settings=Settings(**settings))
    count = int(random.integers(10, 31))
    for _ in range(2):  # sizes and masses of that sweep, equal here
        random.uniform(0.0, 1.0, count)
        random.permutation(count)
    side = math.ceil(count**0.5 - 1e-9)
    half, wall = side + 0.5, 0.05
    walls(world, half, wall, restitution=restitution)
    cells = random.permutation(side**2)[:count]
    places = 2.0 * (np.stack(np.unravel_index(cells, (side, side)), axis=1) - 0.5 * (side - 1))
    ways = random.normal(size=(count, 2))
    velocities = speed / DT * ways / np.linalg.norm(ways, axis=1)[:, None]
    for place, velocity in zip(places, velocities, strict=True):
        world.create_entity(Transform(tuple(place)), RigidBody(1.0, tuple(velocity)), collider.copy())
    return world, half + wall, gravity / DT**2


BOX = AABBCollider((0.5, 0.5), restitution=0.3)
CAPSULE = capsule.CapsuleCollider(0.25, 0.25, restitution=1.0)


@pytest.mark.parametrize(
    "scene",
    [
        pytest.param(
            (7634, 5.9420508775818695, 146.7650256897929, BOX, 0.3,
             {"collision": "event_driven", "integrator": "velocity_verlet"}),
            id="a box that passes beyond a corner of its room in the step in which it touches the wall",
        ),
        pytest.param(
            (3602, 0.4980132477950075, 0.16577867238095748, CAPSULE, 1.0, {"collision": "continuous"}),
            id="a grain that falls through a thin wall before something strikes it",
        ),
    ],
)  # fmt: skip
def test_no_body_leaves_a_room(scene):
    *how, settings = scene
    world, limit, gravity = room(*how, **settings)
    with world:
        bodies = world.bodies.dynamic
        start = energy(bodies, gravity, limit)
        for step in range(40):
            world.step()
            assert np.isfinite(bodies.position).all()
            assert (np.abs(bodies.position) <= limit).all(), step
            # semi-implicit Euler may gain half a step of gravity on each body's way by itself
            drift = gravity * DT * np.abs(bodies.linear_velocity[:, 1]).sum()
            assert energy(bodies, gravity, limit) - drift <= 1.01 * start


def energy(bodies, gravity, limit):
    """J, of bodies of 1 kg; zero at rest on the floor."""
    speeds, heights = (bodies.linear_velocity**2).sum(axis=1), bodies.position[:, 1] + limit
    return float((0.5 * speeds + gravity * heights).sum())


def test_a_falling_stack_keeps_its_order():
    """Rigid contacts of a stack that falls also push against each other."""
    settings = Settings(collision="continuous", integrator="velocity_verlet")
    gravity, speed = 968302.5034074591 / DT**2, 11.232868868896979 / DT
    with World(Physics(dimensions=3, gravity=(0.0, -gravity, 0.0)), half_space.plugin, settings=settings) as world:
        world.create_entity(Transform((0, 0, 0)), half_space.HalfSpaceCollider((0.0, 1.0, 0.0), restitution=0.3))
        for k in range(3):
            body = RigidBody(1.0, (0.0, -speed, 0.0))
            world.create_entity(Transform((0.0, 1.5 + k, 0.0)), body, AABBCollider((0.5, 0.5, 0.5), restitution=0.3))
        for _ in range(60):
            world.step()
            heights = world.bodies.dynamic.position[:, 1]
            assert np.isfinite(heights).all()
            assert (np.diff(heights, prepend=-1.0) > 0.0).all()

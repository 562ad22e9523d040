"""Joints without motors and springs give no energy: random chains of all kinds, whose masses differ by a million."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from worlds import run

from carom import Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.lab.testing import energy
from carom.plugins.joints import Ball, Cone, Distance, Hinge, Joints, Slider, Weld
from carom.plugins.rotation import BoxCollider, Rotation, Spin

SUBSTEPS = (1, 2, 4, 8, 16)


def random_joint(random: np.random.Generator, d: int, a: tuple[Any, Any], b: tuple[Any, Any]) -> Any:
    """Between two (entity, place)."""
    ends, middle = (a[0], b[0]), 0.5 * (a[1] + b[1])
    axis = {"axis": random.normal(size=3)} if d == 3 else {}
    limits = (-0.5, 0.5) if random.random() < 0.5 else None
    length = float(np.linalg.norm(b[1] - a[1]))
    kinds = [
        lambda: Distance(*ends, point_a=a[1]),
        lambda: Distance(*ends, point_a=a[1], length=(0.0, length)),
        lambda: Hinge(*ends, anchor=middle, limits=limits, **axis),
        lambda: Ball(*ends, anchor=middle),
        lambda: Weld(*ends, anchor=middle),
        lambda: Slider(*ends, direction=random.normal(size=d), limits=limits),
        lambda: Slider(*reversed(ends), direction=random.normal(size=d)),
        lambda: Cone(*ends, anchor=middle, swing=0.7, twist=limits, **axis),
    ]
    return kinds[int(random.integers(0, len(kinds) - (d == 2)))]()


def random_chain(seed: int, d: int, gravity: float) -> tuple[World, bool]:
    """Bodies that move and turn anyhow, each joined to an earlier one, or to the world; and whether it is."""
    random, settings = np.random.default_rng(seed), Settings(substeps=SUBSTEPS[seed % 5], on_fault="ignore")
    world = World(Physics(dimensions=d, gravity=(0,) * (d - 1) + (-gravity,)), Rotation(), Joints(), settings=settings)
    place = np.zeros(d)
    ends: list[tuple[Any, Any]] = [(None, place)]
    for _ in range(int(random.integers(2, 9))):
        place = place + random.normal(size=d)
        mass = 10.0 ** random.uniform(-3, 3)
        inertia = mass * random.uniform(0.05, 0.5)
        inertia *= random.uniform(0.7, 1.3, 3) if d == 3 else 1.0
        body = world.create_entity(
            Transform(place),
            RigidBody(mass=mass, linear_velocity=random.normal(0, 2, d)),
            Spin(random.normal(0, 2, None if d == 2 else 3), inertia),
        )
        ends.append((body, place))
    first = 1 + int(random.integers(0, 2))  # the first body hangs on the world, or on nothing
    for k in range(first, len(ends)):
        before = ends[k - 1 if random.random() < 0.7 else int(random.integers(first - 1, k))]
        world.create_entity(random_joint(random, d, before, ends[k]))
    return world, first == 1


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_no_chain_gains_energy(d, gravity):
    for seed in range(5):  # of each number of substeps
        world, hangs = random_chain(seed, d, gravity)
        start = lowest = energy(world)
        momentum, fastest = world.momentum(), world.kinetic_energy()
        for _ in range(80):
            world.step()
            now, fastest = energy(world), max(fastest, world.kinetic_energy())
            assert now <= start + 1e-8 * fastest
            if not gravity:  # what brings joints together lifts bodies
                assert now <= lowest + 1e-8 * fastest
                lowest = min(lowest, now)
        if not (gravity or hangs):
            np.testing.assert_allclose(world.momentum(), momentum, atol=1e-9 * sum(abs(momentum)))
        world.close()


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(6))
def test_a_chain_that_hangs_gains_nothing_as_its_step_changes(d, seed):
    """1 s at 1/60 s, then once, or each other time, a step that is 3 to 250 times as short."""
    random, dt = np.random.default_rng(seed), 1 / 60
    gravity = (0, -10) if d == 2 else (0, 0, -10)
    with World(Physics(d, gravity=gravity), Rotation(), Joints()) as world:
        links, down, before = int(random.integers(2, 16)), np.eye(d)[-1], None
        for k in range(links):
            body = RigidBody(random.uniform(1, 3)), BoxCollider(np.where(down, 0.5, 0.1), group=1), Spin()
            link = world.create_entity(Transform(-(k + 0.5) * down), *body)
            world.create_entity(Ball(before, link, anchor=-k * down))
            before = link
        start, short = energy(world), dt / 3 ** random.uniform(1, 5)
        for step in range(180):
            shorter = step >= 60 and step % 2 == 0 and (seed % 2 == 0 or step == 60)
            world.settings = world.settings.replace(dt=short if shorter else dt)
            world.step()
            assert energy(world) < start
        assert not world.faults


def chain_in_a_room(seed: int, d: int) -> World:
    """The same with boxes and balls, which rub the walls of a room and each other."""
    random, mode = np.random.default_rng((seed, d)), ("discrete", "continuous")[seed % 2]
    settings = Settings(substeps=SUBSTEPS[seed % 5], collision=mode, on_fault="ignore")
    world, ends = World(Physics(dimensions=d), Rotation(), Joints(), settings=settings), []
    for outward in (*np.eye(d), *-np.eye(d)):
        world.create_entity(Transform(4.0 * outward), BoxCollider(5.0 - 4.0 * abs(outward), friction=0.5))
    for k in range(int(random.integers(3, 9))):
        place, spin = random.uniform(-2.5, 2.5, d), Spin(random.normal(0, 4, None if d == 2 else 3))
        body = RigidBody(mass=10.0 ** random.uniform(-1.5, 1.5), linear_velocity=random.normal(0, 4, d))
        collider = BoxCollider((0.3,) * d, friction=0.5) if random.random() < 0.6 else SphereCollider(0.3, friction=0.5)
        ends.append((world.create_entity(Transform(place), body, spin, collider), place))
        if k > 0:
            world.create_entity(random_joint(random, d, ends[int(random.integers(0, k))], ends[k]))
    return world


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
def test_no_chain_gains_energy_from_what_it_touches(d):
    touched = 0
    for seed in range(5):  # of each number of substeps
        with chain_in_a_room(seed, d) as world:
            start = lowest = world.kinetic_energy()
            for _ in range(120):
                world.step()
                assert world.kinetic_energy() <= lowest + 1e-9 * start
                lowest = min(lowest, world.kinetic_energy())
                touched += len(world.contacts)
    assert touched > 300


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 7])
def test_bodies_of_three_moments_that_tumble_about_a_joint_gain_nothing(seed):
    """In 20 s. The first two steps make their velocities fit together."""
    random = np.random.default_rng(seed)
    with World(Physics(3, gravity=0), Rotation(), Joints()) as world:
        ends = [
            world.create_entity(
                Transform((x, 0, 0)), RigidBody(linear_velocity=random.uniform(-1, 1, 3)),
                Spin(random.uniform(-4, 4, 3), random.uniform(0.1, 0.18, 3)),
            )
            for x in (0.0, 1.0)
        ]  # fmt: skip
        world.create_entity(Ball(*ends, anchor=(0.5, 0, 0)))
        run(world, 2)
        start = world.kinetic_energy()
        for _ in range(1200):
            world.step()
            assert 0.95 * start < world.kinetic_energy() < (1.0 + 1e-9) * start

"""Bodies that several joints hold together, put where these cannot be: none bears more than what pulls them back."""

from __future__ import annotations

import numpy as np
import pytest
from joints.helpers_joints import joint_world
from worlds import run

from carom import RigidBody, Transform
from carom.plugins.joints import Ball, Distance, Hinge
from carom.plugins.rotation import BoxCollider, Spin

SEEDS, STEPS = range(6), 60


def box(world, d, place, mass):
    half = (0.5, 0.1, 0.2)[:d]
    return world.create_entity(Transform(place), RigidBody(mass=mass), Spin(), BoxCollider(half))


def pinned(d, seed, **motor):
    """(world, joints, the generator, two boxes that three pins hold together in free fall, a third box)."""
    random, (world, joints) = np.random.default_rng(seed), joint_world((0, -9.81, 0)[:d], d)
    boxes = [box(world, d, place[:d], mass) for place, mass in (((0, 0, 0), 2), ((0.6, 0.1, 0), 1), ((3, 1, 0), 1))]
    for anchor in random.uniform((0.1, -0.1, -0.1)[:d], (0.5, 0.2, 0.1)[:d], (3, d)):
        world.create_entity(Hinge(*boxes[:2], anchor=anchor, **motor) if d == 2 else Ball(*boxes[:2], anchor=anchor))
    run(world, 3)
    return world, joints, random, boxes


def put_aside(world, random, body):
    """By up to a metre along each axis."""
    place = world.component_for_entity(body, Transform)
    place.position = place.position + random.uniform(-1, 1, len(place.position))


def between(world, one, two):
    """How far apart their centres are."""
    places = (world.component_for_entity(body, Transform).position for body in (one, two))
    return np.linalg.norm(next(places) - next(places))


def fastest(world):
    return np.linalg.norm(world.bodies.linear_velocity, axis=1).max()


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", SEEDS)
def test_pins_that_are_torn_open_alike_bear_nothing(d, seed):
    """They fall freely: their momentum grows by the weight, pins have a hundredth of the 1e4 N s that they once bore
    against each other, and in the end they are together as they were."""
    world, joints, random, (one, two, _) = pinned(d, seed)
    apart = between(world, one, two)
    put_aside(world, random, two)
    bodies, most = world.bodies, 0.0
    for _ in range(STEPS):
        before = bodies.mass @ bodies.linear_velocity
        world.step()
        gained = bodies.mass @ bodies.linear_velocity - before
        assert np.allclose(gained, np.array((0, -9.81, 0)[:d]) * bodies.mass.sum() / 60, atol=1e-9)
        most = max(most, abs(joints.columns()["impulse"]).max())
    assert most < 150.0
    assert between(world, one, two) == pytest.approx(apart, abs=1e-3)


@pytest.mark.parametrize(("d", "pins"), [(2, 3), (3, 4)])
@pytest.mark.parametrize("seed", SEEDS)
def test_pins_of_a_body_that_is_turned_do_not_break(d, pins, seed):
    """By a tenth of a radian: along the arms their errors contradict each other by half of its square."""
    random, (world, _) = np.random.default_rng(seed), joint_world(0, d)
    one, two = (box(world, d, (x, 0, 0)[:d], mass) for x, mass in ((0, 2), (0.6, 1)))
    for anchor in random.uniform((0.1, -0.1, -0.1)[:d], (0.5, 0.2, 0.1)[:d], (pins, d)):
        joint = Hinge if d == 2 else Ball
        world.create_entity(joint(one, two, anchor=anchor, breaking_force=2e4))
    run(world, 3)
    place = world.component_for_entity(two, Transform)
    place.rotation = 0.1 if d == 2 else (np.cos(0.05), 0, 0, np.sin(0.05))
    run(world, STEPS)
    assert len(world.get_component(Hinge if d == 2 else Ball)) == pins
    assert world.kinetic_energy() < 1e-9


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("extra", ["", "spring", "motor"])
def test_a_chain_that_lets_go_of_a_heavy_crate_hangs_on(d, extra):
    """Its masses asked for all joints at once; then passes go on, and what they find at first is what the step before
    has left. Links of 1 kg may fall for that step."""
    world, _ = joint_world((0, -9.81, 0)[:d], d)
    half, links = (0.05, 0.45, 0.05)[:d], 8
    places = ((0, -0.5 - k, 0)[:d] for k in range(links))
    chain = [world.create_entity(Transform(at), RigidBody(), Spin(), BoxCollider(half)) for at in places]
    for k, link in enumerate(chain):
        options = {} if d == 2 else {"axis": (0, 0, 1)}
        if extra == "motor" and k == 0:
            options |= {"motor_speed": 0.0, "max_torque": 1.0}
        world.create_entity(Hinge(chain[k - 1] if k else None, link, anchor=(0, -k, 0)[:d], **options))
    crate = box(world, d, (0, -links - 0.5, 0)[:d], 1e4)
    hook = world.create_entity((Hinge if d == 2 else Ball)(chain[-1], crate, anchor=(0, -links, 0)[:d]))
    if extra == "spring":
        lamp = box(world, d, (2, -5, 0)[:d], 0.1)
        world.create_entity(Distance(chain[4], lamp, frequency=1.0, damping_ratio=0.5))
    run(world, 120)
    world.delete_entity(hook)
    world.delete_entity(crate)
    for _ in range(2 * STEPS):
        world.step()
        assert max(np.linalg.norm(world.component_for_entity(link, RigidBody).linear_velocity) for link in chain) < 0.5


@pytest.mark.parametrize("seed", SEEDS)
def test_another_joint_of_what_is_torn_open_throws_nothing(seed):
    """A rope joins it to what was free, and passes solve what was solved at once. Motors of 1 N m turn the pins."""
    world, _, random, (_, two, three) = pinned(2, seed, motor_speed=2.0, max_torque=1.0)
    put_aside(world, random, two)
    run(world, 3)
    world.create_entity(Distance(two, three, length=(0, 2.0)))
    for _ in range(STEPS):
        world.step()
        assert fastest(world) < 9.81 * world.time + 10.0


@pytest.mark.parametrize("seed", SEEDS)
def test_pins_that_contradict_each_other_throw_nothing(seed):
    """The second box is moved and pinned again where it is then, so that its old pins cannot close, nor can the new."""
    world, _, random, (one, two, three) = pinned(2, seed, motor_speed=2.0, max_torque=1.0)
    for _ in range(3):
        put_aside(world, random, two)
        world.create_entity(Hinge(one, two, anchor=random.uniform(-1, 1, 2)))
        run(world, 3)
    world.create_entity(Distance(two, three, length=(0, 2.0)))
    for _ in range(STEPS):
        world.step()
        assert fastest(world) < 9.81 * world.time + 60.0

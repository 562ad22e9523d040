"""Frames, beams and rows of sliders, and joints between bodies whose masses differ much: they hold as the rigid
structures that they are, with the usual substeps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics
from carom.plugins.joints import Ball, Distance, Hinge, Joints, MousePull, Slider, Weld
from carom.plugins.rotation import BoxCollider, Rotation, Spin

MODES = "discrete", "continuous", "event_driven"
G = 10.0


def world_of(d, seed, gravity=G, **settings):
    """A world in one of the three modes."""
    joints = Joints()
    settings = Settings(collision=MODES[seed % 3], **settings)
    return World(Physics(d, gravity=(0, -gravity, 0)[:d]), Rotation(), joints, settings=settings), joints


def vector(d, *numbers):
    return np.array([*numbers, 0.0, 0.0, 0.0][:d])


def bar(world, d, p, q, mass):
    """A thin bar from one point to another, which touches nothing; the third axis of space is its own."""
    way = np.subtract(q, p)
    size, angle = float(np.hypot(*way)), math.atan2(way[1], way[0])
    turned = angle if d == 2 else (math.cos(angle / 2), 0, 0, math.sin(angle / 2))
    box = BoxCollider((size / 2, 0.04, 0.04)[:d], layer=2, mask=1)
    return world.create_entity(Transform(vector(d, *np.add(p, q) / 2), turned), RigidBody(mass), box, Spin())


def hinge(world, d, a, b, place):
    axis = {} if d == 2 else {"axis": (0, 0, 1)}
    return world.create_entity(Hinge(a, b, anchor=vector(d, *place), **axis))


def worst_gap(joints):
    a, b = joints.anchors()
    return float(np.linalg.norm(a - b, axis=1).max())


def girder(world, d, bays, masses):
    """A lattice girder between two supports: chords, posts, crossed bars, all hinged where they end."""
    first, bars = {}, []
    for k in range(bays + 1):
        lines = [((k, 0), (k, 1))]
        if k < bays:
            lines += [((k, 0), (k + 1, 0)), ((k, 1), (k + 1, 1)), ((k, 0), (k + 1, 1)), ((k, 1), (k + 1, 0))]
        for line in lines:
            bars.append(bar(world, d, *line, next(masses)))
            for end in line:
                if end in first:
                    hinge(world, d, first[end], bars[-1], end)
                first.setdefault(end, bars[-1])
    for end in ((0, 0), (bays, 0)):
        hinge(world, d, None, first[end], end)
    return bars


@pytest.mark.parametrize("d", [2, 3])
def test_girders_stand(d):
    """Masses 1:1,000, and a load of up to 50 times the weight of a bar in the middle: nothing moves by a thousandth."""
    for seed in range(3):
        rng = np.random.default_rng((seed, d))
        world, joints = world_of(d, seed, substeps=int(rng.integers(2, 7)))
        bays, ratio = int(rng.integers(2, 6)), 10.0 ** (1.5 * (seed % 3 > 0))
        with world:
            bars = girder(world, d, bays, iter(ratio ** rng.uniform(-1, 1, 60)))
            world.component_for_entity(bars[5 * (bays // 2)], RigidBody).mass *= rng.uniform(1.0, 50.0)
            start = world.bodies.position.copy()
            for _ in range(120):
                world.step()
            assert abs(world.bodies.position - start).max() < 1e-3
            assert abs(world.bodies.linear_velocity).max() < 1e-6
            assert worst_gap(joints) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
def test_scissors_stand(d):
    """Scissors of 1 to 5 levels whose feet are held: their bars of 5 m cannot move."""
    for seed in range(5):
        rng = np.random.default_rng((seed, d))
        world, joints = world_of(d, seed)
        angle, before = rng.uniform(0.1, 1.0), (None, None)
        dx, dy = 2.5 * math.cos(angle), 2.5 * math.sin(angle)
        with world:
            for k in range(seed + 1):
                y, mass = 2 * k * dy, 10.0 ** rng.uniform(-1, 1)
                left = bar(world, d, (-dx, y), (dx, y + 2 * dy), mass)
                right = bar(world, d, (dx, y), (-dx, y + 2 * dy), mass)
                hinge(world, d, left, right, (0, y + dy))
                hinge(world, d, before[1], left, (-dx, y))
                hinge(world, d, before[0], right, (dx, y))
                before = left, right
            start = world.bodies.position.copy()
            for _ in range(120):
                world.step()
            assert abs(world.bodies.position - start).max() < 0.005
            assert worst_gap(joints) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
def test_a_motor_holds_a_lift(d):
    """Scissors whose second foot slides, held by a motor alone, bear 20 to 200 kg: the deck sinks by less than 5 mm;
    with a tenth of the force that it takes the deck comes down."""
    for seed in range(4):
        for share in (3.0, 0.1):
            rng = np.random.default_rng((seed, d))
            world, _ = world_of(d, seed, on_fault="ignore")
            angle, load, before = rng.uniform(0.3, 0.9), 10.0 ** rng.uniform(1.3, 2.3), (None, None)
            dx, dy, levels = math.cos(angle), math.sin(angle), seed + 1
            with world:
                foot = bar(world, d, (dx - 0.1, 0), (dx + 0.1, 0), 0.5)
                for k in range(levels):
                    y = 2 * k * dy
                    left = bar(world, d, (-dx, y), (dx, y + 2 * dy), 1.0)
                    right = bar(world, d, (dx, y), (-dx, y + 2 * dy), 1.0)
                    hinge(world, d, left, right, (0, y + dy))
                    hinge(world, d, before[1], left, (-dx, y))
                    hinge(world, d, before[0] or foot, right, (dx, y))
                    before = left, right
                bears = (levels * load + levels * levels) * G / math.tan(angle)  # at the foot, by virtual work
                motor = {"motor_speed": 0.0, "max_force": share * bears}
                world.create_entity(Slider(None, foot, direction=vector(d, 1), **motor))
                y = 2 * levels * dy
                deck = bar(world, d, (-dx, y), (dx, y), load)
                hinge(world, d, before[1], deck, (-dx, y))
                end = bar(world, d, (dx - 0.1, y), (dx + 0.1, y), 0.5)
                hinge(world, d, before[0], end, (dx, y))
                world.create_entity(Slider(deck, end, direction=vector(d, 1)))
                for _ in range(60):
                    world.step()
                sunk = y - world.component_for_entity(deck, Transform).position[1]
                assert sunk < 0.005 if share > 1.0 else sunk > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
def test_sliders_in_a_row_stay_on_their_rails(d):
    """Each slides along the one before it by up to 6 m, and the last is pulled over with 500 to 5,000 N: none leaves
    its rail by 5 cm, nor has the row more energy than the pull has given."""
    for seed in range(3):
        rng = np.random.default_rng((seed, d))
        world, _ = world_of(d, seed, on_fault="ignore")
        force, n, before, boxes, energy = float(rng.uniform(500, 5000)), 3 + 2 * seed, None, [], []
        with world:
            for k in range(n):
                place, box = vector(d, 0, 0.6 + 1.2 * k), BoxCollider((0.5,) * d)
                boxes.append(
                    world.create_entity(Transform(place), RigidBody(10.0 ** rng.uniform(-0.5, 0.5)), box, Spin())
                )
                world.create_entity(Slider(before, boxes[-1], direction=vector(d, 1), limits=(-6, 6)))
                before = boxes[-1]
            grip = vector(d, 0, 0.6 + 1.2 * (n - 1))
            pull = MousePull(before, grip=grip, target=vector(d, 60, 1.2 * n), max_force=force)
            pull = world.create_entity(pull)
            for k in range(240):
                if k == 120:
                    world.component_for_entity(pull, MousePull).target = vector(d, -60, 1.2 * n)
                world.step()
                off = world.bodies.position[:, 1] - (0.6 + 1.2 * np.arange(n))
                assert abs(off).max() < 0.05
                energy.append(world.kinetic_energy())
            assert max(energy) < force * 2 * 6 * n


@pytest.mark.parametrize("d", [2, 3])
def test_beams_of_welds_do_not_bend(d):
    """Up to 20 boxes of 1 m welded to a wall, the last up to 1,000 times as heavy: it sinks by less than 1 mm."""
    for seed in range(3):
        rng = np.random.default_rng((seed, d))
        world, joints = world_of(d, seed)
        n, before = int(rng.integers(2, 21)), None
        with world:
            for k in range(n):
                mass = 1.0 if k < n - 1 else 10.0 ** rng.uniform(0, 3)
                parts = Transform(vector(d, k + 0.5)), RigidBody(mass), BoxCollider((0.5, 0.2, 0.2)[:d]), Spin()
                box = world.create_entity(*parts)
                world.create_entity(Weld(before, box, anchor=vector(d, k)))
                before = box
            for _ in range(180):
                world.step()
            assert abs(world.bodies.position[:, 1]).max() < 1e-3
            assert worst_gap(joints) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("size", [1.0, 0.2])
@pytest.mark.parametrize("d", [2, 3])
def test_chains_swing_with_what_is_a_thousand_times_as_heavy(d, size):
    """2 to 12 links of 1 kg that fall from the horizontal with 30 to 1,000 kg at their end: no hinge opens by a
    hundredth of a link, and the energy rises by no more than g h v / 2, by which symplectic Euler's swings. Short ones
    would swing too far in a substep."""
    for seed in range(3):
        rng = np.random.default_rng((seed, d))
        world, joints = world_of(d, seed, on_fault="ignore")
        n, load, before = int(rng.integers(2, 13)), 10.0 ** rng.uniform(1.5, 3), None
        with world:
            for k in range(n):
                box = BoxCollider(size * np.array((0.5, 0.1, 0.1)[:d]), layer=2, mask=1)
                parts = RigidBody(1.0 if k < n - 1 else load), box, Spin()
                link, place = world.create_entity(Transform(vector(d, size * (k + 0.5))), *parts), vector(d, size * k)
                world.create_entity((Ball if d == 3 else Hinge)(before, link, anchor=place))
                before = link
            total = world.kinetic_energy() + world.potential_energy()
            most = (load + n) * 0.5 * G * world.settings.dt / world.settings.substeps * math.sqrt(2.0 * G * n * size)
            for _ in range(180):
                world.step()
                assert worst_gap(joints) < 0.01 * size
                assert world.kinetic_energy() + world.potential_energy() < total + most


@pytest.mark.parametrize(("d", "load"), [(2, 1e9), (2, 1e12), (3, 1e12)])
def test_chains_under_what_no_chain_bears_stay_finite_and_are_told(d, load):
    """Links of 1 kg: more stiffness than numbers have digits gave nan."""
    world, joints = world_of(d, 0, on_fault="ignore")
    with world:
        before = None
        for k in range(4):
            parts = RigidBody(1.0 if k < 3 else load), SphereCollider(0.1), Spin()
            link = world.create_entity(Transform(vector(d, 0.5 * (k + 1))), *parts)
            world.create_entity((Ball if d == 3 else Hinge)(before, link, anchor=vector(d, 0.5 * k)))
            before = link
        for _ in range(300):
            world.step()
        assert np.isfinite(world.bodies.position).all()
        assert np.isfinite(world.bodies.linear_velocity).all()
        assert worst_gap(joints) < 0.01 or any("torn open" in fault for fault in world.faults)


@pytest.mark.parametrize("d", [2, 3])
def test_frames_in_flight_keep_their_momentum(d):
    """A girder that is thrown and turns: joints give no momentum, and the energy stays within one part in 1,000."""
    for seed in range(3):
        rng = np.random.default_rng((seed, d))
        world, joints = world_of(d, seed, gravity=0.0)
        with world:
            bars = girder(world, d, 3, iter(10.0 ** rng.uniform(-1, 1, 60)))
            world.delete_entities([e for e, j in world.get_component(Hinge) if j.a is None or j.a == 0])
            speed, about = rng.normal(0, 3, 2), rng.uniform(0.5, 2)
            for one in bars:
                x, y = world.component_for_entity(one, Transform).position[:2]
                world.component_for_entity(one, RigidBody).linear_velocity = vector(
                    d, *(speed + about * np.array((-y, x)))
                )
                world.component_for_entity(one, Spin).angular_velocity = about if d == 2 else np.array((0, 0, about))
            momentum, energy = np.array(world.momentum()), world.kinetic_energy()
            for _ in range(120):
                world.step()
            np.testing.assert_allclose(world.momentum(), momentum, atol=1e-9 * abs(momentum).max())
            assert world.kinetic_energy() == pytest.approx(energy, rel=1e-3)
            assert worst_gap(joints) < 0.01


def test_a_joint_that_is_torn_is_told():
    """Two thirds of a turn in a substep about the end of a bar: no joint holds that."""
    world, _ = world_of(2, 0, gravity=0.0, on_fault="ignore")
    with world:
        one = bar(world, 2, (0, 0), (2, 0), 1.0)
        world.component_for_entity(one, Spin).angular_velocity = 1000.0
        torn = hinge(world, 2, None, one, (0, 0))
        world.step()
        assert any("joints are torn open" in str(fault) and f"entity {torn}" in str(fault) for fault in world.faults)


@pytest.mark.parametrize("joint", [Slider, Distance])
def test_a_joint_that_a_game_tears_is_told(joint):
    """A body is set 3 m beside where its joint holds it."""
    world = World(Physics(dimensions=2), Rotation(), Joints(), settings=Settings(on_fault="ignore"))
    with world:
        bar = world.create_entity(Transform((1, 0)), RigidBody(1.0), BoxCollider((0.2, 0.2)), Spin())
        options = {"direction": (1, 0)} if joint is Slider else {"point_a": (0, 0)}
        torn = world.create_entity(joint(a=None, b=bar, **options))
        world.step()
        assert not list(world.faults)
        world.component_for_entity(bar, Transform).position = (1, 3)
        world.step()
        assert any("joints are torn open" in str(fault) and f"entity {torn}" in str(fault) for fault in world.faults)

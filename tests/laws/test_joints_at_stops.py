"""Joints at their limits: what presses on a stop rests there, and nothing gains energy or opens its joint."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics
from carom.plugins.joints import Distance, Hinge, Joints, Motor, Weld
from carom.plugins.rotation import BoxCollider, Rotation, Spin

MODES = "discrete", "continuous", "event_driven"


def world_of(d, seed):
    """A world without gravity, in one of the three modes."""
    joints = Joints()
    return World(Physics(d, gravity=0.0), Rotation(), joints, settings=Settings(collision=MODES[seed % 3])), joints


def vector(d, *numbers):
    return np.array([*numbers, 0.0, 0.0, 0.0][:d])


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
def test_what_presses_on_a_stop_rests_there(d):
    """A ball on an arm of 10 to 100 times its radius (m r^2 / I up to 25,000), which a motor or a spring turns against
    the limit of its hinge: it never has more energy than these give, and rests at the limit."""
    for seed in range(12):
        rng = np.random.default_rng((seed, d))
        arm, m = rng.uniform(0.5, 5.0), 10.0 ** rng.uniform(-1.5, 1.5)
        radius, stop = arm / 10.0 ** rng.uniform(1.0, 2.0), rng.uniform(0.2, 1.5)
        inertia = m * (arm * arm + radius * radius * (0.5 if d == 2 else 0.4))
        world, joints = world_of(d, seed)
        with world:
            if seed % 2:
                speed = rng.uniform(1.0, 10.0)
                drive = {"motor_speed": speed, "max_torque": (None, 20.0 * inertia)[seed % 4 > 1]}
                most = 0.5 * inertia * speed * speed
            else:
                frequency, rest = rng.uniform(0.5, 5.0), stop + rng.uniform(0.1, 1.0)
                drive = {"frequency": frequency, "damping_ratio": rng.uniform(0.1, 1.0), "rest": rest}
                most = 0.5 * inertia * (2.0 * math.pi * frequency * rest) ** 2
            parts = Transform(vector(d, arm)), RigidBody(m), SphereCollider(radius), Spin()
            axis = {} if d == 2 else {"axis": (0, 0, 1)}
            body = world.create_entity(*parts)
            hinge = world.create_entity(Hinge(None, body, anchor=vector(d), limits=(-0.3, stop), **drive, **axis))
            for _ in range(240):
                world.step()
                assert world.kinetic_energy() < 1.02 * most
            a, b = joints.anchors()
            assert np.linalg.norm(a - b) < 0.02 * arm
            assert joints.state(hinge).value == pytest.approx(stop, abs=1e-4)
            assert world.kinetic_energy() < 1e-9 * most


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
def test_a_door_flung_at_its_stop_stays_on_its_hinge(d):
    """A door of 2 m that meets its stop with 1 to 10 rad/s: its hinge opens by less than 1 cm, which is a quarter of
    the way of a substep at 10 rad/s, and falls with the square of the substeps."""
    for seed in range(6):
        rng, gaps = np.random.default_rng((seed, d)), []
        speed, thick, m = rng.uniform(1.0, 10.0), rng.uniform(0.05, 0.3), 10.0 ** rng.uniform(-1.5, 1.5)
        for substeps in (4, 8):
            world, joints = world_of(d, seed)
            world.settings = world.settings.replace(substeps=substeps)
            with world:
                motion = RigidBody(m, linear_velocity=vector(d, 0.0, speed)), Spin(speed if d == 2 else (0, 0, speed))
                box = BoxCollider((1.0, thick, thick)[:d])
                door = world.create_entity(Transform(vector(d, 1.0)), *motion, box)
                axis = {} if d == 2 else {"axis": (0, 0, 1)}
                world.create_entity(Hinge(None, door, anchor=vector(d), limits=(-0.1, 1.0), **axis))
                gap = 0.0
                for _ in range(120):
                    world.step()
                    a, b = joints.anchors()
                    gap = max(gap, float(np.linalg.norm(a - b)))
                gaps.append(gap)
        assert gaps[0] < 0.01
        assert gaps[1] < gaps[0] / 3.0


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
def test_trees_of_hinges_with_limits_gain_nothing_and_hold(d):
    """Six balls of 1 to 10 or 1 to 1,000 kg on hinges with limits, thrown at random: no energy is gained, and with
    masses of 1:10 no joint opens by more than a tenth of a ball, which would be told."""
    for seed in range(8):
        rng = np.random.default_rng((seed, d, 77))
        ratio, places = (10.0, 1000.0)[seed % 2], [(None, np.zeros(d))]
        world, joints = world_of(d, seed // 2)
        world.settings = world.settings.replace(on_fault="ignore")
        with world:
            for _ in range(6):
                one, start = places[rng.integers(len(places))]
                at = start + rng.normal(size=d)
                motion = RigidBody(ratio ** rng.uniform(), linear_velocity=rng.normal(size=d))
                spin = Spin(rng.normal() if d == 2 else rng.normal(size=3))
                ball = world.create_entity(Transform(at), motion, spin, SphereCollider(0.4, layer=2, mask=1))
                kept = {"limits": (-0.5, 0.5)} if rng.uniform() < 0.5 else {}
                axis = {} if d == 2 else {"axis": rng.normal(size=3)}
                world.create_entity(Hinge(one, ball, anchor=(start + at) / 2, **kept, **axis))
                places.append((ball, at))
            world.step()  # what the joints do not allow of the speeds is gone
            energy, gap = world.kinetic_energy(), 0.0
            for _ in range(180):
                world.step()
                a, b = joints.anchors()
                gap = max(gap, float(np.linalg.norm(a - b, axis=1).max()))
                assert world.kinetic_energy() < 1.02 * energy
            assert gap < 0.08 or ratio > 10.0


@pytest.mark.slow
@pytest.mark.parametrize("what", ["rope", "driven rope", "weld"])
@pytest.mark.parametrize("d", [2, 3])
def test_what_is_far_from_where_a_joint_asks_comes_back_at_a_bounded_speed(d, what):
    """Bodies 20 m apart, on a rope of 1 m or torn from a weld: in a substep that pulls by 3 % of the way and its arms
    at most, as contacts push by 3 % of a size, where it pulled them past each other in one step; a motor in the island
    changes nothing of it."""
    for seed in range(3):
        world, _ = world_of(d, seed)
        world.settings = world.settings.replace(on_fault="ignore")
        with world:
            a = world.create_entity(Transform(vector(d)), RigidBody(1), SphereCollider(0.2), Spin())
            b = world.create_entity(Transform(vector(d, 1)), RigidBody(3), SphereCollider(0.2), Spin())
            transforms = [world.component_for_entity(entity, Transform) for entity in (a, b)]
            if what == "weld":
                world.create_entity(Weld(a, b, anchor=vector(d, 0.5)))
                world.step()
            transforms[1].position = vector(d, 20)
            if what != "weld":
                world.create_entity(Distance(a, b, least=0.0, most=1.0))
            if what == "driven rope":
                world.create_entity(Motor(None, a, speed=1.0, **({} if d == 2 else {"axis": (1, 0, 0)})))
            apart = 20.0
            for _ in range(600):
                world.step()
                before, apart = apart, float(np.linalg.norm(transforms[1].position - transforms[0].position))
                assert before - apart < 4 * 0.03 * (before + 1.0)
                assert world.kinetic_energy() < 1.0
            assert apart < 1.01

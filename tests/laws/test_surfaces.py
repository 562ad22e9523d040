"""Surfaces that run: friction drives what touches them to their speed, with no more than Coulomb's force."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_modes import along
from worlds import MODES, make_world, mostly_2d

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation, Spin

G, MU = 9.81, 0.5


def velocity(world, entity):
    return world.component_for_entity(entity, RigidBody).linear_velocity


def turning_world(d, mode):
    return World(Physics(d, gravity=along(d, 0.0, -G)), Rotation(), settings=Settings(collision=mode))


@mostly_2d
@pytest.mark.parametrize("mode", MODES)
def test_a_crate_gets_the_speed_of_a_belt_at_mu_g(mode, d):
    """Also in a stack, which the lowest one carries, and none once the belt stands."""
    world, u = make_world(d, G, collision=mode), 3.0
    belt = AABBCollider(along(d, 99.0, 1.0, 99.0), friction=MU, surface_velocity=along(d, u))
    world.create_entity(Transform(along(d, 0.0, -1.0)), belt)
    crate = world.create_entity(Transform(along(d, 0.0, 0.5)), RigidBody(2.0), AABBCollider((0.5,) * d))
    for step in range(1, 60):
        world.step()
        assert np.allclose(velocity(world, crate), along(d, min(u, MU * G * step / 60)), rtol=0.0, atol=1e-12)
    belt.surface_velocity = 0.0
    for step in range(1, 60):
        world.step()
        assert np.allclose(velocity(world, crate), along(d, max(0.0, u - MU * G * step / 60)), rtol=0.0, atol=1e-12)


@mostly_2d
@pytest.mark.parametrize("mode", MODES)
def test_an_impact_on_a_belt_gives_mu_times_its_impulse_at_most(mode, d):
    for u, fall in ((0.5, 3.0), (9.0, 3.0)):
        world = make_world(d, collision=mode)
        surface = {"friction": MU, "surface_velocity": along(d, u)}
        world.create_entity(Transform(along(d, 0.0, -1.0)), AABBCollider(along(d, 99.0, 1.0, 99.0), **surface))
        ball = world.create_entity(
            Transform(along(d, 0.0, 1.0)), RigidBody(2.0, along(d, 0.0, -fall)), SphereCollider(0.5, restitution=1.0)
        )
        for _ in range(20):
            world.step()
        assert np.allclose(velocity(world, ball), along(d, min(u, 2.0 * MU * fall), fall), rtol=0.0, atol=1e-12)


@mostly_2d
def test_surfaces_of_both_bodies_add_and_momentum_stays(d):
    world = make_world(d, G)
    world.create_entity(Transform(along(d, 0.0, -1.0)), AABBCollider(along(d, 99.0, 1.0, 99.0), friction=0.0))
    slab = AABBCollider(along(d, 4.0, 0.25, 4.0), friction=2.0, surface_velocity=along(d, 1.0))
    plank = world.create_entity(Transform(along(d, 0.0, 0.25)), RigidBody(3.0), slab)
    skate = AABBCollider((0.5,) * d, friction=2.0, surface_velocity=along(d, -0.5))
    crate = world.create_entity(Transform(along(d, 0.0, 1.0)), RigidBody(1.0), skate)
    for _ in range(60):
        world.step()
    assert np.allclose(velocity(world, crate) - velocity(world, plank), along(d, 1.5), rtol=0.0, atol=1e-12)
    assert abs(world.momentum()[0]) < 1e-12


@mostly_2d
def test_a_wheel_on_a_belt_spins_and_goes_along_until_it_rolls(d):
    """Friction gives m v = I w / r, until the wheel's underside is as fast as the belt: v = u k / (1 + k), I = k m r².
    """
    world, u, k = turning_world(d, "discrete"), 2.0, 0.5 if d == 2 else 0.4
    belt = BoxCollider(along(d, 99.0, 1.0, 99.0), friction=MU, surface_velocity=along(d, u))
    world.create_entity(Transform(along(d, 0.0, -1.0)), belt)
    wheel = world.create_entity(Transform(along(d, 0.0, 0.5)), RigidBody(), Spin(), SphereCollider(0.5))
    for _ in range(60):
        world.step()
    spin = np.ravel(world.component_for_entity(wheel, Spin).angular_velocity)[-1]
    assert np.allclose(velocity(world, wheel), along(d, u * k / (1.0 + k)), rtol=0.0, atol=1e-9)
    assert np.allclose(spin, (u - u * k / (1.0 + k)) / 0.5, rtol=0.0, atol=1e-9)


def test_a_bar_on_two_rollers_that_run_against_each_other_swings():
    """The roller that it is nearer to bears more and pushes it back: x'' = -mu g x / (L - mu h), h its half height."""
    world, length, start, h, mu = turning_world(2, "discrete"), 2.0, 0.5, 0.1, 0.2
    for side in (-1.0, 1.0):
        roller = SphereCollider(0.5, friction=mu, surface_velocity=(-20.0 * side, 0.0))
        world.create_entity(Transform((side * length, -0.5)), roller)
    bar = world.create_entity(Transform((start, h)), RigidBody(), Spin(), BoxCollider((5.0, h)))
    period, places = 2.0 * math.pi * math.sqrt((length - mu * h) / (mu * G)), []
    for _ in range(round(60 * period)):
        world.step()
        places.append(world.component_for_entity(bar, Transform).position[0])
    expected = start * np.cos(2.0 * math.pi * np.arange(1, len(places) + 1) / 60 / period)
    assert np.abs(places - expected).max() < 0.02 * start


def test_a_belt_turns_with_its_body_and_climbs():
    world, tilt = turning_world(2, "discrete"), math.radians(20.0)
    belt = BoxCollider((99.0, 1.0), friction=0.9, surface_velocity=(1.5, 0.0))
    world.create_entity(Transform((0.0, 0.0), tilt), belt)
    up, out = np.array((math.cos(tilt), math.sin(tilt))), np.array((-math.sin(tilt), math.cos(tilt)))
    crate = world.create_entity(Transform(1.5 * out, tilt), RigidBody(), Spin(), BoxCollider((0.5, 0.5)))
    for _ in range(120):
        world.step()
    assert np.allclose(velocity(world, crate), 1.5 * up, rtol=0.0, atol=1e-9)


def test_what_a_slow_belt_carries_stays_awake():
    world = make_world(2, G, sleeping=True)
    belt = AABBCollider((9.0, 1.0), friction=MU, surface_velocity=1e-3)
    world.create_entity(Transform((0.0, -1.0)), belt)
    crate = world.create_entity(Transform((0.0, 0.5)), RigidBody(), AABBCollider((0.5, 0.5)))
    for _ in range(120):
        world.step()
    body = world.component_for_entity(crate, RigidBody)
    assert not body.asleep
    assert abs(body.linear_velocity[0] - 1e-3) < 1e-12
    belt.surface_velocity = 0.0
    for _ in range(60):
        world.step()
    assert body.asleep

"""Impacts on parabolas at the time of the closed form: static geometry, the apex, different accelerations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_modes import along, mode_world, strikes
from helpers_pairwise import pairwise
from worlds import ball, both_dimensions, box, position, velocity

from carom.components import RigidBody, SphereCollider, Transform

G = 9.81


@pytest.mark.parametrize(
    ("method", "dt", "target", "d"),
    pairwise(
        (("continuous", "velocity_verlet"), ("continuous", "rk4"), ("continuous", "yoshida4"), ("event_driven", "rk4")),
        (1.0, 1 / 60), ("floor", "ball", "face", "corner", "box on box"), (2, 3),
    ),
)  # fmt: skip
def test_parabolas_onto_static_geometry(method, dt, target, d):
    """Traced back 0.9 s from the touch, so time, normal and point are known; to 1e-12, in a single step of 1 s."""
    gravity, (mode, integrator) = np.array(along(d, 1.5, -G, 0.5)), method
    world = mode_world(mode, d, gravity, dt=dt, integrator=integrator, restitution_threshold=0.0)
    normal = np.array(along(d, 0.6, -0.8))  # from the body to the static shape
    if target in ("floor", "face", "box on box"):
        normal = np.array(along(d, 0.0, -1.0) if target == "floor" else along(d, 1.0))
    centre, size = np.array(along(d, 3.0, 2.0, 1.0)), 0.7
    if target == "ball":
        ball(world, centre, radius=size, kind="static")
        touch = centre - (size + 0.4) * normal
    elif target == "corner":
        box(world, centre, half=size, kind="static")
        touch = centre + size * np.array(along(d, -1.0, 1.0)) - 0.4 * normal  # in 3D the edge
    else:
        box(world, centre, half=size, kind="static")
        touch = centre - (size + 0.4) * normal + 0.3 * np.array(along(d, -normal[1], normal[0]))
    impact = np.array(along(d, 14.0, -11.0, 3.0))
    start, speed = touch - impact * 0.9 + gravity * 0.9**2 / 2, impact - gravity * 0.9
    shape = {"half": 0.4} if target == "box on box" else {"radius": 0.4}
    mover = (box if "half" in shape else ball)(world, start, speed, restitution=1.0, **shape)
    steps = round(1 / dt)
    hits = strikes(world, steps)
    assert hits.time.tolist() == pytest.approx([0.9], abs=1e-12)
    np.testing.assert_allclose(-hits.normal[0], normal, atol=1e-12)
    after = impact - 2 * (impact @ normal) * normal
    np.testing.assert_allclose(velocity(world, mover), after + gravity * 0.1, atol=1e-11)
    np.testing.assert_allclose(position(world, mover), touch + after * 0.1 + gravity * 0.005, atol=1e-11)


@both_dimensions
@pytest.mark.parametrize("mode", ["continuous", "event_driven"])
@pytest.mark.parametrize("dt", [0.25, 1.0])
@pytest.mark.parametrize("target", ["ball", "box"])
def test_the_top_of_a_parabola_touches_a_ceiling(mode, dt, target, d):
    """An apex ``over`` too high meets the ceiling at (v0 - sqrt(2 g over)) / g, to 1e-16 over the speed there."""
    g, v0, top = 8.0, 0.88, 0.88**2 / 16
    for over in (1e-3, 1e-6, 1e-9, 1e-12, -1e-12, -1e-9):
        world = mode_world(mode, d, g, dt=dt, integrator="velocity_verlet", restitution_threshold=0.0)
        (ball if target == "ball" else box)(world, along(d, 0.0, top - over + 1.0), kind="static")
        ball(world, along(d), along(d, 0.0, v0), restitution=1.0)
        hits = strikes(world, 1)
        slow = math.sqrt(2 * g * max(over, 0.0))
        expected = [(v0 - slow) / g] if over > 0 else []
        assert hits.time.tolist() == pytest.approx(expected, abs=1e-15 / slow if expected else None), over


@pytest.mark.parametrize("dt", [2.0, 1 / 60])
@pytest.mark.parametrize(
    ("mode", "integrator"),
    [("continuous", "velocity_verlet"), ("continuous", "rk4"), ("event_driven", "semi_implicit_euler")],
)
def test_two_bodies_on_different_parabolas(mode, integrator, dt):
    """One falls with g and a constant force, the other with a quarter of g: their distance is a parabola too."""
    world = mode_world(mode, gravity=G, dt=dt, integrator=integrator, restitution_threshold=0.0)
    upper = RigidBody(1.0, constant_force=(0.0, -3.0))
    world.create_entity(Transform((0.0, 5.0)), upper, SphereCollider(0.2, restitution=1.0))
    lower = RigidBody(2.0, (0.0, 1.0), gravity_scale=0.25)
    world.create_entity(Transform((0.0, 0.0)), lower, SphereCollider(0.3, restitution=1.0))
    hits = strikes(world, round(2 / dt))
    closing = 0.75 * G + 3.0
    assert hits.time.tolist() == pytest.approx([(math.sqrt(1 + 2 * closing * 4.5) - 1) / closing], abs=1e-12)

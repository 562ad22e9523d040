"""Water: what it carries, holds and slows, against closed forms, with contacts, joints and forces on what is in it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from worlds import METHODS, MODES, both_dimensions, box, run, velocity

from carom import (
    AABBCollider,
    BoxCollider,
    Distance,
    ForceSystem,
    HalfSpaceCollider,
    Joints,
    PartOf,
    Parts,
    Physics,
    RigidBody,
    Rotation,
    Settings,
    SphereCollider,
    Spin,
    Transform,
    Water,
    World,
    Zones,
)
from carom.plugins import half_space

G = 10.0


def sea(*plugins, d=2, gravity=G, **water):
    """Water up to y = 0, and the settings among what is given."""
    settings = {name: water.pop(name) for name in ("dt", "collision", "integrator") if name in water}
    world = World(Physics(d, gravity=(0, -gravity, 0)[:d]), Zones(), *plugins, settings=Settings(**settings))
    water = Water(1000.0, **water)
    world.create_entity(Transform((0, -50, 0)[:d]), AABBCollider((100, 50, 100)[:d], sensor=True), water)
    return world


class Push(ForceSystem):
    def add_forces(self, bodies, time):
        bodies.force[:, 0] += 3000.0


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("drag", "dt"), [(1.0, 1 / 60), (10.0, 1 / 60), (10.0, 1 / 240)])
@pytest.mark.parametrize("held", ["contact", "joint"])
def test_a_raft_displaces_what_it_carries(held, drag, dt, mode):
    """In an event-driven world, which sums forces at both ends of the free flight, but for dt^2."""
    world = sea(Joints(), drag=drag, dt=dt, collision=mode)
    raft = box(world, (0, 0), half=(1, 0.5), mass=50.0)
    load = box(world, (0, 1.0) if held == "contact" else (0, -3), half=0.5, mass=600.0, layer=2, mask=1)
    if held == "joint":
        world.component_for_entity(load, AABBCollider).mask = 2
        world.create_entity(Distance(raft, load))
    run(world, round(25 / dt))
    assert 2000.0 * (0.5 - world.component_for_entity(raft, Transform).y) == pytest.approx(
        650.0, abs=20.0 * (60 * dt) ** 2 if mode == "event_driven" else 0.2
    )


@pytest.mark.parametrize("mode", MODES)
def test_a_stone_weighs_what_it_does_not_displace(mode):
    """On the ground, and on a rod."""
    world = sea(joints := Joints(), drag=10.0, collision=mode)
    box(world, (0, -11), half=(50, 1), kind="static")
    stone = box(world, (0, -9.5), half=0.5, mass=3000.0)
    rod = world.create_entity(Distance(None, box(world, (5, -5), half=0.5, mass=3000.0), point_a=(5, 2)))
    run(world, 300)
    assert sum(c.normal_impulse for c in world.contacts.of(stone)) * 60 == pytest.approx(20000.0, rel=1e-9)
    assert joints.state(rod).impulse[1] * 60 == pytest.approx(20000.0, rel=1e-6)


@pytest.mark.parametrize("settings", [{"integrator": name} for name in METHODS] + [{"collision": "event_driven"}])
@pytest.mark.parametrize("drag", [3.0, 60.0])
def test_forces_and_drag_agree(settings, drag):
    """Without a force e^(-c t) is left of the speed; with one the body ends at flow + force / (displaced mass c)."""
    world = sea(gravity=0.0, drag=drag, flow=(0.5, 0), **settings)
    one = box(world, (0, -20), (4.5, 0), half=0.5, mass=1000.0)
    run(world, 15)
    assert velocity(world, one)[0] == pytest.approx(0.5 + 4.0 * math.exp(-drag / 4), rel=1e-9)
    world.add_system(Push())
    run(world, 600)
    assert velocity(world, one)[0] == pytest.approx(0.5 + 3.0 / drag, rel=1e-9)


@pytest.mark.parametrize("integrator", ["velocity_verlet", "rk4", "yoshida4"])
@pytest.mark.parametrize("parts", [False, True])
def test_water_without_drag_keeps_the_energy_of_what_bobs(integrator, parts):
    """Kinetic, of height, and of what the body has pushed aside, by a sum over its squares."""
    world = sea(Rotation(), Parts(), drag=0.0, integrator=integrator)
    half, mass, tilt = (1.0, 0.4), 500.0, 0.3
    bob = world.create_entity(Transform((0, 1.0), tilt), RigidBody(mass=mass), Spin(inertia=mass * 1.16 / 3))
    if parts:
        for x in (-0.5, 0.5):
            world.create_entity(PartOf(bob, position=(x, 0), mass=0.0), BoxCollider((0.5, 0.4)))
    else:
        world.add_component(bob, BoxCollider(half))
    x, y = np.meshgrid((np.arange(400) + 0.5) / 200 - 1, (np.arange(160) + 0.5) / 80 - 1)
    place, found = world.component_for_entity(bob, Transform), []
    for k in range(901):
        if k % 150 == 0:
            depth = -(place.y + math.sin(place.rotation) * x * half[0] + math.cos(place.rotation) * y * half[1])
            aside = 1000.0 * G * np.maximum(depth, 0).mean() * 4 * half[0] * half[1]
            found.append(world.kinetic_energy() + mass * G * place.y + aside)
        world.step()
    np.testing.assert_allclose(found, 5000.0, rtol=2e-3)


@both_dimensions
def test_a_half_space_of_water_is_a_sea_without_end(d):
    up = (0, 1, 0)[:d]
    world = World(Physics(d, gravity=tuple(-G * u for u in up)), Zones(), half_space.plugin)
    world.create_entity(Transform((0, 3, 0)[:d]), HalfSpaceCollider(up, sensor=True), Water(1000.0, drag=3.0))
    floats = [box(world, (x, y, 0)[:d], half=0.5, mass=300.0) for x, y in ((0.0, 3.0), (1e5, -40.0))]
    ball = world.create_entity(Transform((-5, 5, 0)[:d]), RigidBody(1.0), SphereCollider(0.5))
    run(world, 1800)
    for entity in floats:
        assert world.component_for_entity(entity, Transform).y == pytest.approx(3.2, abs=1e-6)
    assert 3.4 < world.component_for_entity(ball, Transform).y < 3.5

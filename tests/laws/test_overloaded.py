"""Laws of islands that are too heavy to bear themselves: they keep momentum and gain no energy, and stand on floors."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_pairwise import pairwise
from laws.helpers_laws import MODES

from carom import Physics, Settings, World
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.plugins.joints import Distance, Joints
from carom.plugins.rotation import BoxCollider, Rotation, Spin

G = 10.0
DOWN = np.array((0.0, -G, 0.0))
LIGHT, HEAVY, BLOW = 1.0, 1e10, 1e6  # kg
ROUNDING = 1e-6  # of a momentum: 1e-16 of that of the heavy body under its weight, in each substep
LAID = 1.001  # m between boxes of 1 m
CASES = pairwise((2, 3), MODES, ("glides", "turns", "joined"))


class Scene:
    """Boxes of 1 m, the heavy one on light ones, and a ball of 1e6 kg that comes from the left at 1 m/s."""

    def __init__(self, d, mode, kind):
        joints = Joints()
        plugins = {"glides": (), "turns": (Rotation(),), "joined": (Rotation(), joints)}[kind]
        settings = Settings(collision=mode, on_fault="ignore")
        self.d, self.turns = d, kind != "glides"
        self.world = World(Physics(d, gravity=DOWN[:d]), *plugins, settings=settings)
        self.box = BoxCollider if self.turns else AABBCollider

    def add(self, place, mass, velocity=(0.0, 0.0, 0.0), shape=None):
        spin = (Spin(),) if self.turns else ()
        shape = self.box((0.5,) * self.d) if shape is None else shape
        return self.world.create_entity(
            Transform(tuple(place)[: self.d]), RigidBody(mass, tuple(velocity)[: self.d]), shape, *spin
        )

    def tower(self, bottom, velocity=(0.0, 0.0, 0.0)):
        return [self.add((0.0, bottom + LAID * k, 0.0), m, velocity) for k, m in enumerate((LIGHT, LIGHT, HEAVY))]

    def approach_extents(self, height):
        return self.add((-1.2, height, 0.0), BLOW, (1.0, 0.0, 0.0), SphereCollider(0.5))


def told(world):
    return any("too heavy" in text for text in world.faults)


@pytest.mark.slow
@pytest.mark.parametrize(("d", "mode", "kind"), CASES)
def test_what_falls_freely_keeps_momentum_and_energy(d, mode, kind):
    """In the frame that falls with it no force acts: there momentum stays, and kinetic energy never rises."""
    scene = Scene(d, mode, kind)
    with scene.world as world:
        boxes = scene.tower(0.5)
        scene.approach_extents(0.5 + 2 * LAID)
        if kind == "joined":
            world.create_entity(Distance(boxes[0], boxes[2], length=2 * LAID))
        bodies = world.bodies.dynamic
        mass = bodies.mass[:, None]
        momentum = world.momentum()
        highest = start = world.kinetic_energy()
        for _ in range(60):
            world.step()
            falling = world.time * DOWN[:d]
            relative = bodies.linear_velocity - falling
            np.testing.assert_allclose((mass * relative).sum(axis=0), momentum, atol=ROUNDING * BLOW)
            energy = world.kinetic_energy() + 0.5 * float((mass * (relative**2 - bodies.linear_velocity**2)).sum())
            assert energy <= highest * (1 + ROUNDING)
            highest = max(highest, energy)
        assert told(world)
        assert highest < 1.01 * start


@pytest.mark.slow
@pytest.mark.parametrize(("d", "mode", "kind"), CASES)
def test_a_floor_without_friction_takes_no_momentum_along_it(d, mode, kind):
    """It bears the pile, but what a blow gives along the floor stays, and no energy comes from it."""
    scene = Scene(d, mode, kind)
    with scene.world as world:
        world.create_entity(Transform((0.0, -0.5, 0.0)[:d]), scene.box((100.0, 0.5, 100.0)[:d]))
        boxes = scene.tower(0.5)
        scene.approach_extents(0.5 + 2 * LAID)
        momentum, highest = world.momentum()[0], world.kinetic_energy() + world.potential_energy()
        for _ in range(60):
            world.step()
            assert world.momentum()[0] == pytest.approx(momentum, rel=1e-3)
            energy = world.kinetic_energy() + world.potential_energy()
            assert energy <= highest * (1 + 1e-9)
            highest = max(highest, energy)
        assert told(world)
        if kind == "glides":  # without friction boxes that turn are pressed aside
            assert world.component_for_entity(boxes[2], Transform).position[1] == pytest.approx(2.5, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("d", "mode", "speed"), pairwise((2, 3), MODES, (1.0, -1.0, -3.0)))
def test_a_lift_carries_an_overloaded_tower(d, mode, speed):
    """As a floor does, whichever way it moves."""
    scene, velocity = Scene(d, mode, "glides"), (0.0, speed, 0.0)
    with scene.world as world:
        lift = RigidBody(linear_velocity=velocity[:d], kind="kinematic")
        world.create_entity(Transform((0.0, -0.5, 0.0)[:d]), lift, scene.box((5.0, 0.5, 5.0)[:d]))
        top = scene.tower(0.5, velocity)[2]
        for _ in range(120):
            world.step()
            height = world.component_for_entity(top, Transform).position[1] - speed * world.time
            assert height == pytest.approx(2.5, abs=0.05)
        assert told(world)
        assert world.component_for_entity(top, RigidBody).linear_velocity[1] == pytest.approx(speed, abs=1e-3)

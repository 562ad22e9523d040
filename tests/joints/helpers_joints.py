"""Worlds with joints, and bodies of two dimensions for them."""

from __future__ import annotations

from typing import Any

import numpy as np

from carom import Phase, Physics, RigidBody, Settings, SphereCollider, StepError, System, Transform, World
from carom.plugins.joints import Hinge, Joints
from carom.plugins.rotation import BoxCollider, Rotation, Spin

G = 9.81


def joint_world(gravity: Any = (0.0, -G), d: int = 2, **settings: Any) -> tuple[World, Joints]:
    joints = Joints()
    return World(Physics(dimensions=d, gravity=gravity), Rotation(), joints, settings=Settings(**settings)), joints


def disc(world: World, place: Any, radius: float = 0.1, mass: float = 1.0, **spin: Any) -> int:
    return world.create_entity(
        Transform(place), RigidBody(mass=mass), SphereCollider(radius), Spin(**({"inertia": 1.0} | spin))
    )


def plank(world: World, place: Any, half: Any = (0.5, 0.1), mass: float = 1.0, angle: float = 0.0) -> int:
    return world.create_entity(Transform(place, angle), RigidBody(mass=mass), BoxCollider(half), Spin())


def chain(world: World, links: int, way: Any, half: Any, hangs: bool = True) -> tuple[list[int], list[int]]:
    """(links of length 1 one after the other, from the origin along a way; the hinges before each)."""
    way, bodies, hinges = np.asarray(way, float), [], []
    for k in range(links):
        bodies.append(plank(world, (k + 0.5) * way, half))
        if k or hangs:
            hinges.append(world.create_entity(Hinge(bodies[k - 1] if k else None, bodies[k], anchor=k * way)))
    return bodies, hinges


def run_failing(world: World, steps: int, due: int) -> None:
    """The same, where the step of that number, if any, fails at its end once and is taken again."""

    class Fails(System):
        phase = Phase.END
        fails = due >= 0

        def process(self, dt: float) -> None:
            if self.fails and self.world.step_count == due:
                self.fails = False
                raise RuntimeError("once")

    system = Fails()
    world.add_system(system)
    for _ in range(steps):
        try:
            world.step()
        except StepError:
            world.step()
    assert not system.fails


def at(world: World, body: int) -> Transform:
    return world.component_for_entity(body, Transform)


def spin_of(world: World, body: int) -> float:
    return float(world.component_for_entity(body, Spin).angular_velocity)


def gaps(world: World, hinges: list[int]) -> np.ndarray:
    """m, by which the two ends of each joint are apart."""
    found = []
    for hinge in hinges:
        joint = world.component_for_entity(hinge, Hinge)
        ends = []
        for body, local in ((joint.a, joint.at_a), (joint.b, joint.at_b)):
            if not body:
                ends.append(np.asarray(local))
                continue
            angle, place = at(world, body).rotation, at(world, body).position
            c, s = np.cos(angle), np.sin(angle)
            ends.append(place + np.array(((c, -s), (s, c))) @ local)
        found.append(np.linalg.norm(ends[1] - ends[0]))
    return np.array(found)

"""A car with sprung wheels and a motor drives over hills."""

import math
from typing import Any

from carom import Physics, RigidBody, Settings, SphereCollider, Transform, World, create_chain
from carom.framework.elementary import cos
from carom.plugins import terrain
from carom.plugins.joints import Joints, Wheel
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.scenes.sizes import real

LENGTH, START = 120.0, -6.0  # m of road, and where the car starts
PIECE = 1.0  # m of a piece of road
HILL, WAVE = 0.6, 15.0  # m
WHEEL, BASE = 0.4, 1.3  # m: radius, and from the middle of the car to an axle
SPEED = 30.0  # rad/s of the wheels
TORQUE = 60.0  # N m
SPRING, RATIO = 4.0, 0.7  # Hz of the suspension, and its damping ratio
TRAVEL = 0.25  # m
SECONDS = 9.0
VIEW = ((-10.0, -4.0), (100.0, 12.0))


def height(x: float) -> float:
    """Of the road: flat at both ends."""
    rise = min(1.0, max(0.0, x / 10.0)) * min(1.0, max(0.0, (LENGTH - 20.0 - x) / 10.0))
    return HILL * rise * (1.0 - cos(2.0 * math.pi * x / WAVE))


def build(settings: Settings | None = None, seed: int = 0, *, speed: float = SPEED) -> World:
    """A motor turns the rear wheel against the car, up to ``speed``; ``seed`` changes nothing."""
    speed = real(speed, "speed")
    physics = Physics(dimensions=2, gravity=(0.0, -9.81))
    world = World(physics, Rotation(), Joints(), terrain.plugin, settings=settings)
    road = [(k * PIECE, height(k * PIECE)) for k in range(-20, int(LENGTH / PIECE) + 1)]
    create_chain(world, road, friction=0.9)
    chassis = world.create_entity(
        Transform((START, WHEEL + 0.5)), RigidBody(mass=20.0), BoxCollider((1.8, 0.25), friction=0.3), Spin()
    )
    for side in (-1, 1):
        axle = START + side * BASE, WHEEL
        wheel = world.create_entity(Transform(axle), RigidBody(mass=3.0), SphereCollider(WHEEL, friction=0.9), Spin())
        motor: dict[str, Any] = {"motor_speed": -speed, "max_torque": TORQUE} if side < 0 else {}
        spring = {"frequency": SPRING, "damping_ratio": RATIO, "rest": -0.1}
        world.create_entity(Wheel(chassis, wheel, axle, (0.0, 1.0), limits=(-TRAVEL, TRAVEL), **spring, **motor))
    return world

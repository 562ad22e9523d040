"""Ragdolls of ten parts, whose joints bend as far as those of people, fall down stairs."""

import numpy as np

from carom import Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.plugins.joints import Hinge, Joints
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.scenes.sizes import whole

DOLLS = 4
STEPS, STEP = 8, (1.2, 0.6)  # of the stairs, m
FRICTION = 0.5

# Parts: place and half size, m, of a doll whose hip is at the origin; each hangs on an earlier one, at a place, and
# bends by so much against it, rad.
PARTS = {
    "chest": ((0.0, 0.35), (0.18, 0.3)),
    "head": ((0.0, 0.83), None),
    "upper_arm_l": ((-0.38, 0.57), (0.18, 0.06)),
    "lower_arm_l": ((-0.76, 0.57), (0.18, 0.05)),
    "upper_arm_r": ((0.38, 0.57), (0.18, 0.06)),
    "lower_arm_r": ((0.76, 0.57), (0.18, 0.05)),
    "thigh_l": ((-0.1, -0.2), (0.08, 0.22)),
    "shin_l": ((-0.1, -0.66), (0.06, 0.22)),
    "thigh_r": ((0.1, -0.2), (0.08, 0.22)),
    "shin_r": ((0.1, -0.66), (0.06, 0.22)),
}
JOINTS = (
    ("chest", "head", (0.0, 0.66), (-0.6, 0.6)),
    ("chest", "upper_arm_l", (-0.2, 0.57), (-1.4, 1.4)),
    ("upper_arm_l", "lower_arm_l", (-0.57, 0.57), (-2.2, 0.1)),
    ("chest", "upper_arm_r", (0.2, 0.57), (-1.4, 1.4)),
    ("upper_arm_r", "lower_arm_r", (0.57, 0.57), (-0.1, 2.2)),
    ("chest", "thigh_l", (-0.1, 0.03), (-1.2, 0.8)),
    ("thigh_l", "shin_l", (-0.1, -0.43), (-0.1, 2.2)),
    ("chest", "thigh_r", (0.1, 0.03), (-0.8, 1.2)),
    ("thigh_r", "shin_r", (0.1, -0.43), (-2.2, 0.1)),
)
HEAD = 0.16  # m, its radius
DENSITY = 60.0  # kg/m^2
BODY, LIMBS = 1, 2  # layers: parts of dolls meet the stairs, and not each other
SECONDS = 10.0
VIEW = ((-3.0, -7.0), (18.0, 12.0))


def _doll(world: World, hip: np.ndarray, velocity: np.ndarray) -> list[int]:
    """One doll; returns its joints."""
    parts = {}
    for name, (place, half) in PARTS.items():
        area = np.pi * HEAD**2 if half is None else 4.0 * half[0] * half[1]
        material = {"friction": FRICTION, "layer": LIMBS, "mask": BODY}
        collider = SphereCollider(HEAD, **material) if half is None else BoxCollider(half, **material)
        body = RigidBody(mass=DENSITY * area, linear_velocity=velocity)
        parts[name] = world.create_entity(Transform(hip + place), body, collider, Spin())
    return [
        world.create_entity(Hinge(parts[one], parts[other], anchor=hip + place, limits=limits))
        for one, other, place, limits in JOINTS
    ]


def build(settings: Settings | None = None, seed: int = 0, *, n: int = DOLLS) -> World:
    """``n`` dolls above the stairs, thrown as ``seed`` says."""
    n = whole(n, "n")
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), Rotation(), Joints(), settings=settings)
    width, height = STEP
    for k in range(STEPS):
        world.create_entity(
            Transform(((k + 0.5) * width, -(k + 5.0) * height)),
            BoxCollider((0.5 * width, 5.0 * height), friction=FRICTION, layer=BODY),
        )
    end = STEPS * width
    world.create_entity(
        Transform((end + 10.0, -STEPS * height - 5.0)), BoxCollider((10.0, 5.0), friction=FRICTION, layer=BODY)
    )
    world.create_entity(Transform((-1.0, 0.0)), BoxCollider((1.0, 10.0), friction=FRICTION, layer=BODY))
    random = np.random.default_rng(seed)
    for k in range(n):
        hip = np.array((1.5 + 0.4 * (k % 3), 2.0 + 2.5 * k))
        _doll(world, hip, random.uniform((1.0, -2.0), (4.0, 2.0)))
    return world

"""Joints of a plugin, whose rows a function gives, and worlds that have them."""

from __future__ import annotations

import math

import numpy as np
from joints.helpers_joints import G, joint_world

from carom import Plugin, RigidBody, Transform, column
from carom.framework.typing import Vector
from carom.framework.vectors import add, divided, dot, length, replace, scale, sub
from carom.plugins.joints import CUSTOM, HOLD, LIMIT, Driven, Joint, Row, arm_of, moment
from carom.plugins.rotation import Spin

machines = Plugin("machines", version="1.0")


@machines.joint
class Gear(Joint):
    a: int | None = column(dtype=int)
    b: int | None = column(dtype=int)
    ratio: float = column(default=1.0)
    axle_a: Vector = column(default=0.0, item="vector", kw_only=True)
    axle_b: Vector = column(default=0.0, item="vector", kw_only=True)

    @staticmethod
    def constraint(joint, a, b):
        nothing = scale(a.position, 0.0)
        axis_a = axis_b = replace(nothing, 0, 1.0)
        if len(nothing) == 3:
            axis_a, axis_b = arm_of(a, joint.axle_a), arm_of(b, joint.axle_b)
        return None, nothing, axis_a, nothing, scale(axis_b, joint.ratio)


@machines.joint
class Pulley(Joint):
    a: int | None = column(dtype=int)
    b: int | None = column(dtype=int)
    wheel_a: Vector = column(item="vector")
    wheel_b: Vector = column(item="vector")
    ratio: float = column(default=1.0, positive=True)
    anchor_a: Vector = column(default=0.0, item="vector", kw_only=True)
    anchor_b: Vector = column(default=0.0, item="vector", kw_only=True)

    @staticmethod
    def constraint(joint, a, b):
        arm_a, arm_b = arm_of(a, joint.anchor_a), arm_of(b, joint.anchor_b)
        rope_a, rope_b = sub(add(a.position, arm_a), joint.wheel_a), sub(add(b.position, arm_b), joint.wheel_b)
        along_a, along_b = divided(rope_a, length(rope_a)), scale(rope_b, joint.ratio / length(rope_b))
        whole = length(rope_a) + joint.ratio * length(rope_b)
        return whole, along_a, moment(arm_a, along_a), along_b, moment(arm_b, along_b)


@machines.joint
class Rod(Joint):
    """As Distance is, written as a function."""

    a: int | None = column(dtype=int)
    b: int | None = column(dtype=int)
    anchor_a: Vector = column(default=0.0, item="vector")
    anchor_b: Vector = column(default=0.0, item="vector")

    @staticmethod
    def constraint(joint, a, b):
        arm_a, arm_b = arm_of(a, joint.anchor_a), arm_of(b, joint.anchor_b)
        way = sub(add(b.position, arm_b), add(a.position, arm_a))
        along = divided(way, length(way))
        back = scale(along, -1.0)
        return length(way), back, moment(arm_a, back), along, moment(arm_b, along)


@machines.joint
class Stop(Joint):
    """b turns against a by ``most`` at most."""

    a: int | None = column(dtype=int)
    b: int | None = column(dtype=int)
    axle: Vector = column(default=0.0, item="vector")
    most: float = column(default=1.0)

    @staticmethod
    def constraint(joint, a, b):
        nothing = scale(a.position, 0.0)
        axis = replace(nothing, 0, 1.0) if len(nothing) == 2 else arm_of(a, joint.axle)
        return None, nothing, scale(axis, -1.0), nothing, axis

    def rows(self, dimensions):
        return [Row(CUSTOM, LIMIT, low=-math.inf, high=self.most)]


@machines.joint
class Rail(Driven):
    """b's way along x, and its height: two values with rules of their own."""

    a: int | None = column(dtype=int)
    b: int | None = column(dtype=int)
    rule: int = column(default=-1, dtype=int)
    to: float = column(default=0.0)

    @staticmethod
    def constraint(joint, a, b):
        nothing = scale(b.position, 0.0)
        x, y = replace(nothing, 0, 1.0), replace(nothing, 1, 1.0)
        return (
            (b.position[0], nothing, nothing, x, nothing),
            (dot(b.position, y), nothing, nothing, y, nothing),
        )

    def rows(self, dimensions):
        along = Row(CUSTOM, HOLD, 0.0, most=50.0)
        across = Row(CUSTOM, HOLD, 0.0, part=1)
        if self.rule >= 0:
            rule = along._replace(rule=self.rule, low=self.to, high=self.to + 1.0, target=self.to)
            return [rule._replace(frequency=1.0, damping_ratio=0.0), across]
        return [*self.moving(along, 5.0), across]


def machine_world(dimensions=2, gravity=G, **settings):
    world, joints = joint_world((0.0, -gravity, 0.0)[:dimensions], dimensions, **settings)
    world.add_plugin(machines)
    return world, joints


def body(world, place, inertia=0.0, mass=1.0, **fields):
    d = world.dimensions
    spin = [Spin(inertia=inertia if d == 2 else np.full(3, inertia))] if inertia else []
    return world.create_entity(Transform((*place, 0)[:d]), RigidBody(mass=mass, **fields), *spin)

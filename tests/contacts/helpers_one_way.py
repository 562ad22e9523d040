"""Worlds with one-way platforms, and bodies thrown at them."""

from __future__ import annotations

import numpy as np
import pytest
from worlds import position

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics
from carom.plugins.capsule import plugin as capsule

G = 10.0
REST = 0.0025  # half the slop of 0.005 of a size of 1, or less
SHAPES = {"ball": lambda **c: SphereCollider(0.5, **c), "box": lambda **c: AABBCollider(0.5, **c)}
each_shape = pytest.mark.parametrize("shape", SHAPES)


def platform(half=2.0, **collider):
    """A box without height, solid from above."""
    return AABBCollider((half, 0.0), **{"one_way": (0, 3), **collider})


def make_world(*segments, with_capsules=False, **settings):
    """One segment from x = -2 to 2 unless given; a distant box and ball, so that all tests share compiled code."""
    plugins = (capsule,) if with_capsules else ()
    world = World(
        Physics(dimensions=2, gravity=(0, -G)), *plugins, settings=Settings(**settings))
    for segment in segments or ((Transform((0, 0)), platform()),):
        world.create_entity(*segment)
    world.create_entity(Transform((1e5, -1)), AABBCollider(0.5))
    world.create_entity(Transform((2e5, -1)), SphereCollider(0.5))
    return world


def throw(world, place, velocity=(0.0, 0.0), shape="box", **collider):
    made = SHAPES[shape](**collider) if isinstance(shape, str) else shape
    return world.create_entity(Transform(place), RigidBody(linear_velocity=velocity), made)


def run(world, seconds, *entities):
    """Heights of the entities after each step, (steps, entities)."""
    heights = []
    for _ in range(round(60 * seconds)):
        world.step()
        heights.append([position(world, entity)[1] for entity in entities])
    return np.array(heights)

"""Spins that impacts give: what turns by them within the step is swept as well."""

from __future__ import annotations

import math

import pytest

from carom import Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.plugins.rotation import BoxCollider, Rotation, Spin


@pytest.mark.parametrize("mode", ["continuous", "event_driven"])
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("lying", [0, 1000])
def test_what_is_struck_into_spin_passes_through_nothing(lying, d, mode):
    """Two bullets strike the ends of a rod, whose centre stays where it is: it meets the posts within the step, however
    many bodies lie 1 km away, on which the margin of what is searched depends."""
    pad = (0.0,) * (d - 2)
    world = World(Physics(d, gravity=0), Rotation(), settings=Settings(collision=mode))
    body = RigidBody(mass=1.0)
    rod = world.create_entity(Transform((0.0, 0.0, *pad)), body, Spin(), BoxCollider((0.05, 1.0, *(0.05,) * (d - 2))))
    posts = []
    for s in (1.0, -1.0):
        bullet = RigidBody(mass=0.5, linear_velocity=(80.0 * s, 0.0, *pad))
        world.create_entity(Transform((-0.5 * s, 0.9 * s, *pad)), bullet, SphereCollider(0.05))
        place = Transform((0.22 * s, 0.8 * s, *pad))
        posts.append(world.create_entity(place, SphereCollider(0.02, restitution=0.5)))
    for i in range(lying):
        place = Transform((1000.0 + 3 * (i % 32), 3.0 * (i // 32), *pad))
        world.create_entity(place, RigidBody(), SphereCollider(0.5))
    struck = set()
    for _ in range(3):
        world.step()
        impacts = world.contacts.impacts
        struck |= {int(b) for a, b in zip(impacts.entity_a, impacts.entity_b, strict=True) if a == rod}
    assert struck >= set(posts)
    turn = world.component_for_entity(rod, Transform).rotation
    angle = turn if d == 2 else 2 * math.atan2(turn[3], turn[0])
    assert -0.3 < angle < 0.0
    world.close()

"""One manifold per pair and step: what is read of it is what the pair's function says where the bodies are."""

from __future__ import annotations

import numpy as np
import pytest

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Phase, Settings, System, World
from carom.plugins import Physics, half_space
from carom.plugins.half_space import HalfSpaceCollider

TOLERANCE = 1e-9  # of the extents, which are 1
STAYS = 5e-6  # of them, a thousandth of the slop: what rests and moves by less keeps its point


def overlap(world: World, a: int, b: int) -> tuple[float, np.ndarray, np.ndarray]:
    """(depth, normal, point) of a sphere on a half space, or of two spheres, in closed form."""
    one, two = (world.component_for_entity(entity, Transform).position for entity in (a, b))
    radius = world.component_for_entity(b, SphereCollider).radius
    if world.has_component(a, SphereCollider):
        way = two - one
        distance = float(np.linalg.norm(way))
        depth, normal = world.component_for_entity(a, SphereCollider).radius + radius - distance, way / distance
        return depth, normal, one + (world.component_for_entity(a, SphereCollider).radius - depth / 2) * normal
    normal = np.asarray(world.component_for_entity(a, HalfSpaceCollider).normal)
    normal = normal / np.linalg.norm(normal)
    depth = radius - float((two - one) @ normal)
    return depth, normal, two - (radius - depth / 2) * normal


def heap(slope: float, **options) -> World:
    """Spheres that fall onto a slope and onto each other, slide and roll off."""
    rng = np.random.default_rng(3)
    world = World(Physics(dimensions=2, gravity=(0.0, -10.0)), half_space.plugin, settings=Settings(**options))
    world.create_entity(Transform((0.0, 0.0)), HalfSpaceCollider((slope, 1.0), friction=0.5))
    for k in range(12):
        at = (float(rng.uniform(-1.0, 1.0)), 0.6 + 1.05 * k)
        world.create_entity(Transform(at), RigidBody(mass=1.0), SphereCollider(radius=0.5, friction=0.3))
    return world


@pytest.mark.slow
@pytest.mark.parametrize("slope", [0.0, 0.2])
@pytest.mark.parametrize("collision", ["discrete", "event_driven"])
def test_contacts_of_a_step_are_those_at_its_end(slope, collision):
    seen, depths = 0, []
    with heap(slope, collision=collision) as world:
        for _ in range(240):
            world.step()
            for contact in world.contacts:
                depth, normal, point = overlap(world, contact.entity_a, contact.entity_b)
                assert contact.depth == pytest.approx(max(0.0, depth), abs=TOLERANCE)
                if contact.normal_impulse == 0.0:  # else that along which they pushed
                    np.testing.assert_allclose(contact.normal, normal, atol=TOLERANCE)
                if contact.depth > 0.0:
                    near = STAYS if contact.normal_impulse > 0.0 else TOLERANCE
                    np.testing.assert_allclose(contact.point, point, atol=near)
                depths.append(depth)
                seen += 1
    assert seen > 500
    assert max(depths) > 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("slope", [0.0, 0.2])
def test_contacts_that_a_system_reads_are_those_at_the_end_of_free_flight(slope):
    """Also of pairs that rested, of which the step itself looks at its start; and reading changes nothing."""
    seen = []

    class Reader(System):
        phase = Phase.NARROW

        def process(self, dt: float) -> None:
            for contact in self.world.contacts:
                depth, normal, point = overlap(self.world, contact.entity_a, contact.entity_b)
                assert contact.depth == pytest.approx(depth, abs=TOLERANCE)
                np.testing.assert_allclose(contact.normal, normal, atol=TOLERANCE)
                np.testing.assert_allclose(contact.point, point, atol=TOLERANCE)
                seen.append(depth)

    with heap(slope) as world, heap(slope) as unread:
        world.add_system(Reader())
        for _ in range(240):
            world.step()
            unread.step()
        assert len(seen) > 1000
        assert max(seen) > 1e-3
        np.testing.assert_array_equal(world.bodies.position, unread.bodies.position)


def test_a_shape_changed_between_steps_is_seen_at_once():
    """Nothing of the step before is taken for true but that the two rested."""
    world = World(Physics(dimensions=2, gravity=(0.0, -10.0)))
    floor = world.create_entity(Transform((0.0, -0.5)), AABBCollider(half_extents=(5.0, 0.5)))
    ball = world.create_entity(Transform((0.0, 0.5)), RigidBody(mass=1.0), SphereCollider(radius=0.5))
    with world:
        for _ in range(60):
            world.step()
        assert len(world.contacts) == 1
        world.component_for_entity(ball, SphereCollider).radius = 0.4
        world.step()
        assert not len(world.contacts)
        world.component_for_entity(floor, AABBCollider).offset = (0.0, 0.2)
        world.step()
        (contact,) = world.contacts
        assert contact.depth > 0.09

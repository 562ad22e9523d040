"""What cannot be a part, or go together with one, is refused by name."""

from __future__ import annotations

import math

import pytest
from parts.helpers_parts import parts_world

from carom import AABBCollider, NoPhysicsError, Physics, RigidBody, SphereCollider, Transform, World
from carom.framework import StepError
from carom.plugins.joints import Hinge, Joints, Weld
from carom.plugins.parts import PartOf, Parts
from carom.plugins.rotation import BoxCollider, Spin

pytestmark = pytest.mark.plain


def test_what_no_part_can_be_is_refused_at_the_call():
    world, parts = parts_world()
    world.add_plugin(Joints())
    body = world.create_entity(Transform((0, 0)), RigidBody(), SphereCollider(0.5))
    part = world.create_entity(PartOf(body, (1, 0)), SphereCollider(0.5))
    inner = world.create_entity(PartOf(part, (1, 0)), SphereCollider(0.5))
    sign, gone = world.create_entity("no body"), world.create_entity(Transform((9, 9)), SphereCollider(0.5))
    world.delete_entity(gone)
    for message, call in (
        ("no entity 99", lambda: world.create_entity(PartOf(99), SphereCollider(0.5))),
        (f"no entity {gone}", lambda: world.create_entity(PartOf(gone), SphereCollider(0.5))),
        ("no body, it has no Transform", lambda: world.create_entity(PartOf(sign), SphereCollider(0.5))),
        ("is a part of", lambda: world.add_component(body, PartOf(inner))),
        ("is a part of", lambda: world.add_component(body, PartOf(body))),
        ("2 components", lambda: world.create_entity(PartOf(body, (1, 0, 0)), SphereCollider(0.5))),
        ("at least 0", lambda: PartOf(body, mass=-1.0)),
        ("at least 1", lambda: PartOf(0)),
        (r"PartOf.position must be at most 1e\+15 .*, got \(1e\+160, 0\)", lambda: PartOf(body, (1e160, 0))),
        (f"Weld joins entity {part} and entity {body}, .* one body, {body}",
         lambda: world.create_entity(Weld(part, body, anchor=(0, 0)))),
        (f"Hinge joins entity {inner} and entity {part}, .* one body, {body}",
         lambda: world.create_entity(Hinge(inner, part, anchor=(0, 0)))),
        (f"entity {part} is a part of entity {body}", lambda: parts.centre(part)),
        (f"entity {part} is a part of entity {body}", lambda: parts.balance(part)),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=message):
            call()
    world.step()
    handle = world.component_for_entity(part, PartOf)
    for message, other in ((f"entity {inner} is a part of it", inner), ("no body 99", 99)):
        with pytest.raises(ValueError, match=message):
            handle.body = other
    assert handle.body == body
    assert len(world.get_entities()) == 4
    for call in (parts.centre, parts.balance):
        with pytest.raises(KeyError, match="entity 99 is no body"):
            call(99)
    handle.position[:] = (math.nan, 0)
    with pytest.raises(ValueError, match=rf"entity {part}: PartOf.position must be finite, got \[nan, 0.0\]"):
        world.step()
    handle.position[:] = (1, 0)
    world.step()


def test_a_joint_whose_bodies_become_parts_of_one_body_is_named_until_it_goes():
    world, _ = parts_world()
    world.add_plugin(Joints())
    body, other = (world.create_entity(Transform((x, 0)), RigidBody(), SphereCollider(0.4)) for x in (0, 1))
    part = world.create_entity(PartOf(other, (1, 0)), SphereCollider(0.4))
    joint = world.create_entity(Hinge(body, part, anchor=(0.5, 0)))
    world.step()
    for become in (lambda: setattr(world.component_for_entity(part, PartOf), "body", body),
                   lambda: world.add_component(other, PartOf(body, (1, 0)))):  # fmt: skip
        become()
        for _ in range(2):
            with pytest.raises(ValueError, match=f"entity {joint}: Hinge joins entity {body} and entity {part}, which"):
                world.step()
        world.component_for_entity(part, PartOf).body = other
    world.delete_entity(joint)
    world.step()


@pytest.mark.parametrize(
    ("components", "message"),
    [
        ((AABBCollider((0.1, 0.1)),), "give it a BoxCollider"),
        ((SphereCollider(0.1), Spin()), "a part turns with its body"),
        ((SphereCollider(0.1, offset=(1, 0)),), "PartOf.position"),
    ],
)
def test_what_does_not_go_together_is_refused_when_the_world_takes_it(components, message):
    world, _ = parts_world()
    body = world.create_entity(Transform((0, 0)), RigidBody(), Spin(), SphereCollider(0.5))
    part = world.create_entity(PartOf(body, (1, 0)), *components)
    with pytest.raises(ValueError, match=message):
        world.step()
    world.delete_entity(part, immediate=True)
    world.step()


def test_parts_belong_to_one_world_with_physics():
    parts = Parts()
    with pytest.raises(NoPhysicsError, match="needs physics"):
        World(parts)
    with World(Physics(dimensions=2), parts), pytest.raises(ValueError, match="each world takes its own"):
        World(Physics(dimensions=2), parts)


def test_a_part_with_a_mass_and_no_collider_is_named():
    world, _ = parts_world()
    body = world.create_entity(Transform((0, 0)), RigidBody(), Spin(), BoxCollider((0.5, 0.1)))
    part = world.create_entity(PartOf(body, (1, 0)))
    with pytest.raises(StepError, match=rf"entity {part}: .*PartOf has a mass, and it has no collider"):
        world.step()
    world.component_for_entity(part, PartOf).mass = 0.0
    world.step()

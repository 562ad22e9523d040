"""Prefabs: what they make is what create_entity makes of copies, one by one or in bulk, and they stay as they are."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from worlds import make_world

from carom import (
    AABBCollider,
    BoxCollider,
    CapsuleCollider,
    CaromError,
    Component,
    ConvexHullCollider,
    ConvexPolygonCollider,
    PartOf,
    Parts,
    Physics,
    Prefab,
    RigidBody,
    Rotation,
    SphereCollider,
    Spin,
    Transform,
    World,
    column,
)  # fmt: skip
from carom.plugins import capsule, convex_hull, convex_polygon

pytestmark = [pytest.mark.usefixtures("invariants"), pytest.mark.plain]

CORNERS = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)])
TURN = (math.cos(0.1), 0.0, math.sin(0.1), 0.0)


class Lives(Component):
    left = column(3, dtype=int)
    shield = column(None, optional=True)
    aim = column(0.0, item="vector")


class Plain:
    """A component that is not carom's."""


def kinds(d):
    """Components with numbers for vectors, vectors, choices, None and arrays of any length."""
    e = np.eye(d)[0]
    shapes = [
        SphereCollider(0.5, friction=0.25, layer=4),
        BoxCollider([0.25] * d, offset=0.5),
        CapsuleCollider(0.25, 0.5),
    ]
    shapes += [ConvexPolygonCollider(CORNERS)] if d == 2 else [ConvexHullCollider(np.vstack((np.eye(3), -np.eye(3))))]
    bodies = RigidBody(2.0, 3.0, kind="kinematic"), RigidBody(2.0, e, max_linear_speed=9.0, gravity_scale=0.5)
    spins = Spin(2.0 * e if d == 3 else 2.0), Spin()
    extra = Lives(2, aim=0.5), Lives(shield=7.0, aim=e)
    return [(bodies[k % 2], shape, spins[k % 2], extra[k % 2]) for k, shape in enumerate(shapes)]


def world_of(d):
    hulls = convex_polygon.plugin if d == 2 else convex_hull.plugin
    return World(Physics(d, gravity=(0, -9.81, 0)[:d]), Rotation(), capsule.plugin, hulls)


@pytest.mark.compiled
@pytest.mark.parametrize("d", [2, 3])
def test_one_by_one_and_in_bulk_are_as_copies_are(d):
    """Same ids, same bits, before a step and after, with positions and other fields for each."""
    places = 4.0 * np.arange(12 * d).reshape(12, d)
    masses = np.linspace(1.0, 2.0, 12)
    turn = 0.1 if d == 2 else TURN
    by_hand, spawned, bulk = worlds = [world_of(d) for _ in range(3)]
    for k, parts in enumerate(kinds(d)):
        prefab, rows = Prefab(*parts), slice(3 * k, 3 * k + 3)
        shown = repr(prefab)
        for place, mass in zip(places[rows], masses[rows], strict=True):
            copies = [part.copy() for part in parts]
            copies[0].mass = mass
            by_hand.create_entity(Transform(place, turn), *copies)
            spawned_id = prefab.spawn(spawned, position=place, mass=mass, rotation=turn)
        ids = prefab.spawn_many(bulk, 3, position=places[rows], **{"rigid_body.mass": masses[rows]}, rotation=turn)
        assert ids[-1] == spawned_id
        assert repr(prefab) == repr(pickle.loads(pickle.dumps(prefab))) == shown
    for _ in range(3):
        assert by_hand.state_hash() == spawned.state_hash() == bulk.state_hash()
        for world in worlds:
            world.step()


def test_a_prefab_and_what_it_is_made_of_and_makes_have_nothing_in_common():
    world, body, at = make_world(), RigidBody(2.0, (1.0, 2.0)), np.array((1.0, 1.0))
    prefab = Prefab(Transform(at), body, SphereCollider(0.5))
    body.linear_velocity[:] = 9.0
    at[:] = 9.0
    first = prefab.spawn(world)
    ids = prefab.spawn_many(world, 2)
    for entity in (first, *ids):
        made = world.component_for_entity(entity, RigidBody)
        made.mass = 7.0
        made.linear_velocity[:] = 7.0
    world.step()
    world.bodies.linear_velocity[:] = 5.0
    second = prefab.spawn(world, mass=3.0, position=(0, 0))
    third = prefab.spawn(world)
    for entity, mass, place in ((second, 3.0, [0.0, 0.0]), (third, 2.0, [1.0, 1.0])):
        assert world.component_for_entity(entity, RigidBody).mass == mass
        assert world.component_for_entity(entity, RigidBody).linear_velocity.tolist() == [1.0, 2.0]
        assert world.component_for_entity(entity, Transform).position.tolist() == place
    clone = Prefab(*world.components_for_entity(ids[0])).spawn(world, position=(3, 3))
    assert world.component_for_entity(clone, RigidBody).linear_velocity.tolist() == [5.0, 5.0]


def test_prefabs_of_parts_and_of_what_is_no_body_take_no_place():
    world = World(Physics(2), Rotation(), Parts())
    ship = Prefab(RigidBody(), Spin(), SphereCollider(1.0)).spawn(world, position=(5, 5))
    turret = Prefab(PartOf(ship, (1.0, 0.0)), SphereCollider(0.25))
    first, second = turret.spawn(world), turret.spawn(world, position=(-1.0, 0.0))
    score = Prefab(Lives(5)).spawn(world, left=4)
    world.step()
    for entity, place in ((first, [1.0, 0.0]), (second, [-1.0, 0.0])):
        assert world.component_for_entity(entity, PartOf).position.tolist() == place
        assert world.component_for_entity(entity, Transform).position.tolist() == [5.0, 5.0]
    assert world.component_for_entity(score, Lives).left == 4


WRONG = (
    ({"radios": 1.0}, TypeError, "no field 'radios' .did you mean 'radius'.*; its components have position, rotation"),
    ({"speed": 1.0}, TypeError, "no field 'speed' .did you mean 'linear_velocity'"),
    ({"box.radius": 1.0}, TypeError, "no field 'box.radius'"),
    ({"restitution": 1.0}, TypeError, "2 components have a field 'restitution': .*sphere_collider.* or .*aabb_"),
    ({"mass": 1.0, "rigid_body.mass": 2.0}, TypeError, "got RigidBody.mass twice"),
    ({"radius": -1.0}, ValueError, r"SphereCollider.radius must be at least 0.0, got -1.0"),
    ({"position": (1.0, 2.0, 3.0)}, ValueError, "Transform.position must"),
    ({"position": None}, TypeError, "needs position=, because the prefab makes a body and has no Transform"),
)  # fmt: skip


@pytest.mark.parametrize(("changes", "error", "message"), WRONG)
def test_what_cannot_be_spawned_is_refused_and_nothing_is_made(changes, error, message):
    world, prefab = make_world(), Prefab(RigidBody(), SphereCollider(1.0), AABBCollider((1.0, 1.0)))
    changes = {"position": (0.0, 0.0), **changes}
    for spawn in (prefab.spawn, lambda world, **changes: prefab.spawn_many(world, 2, **changes)):
        with pytest.raises(error, match=message):
            spawn(world, **changes)
    assert world.get_entities() == []


def test_what_no_prefab_can_hold_is_refused():
    with pytest.raises(TypeError, match="Prefab takes carom components, instances of them, got <class"):
        Prefab(RigidBody)
    with pytest.raises(TypeError, match=r"Prefab takes carom components, .* got <.*Plain object"):
        Prefab(Plain())
    with pytest.raises(ValueError, match="one component of each type, got two RigidBody"):
        Prefab(RigidBody(), RigidBody(2.0))
    flat = Prefab(Transform((0, 0)), RigidBody(linear_velocity=(1.0, 2.0)))
    for spawn in (flat.spawn, lambda world: flat.spawn_many(world, 2)):
        with pytest.raises(ValueError, match=r"Transform\.position must have 3 components in this 3D world"):
            spawn(make_world(3))
    with pytest.raises(CaromError, match="no physics in this world"):
        flat.spawn_many(World(), 2)

"""Columns that have no memory while every row holds the default: to users they are like any other."""

from __future__ import annotations

import copy
from operator import attrgetter

import numpy as np
import pytest
from worlds import make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, ForceSystem
from carom.framework.data.columns import column

COUNT = 30
ON_DEMAND = {
    "rotation", "constant_force", "gravity_scale", "linear_damping", "max_linear_speed", "ccd", "applied_force",
    "applied_frame", "step_force", "force", "sphere_collider.offset", "sphere_collider.restitution",
    "sphere_collider.friction", "sphere_collider.sensor", "sphere_collider.layer", "sphere_collider.mask",
    "sphere_collider.group", "sphere_collider.one_way",
}  # fmt: skip
# Another value of each field that a handle or a constructor takes.
BODY = {"constant_force": 2.0, "gravity_scale": 0.5, "linear_damping": 0.25, "max_linear_speed": 3.0, "ccd": True}
BALL = {"offset": 0.1, "restitution": 0.5, "friction": 0.25, "sensor": True, "layer": 2, "mask": 6, "group": 3,
        "one_way": 0.5}  # fmt: skip
OTHERS = {**{name: (RigidBody, value) for name, value in BODY.items()},
          **{name: (SphereCollider, value) for name, value in BALL.items()}}  # fmt: skip


def crowd(dimensions=2, gravity=0.0, **settings):
    """Balls in a row, not touching, on their way; every field of theirs is at its default."""
    world = make_world(dimensions, gravity=gravity, **settings)
    places, speeds = np.zeros((COUNT, dimensions)), np.zeros((COUNT, dimensions))
    places[:, 0], speeds[:, 0] = 1.5 * np.arange(COUNT), np.where(np.arange(COUNT) % 2, -1.0, 1.0)
    entities = world.create_entities(
        COUNT, Transform.many(places), RigidBody.many(1.0, speeds), SphereCollider.many(radius=0.5)
    )
    world.step()
    return world, entities


def made(world):
    """The columns on demand that have memory, as the plan tells."""
    return {c.column for c in world.plan().columns if c.of == "body" and c.group != "going back"} & ON_DEMAND


def with_memory(world):
    """Let every column have its memory, without another value anywhere."""
    for name in sorted(ON_DEMAND):
        attrgetter(name)(world.bodies)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_at_first_there_are_none(dimensions):
    world, entities = crowd(dimensions)
    for _ in range(30):
        world.step()
    assert world.stats().totals.counters["contacts"] > 0
    assert made(world) == set()
    ball = world.component_for_entity(entities[3], RigidBody)
    assert (ball.gravity_scale, ball.ccd, ball.max_linear_speed, ball.linear_damping) == (1.0, False, None, 0.0)
    assert "gravity_scale=1.0" in repr(ball)
    copy.copy(ball)
    world.state_hash()
    world.potential_energy()
    world.snapshot()
    assert made(world) == set()
    assert set(dir(world.bodies)) >= {name for name in ON_DEMAND if "." not in name}


@pytest.mark.parametrize("dimensions", [2, 3])
def test_with_and_without_memory_are_the_same_to_the_bit(dimensions):
    hashes = []
    for asked in (False, True):
        for gravity in (0.0, 9.81):
            world, _ = crowd(dimensions, gravity, integrator="velocity_verlet")
            floor = np.zeros(dimensions)
            floor[1] = -2.0
            world.create_entity(
                Transform(floor), AABBCollider(np.full(dimensions, 1.0) * (100.0, 1.0, 100.0)[:dimensions])
            )
            if asked:
                with_memory(world)
                assert made(world) == ON_DEMAND
            for _ in range(60):
                world.step()
            hashes.append((world.state_hash(), world.contacts.point.tobytes(), world.contacts.normal_impulse.tobytes()))
            assert gravity == 0.0 or len(world.contacts) > COUNT // 2
    assert hashes[:2] == hashes[2:]


@pytest.mark.slow
@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize("name", OTHERS)
def test_a_value_by_handle_column_or_constructor_is_the_same(name, dimensions):
    component, value = OTHERS[name]
    hashes, flat = set(), component is RigidBody
    for way in ("handle", "column", "constructor", "in place"):
        world, entities = crowd(dimensions)
        handle = world.component_for_entity(entities[5], component)
        where = world.bodies if flat else world.bodies.sphere_collider
        if way == "handle":
            setattr(handle, name, value)
        elif way == "column":
            getattr(where, name)[5] = value
        elif way == "in place" and np.ndim(getattr(handle, name)):
            getattr(handle, name)[:] = value
        elif way == "in place":
            rest = getattr(where, name).copy()
            rest[5] = value
            setattr(where, name, rest)
        else:
            own = {"linear_velocity": handle.linear_velocity} if flat else {"radius": 0.5}
            world.add_component(entities[5], component(**own, **{name: value}))
        world.step()
        key = name if flat else f"sphere_collider.{name}"
        assert key in made(world)
        assert np.all(world.component_for_entity(entities[5], component).__getattribute__(name) == value)
        others = np.delete(np.arange(COUNT), 5)
        default = component.columns[name].default
        values = getattr(world.bodies if flat else world.bodies.sphere_collider, name)[others]
        assert np.isnan(values).all() if default is None else (values == default).all()
        for _ in range(30):
            world.step()
        hashes.add(world.state_hash())
    assert len(hashes) == 1


class Marked(Component):
    strength = column(0.0)


def test_force_systems_for_some_bodies_see_defaults_that_cannot_be_written():
    class Pull(ForceSystem):
        requires = (Marked,)

        def add_forces(self, bodies, time):
            assert (bodies.gravity_scale == 1.0).all()
            with pytest.raises(ValueError, match="read-only"):
                bodies.linear_damping[0] = 1.0
            bodies.force[:, 1] += 3.0

    world, entities = crowd()
    world.add_component(entities[7], Marked())
    world.add_system(Pull())
    world.step()
    assert np.flatnonzero(world.bodies.linear_velocity[:, 1]).tolist() == [7]
    assert "gravity_scale" not in made(world)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_snapshot_from_before_has_the_defaults(dimensions):
    world, entities = crowd(dimensions)
    before, hashed = world.snapshot(), world.state_hash()
    world.bodies.constant_force[4] = 5.0
    world.bodies.sphere_collider.layer[4] = 0
    world.component_for_entity(entities[2], RigidBody).linear_damping = 1.0
    after, changed = world.snapshot(), world.state_hash()
    world.step()
    world.restore(before)
    assert world.state_hash() == hashed
    assert not world.bodies.constant_force.any()
    assert (world.bodies.sphere_collider.layer == 1).all()
    world.restore(after)
    assert world.state_hash() == changed
    assert (world.bodies.constant_force[4] == 5.0).all()


@pytest.mark.parametrize("dimensions", [2, 3])
def test_bodies_that_come_and_go(dimensions):
    world, entities = crowd(dimensions)
    damped = {entities[6]: 0.5}
    world.component_for_entity(entities[6], RigidBody).linear_damping = 0.5
    for entity in entities[:4]:
        world.delete_entity(entity)
    handle = world.component_for_entity(entities[4], RigidBody)
    far = np.full(dimensions, 50.0)
    for k in range(200):  # more than there is room for
        body = RigidBody(linear_damping=0.25 if k == 9 else 0.0)
        entity = world.create_entity(Transform(far + 2.0 * k), body, SphereCollider(0.5))
        if k == 9:
            damped[entity] = 0.25
    world.step()
    for entity in world.bodies.entity.tolist():
        assert world.component_for_entity(entity, RigidBody).linear_damping == damped.get(entity, 0.0)
    assert made(world) == {"linear_damping"}
    world.delete_entity(entities[6], immediate=True)
    world.step()
    assert (handle.linear_damping, handle.gravity_scale) == (0.0, 1.0)
    gone = world.remove_component(entities[5], RigidBody)
    world.step()
    assert (gone.gravity_scale, gone.constant_force.tolist()) == (1.0, [0.0] * dimensions)
    gone.constant_force = 2.0
    assert "constant_force" not in made(world)


def test_negative_zero_is_kept():
    world = make_world()
    entity = world.create_entity(Transform((0.0, 0.0)), RigidBody(constant_force=(-0.0, 0.0)))
    world.step()
    assert np.signbit(world.component_for_entity(entity, RigidBody).constant_force[0])

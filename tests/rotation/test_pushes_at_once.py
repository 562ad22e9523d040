"""Forces and velocities at points, of many bodies in one call: what they are one by one."""

from __future__ import annotations

import numpy as np
import pytest
from rotation.helpers_turning import box, part, turning_world, wall

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import Phase, System
from carom.plugins.rotation import Spin

pytestmark = pytest.mark.plain


def some_bodies(d, n=12):
    random = np.random.default_rng(d)
    world = turning_world(d, 9.81, sleeping=True)
    ids = []
    for k in range(n):
        turn = 0.3 if d == 2 else (0.8, 0.0, 0.6, 0.0)
        place = 4.0 * k, *random.uniform(0, 1, d - 1)
        ids.append(box(world, place, (0.5,) * d, random.normal(size=d), rotation=turn))
        part(world, ids[-1], Spin).angular_velocity = random.normal(size=d) if d == 3 else random.normal()
    part(world, ids[3], RigidBody).kind = "kinematic"
    ids.append(wall(world, (-9.0,) + (0,) * (d - 1), (0.5,) * d))
    world.add_component(ids[-1], Spin())
    len(world.bodies)
    return world, np.array(ids)


class Pushing(System):
    def __init__(self, act, phase):
        self.act, self.phase = act, phase

    def process(self, dt):
        self.act(self.world)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("points", [False, True])
@pytest.mark.parametrize("where", [None, Phase.START, Phase.END])
def test_pushes_at_once_are_to_the_bit_those_one_by_one(d, points, where):
    """Of static, kinematic and dynamic bodies, some of them twice, before steps and within them."""
    hashes = []
    for at_once in (False, True):
        world, ids = some_bodies(d)
        random = np.random.default_rng(5)

        def act(world, ids=ids, random=random, at_once=at_once):
            chosen = random.choice(ids, 9)
            forces, at = random.normal(size=(2, 9, d))
            if at_once:
                world.bodies.apply_force(chosen, forces, at if points else None)
                return
            for entity, force, point in zip(chosen.tolist(), forces, at, strict=True):
                if points:
                    part(world, entity, Spin).apply_force(force, at=point)
                else:
                    part(world, entity, RigidBody).apply_force(force)

        if where is not None:
            world.add_system(Pushing(act, where))
        for _ in range(8):
            if where is None:
                act(world)
                act(world)
            world.step()
        hashes.append(world.state_hash())
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize("d", [2, 3])
def test_velocities_at_points_are_those_one_by_one(d):
    world, ids = some_bodies(d)
    points = np.random.default_rng(1).normal(size=(len(ids), d))
    one_by_one = [part(world, entity, Spin).velocity_at(at) for entity, at in zip(ids.tolist(), points, strict=True)]
    assert (world.bodies.velocity_at(ids, points) == one_by_one).all()
    plain = world.create_entity(Transform((99.0,) * d), RigidBody(linear_velocity=(1.0,) * d), SphereCollider(0.5))
    assert (world.bodies.velocity_at([plain], (0.0,) * d) == 1.0).all()


def test_if_one_push_is_refused_none_is_applied():
    world, ids = some_bodies(2)
    plain = world.create_entity(Transform((99, 0)), RigidBody(), SphereCollider(0.5))
    world.step()
    before, push = world.state_hash(), world.bodies.apply_force
    with pytest.raises(KeyError, match="entity 999 is no body"):
        push([*ids, 999], (1.0, 0.0))
    with pytest.raises(ValueError, match=f"entity {plain}: apply_force: it has no Spin"):
        push([*ids, plain], (1.0, 0.0), at=(0.0, 0.0))
    with pytest.raises(ValueError, match=r"bodies\.apply_force must"):
        push(ids, np.ones((len(ids) - 1, 2)))
    with pytest.raises(ValueError, match=r"bodies\.apply_force at must"):
        push(ids, (1.0, 0.0), at=np.ones((len(ids), 3)))
    with pytest.raises(ValueError, match=r"bodies\.apply_force must be finite"):
        push(ids, (np.nan, 0.0))
    with pytest.raises(ValueError, match="its torque must be at most"):
        push(ids, (1e100, 0.0), at=(0.0, 1e100))
    assert world.state_hash() == before

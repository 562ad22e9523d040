"""Restored snapshots give the same bits and events, and the state hash detects any change."""

from __future__ import annotations

import numpy as np
from helpers_determinism import Charge, settled
from worlds import ball, make_world

from carom.components import RigidBody, SphereCollider, Transform


def test_settings_stay_when_a_snapshot_is_restored():
    world = make_world(dt=0.5)
    ball(world, 0.0, 1.0)
    snapshot = world.snapshot()
    world.settings = world.settings.replace(dt=0.25)
    world.restore(snapshot)
    world.step()
    assert (world.time, world.bodies.position[0, 0]) == (0.25, 0.25)
    assert world.advance(0.5) == 2


def test_the_hash_notices_the_smallest_change_of_any_value():
    world = make_world()
    e = ball(world, (1.0, 2.0), 3.0)
    world.add_component(e, Charge(4.0))
    seen = {world.state_hash()}
    for component in (Transform, RigidBody, SphereCollider, Charge):
        handle = world.component_for_entity(e, component)
        for name, field in component.columns.items():
            value = getattr(handle, name)
            if isinstance(value, np.ndarray):
                new = value.copy()
                new[-1] = np.nextafter(new[-1], np.inf)
            elif isinstance(value, float):
                new = np.nextafter(value, np.inf)
            else:
                new = {"kind": "kinematic", "sensor": True, "ccd": True}.get(name, 0.25 if value is None else value)
                new = value + 1 if field.dtype is np.int64 else new
            setattr(handle, name, new)
            digest = world.state_hash()
            assert digest not in seen, name
            seen.add(digest)
    for change in (
        lambda: world.remove_component(e, Charge),
        lambda: ball(world, 50.0),
        lambda: world.delete_entity(e, immediate=True),
    ):
        change()
        assert world.state_hash() not in seen
        seen.add(world.state_hash())


def test_the_hash_does_not_tell_minus_zero_from_zero():
    worlds = [make_world() for _ in range(2)]
    for world, zero in zip(worlds, (0.0, -0.0), strict=True):
        ball(world, (zero, 1.0))
    assert worlds[0].state_hash() == worlds[1].state_hash()


def test_the_hash_is_of_the_state_not_of_the_frame_rate():
    def run(frames, per_frame):
        world = settled(dt=1 / 64)
        e = ball(world, (0.0, 1.0))
        for _ in range(frames):
            world.component_for_entity(e, RigidBody).apply_force((2.0, 0.0))
            world.advance(per_frame / 64)
        return world.step_count, world.state_hash()

    assert run(32, 1) == run(16, 2) == run(8, 4)

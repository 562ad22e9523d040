"""Restored snapshots give the same bits and events, and the state hash detects any change."""

from __future__ import annotations

import functools

import numpy as np
from helpers_determinism import Charge, settled, state
from worlds import ball, floor, make_world

from carom.components import RigidBody, SphereCollider, Transform


def pile():
    world = settled()
    floor(world)
    rng = np.random.default_rng(2)
    for x in range(30):
        ball(world, (0.9 * (x % 6), 1.0 + 0.95 * (x // 6)), rng.normal(size=2) * 2, restitution=0.7)
    for _ in range(20):
        world.step()
    return world


def log_events(world, log):
    def note(name, c):
        log.append((name, c.entity_a, c.entity_b, c.step, c.depth, c.normal_impulse))

    for name in ("contact_begin", "contact_stay", "contact_end", "impact"):
        world.on(name, functools.partial(note, name))


def test_a_restored_snapshot_goes_on_with_the_same_bits_and_events():
    world, log = pile(), []
    log_events(world, log)
    snapshot = world.snapshot()
    at = (world.state_hash(), world.time, world.step_count, state(world))

    def go_on():
        log.clear()
        states = []
        for _ in range(40):
            world.step()
            states.append(state(world))
        return states, list(log), world.state_hash()

    first = go_on()
    assert len({name for name, *_ in first[1]}) == 4
    for _ in range(2):  # it can be restored repeatedly
        world.restore(snapshot)
        assert (world.state_hash(), world.time, world.step_count, state(world)) == at
        assert go_on() == first
        world.contacts.enabled[:] = False  # what is written into the world's contacts is not written into the snapshot


def test_a_snapshot_holds_kinds_and_components_of_ones_own():
    world = make_world(dt=1.0)
    a, b = ball(world, 0.0, 1.0), ball(world, 9.0, 1.0)
    world.add_component(b, Charge(3.0))
    snapshot, digest = world.snapshot(), world.state_hash()
    world.component_for_entity(a, RigidBody).kind = "static"
    world.component_for_entity(b, Charge).value = 4.0
    world.step()
    assert world.bodies.entity.tolist() == [b, a]
    world.restore(snapshot)
    assert world.state_hash() == digest
    assert world.bodies.dynamic.entity.tolist() == [a, b]
    world.step()
    assert world.bodies.position[:, 0].tolist() == [1.0, 10.0]
    assert world.component_for_entity(b, Charge).value == 3.0


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

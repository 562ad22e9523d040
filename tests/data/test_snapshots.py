"""Snapshots: a restored world is what it was and goes on as it did; the state hash detects any change."""

from __future__ import annotations

import copy
import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from data.helpers_snapshots import Bullet, Tag, fill, log_events, make, springs_of
from helpers_determinism import Charge, settled
from worlds import MODES, ball, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import CaromError, ForceSystem, System, World
from carom.plugins import Physics
from carom.plugins.springs import Springs

pytestmark = pytest.mark.usefixtures("invariants")

ROOT = Path(__file__).resolve().parents[2]
STEPS = 60


def contents(world):
    """Entities with their components, in esper's order, without making objects of what is in bulk."""
    return {
        "ids": world.get_entities(),
        "tags": [(e, tag.name) for e, tag in world.get_component(Tag)],
        "bullets": [(e, bullet.expires) for e, bullet in world.get_component(Bullet)],
        "counters": dict(world.stats().counters),
        "clock": world.clock.state(),
        "gravity": world.gravity.tolist(),
        "springs": [(s.a, s.b, s.stiffness) for s in springs_of(world)],
        "touching": world.contacts.entity_a.tolist(),
    }


def go_on(world, log, steps):
    log.clear()
    hashes = []
    for k in range(steps):
        if k % 3:
            world.step()
        else:
            world.advance(1.1 / 60)
        if k % 20 == 0:
            hashes.append(world.state_hash())
    return hashes, list(log), world.state_hash(), contents(world)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("mode", MODES)
def test_the_next_steps_and_events_repeat_to_the_bit(mode, d):
    world, log = make(d, mode), []
    fill(world)
    log_events(world, log)
    go_on(world, log, 40)
    world.delete_entity(world.get_entities()[-2])
    springs = list(springs_of(world))
    snapshot, digest = world.snapshot(), world.state_hash()
    first = go_on(world, log, STEPS)
    assert len({name for name, *_ in first[1]}) >= 4
    world.gravity = (1.0,) * d
    for entity in world.get_entities()[::2]:
        world.delete_entity(entity, immediate=True)
    springs_of(world).clear()
    world.contacts.enabled[:] = False  # what is written into the world's contacts is not in the snapshot
    world.restore(snapshot)
    assert world.state_hash() == digest
    assert list(springs_of(world)) == springs
    assert go_on(world, log, STEPS) == first
    copied = pickle.loads(pickle.dumps(snapshot))
    world.restore(copied)
    assert world.state_hash() == digest
    assert go_on(world, log, 41)[0] == first[0][:3]
    other, others = make(d, mode), []
    log_events(other, others)
    other.restore(copied)
    assert other.state_hash() == digest
    assert go_on(other, others, 41)[0] == first[0][:3]
    assert others == first[1][: len(others)]


def test_bodies_that_have_come_or_gone():
    world = make_world()
    a, b = ball(world, 0.0), ball(world, 9.0)
    snapshot, digest = world.snapshot(), world.state_hash()
    handle = world.component_for_entity(a, SphereCollider)
    c = ball(world, 4.0)
    stranger = world.component_for_entity(c, Transform)
    world.delete_entity(a, immediate=True)
    world.remove_component(b, SphereCollider)
    world.add_component(b, AABBCollider((1.0, 1.0)))
    world.step()
    world.restore(snapshot)
    assert world.state_hash() == digest
    assert world.get_entities() == [a, b]
    assert world.component_for_entity(a, SphereCollider) is handle
    handle.radius = 0.75
    assert world.bodies.row_of(a) == 0
    assert handle.radius == 0.75
    assert world.has_component(b, SphereCollider)
    assert not world.has_component(b, AABBCollider)
    assert stranger.position.tolist()[0] == 4.0  # it keeps its last values
    assert ball(world, 5.0) == c  # the id counter too
    assert stranger.position.tolist()[0] == 4.0


def test_ordinary_objects_are_there_by_reference_and_ours_by_value():
    world = make_world()
    tag, bullet = Tag("here"), Bullet(1.0)
    body, loose = ball(world, 0.0), world.create_entity(bullet)
    world.add_component(body, tag)
    snapshot = world.snapshot()
    tag.name, bullet.expires = "there", 2.0
    world.remove_component(body, Tag)
    world.delete_entity(loose, immediate=True)
    world.restore(snapshot)
    assert world.component_for_entity(body, Tag) is tag
    assert tag.name == "there"
    assert world.component_for_entity(loose, Bullet).expires == 1.0
    assert bullet.expires == 1.0


def test_a_snapshot_of_another_kind_of_world_is_refused_and_nothing_is_disturbed():
    world = World(Physics(dimensions=2), Springs())
    ball(world, 0.0)
    snapshot = world.snapshot()
    flat, deep = make_world(), World(Physics(dimensions=3), Springs())
    entity = ball(flat, 1.0)
    digest = flat.state_hash()
    with pytest.raises(CaromError, match=r"plugins .* springs"):
        flat.restore(snapshot)
    with pytest.raises(CaromError, match=r"2 dimensions; .* has 3"):
        deep.restore(snapshot)
    with pytest.raises(TypeError, match=r"what world.snapshot\(\) returns"):
        flat.restore(None)
    assert flat.state_hash() == digest
    assert flat.get_entities() == [entity]


@pytest.mark.parametrize("do", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_world_is_not_copied(do):
    world = make_world()
    for thing in (world, [world])[: 1 if do is copy.copy else 2]:
        with pytest.raises(CaromError, match=r"world\.snapshot\(\).*world\.save\(path\)"):
            do(thing)


@pytest.mark.slow
def test_two_peers_with_delayed_inputs_end_with_the_same_world(capsys):
    source = (ROOT / "examples" / "rollback.py").read_text(encoding="utf-8")
    example = {"__name__": "__main__"}
    exec(compile(re.sub("^FRAMES = .*", "FRAMES = 45", source, flags=re.MULTILINE), "rollback.py", "exec"), example)
    assert "45 frames, " in capsys.readouterr().out
    late, at_once = example["peers"], example["play"](45, 0)
    hashes = {peer.world.state_hash() for peer in (*late, *at_once)}
    assert len(hashes) == 1
    assert {peer.frame for peer in late} == {45}
    assert [peer.world.get_entities() for peer in late] == [at_once[0].world.get_entities()] * 2
    assert min(peer.replayed for peer in late) > 8 * 25


class Wind(ForceSystem):
    def __init__(self):
        self.strength = [1.0]


class Counts(System):
    def __init__(self):
        self.seen = []

    def process(self, dt):
        self.seen.append(dt)


@pytest.mark.parametrize("do", [copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
@pytest.mark.parametrize("make_one", [Wind, Counts])
def test_a_copy_of_a_system_is_in_no_world(make_one, do):
    world, one = make_world(), make_one()
    world.add_system(one)
    other = do(one)
    assert not hasattr(other, "world")
    assert vars(other) == {name: value for name, value in vars(one).items() if name != "world"}
    assert one.world is world
    world.add_system(other)
    assert other.world is world


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
                other = {"kind": "kinematic", "sensor": True, "enabled": False, "ccd": True}
                new = other.get(name, 0.25 if value is None else value)
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

"""A step in which nothing has changed is one flat function: the same bits as with all its parts, whatever changes."""

from __future__ import annotations

import pytest
from worlds import ball, floor, make_world

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import System
from carom.framework.schedule import step


class Wind(System):
    def process(self, dt):
        self.world.bodies.dynamic.linear_velocity[:, 0] += 0.01


def replace_settings(world, **settings):
    world.settings = world.settings.replace(**settings)


def other_context(world):
    with world:
        world.delete_entity(world.bodies.entity.item(0))


def body(world):
    return world.component_for_entity(world.bodies.entity.item(1), RigidBody)


CHANGES = {
    "a body comes": lambda world: ball(world, (3.0, 5.0)),
    "one goes": lambda world: world.delete_entity(world.bodies.entity.item(0)),
    "in another context": other_context,
    "a component comes": lambda world: world.add_component(world.bodies.entity.item(1), SphereCollider(0.3)),
    "the floor rises": lambda world: setattr(
        world.component_for_entity(world.bodies.static.entity.item(0), Transform), "position", (0.0, -0.3)
    ),
    "a push": lambda world: body(world).apply_impulse((3.0, 1.0)),
    "a kind": lambda world: setattr(body(world), "kind", "kinematic"),
    "another dt": lambda world: replace_settings(world, dt=1 / 30),
    "sleeping": lambda world: replace_settings(world, sleeping=True),
    "a handler": lambda world: world.on("contact_begin", lambda contact: None),
    "a system": lambda world: world.add_system(Wind()),
    "gravity": lambda world: setattr(world, "gravity", (1.0, -3.0)),
    "a column": lambda world: world.bodies.dynamic.position.__setitem__((0, 0), 0.25),
    "nothing": lambda world: None,
}


def hashes(change, frames):
    with make_world(gravity=9.81) as world:
        floor(world)
        for k in range(4):
            ball(world, (1.1 * k - 2.0, 0.6 + 0.4 * k), restitution=0.4)
        before = world.snapshot()
        result = []
        for frame in range(40):
            if frame == 20:
                change(world)
            world.advance(frames) if frame % 3 else world.step()
            result.append((world.state_hash(), world.step_count, len(world.contacts), len(world.contacts.begin)))
        world.restore(before)
        for _ in range(15):
            world.step()
        return [*result, world.state_hash()]


@pytest.mark.slow
@pytest.mark.parametrize("frames", [1 / 60, 1 / 25])
@pytest.mark.parametrize("name", CHANGES)
def test_the_flat_step_has_the_bits_of_all_parts_whatever_changes(name, frames, monkeypatch):
    flat = hashes(CHANGES[name], frames)
    monkeypatch.setattr(step, "make_quiet_step", lambda *_: None)
    assert hashes(CHANGES[name], frames) == flat


def test_a_world_at_rest_takes_it(monkeypatch):
    with make_world(gravity=9.81) as world:
        floor(world)
        ball(world, (0.0, 0.5))
        world.step()
        world.step()
        monkeypatch.setattr(world._pipeline, "_take", lambda steps: pytest.fail("all parts"))
        world.step()
        world.advance(world.settings.dt)
    assert world.step_count == 4

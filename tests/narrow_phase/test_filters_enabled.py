"""Filters of contacts: ``contacts.enabled``, in every path of a step."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_filters import DT, listen, pairs, up
from worlds import ball, both_dimensions, box, floor, make_world, position, run, velocity

from carom.components import RigidBody, Transform
from carom.framework import Phase, System


class Disable(System):
    """Clears ``enabled`` in the steps selected by ``when(step)``, for the contacts of one entity or of all."""

    phase = Phase.NARROW

    def __init__(self, when=lambda step: True, entity=None):
        self.when, self.entity, self.found = when, entity, 0

    def process(self, dt):
        contacts = self.world.contacts
        if self.when(self.world.step_count):
            mine = (contacts.entity_a == self.entity) | (contacts.entity_b == self.entity)
            chosen = mine if self.entity is not None else np.ones(len(contacts), bool)
            contacts.enabled[chosen] = False
            self.found += int(chosen.sum())


@both_dimensions
def test_a_disabled_impact_does_not_happen(d):
    """Two balls fly through each other, to the last bit as if they were alone; no event is sent."""
    world = make_world(d)
    a, b = ball(world, -1.0, 2.0, restitution=1.0), ball(world, 1.0, -2.0, restitution=1.0)
    off = Disable()
    world.add_system(off)
    told = listen(world)
    run(world, 60)
    assert off.found > 10
    assert told == []
    assert (velocity(world, a)[0], velocity(world, b)[0]) == (2.0, -2.0)
    assert len(world.contacts.impacts) == 0


@both_dimensions
def test_only_the_contact_that_is_disabled_is_out(d):
    """A ball between two walls that it hits in one step: it may pass one, the other reflects it."""
    world = make_world(d)
    gate = box(world, 0.3, half=0.1, kind="static", restitution=1.0)
    wall = box(world, 0.5, half=0.1, kind="static", restitution=1.0)
    flying = ball(world, 0.0, 12.0, radius=0.1, restitution=1.0)
    world.add_system(Disable(entity=gate))
    told = listen(world)
    world.step()
    assert velocity(world, flying)[0] == 12.0  # at 0.2, in the gate
    world.step()  # to the wall at 0.3, back to 0.2
    assert velocity(world, flying)[0] == -12.0
    assert position(world, flying)[0] == pytest.approx(0.2, abs=1e-12)
    assert told == [("begin", wall, flying), ("impact", wall, flying)]


@both_dimensions
@pytest.mark.parametrize("shape", [ball, box])
def test_a_disabled_support_is_gone_and_leaves_nothing(d, shape):
    """Disabled for one step it falls freely (v = -g dt) and the pair ends; then it begins again, and holds."""
    world = make_world(d, gravity=10.0)
    ground = floor(world)
    body = shape(world, up(d, 0.5))
    run(world, 60)
    before, height = velocity(world, body)[1], position(world, body)[1]
    off = Disable(when=lambda step: step == 60)
    world.add_system(off)
    told = listen(world)
    world.step()
    assert off.found == 1
    assert velocity(world, body)[1] == pytest.approx(before - 10 * DT, rel=1e-12)
    assert position(world, body)[1] == pytest.approx(height + (before - 10 * DT) * DT, rel=1e-12)
    assert told == [("end", ground, body)]
    assert pairs(world.contacts) == [(ground, body)]  # the row stays, marked as disabled
    assert world.contacts.enabled.tolist() == [False]
    assert world.contacts.of(body) == []
    assert list(world.contacts.pairs(RigidBody, Transform)) == []
    told.clear()
    world.step()
    assert told == [("begin", ground, body)]
    assert abs(velocity(world, body)[1]) < 0.2
    told.clear()
    run(world, 60)
    assert told == [("stay", ground, body)] * 60
    assert position(world, body)[1] == pytest.approx(height, abs=0.005)
    assert [contact.entity_b for contact in world.contacts.of(body)] == [ground]


@both_dimensions
def test_a_pair_disabled_from_the_start_never_begins(d):
    """For any gap at the end of a step none of forty boxes is stopped, before it overlaps or after; no event."""
    world = make_world(d, gravity=10.0)
    ground = floor(world)
    places = [(3.0 * k, 1.0 + 0.004 * k, 0.0)[:d] for k in range(40)]
    through = [box(world, place) for place in places]
    held = box(world, (-5.0, 1.0, 0.0)[:d])

    class Open(System):
        phase = Phase.NARROW

        def process(self, dt):
            self.world.contacts.enabled[self.world.contacts.entity_b != held] = False

    world.add_system(Open())
    told = listen(world)
    run(world, 60)
    for body, place in zip(through, places, strict=True):
        assert position(world, body)[1] == pytest.approx(place[1] - 10 * DT**2 * 60 * 61 / 2, rel=1e-12)
        assert velocity(world, body)[1] == pytest.approx(-10.0, rel=1e-12)
    assert position(world, held)[1] == pytest.approx(0.5, abs=0.01)
    assert {event[1:] for event in told} == {(ground, held)}


def test_a_disabled_sensor_is_not_touched():
    """Nor is it found when its pair is tested again after a bounce of the body."""
    world = make_world()
    wall = box(world, 0.75, half=(0.25, 3), kind="static", restitution=1.0)
    sensor = box(world, 0.0, half=(0.5, 3), kind="static", sensor=True)
    flying = ball(world, 0.25, 12.0, radius=0.1, restitution=1.0)
    off = Disable(entity=sensor)
    world.add_system(off)
    told = listen(world)
    run(world, 10)
    assert off.found > 3
    assert {event[1:] for event in told} == {(wall, flying)}


def test_enabled_holds_for_its_step_only():
    """Disabled in every other step, a pair of sensors begins and ends in turns; the same as events and as columns."""
    world = make_world()
    one, two = ball(world, 0.0, sensor=True), ball(world, 0.5)
    world.add_system(Disable(when=lambda step: step % 2 == 1))
    told = listen(world)
    for step in range(6):
        told.clear()
        world.step()
        assert told == [("end" if step % 2 else "begin", one, two)]
        assert pairs(world.contacts.end if step % 2 else world.contacts.begin) == [(one, two)]
        assert len(world.contacts.stay) == 0
        assert len(world.contacts.of(one)) == (step + 1) % 2

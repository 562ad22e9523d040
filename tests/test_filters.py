"""Who meets whom, and who is pushed: sensors, layers and masks, ``contacts.enabled``, in every path of a step.

The paths: contacts found (NARROW), impacts, contacts at rest, begin, stay, end, handlers, ``contacts.of`` and
``pairs``, queries. What is not pushed must move exactly as if the other were not there, to the last bit.
"""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
from worlds import ball, box, floor, make_world, position, run, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Phase, System

ROOT = Path(__file__).resolve().parent.parent
both_dimensions = pytest.mark.parametrize("d", [2, 3])
DT = 1 / 60
EVENTS = ("contact_begin", "contact_stay", "contact_end", "impact")


def up(d, height):
    """A place above the origin."""
    return (0.0, height, 0.0)[:d]


def listen(world):
    """Events as (name without ``contact_``, a, b), as they happen."""
    told = []
    for name in EVENTS:
        world.on(name, lambda contact, name=name: told.append((name[8:] or name, contact.entity_a, contact.entity_b)))
    return told


def pairs(rows):
    return list(zip(rows.entity_a.tolist(), rows.entity_b.tolist(), strict=True))


def assert_same_motion(world, other, entities):
    """The same bits: of entities that have the same ids in both worlds."""
    for entity in entities:
        np.testing.assert_array_equal(position(world, entity), position(other, entity))
        np.testing.assert_array_equal(velocity(world, entity), velocity(other, entity))


class Disable(System):
    """Clears ``enabled`` in the steps that ``when(step)`` names, of the contacts of one entity or of all."""

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


# -- sensors -------------------------------------------------------------------------------------


@both_dimensions
@pytest.mark.parametrize("shape", [ball, box])
def test_a_sensor_between_bouncing_bodies_changes_nothing(d, shape):
    """Two balls bounce to and fro through a sensor, also at the moment of their impact; both begin and end with it."""

    def scene(sensor):
        world = make_world(d)
        a, b = ball(world, -1.0, 2.0, restitution=1.0), ball(world, 1.0, -2.0, restitution=1.0)
        if sensor:
            shape(world, 0.0, kind="static", sensor=True, restitution=1.0)
        return world, a, b

    (plain, a, b), (world, *_) = scene(False), scene(True)
    told = listen(world)
    for _ in range(60):
        plain.step()
        world.step()
        assert_same_motion(plain, world, (a, b))
    assert ("impact", a, b) in told
    others = [event for event in told if event[2] == 3]
    assert {event[0] for event in others} == {"begin", "stay", "end"}
    assert sorted(event for event in others if event[0] != "stay") == [
        ("begin", a, 3), ("begin", b, 3), ("end", a, 3), ("end", b, 3)
    ]  # fmt: skip
    assert not any(world.contacts.impacts.entity_b == 3)


@both_dimensions
@pytest.mark.parametrize("mine", [False, True])
def test_a_sensor_that_falls_or_lies_below_holds_nobody(d, mine):
    """A sensor falls through the floor, and a body through a sensor floor: free fall, v = -g t and the discrete sum."""
    world = make_world(d, gravity=10.0)
    ground = floor(world, sensor=not mine)
    falling = ball(world, up(d, 1.0), sensor=mine)
    told = listen(world)
    run(world, 90)
    steps = np.arange(1, 91)
    assert velocity(world, falling)[1] == pytest.approx(-10 * 90 * DT, rel=1e-12)
    assert position(world, falling)[1] == pytest.approx(1 - 10 * DT**2 * steps.sum(), rel=1e-12)
    assert [event for event in told if event[0] != "stay"] == [("begin", ground, falling), ("end", ground, falling)]
    assert position(world, ground)[1] == -0.5


@both_dimensions
def test_a_sensor_on_a_body_at_rest(d):
    """In, on and just under the floor: a body at rest is as without; one that it does not reach never begins."""

    def scene(*tops):
        world = make_world(d, gravity=10.0)
        ground, body = floor(world), box(world, up(d, 0.5))
        sensors = [box(world, up(d, top - 0.25), half=0.25, kind="static", sensor=True) for top in tops]
        return world, ground, body, sensors

    plain, ground, body, _ = scene()
    world, _, _, (reached, missed) = scene(0.1, -0.03)
    told = listen(world)
    for _ in range(60):
        plain.step()
        world.step()
        assert_same_motion(plain, world, (body,))
        assert pairs(world.contacts) == [(ground, body), (body, reached)]
    assert missed not in {entity for event in told for entity in event[1:]}
    assert {contact.entity_b: contact.normal_impulse > 0 for contact in world.contacts.of(body)} == {
        ground: True, reached: False
    }  # fmt: skip


def test_a_sensor_behind_a_wall_is_not_touched_by_what_bounces_off_it():
    """At 60 m/s the ball would come to be a metre behind the wall: it is back where it came from instead, and there it
    is that it touches a sensor."""
    world = make_world()
    wall = box(world, (0.0, 0.0), half=(0.25, 3), kind="static", restitution=1.0)
    for x in (0.8, -0.9):
        box(world, (x, 0.0), half=(0.2, 3), kind="static", sensor=True)
    flying = ball(world, -0.95, 60.0, radius=0.1, restitution=1.0)
    told = listen(world)
    world.step()  # 0.6 m to the wall, then 0.4 m back: to x = -0.75
    assert position(world, flying)[0] == pytest.approx(-0.75, abs=1e-12)
    assert [event for event in told if event[0] != "stay"] == [
        ("begin", wall, flying), ("begin", 3, flying), ("impact", wall, flying)
    ]  # fmt: skip
    np.testing.assert_allclose(world.contacts.depth[1], 0.15, atol=1e-12)  # the sensor ends at -0.7


def test_sensors_meet_sensors_and_kinematic_bodies_and_are_found_by_queries():
    world = make_world()
    one = ball(world, 0.0, sensor=True)
    two = ball(world, 0.7, kind="kinematic", sensor=True)
    three = box(world, (0.0, 0.7), kind="static")
    world.step()
    assert pairs(world.contacts) == [(one, two), (one, three), (two, three)]
    assert world.query_point((-0.4, 0.0)) == [one]
    assert world.query_sphere((0.35, 0.0), 0.1) == [one, two]
    assert world.query_aabb((-3.0, -3.0), (3.0, 3.0)) == [one, two, three]


def test_a_body_may_become_a_sensor_and_back_between_steps():
    """At rest on the floor; a sensor for ten steps: it falls freely and stays in touch; then solid, it is pushed out
    upwards without being shot up."""
    world = make_world(gravity=10.0)
    floor(world)
    body = box(world, (0.0, 0.5))
    run(world, 30)
    told = listen(world)
    start = velocity(world, body)[1]
    world.component_for_entity(body, AABBCollider).sensor = True
    run(world, 6)
    assert velocity(world, body)[1] == pytest.approx(start - 10 * 6 * DT, rel=1e-12)
    world.component_for_entity(body, AABBCollider).sensor = False
    world.step()
    assert abs(velocity(world, body)[1]) < 0.2  # 10 m/s^2 in one step: 0.17
    run(world, 200)
    assert position(world, body)[1] == pytest.approx(0.5, abs=0.01)
    assert {event[0] for event in told} == {"stay"}


# -- layers and masks ----------------------------------------------------------------------------


@both_dimensions
@pytest.mark.parametrize("refuses", [0, 1])
def test_one_mask_that_refuses_is_enough(d, refuses):
    """Impacts and rest, either way round: the two pass through each other, and neither an event nor a contact tells."""
    masks = [{"layer": 1, "mask": 3}, {"layer": 2, "mask": 3}]
    masks[refuses]["mask"] = 4
    world = make_world(d, gravity=10.0)
    ground = floor(world, layer=1, mask=3 if refuses else 4)
    fallen = box(world, up(d, 0.5), layer=2, mask=4 if refuses else 3)
    a = ball(world, (-1.0, 50.0, 0.0)[:d], (2.0, 0.0, 0.0)[:d], restitution=1.0, **masks[0])
    b = ball(world, (1.0, 50.0, 0.0)[:d], (-2.0, 0.0, 0.0)[:d], restitution=1.0, **masks[1])
    told = listen(world)
    run(world, 60)
    assert told == []
    assert len(world.contacts) == world.stats().counters["pairs"] == 0
    assert velocity(world, a)[0] == 2.0
    assert velocity(world, b)[0] == -2.0
    assert velocity(world, fallen)[1] == pytest.approx(-10.0, rel=1e-12)
    assert world.query_point(up(d, -0.1), mask=1) == [ground]
    assert world.query_point(up(d, -0.1), mask=2) == []


def test_layers_changed_between_steps_let_go_and_catch_again():
    """A body at rest that its floor no longer meets falls freely in that very step: nothing of the support is left."""
    world = make_world(gravity=10.0)
    ground = floor(world)
    body = box(world, (0.0, 0.5))
    other = box(world, (5.0, 0.5))
    run(world, 60)
    start, told = velocity(world, body)[1], listen(world)
    world.component_for_entity(body, AABBCollider).mask = 2
    world.step()
    assert velocity(world, body)[1] == pytest.approx(start - 10 * DT, rel=1e-12)
    assert told == [("stay", ground, other), ("end", ground, body)]
    told.clear()
    world.component_for_entity(body, AABBCollider).mask = 1
    world.step()
    assert told == [("begin", ground, body), ("stay", ground, other)]
    assert abs(velocity(world, body)[1]) < 0.2
    run(world, 60)
    assert position(world, body)[1] == pytest.approx(0.5, abs=0.01)


def test_layers_changed_by_a_system_hold_from_broad_phase_on():
    """Written as whole columns before NARROW they are this step's."""

    class Ghost(System):
        phase = Phase.FORCES

        def process(self, dt):
            self.world.bodies.sphere_collider.mask[:] = 0 if self.world.step_count % 2 else -1

    world = make_world()
    ball(world, 0.0, sensor=True)
    ball(world, 0.5)
    world.add_system(Ghost())
    for step in range(6):
        world.step()
        assert len(world.contacts) == (step + 1) % 2
        assert len(world.contacts.begin) == (step + 1) % 2


# -- enabled -------------------------------------------------------------------------------------


@both_dimensions
def test_a_disabled_impact_does_not_happen(d):
    """Two balls fly through each other, to the last bit as if they were alone; nobody is told."""
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
    """A ball between two walls that it strikes in one step: the one it may pass, the other sends it back."""
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
    """At rest, disabled for one step: in it the body falls as in free flight (v = -g dt, no warm start left of the
    support), the pair ends; enabled again it begins and holds, and the body is where it was."""
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
    assert pairs(world.contacts) == [(ground, body)]  # the row stays, and says that it is off
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


def test_a_stack_on_a_disabled_contact_falls_together():
    """Three boxes; what holds the lowest is off: all fall freely, and hold on to each other without impulse."""
    world = make_world(gravity=10.0)
    ground = floor(world)
    stack = [box(world, (0.0, 0.5 + k)) for k in range(3)]
    run(world, 120)
    before = [velocity(world, body)[1] for body in stack]
    world.add_system(Disable(entity=ground))
    run(world, 30)
    for body, speed in zip(stack, before, strict=True):
        assert velocity(world, body)[1] == pytest.approx(speed - 10 * 30 * DT, abs=1e-3)


@both_dimensions
def test_a_pair_disabled_from_the_start_never_begins(d):
    """Forty boxes fall onto a floor that is off for them, each a little higher: whatever the gap at the end of a step
    is, none is held for a moment, before it overlaps or after. No begin, stay, end; another box is held."""
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
    """Nor does it come back when its pair is looked at again because the body has bounced."""
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


# -- a one-way platform --------------------------------------------------------------------------


def one_way_world(**settings):
    """The example's system, a platform whose upper side is at y = 2, and a floor."""
    example = runpy.run_path(str(ROOT / "examples" / "one_way_platform.py"), run_name="example")
    world = make_world(gravity=20.0, **settings)
    ground = floor(world)
    platform = world.create_entity(Transform((0, 1.75)), AABBCollider((2, 0.25)), example["Platform"]())
    world.add_system(example["OneWay"]())
    return world, ground, platform, example


@pytest.mark.parametrize("collider", [AABBCollider((0.4, 0.5)), SphereCollider(0.5)], ids=["box", "sphere"])
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_jump_through_a_platform_from_below_ends_on_it(collider, restitution):
    """Up through it as in free flight, whatever the gap below it at the end of a step; then at rest on it. The contact
    begins once."""
    world, _, platform, _ = one_way_world()
    world.component_for_entity(platform, AABBCollider).half_extents = (30, 0.25)
    players, speeds = [], 11 + 0.1 * np.arange(20)
    for k, speed in enumerate(speeds):
        shape = collider.copy()
        shape.restitution = restitution
        players.append(
            world.create_entity(Transform((2.5 * k - 25, 0.5)), RigidBody(linear_velocity=(0, speed)), shape)
        )
    told = listen(world)
    world.step()
    told.clear()
    for step in range(2, 33):  # nearly to the top of their ways, 3.5 to 4.8 m up
        world.step()
        for player, speed in zip(players, speeds, strict=True):
            assert velocity(world, player)[1] == pytest.approx(speed - 20 * DT * step, abs=1e-9)
    assert not [event for event in told if platform in event]
    run(world, 200)
    for player in players:
        assert position(world, player)[1] == pytest.approx(2.5, abs=0.01)
        assert abs(velocity(world, player)[1]) < 0.01
        assert [contact.entity_b for contact in world.contacts.of(player)] == [platform]
    if restitution == 0:
        begun = [event for event in told if event[0] != "stay" and platform in event]
        assert sorted(begun) == [("begin", platform, player) for player in players]


@pytest.mark.parametrize("speed", [9.5, 8.0, 7.0, 6.0])
def test_a_jump_that_does_not_reach_falls_back(speed):
    """With the feet below its upper side at the top of the jump it is not lifted: it falls back as it came."""
    world, ground, platform, _ = one_way_world()
    player = world.create_entity(Transform((0, 0.5)), RigidBody(linear_velocity=(0, speed)), AABBCollider((0.4, 0.5)))
    top = 0.0
    for _ in range(200):
        world.step()
        top = max(top, position(world, player)[1])
    feet = top - 0.5
    expected = 2.5 if feet > 2.0 else 0.5
    assert position(world, player)[1] == pytest.approx(expected, abs=0.01)
    held_by = [contact.entity_b for contact in world.contacts.of(player)]
    assert held_by == [platform if feet > 2.0 else ground]


@pytest.mark.parametrize("rate", [13, 30, 60, 144])
def test_the_same_jump_at_any_frame_rate(rate):
    """After 2 s of frames of any length the bits are those of 120 steps."""
    world, _, _, _ = one_way_world(max_steps_per_advance=100)
    player = world.create_entity(Transform((0, 0.5)), RigidBody(linear_velocity=(1, 12)), AABBCollider((0.4, 0.5)))
    while world.step_count < 120:
        world.advance(1 / rate)
    while world.step_count < 130:
        world.step()
    expected, _, _, _ = one_way_world()
    expected.create_entity(Transform((0, 0.5)), RigidBody(linear_velocity=(1, 12)), AABBCollider((0.4, 0.5)))
    run(expected, world.step_count)
    assert_same_motion(world, expected, (player,))


@pytest.mark.parametrize("dt", [1 / 30, 1 / 60, 1 / 240])
@pytest.mark.parametrize("height", [3.0, 10.0])
def test_it_holds_what_falls_at_any_step(dt, height):
    """Landing at 4 to 17 m/s, at 0.6 m to 2 cm a step: caught, and at rest."""
    world, _, platform, _ = one_way_world(dt=dt)
    player = world.create_entity(Transform((0, height)), RigidBody(), AABBCollider((0.4, 0.5)))
    run(world, round(6 / dt))
    assert position(world, player)[1] == pytest.approx(2.5, abs=0.01)
    assert [contact.entity_b for contact in world.contacts.of(player)] == [platform]


def test_it_is_walked_through_from_the_side():
    world, ground, _, _ = one_way_world()
    walker = world.create_entity(Transform((-4, 1.9)), RigidBody(linear_velocity=(6, 0)), AABBCollider((0.4, 1.9)))
    for _ in range(80):
        world.step()
        assert [contact.entity_b for contact in world.contacts.of(walker)] == [ground]
    assert velocity(world, walker)[0] == 6.0
    assert position(world, walker) == pytest.approx((4, 1.9), abs=0.01)


def test_who_stands_on_it_may_drop():
    """For a fifth of a second platforms do not hold the player: free fall at once, and down to the floor."""
    world, ground, platform, example = one_way_world()
    player = world.create_entity(Transform((1, 2.5)), RigidBody(), AABBCollider((0.4, 0.5)), example["Drops"]())
    run(world, 60)
    assert position(world, player)[1] == pytest.approx(2.5, abs=0.01)
    world.component_for_entity(player, example["Drops"]).until = world.time + 0.2
    start = velocity(world, player)[1]
    run(world, 6)
    assert velocity(world, player)[1] == pytest.approx(start - 20 * 6 * DT, rel=1e-12)
    run(world, 100)
    assert position(world, player)[1] == pytest.approx(0.5, abs=0.01)
    assert [contact.entity_b for contact in world.contacts.of(player)] == [ground]
    assert not world.contacts.of(platform)


def test_a_moving_platform_carries_and_lets_through():
    """A lift that is one-way: a player jumps up through it while it rises, lands, and rides at its speed."""
    world, _, still, example = one_way_world()
    world.delete_entity(still)
    lift = world.create_entity(
        Transform((0, 1.75)), RigidBody(kind="kinematic", linear_velocity=(0, 1)), AABBCollider((2, 0.25)),
        example["Platform"](),
    )  # fmt: skip
    player = world.create_entity(Transform((0, 0.5)), RigidBody(linear_velocity=(0, 14)), AABBCollider((0.4, 0.5)))
    run(world, 240)
    assert position(world, lift)[1] == pytest.approx(1.75 + 4, abs=1e-9)
    assert position(world, player)[1] - position(world, lift)[1] == pytest.approx(0.75, abs=0.01)
    assert velocity(world, player)[1] == pytest.approx(1.0, abs=0.01)


def test_the_example_runs(capsys):
    runpy.run_path(str(ROOT / "examples" / "one_way_platform.py"), run_name="__main__")
    assert "stands on the platform" in capsys.readouterr().out

"""Contact events and their handlers: begin, stay, end, impacts; independent of the frame rate."""

from __future__ import annotations

import itertools

import esper
import numpy as np
import pytest
from helpers_filters import EVENTS, pairs
from worlds import MODES, ball, both_dimensions, box, floor, make_world, run, velocity

from carom.components import RigidBody, SphereCollider, Transform
from carom.systems.contacts.events import ContactEvents


def listen(world, told, *names):
    for name in names or EVENTS:
        world.on(name, lambda contact, name=name: told.append((name, contact.step, contact.entity_a, contact.entity_b)))


def rain(restitution=0.5, **settings):
    """Twelve balls falling on a floor and on each other: begins, stays, ends and impacts of all kinds."""
    world = make_world(gravity=9.81, **settings)
    floor(world)
    rng = np.random.default_rng(2)
    for k in range(12):
        ball(world, (rng.uniform(-1.5, 1.5), 0.6 + 1.05 * k), restitution=restitution * (k % 3) / 2)
    return world


def test_begin_stay_end_in_order():
    """Each pair: begin, then stay in every step, then end; never two begins without an end between."""
    world = rain()
    told = []
    listen(world, told, "contact_begin", "contact_stay", "contact_end")
    touching = set()
    for step in range(240):
        told.clear()
        world.step()
        for name, number, *pair in told:
            assert number == step
            pair = tuple(pair)
            match name:
                case "contact_begin":
                    assert pair not in touching
                    touching.add(pair)
                case "contact_stay":
                    assert pair in touching
                case "contact_end":
                    assert pair in touching
                    touching.remove(pair)
        assert set(pairs(world.contacts)) == touching
    assert touching


def test_a_window_gathers_all_its_steps():
    """advance() of k steps holds what k step() calls held one by one; stay and contacts are of the last step."""
    one, many = rain(), rain()
    gathered = {name: [] for name in ("begin", "end", "impacts")}
    for _ in range(15):
        for _ in range(8):
            one.step()
            for name, rows in gathered.items():
                part = getattr(one.contacts, name)
                rows += list(zip(part.step.tolist(), part.entity_a.tolist(), part.entity_b.tolist(), strict=True))
        assert many.advance(8 / 60) == 8
        for name, rows in gathered.items():
            part = getattr(many.contacts, name)
            found = list(zip(part.step.tolist(), part.entity_a.tolist(), part.entity_b.tolist(), strict=True))
            assert found == rows
            rows.clear()
        for name in ("entity_a", "entity_b", "depth", "normal_impulse", "step"):
            np.testing.assert_array_equal(getattr(one.contacts, name), getattr(many.contacts, name))
            np.testing.assert_array_equal(getattr(one.contacts.stay, name), getattr(many.contacts.stay, name))


def test_no_step_no_events():
    """A frame too short for a step: begin, stay, end and impacts are empty, so nothing is counted twice."""
    world = make_world()
    ball(world, -0.51, 1.0, restitution=1.0)
    ball(world, 0.51, -1.0, restitution=1.0)
    assert world.advance(1 / 60) == 1
    assert len(world.contacts.begin) == len(world.contacts.impacts) == 1
    assert world.advance(1 / 600) == 0
    contacts = world.contacts
    assert [len(rows) for rows in (contacts.begin, contacts.stay, contacts.end, contacts.impacts)] == [0, 0, 0, 0]
    assert world.advance(1 / 60) == 1
    assert len(world.contacts.end) == 1


def test_nothing_of_the_frame_before_is_told_in_one_without_a_step():
    """Nor if nobody has looked at it."""
    world = make_world()
    ball(world, -0.51, 1.0, restitution=1.0)
    ball(world, 0.51, -1.0, restitution=1.0)
    assert (world.advance(1 / 60), world.advance(1 / 600)) == (1, 0)
    assert len(world.contacts.begin) == len(world.contacts.impacts) == 0


@both_dimensions
@pytest.mark.parametrize("mode", MODES)
def test_impacts_name_those_that_bounce_when_a_body_falls_asleep_in_that_step(mode, d):
    """Its row goes before those of all that are awake, and the impacts are read after that."""
    world = make_world(d, 10.0, sleeping=True, collision=mode)
    floor(world)
    balls = [ball(world, (2 * k - 20, 0.6 + 0.03 * k, 0)[:d], restitution=1.0) for k in range(60)]
    crate = box(world, (-30, 0.5, 0)[:d])
    for step in range(50):
        before = {k: velocity(world, k)[1] for k in balls}
        world.step()
        bounced = [k for k in balls if before[k] < 0 < velocity(world, k)[1]]
        assert np.sort(world.contacts.impacts.entity_b).tolist() == bounced
        assert bounced or not 25 < step < 36
    assert world.component_for_entity(crate, RigidBody).asleep


def test_contacts_of_the_narrow_phase_alone_name_those_that_touch_when_others_fall_asleep():
    """The pairs of what drifts side by side, in a world without a response."""
    world = make_world(sleeping=True)
    drifting = [ball(world, (0.9 * k, 5), (1, 0), sensor=True) for k in range(4)]
    resting = [ball(world, (0.9 * k, 0), sensor=True) for k in range(12)]
    for system in world.systems[-2:]:
        world.remove_system(system)
    for _ in range(60):
        world.step()
        assert {pair for pair in pairs(world.contacts) if pair[0] < resting[0]} == set(itertools.pairwise(drifting))
    assert world.bodies.asleep.sum() == len(resting)


def test_impacts_are_told_without_the_system_of_events():
    """As they are with it, of all steps of a frame."""
    told = []
    for removed in ((), ContactEvents):
        world = rain(1.0)
        for system in world.systems:
            if isinstance(system, removed):
                world.remove_system(system)
        told.append([])
        for _ in range(16):
            world.advance(4 / 60)
            told[-1] += [(one.step, one.entity_a, one.entity_b) for one in world.contacts.impacts]
    assert told[0] == told[1]
    assert len(told[0]) > 5


@pytest.mark.slow
@pytest.mark.parametrize("rate", [15, 30, 144, 0])
def test_events_do_not_depend_on_the_frame_rate(rate):
    """Every event of 2 s, in order, equals those at 60 Hz; rate 0: irregular frames."""

    def history(frames):
        world = rain(max_steps_per_advance=100)
        told, columns = [], []
        listen(world, told)
        for frame in frames:
            world.advance(frame)
            for name in ("begin", "end", "impacts"):
                rows = getattr(world.contacts, name)
                columns += [(name, c.step, c.entity_a, c.entity_b, c.depth, c.normal_impulse) for c in rows]
        assert world.step_count == 120
        told = [event for event in told if event[0] != "contact_stay" or event[1] < 120]
        return told, sorted(columns), world.state_hash()

    frames = [1 / rate] * (2 * rate) if rate else [0.1, 0.003, 0.25, 0.047, 1.0, 0.5, 0.1]
    assert history(frames) == history([1 / 60] * 120)


@pytest.mark.parametrize("how", ["separation", "first deleted", "second deleted", "collider removed", "moved away"])
def test_an_end_is_always_delivered(how):
    """Whatever ends a contact, its end comes in the next step, once, with the ids."""
    world = make_world()
    a, b = ball(world, 0.0, restitution=1.0), ball(world, 0.9)
    told = []
    listen(world, told, "contact_end")
    run(world, 2)
    assert told == []
    match how:
        case "separation":
            world.component_for_entity(b, RigidBody).linear_velocity = (100, 0)
        case "first deleted":
            world.delete_entity(a)
        case "second deleted":
            world.delete_entity(b, immediate=True)
        case "collider removed":
            world.remove_component(b, SphereCollider)
        case "moved away":
            world.component_for_entity(b, Transform).position = (50, 0)
    world.step()
    assert told == [("contact_end", 2, a, b)]
    assert [(c.entity_a, c.entity_b, c.normal_impulse) for c in world.contacts.end] == [(a, b, 0.0)]
    world.step()
    assert len(told) == 1
    assert len(world.contacts.end) == 0


@pytest.mark.parametrize("immediate", [False, True])
def test_a_handler_may_delete_and_create(immediate):
    """Deleting a body while the step's events are delivered is safe; its end comes in the next step."""
    world = make_world()
    told = []
    listen(world, told)
    entities = [ball(world, 0.9 * k, restitution=1.0) for k in range(4)]

    def shatter(contact):
        for entity in (contact.entity_a, contact.entity_b):
            if world.entity_exists(entity):
                world.delete_entity(entity, immediate=immediate)
                ball(world, (20.0 * entity, 5.0))

    world.on("contact_begin", shatter)
    world.step()
    begun = [pair for name, _, *pair in told if name == "contact_begin"]
    assert begun == [[a, b] for a, b in itertools.pairwise(entities)]
    told.clear()
    world.step()
    assert [pair for name, _, *pair in told if name == "contact_end"] == begun
    assert len(world.bodies) == 4
    assert np.isfinite(world.bodies.position).all()


def test_pairs_end_when_their_ids_come_to_mean_others():
    """After esper.clear_database() the same two ids are other balls: the old pair ends, the new one begins."""
    world = make_world()
    told = []
    for event in ("contact_begin", "contact_stay", "contact_end"):
        world.on(event, lambda contact, event=event: told.append(event))
    for _ in range(2):
        with world:
            esper.clear_database()
            for x in (0.0, 0.9):
                esper.create_entity(Transform((x, 0.0)), RigidBody(), SphereCollider(0.5, sensor=True))
        world.step()
    assert sorted(told) == ["contact_begin", "contact_begin", "contact_end"]

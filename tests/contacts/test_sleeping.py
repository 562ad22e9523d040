"""Islands at rest sleep: they stay to the bit, cost nothing, and what is awake does not notice."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from contacts.helpers_sleeping import MODES, is_asleep, sleep, sleeping_tower, sleepy_world, tower
from helpers_pairwise import pairwise
from worlds import METHODS, Calls, ball, box, make_world, position, run, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Phase, Settings, System, World


def rows_of(world: World, entities) -> list[tuple]:
    """All that can be seen of these bodies and their contacts."""
    bodies, contacts = world.bodies, world.contacts
    rows = [bodies.row_of(entity) for entity in entities]
    touching = np.isin(contacts.entity_a, entities) | np.isin(contacts.entity_b, entities)
    names = ("entity_a", "entity_b", "point", "normal", "depth", "normal_impulse")
    seen = [getattr(bodies, name)[rows].tobytes() for name in ("position", "linear_velocity", "previous_position")]
    return seen + [getattr(contacts, name)[touching].tobytes() for name in names]


def test_off_by_default_and_nothing_sleeps():
    assert Settings().sleeping is False
    world = sleepy_world(sleeping=False)
    boxes = tower(world, 0.0)
    run(world, 60)
    assert not any(is_asleep(world, *boxes))
    assert not any(name in str(world.plan()) for name in ("rest_sleepers", "update_sleep", "leave_out_still"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mode", "method", "d", "substeps"), pairwise(MODES, METHODS, (2, 3), (1, 4)), ids=lambda value: str(value)
)
def test_falls_asleep_and_stays_to_the_bit(mode, method, d, substeps):
    world, boxes = sleeping_tower(2, d=d, collision=mode, integrator=method, substeps=substeps)
    before, contacts = world.state_hash(), len(world.contacts)
    assert contacts == 2
    for _ in range(20):
        world.step()
        assert len(world.contacts) == contacts
        assert len(world.contacts.begin) == len(world.contacts.end) == 0
    assert world.state_hash() == before
    assert not world.bodies.dynamic.linear_velocity.any()
    world.component_for_entity(boxes[0], RigidBody).apply_impulse((0.5, 0.0, 0.0)[:d])
    world.step()
    assert not any(is_asleep(world, *boxes))


@pytest.mark.slow
@pytest.mark.parametrize("gap", [0.006, 0.009, 0.012, 0.015, 0.03])
@pytest.mark.parametrize("mode", MODES)
def test_neighbours_that_do_not_touch_do_not_wake_each_other_in_turns(mode, gap):
    """The second one comes to rest later."""
    world = sleepy_world(collision=mode)
    neighbours = box(world, (0.0, 0.5)), box(world, (1.0 + gap, 0.6))
    run(world, 90)
    for _ in range(60):
        world.step()
        assert all(is_asleep(world, *neighbours))


def test_not_before_half_a_second_at_rest():
    world = sleepy_world()
    boxes = tower(world, 0.0, 1)
    run(world, 28)
    assert is_asleep(world, *boxes) == [False]
    sleep(world, *boxes)


def test_what_drifts_flies_or_is_carried_does_not_sleep():
    world = make_world(2, 0.0, sleeping=True)
    drifting, thrown = ball(world, 0.0, 0.001), ball(world, 10.0, 0.0)
    world.component_for_entity(thrown, RigidBody).constant_force = (0.01, 0.0)
    lift = sleepy_world()
    box(lift, (0.0, 5.0), (0.0, 0.1), half=(2.0, 0.5), kind="kinematic")
    carried = box(lift, (0.0, 6.0))
    for _ in range(90):
        world.step()
        lift.step()
    assert not any(is_asleep(world, drifting, thrown))
    assert is_asleep(lift, carried) == [False]


def test_what_slides_slowly_does_not_stop():
    world = sleepy_world()
    slow = box(world, (0.0, 0.05), (0.02, 0.0), half=0.05, friction=0.0)
    run(world, 120)
    assert world.component_for_entity(slow, RigidBody).linear_velocity[0] == pytest.approx(0.02)


def test_sleeps_on_a_kinematic_body_that_stands_until_it_moves():
    world = sleepy_world()
    lift = box(world, (0.0, 5.0), half=(2.0, 0.5), kind="kinematic")
    carried = tower(world, 0.0, 1)[0]
    world.component_for_entity(carried, Transform).position = (0.0, 6.0)
    sleep(world, carried)
    world.component_for_entity(lift, RigidBody).linear_velocity = (0.0, 1.0)
    world.step()
    assert is_asleep(world, carried) == [False]
    run(world, 30)
    assert position(world, carried)[1] > 6.4


def test_a_sleeping_pile_costs_no_flight_no_pairs_and_no_solving():
    world = sleepy_world()
    boxes = [entity for x in range(0, 8, 2) for entity in tower(world, float(x))]
    sleep(world, *boxes)
    world.reset_stats()
    world.step()
    counters = world.stats().counters
    for name in ("bodies", "candidates", "pairs", "contacts", "resting_contacts", "impacts"):
        assert counters[name] == 0, name
    assert len(world.contacts) == 12


def halves(sleeping: bool, d: int, mode: str) -> tuple[World, list[int], list[int]]:
    """A tower that comes to rest, and far from it balls that bounce and roll among boxes."""
    world = sleepy_world(d, sleeping=sleeping, collision=mode)
    still = tower(world, 0.0) + tower(world, 3.0, 2)
    lively = tower(world, 50.0)
    for k, e in itertools.product(range(4), (0.0, 0.9)):
        place = (47.0 + 2.0 * k, 2.0 + k + 3.0 * e, 0.1 * k)[:d]
        lively.append(ball(world, place, (1.0 - k, -2.0, 0.3)[:d], radius=0.3, restitution=e, friction=0.3))
    return world, still, lively


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("d", [2, 3])
def test_what_is_awake_has_the_same_bits_as_without_sleeping(d, mode):
    (on, still, lively), (off, _, _) = halves(True, d, mode), halves(False, d, mode)
    kicks, slept = np.random.default_rng(1), 0
    for step in range(110):
        for entity in lively if step % 12 == 0 else ():
            velocity = kicks.uniform(-3.0, 3.0, d)
            for world in (on, off):
                world.component_for_entity(entity, RigidBody).linear_velocity = velocity
        on.step()
        off.step()
        slept += all(is_asleep(on, *still))
        assert not any(is_asleep(on, *lively))
        assert rows_of(on, lively) == rows_of(off, lively), step
    assert slept > 60


def test_waking_goes_on_as_if_nothing_had_happened():
    """The impulses that carry a tower are there again: it does not sag."""
    world, boxes = sleeping_tower(6)
    before = world.bodies.dynamic.position.copy()
    impulses = world.contacts.normal_impulse.copy()
    world.wake(boxes[0])
    world.step()
    assert not any(is_asleep(world, *boxes))
    np.testing.assert_allclose(world.contacts.normal_impulse, impulses, rtol=1e-2)
    np.testing.assert_allclose(world.bodies.dynamic.position, before, atol=1e-5)
    assert len(world.contacts.begin) == len(world.contacts.end) == 0


def test_contacts_of_sleepers_are_listed_in_order_and_stay():
    world = sleepy_world()
    boxes = tower(world, 0.0)
    rolling = ball(world, (-10.0, 0.3), (1.0, 0.0), radius=0.3)
    late = tower(world, 10.0)
    told, stays = [], []
    for name in ("contact_begin", "contact_end"):
        world.on(name, lambda contact, name=name: told.append((name, contact.entity_a, contact.entity_b)))
    world.on("contact_stay", lambda contact: stays.append((contact.entity_a, contact.entity_b)))
    world.step()
    told.clear()
    sleep(world, *boxes, *late)
    stays.clear()
    world.step()
    contacts = world.contacts
    assert not is_asleep(world, rolling)[0]
    pairs = list(zip(contacts.entity_a.tolist(), contacts.entity_b.tolist(), strict=True))
    assert len(pairs) == len(contacts.stay) == 7
    assert pairs == sorted(pairs) == sorted(stays)
    assert set(contacts.step.tolist()) == {world.step_count - 1}
    assert (contacts.normal_impulse > 0.0).all()
    assert told == []
    world.wake(boxes[0])
    world.step()
    assert told == []
    world.delete_entity(late[2])
    world.step()
    assert told == [("contact_end", late[1], late[2])]


def test_what_a_game_writes_into_the_contacts_of_sleepers_changes_nothing_but_what_it_reads():
    world, boxes = sleeping_tower()
    normals = world.contacts.normal.copy()
    world.contacts.normal[:] = 7.0
    world.contacts.enabled[:] = False
    world.step()
    assert (world.contacts.normal == normals).all()
    assert world.contacts.enabled.all()
    assert all(is_asleep(world, *boxes))


def test_sensors_do_not_wake_and_tell_who_comes_and_goes():
    world = sleepy_world()
    boxes = tower(world, 0.0, 2)
    zone = world.create_entity(Transform((0.0, 1.0)), AABBCollider((2.0, 2.0), sensor=True))
    sleep(world, *boxes)
    assert len(world.contacts) == 4
    passing = ball(world, (-3.0, 1.0), (4.0, 0.0), radius=0.2, sensor=True)
    world.component_for_entity(passing, RigidBody).gravity_scale = 0.0
    begun = ended = 0
    for _ in range(90):
        world.step()
        begun += len(world.contacts.begin.of(boxes[0]))
        ended += len(world.contacts.end.of(boxes[0]))
    assert all(is_asleep(world, *boxes))
    assert (begun, ended) == (1, 1)
    world.delete_entity(zone)
    world.step()
    assert len(world.contacts.end) == 2
    assert all(is_asleep(world, *boxes))


class Disable(System):
    phase = Phase.NARROW
    open = True

    def process(self, dt):
        if self.open:
            self.world.contacts.enabled[:] = False


@pytest.mark.parametrize("woken", [False, True])
def test_disabling_the_contact_of_sleepers_wakes_them(woken):
    """It holds them for one more step, and acts at once on what is awake."""
    world, trapdoor = sleepy_world(), Disable()
    boxes = tower(world, 0.0, 1)
    trapdoor.open = False
    world.add_system(trapdoor)
    sleep(world, *boxes)
    trapdoor.open = True
    if woken:
        world.wake(boxes[0])
    world.step()
    assert is_asleep(world, *boxes) == [False]
    for falls in (woken, True):
        assert (velocity(world, boxes[0])[1] < 0.0) == falls
        assert (len(world.contacts.of(boxes[0])), len(world.contacts.stay)) == ((0, 0) if falls else (1, 1))
        world.step()
    run(world, 30)
    assert position(world, boxes[0])[1] < 0.0
    assert is_asleep(world, *boxes) == [False]


def test_what_is_held_apart_by_disabled_contacts_does_not_sleep():
    world, off = make_world(2, 0.0, sleeping=True), Disable()
    pair = ball(world, 0.0), ball(world, 0.9)
    world.add_system(off)
    run(world, 60)
    assert not any(is_asleep(world, *pair))
    world.remove_system(off)
    world.step()
    assert len(world.contacts.begin) == 1


def test_one_way_platforms_that_look_at_velocities_hold_sleepers():
    def let_through():
        contacts, bodies = world.contacts, world.bodies
        contacts.enabled[:] = bodies.linear_velocity[bodies.rows_of(contacts.entity_b), 1] < 0.0

    world = sleepy_world()
    tower(world, 0.0, 1)
    world.add_system(Calls(Phase.NARROW, let_through))
    heights = [world.step() or world.bodies.dynamic.position[0, 1] for _ in range(100)]
    assert min(heights) > 0.49


@pytest.mark.parametrize("balls", [3, 60])
def test_balls_above_a_sleeping_crowd_fly_as_where_nothing_sleeps(balls):
    """The search for pairs costs work for those that are awake only."""
    places = []
    for sleeping in (True, False):
        world, x = sleepy_world(sleeping=sleeping), np.arange(300) * 1.5
        world.create_entities(
            300, Transform.many(np.stack([x, np.full(300, 0.5)], axis=1)), RigidBody.many(),
            AABBCollider.many(half_extents=(0.5, 0.5)),
        )  # fmt: skip
        flyers = world.create_entities(
            balls, Transform.many(np.stack([x[:balls], np.full(balls, 9.0)], axis=1)),
            RigidBody.many(gravity_scale=0.0, linear_velocity=(0.5, 0.0)),
            SphereCollider.many(radius=0.5, restitution=1.0),
        )  # fmt: skip
        run(world, 120)
        assert world.bodies.asleep.sum() == 300 * sleeping
        assert not sleeping or world.physics.state.static_grid.suits
        run(world, 120)
        places.append([position(world, entity).tolist() for entity in flyers])
    assert places[0] == places[1]


def test_a_body_that_is_woken_within_a_step_finds_what_it_touches():
    """All bodies look for others in that step, not only those that were awake when it began."""

    world = sleepy_world()
    boxes = [entity for k in range(3) for entity in tower(world, 3.0 * k, 2)]
    flyer = ball(world, (0.0, 30.0), (0.1, 0.0))
    world.component_for_entity(flyer, RigidBody).gravity_scale = 0.0
    after_the_flight = Calls(Phase.INTEGRATION, lambda: world.step_count == 200 and world.wake(boxes[0]))
    world.add_system(after_the_flight)
    run(world, 200)
    assert is_asleep(world, *boxes) == [True] * 6
    contacts = len(world.contacts)
    world.step()
    assert is_asleep(world, *boxes) == [False, False, True, True, True, True]
    assert len(world.contacts) == contacts


@pytest.mark.parametrize("mode", MODES)
def test_what_an_impact_has_stopped_sleeps_alone(mode):
    """In space, where nothing is near it any more: it has given its speed to another ball, which flies on."""
    world = make_world(collision=mode, sleeping=True)
    struck = ball(world, (0.0, 0.0), (3.0, 0.0), restitution=1.0)
    ball(world, (2.0, 0.0), restitution=1.0)
    sleep(world, struck, steps=180)


def test_what_moves_meets_sleepers_after_others_have_gone():
    """Rows of sleepers close up, also those that stand in a grid."""
    world = make_world(2, sleeping=True)
    balls = [ball(world, (3.0 * (k % 20), 3.0 * (k // 20)), restitution=0.0) for k in range(400)]
    mover = world.create_entity(
        Transform((-9.0, 9.0)), RigidBody(kind="kinematic", linear_velocity=(0.01, 0.0)), SphereCollider(0.5)
    )
    sleep(world, *balls)
    world.delete_entity(balls[0])
    world.component_for_entity(mover, Transform).position = (14.3, 9.0)
    world.step()
    assert (world.contacts.entity_a.tolist(), world.contacts.entity_b.tolist()) == ([balls[65]], [mover])
    assert is_asleep(world, balls[65], balls[66]) == [False, True]

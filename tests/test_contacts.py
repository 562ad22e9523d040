"""``world.contacts`` and events: what a game reads after a step, and that it never depends on the frame rate."""

from __future__ import annotations

import gc
import itertools

import esper
import numpy as np
import pytest
from worlds import ball, box, floor, make_world, run, velocity

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import Component, Phase, System, column

EVENTS = ("contact_begin", "contact_stay", "contact_end", "impact")
COLUMNS = {"entity_a": 1, "entity_b": 1, "point": 2, "normal": 2, "depth": 1, "normal_impulse": 1, "step": 1}
both_dimensions = pytest.mark.parametrize("d", [2, 3])


class Missile(Component):
    power = column(default=1.0)


class Enemy(Component):
    points = column(default=100.0)


def listen(world, told, *names):
    for name in names or EVENTS:
        world.on(name, lambda contact, name=name: told.append((name, contact.step, contact.entity_a, contact.entity_b)))


def ids(rows):
    return list(zip(rows.entity_a.tolist(), rows.entity_b.tolist(), strict=True))


def rain(restitution=0.5, **settings):
    """Twelve balls falling on a floor and on each other: begins, stays, ends and impacts of all kinds."""
    world = make_world(gravity=9.81, **settings)
    floor(world)
    rng = np.random.default_rng(2)
    for k in range(12):
        ball(world, (rng.uniform(-1.5, 1.5), 0.6 + 1.05 * k), restitution=restitution * (k % 3) / 2)
    return world


# -- columns -------------------------------------------------------------------------------------


@both_dimensions
def test_columns_and_their_shapes(d):
    """Before any step and after, empty or not: the same columns, dtypes and shapes; impacts also have their time."""
    world = make_world(d)
    for _ in range(3):
        contacts = world.contacts
        for rows in (contacts, contacts.begin, contacts.stay, contacts.end, contacts.impacts):
            for name, rank in COLUMNS.items():
                values = getattr(rows, name)
                assert values.shape == ((len(rows), d) if rank == 2 else (len(rows),))
                assert values.dtype == (np.int64 if name in ("entity_a", "entity_b", "step") else np.float64)
        assert world.contacts.enabled.dtype == bool
        assert world.contacts.impacts.time_of_impact.shape == (len(world.contacts.impacts),)
        if not len(world.bodies):
            for k in range(3):
                ball(world, 0.9 * k, -k, restitution=1.0)
        world.step()
    assert len(world.contacts) >= 2
    with pytest.raises(AttributeError, match=r"contacts have no column 'colour'; they have entity_a, entity_b"):
        _ = world.contacts.colour


def test_canonical_order_whatever_the_history():
    """entity_a < entity_b, sorted; bodies of all kinds, some deleted and created in between so that rows are mixed."""
    world = make_world()
    rng = np.random.default_rng(3)
    kinds = ("dynamic", "kinematic", "static")
    entities = [ball(world, rng.uniform(-3, 3, 2), kind=kinds[k % 3]) for k in range(60)]
    world.step()
    for k in (3, 10, 17, 30, 44):
        world.delete_entity(entities[k])
    for k in range(10):
        ball(world, rng.uniform(-3, 3, 2), kind=kinds[k % 3])
    world.step()
    pairs = ids(world.contacts)
    assert len(pairs) > 100
    assert all(a < b for a, b in pairs)
    assert pairs == sorted(set(pairs))
    assert not {entities[k] for k in (3, 10, 17, 30, 44)} & {entity for pair in pairs for entity in pair}
    assert pairs == sorted([*ids(world.contacts.begin), *ids(world.contacts.stay)])


def test_normal_impulse_is_the_momentum_exchanged():
    """Impact: m1 (1 + e) w / 2 for equal masses; at rest: m g dt in every step, of a pile the load above included."""
    world = make_world()
    ball(world, -0.51, 1.0, mass=2.0, restitution=0.5)
    ball(world, 0.51, -1.0, mass=2.0)
    run(world, 1)
    assert world.contacts.normal_impulse[0] == pytest.approx(1.0 * 1.5 * 2.0, rel=1e-14)
    assert world.contacts.impacts.normal_impulse[0] == world.contacts.normal_impulse[0]

    world = make_world(gravity=9.81)
    floor(world)
    for k in range(3):
        box(world, (0, 0.5 + k), mass=1.0 + k)
    run(world, 120)
    load = 9.81 / 60 * np.array([6.0, 5.0, 3.0])  # on the floor, on the lowest, on the middle one
    np.testing.assert_allclose(world.contacts.normal_impulse, load, rtol=1e-3)


# -- begin, stay, end, impacts -------------------------------------------------------------------


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
        assert set(ids(world.contacts)) == touching
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


def test_deleting_everything_ends_everything():
    world = make_world()
    entities = [ball(world, 0.5 * k) for k in range(5)]
    world.step()
    begun = len(world.contacts.begin)
    for entity in entities:
        world.delete_entity(entity)
    world.step()
    assert len(world.contacts.end) == begun > 0
    assert len(world.contacts) == 0


# -- pairs and of --------------------------------------------------------------------------------


def duel():
    world = make_world()
    missile, enemy = ball(world, 0.0), ball(world, 0.9)
    other = ball(world, (0.0, 0.9))
    world.add_component(missile, Missile())
    world.add_component(enemy, Enemy())
    world.step()
    return world, missile, enemy, other


def test_pairs_are_oriented_from_first_to_second():
    world, missile, enemy, _ = duel()
    ((a, b, contact),) = world.contacts.begin.pairs(Missile, Enemy)
    assert (a, b) == (contact.entity_a, contact.entity_b) == (missile, enemy)
    apart = world.bodies.position[world.bodies.row_of(enemy)] - world.bodies.position[world.bodies.row_of(missile)]
    np.testing.assert_allclose(contact.normal, apart / np.linalg.norm(apart), rtol=1e-12)
    ((a, b, turned),) = world.contacts.begin.pairs(Enemy, Missile)
    assert (a, b) == (turned.entity_a, turned.entity_b) == (enemy, missile)
    np.testing.assert_array_equal(turned.normal, -contact.normal)
    np.testing.assert_array_equal(turned.point, contact.point)
    assert turned.depth == contact.depth


def test_pairs_of_one_kind_come_once():
    """A == B: every pair of them once, the smaller id first."""
    world = make_world()
    entities = [ball(world, 0.9 * k) for k in range(4)]
    for entity in entities[:3]:
        world.add_component(entity, Missile())
    world.step()
    found = [(a, b) for a, b, _ in world.contacts.pairs(Missile, Missile)]
    assert found == [(entities[0], entities[1]), (entities[1], entities[2])]
    everybody = [(a, b) for a, b, _ in world.contacts.pairs(SphereCollider, RigidBody)]
    assert everybody == list(itertools.pairwise(entities))


@pytest.mark.parametrize("immediate", [False, True])
def test_pairs_skip_the_deleted_also_while_iterating(immediate):
    """A missile that hits three enemies is gone after the first; deleted ones do not come at all."""
    world = make_world()
    missile = ball(world, 0.0)
    world.add_component(missile, Missile())
    enemies = [ball(world, (0.6 * k - 0.6, 0.7)) for k in range(3)]
    for enemy in enemies:
        world.add_component(enemy, Enemy())
    world.step()
    assert len(list(world.contacts.begin.pairs(Missile, Enemy))) == 3
    world.delete_entity(enemies[0], immediate=immediate)
    seen = []
    for shot, enemy, _ in world.contacts.begin.pairs(Missile, Enemy):
        seen.append(enemy)
        world.delete_entity(shot, immediate=immediate)
    assert seen == [enemies[1]]
    assert list(world.contacts.begin.pairs(Missile, Enemy)) == []


def test_of_looks_from_the_entity():
    """The normal points away from the one asked about: what does it stand on."""
    world = make_world(gravity=9.81)
    ground = floor(world)
    player = ball(world, (0, 0.5))
    stone = ball(world, (0, 1.5))
    run(world, 10)
    standing = [c.entity_b for c in world.contacts.of(player) if c.normal[1] < -0.7]
    assert standing == [ground]
    assert {c.entity_b for c in world.contacts.of(player)} == {ground, stone}
    assert all(c.entity_a == player for c in world.contacts.of(player))
    assert [c.normal.tolist() for c in world.contacts.of(ground)] == [[0, 1]]
    assert world.contacts.of(12345) == []


# -- handlers ------------------------------------------------------------------------------------


def test_handlers_run_in_order_and_are_kept_alive():
    """In the order they were added; a lambda that nobody else holds stays (esper alone would lose it)."""
    world = make_world()
    called = []
    for name in "abc":
        world.on("contact_begin", lambda contact, name=name: called.append(name))
    gc.collect()
    ball(world, 0.0)
    ball(world, 0.9)
    world.step()
    assert called == ["a", "b", "c"]


def test_a_handler_may_take_itself_or_others_away():
    world = make_world()
    called = []

    def once(contact):
        called.append("once")
        world.off("contact_stay", once)
        world.off("contact_stay", never)

    def never(contact):
        called.append("never")

    world.on("contact_stay", once)
    world.on("contact_stay", never)
    world.on("contact_stay", lambda contact: called.append("always"))
    ball(world, 0.0)
    ball(world, 0.9)
    run(world, 4)
    assert called == ["once", "always", "always", "always"]
    with pytest.raises(KeyError, match="no such handler for 'contact_stay'"):
        world.off("contact_stay", once)


@pytest.mark.parametrize("immediate", [False, True])
def test_a_handler_may_delete_and_create(immediate):
    """Deleting a body in the middle of the step's events harms nothing; its end comes in the next step."""
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


def test_espers_own_handlers_get_the_same_events():
    world = rain()
    told, from_esper = [], []
    listen(world, told)
    handlers = [
        lambda contact, name=name: from_esper.append((name, contact.step, contact.entity_a, contact.entity_b))
        for name in EVENTS
    ]
    with world:
        for name, handler in zip(EVENTS, handlers, strict=True):
            esper.set_handler(name, handler)
    run(world, 60)
    with world:
        for name, handler in zip(EVENTS, handlers, strict=True):
            esper.remove_handler(name, handler)
    assert told == from_esper
    assert {name for name, *_ in told} == set(EVENTS)


def test_a_handler_that_fails_is_named_and_the_step_undone():
    world = make_world()
    ball(world, -0.51, 1.0, restitution=1.0)
    ball(world, 0.51, -1.0)
    before = world.state_hash()

    def broken(contact):
        raise ZeroDivisionError("on purpose")

    world.on("impact", broken)
    with pytest.raises(Exception, match="on purpose"):
        world.step()
    assert world.state_hash() == before
    assert world.step_count == 0
    world.off("impact", broken)
    world.step()
    assert len(world.contacts.begin) == len(world.contacts.impacts) == 1


# -- enabled -------------------------------------------------------------------------------------


class OneWay(System):
    """Platforms that hold only what comes from above: contacts of those moving up are switched off."""

    phase = Phase.NARROW

    def __init__(self, platform):
        self.platform = platform

    def process(self, dt):
        contacts, bodies = self.world.contacts, self.world.bodies
        for row in range(len(contacts)):
            pair = (contacts.entity_a[row], contacts.entity_b[row])
            if self.platform in pair:
                other = pair[0] if pair[1] == self.platform else pair[1]
                k = bodies.row_of(int(other))
                contacts.enabled[row] = bodies.linear_velocity[k, 1] < 0 and bodies.previous_position[k, 1] >= 0.999


def test_one_way_platform():
    """A player jumps up through it, unslowed, and then stands on it."""
    world = make_world(gravity=10.0)
    platform = box(world, 0.0, half=(5, 0.5), kind="static")
    player = ball(world, (0.0, -1.5), (0.0, 10.0))
    world.add_system(OneWay(platform))
    told = []
    listen(world, told, "contact_begin", "contact_end")
    heights = []
    for step in range(1, 181):
        world.step()
        heights.append(world.component_for_entity(player, Transform).y)
        if step < 60:  # 10 - g t, undisturbed through the platform
            assert velocity(world, player)[1] == pytest.approx(10 - 10 * step / 60, abs=1e-12)
    assert max(heights) > 3.3
    assert heights[-1] == pytest.approx(1.0, abs=0.005)
    assert velocity(world, player)[1] == 0
    assert [name for name, *_ in told] == ["contact_begin"]


def test_disabled_contacts_push_nobody_and_end():
    """Switched off in the middle of a bounce at e = 1: no impulse; switched off while touching: the contact ends."""
    world = make_world()
    a, b = ball(world, -0.51, 1.0, restitution=1.0), ball(world, 0.51, -1.0, restitution=1.0)
    rest = ball(world, (0, 50)), ball(world, (0.9, 50))

    class Off(System):
        phase = Phase.NARROW

        def process(self, dt):
            self.world.contacts.enabled[:] = False

    run(world, 0)
    off = Off()
    world.add_system(off)
    told = []
    listen(world, told)
    run(world, 60)
    assert told == []
    assert velocity(world, a)[0] == 1
    assert velocity(world, b)[0] == -1
    world.remove_system(off)
    world.step()
    assert ("contact_begin", 60, *rest) in told
    world.add_system(off)
    world.step()
    assert ("contact_end", 61, *rest) in told


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


def test_a_record_of_a_contact_cannot_be_written():
    """The error says what can: the column."""
    world = make_world()
    ball(world, 0.0)
    ball(world, 0.5)
    world.step()
    (contact,) = world.contacts
    for name in ("enabled", "depth"):
        with pytest.raises(AttributeError, match=rf"{name} cannot be set; write the columns: world.contacts.enabled"):
            setattr(contact, name, 0.0)
    world.close()
